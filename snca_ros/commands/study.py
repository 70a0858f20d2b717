"""The `study` command: statistics and figures of campaigns, and a page that holds them all."""

import argparse
from pathlib import Path

from sim_node.errors import InvalidInput
from snca_ros.comparison.pairwise import contrasts, contrasts_csv, shown_contrasts
from snca_ros.comparison.runs import missing_runs, read_cases, warnings
from snca_ros.comparison.tables import (
    champions_table,
    contrasts_table,
    factors_table,
    speeds_table,
    told_lines,
    vibration_table,
)
from snca_ros.files import write_text

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
                        help='only the runs of this campaign file, of which the missing '
                             'are named; may be given again')
    parser.add_argument('--output', type=Path, metavar='FOLDER',
                        help='index.html, statistics.csv and figures (default RESULTS/study)')
    parser.add_argument('--text', action='store_true',
                        help='only print a summary in Markdown; write nothing')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Study as the command line says; return the exit code."""
    if args.text and args.output:
        parser.error('--text writes nothing; drop --output')
    cases = read_cases(args.results, args.campaign)
    found = contrasts(cases)
    shown = shown_contrasts(found)
    warned, missing = warnings(cases), missing_runs(cases, args.campaign)
    tables = [
        speeds_table(cases), champions_table(cases), vibration_table(cases), factors_table(cases),
    ]
    summary = [
        *(table.markdown() for table in (*tables, contrasts_table(shown)) if table.rows),
        *told_lines('Warnings', warned), *told_lines('Missing', missing),
    ]
    if args.text:
        print('\n\n'.join(summary), flush=True)
        return 0

    from snca_ros.comparison.figures import draw_all  # matplotlib loads slowly
    from snca_ros.comparison.page import page

    figures = draw_all(cases, shown)
    tables = [table for table in (*tables, contrasts_table(found)) if table.rows]
    files = {f'{kind}-{shape}.svg': svg for kind, shape, svg in figures}
    files['statistics.csv'] = contrasts_csv(found)
    files['index.html'] = page(cases, missing, warned, tables, figures)
    output = args.output or args.results[0] / 'study'
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            write_text(output / name, text)
    except OSError as error:
        expected = 'a folder that can be written'
        raise InvalidInput('output', error.strerror, expected, str(output)) from None
    for line in (*warned, *missing):
        print(line)
    print(f'{output / "index.html"}: {len(figures)} figures; statistics.csv has all comparisons')
    return 0
