"""The `study` command: compares results of campaigns by statistics and figures, on one page."""

import argparse
from pathlib import Path

from sim_node.errors import InvalidInput
from snca_ros.commands.json_output import add_json_option
from snca_ros.comparison.study import Study
from snca_ros.files import write_text

FOLDER = 'study'
"""Default name of the output folder, in the first results folder."""

EXAMPLES = """
  snca study results/example
  snca study results/main results/more --campaign config/experiments/paper-main.yaml
  snca study results/example --text
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `study`."""
    parser.add_argument('results', nargs='+', type=Path, metavar='RESULTS',
                        help='results folders of campaigns; their tables are joined')
    parser.add_argument('--campaign', action='append', type=Path, default=[], metavar='FILE',
                        help='compare only the runs of this campaign file, and list the missing '
                             'ones; may be repeated')
    parser.add_argument('--output', type=Path, metavar='FOLDER',
                        help='folder of index.html, statistics.csv and figures '
                        f'(default RESULTS/{FOLDER})')
    parser.add_argument('--text', action='store_true',
                        help='print a summary in Markdown and write no files')
    add_json_option(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Compare results, and write or print the study; return the exit code."""
    if args.text and args.output:
        parser.error('--text writes no files; drop --output')
    study = Study(args.results, args.campaign)
    args.write_json(study.as_dict())
    if args.text:
        print(study.summary(), flush=True)
        return 0
    files, output = study.files(), args.output or args.results[0] / FOLDER
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            write_text(output / name, text)
    except OSError as error:
        expected = 'a folder that can be written'
        raise InvalidInput('output', error.strerror, expected, str(output)) from None
    for line in (*study.warnings, *study.missing):
        print(line)
    n = sum(name.endswith('.svg') for name in files)
    print(f'{output / "index.html"}: {n} figures; statistics.csv has all comparisons')
    return 0
