"""A study of made-up results: as cases, and as the command."""

from support.made_up_results import write_results

from snca_ros import cli
from snca_ros.comparison.runs import (
    ControllerType,
    read_cases,
)

SNCA = ControllerType('U-nD', 'snn-h')


def cases_of(tmp_path, *rows):
    return read_cases([write_results(tmp_path / 'results', list(rows))])


def study(*arguments, capsys):
    code = cli.main(['study', *map(str, arguments)])
    return code, *capsys.readouterr()
