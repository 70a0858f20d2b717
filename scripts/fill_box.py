"""Puts the fastest controller of each shape and type of the paper's campaign into the box.

    python scripts/fill_box.py [RUNS]

Fastest is the mean over pushed starts in results/paper/. RUNS (default runs/) is where the run
folders of the campaign are: of the default controller the box holds configuration and history too.
"""

import re
import shutil
import sys
from pathlib import Path

from snca_ros.box import DEFAULT_CONTROLLER
from snca_ros.files import write_text
from snca_ros.study.cases import Run, fastest, read_cases

ROOT = Path(__file__).resolve().parents[1]
BOX, RESULTS = ROOT / 'config' / 'controllers', ROOT / 'results' / 'paper'
_TABLE = re.compile(r'(^\| name .*\n\|---.*\n)(?:\|.*\n)*', re.MULTILINE)
_SEED = re.compile(r'(--evaluations 30000 --seed )\d+')


def champions() -> dict[str, Run]:
    """Return the fastest run of each shape and type of controller, by its name in the box."""
    cases = read_cases([RESULTS], [ROOT / 'config' / 'experiments' / 'paper-main.yaml'])
    return {
        f'{shape}-{controller.architecture}-{controller.neuron_model}': fastest(runs)
        for shape, of_shape in cases.items() for controller, runs in of_shape.items()
    }


def table_row(name: str, run: Run) -> str:
    """Return the row of the box's README."""
    speeds = (run.value(f'v_x{what}') for what in ('', '_starts_mean', '_starts_std'))
    return '| `{}` | `{}` | {:.2f} | {:.2f} ± {:.2f} |\n'.format(name, run.row['run'], *speeds)


def fill(runs: Path) -> None:
    """Fill the box anew."""
    found = champions()
    for name, run in found.items():
        best = RESULTS / 'controllers' / f'{run.row["run"]}.npz'
        shutil.copyfile(best, BOX / f'{name}.npz')
    default = found[DEFAULT_CONTROLLER].row
    for file, suffix in (('config.yaml', '.yaml'), ('history.csv', '.csv')):
        shutil.copyfile(runs / default['run'] / file, BOX / f'{DEFAULT_CONTROLLER}{suffix}')
    rows = ''.join(table_row(name, run) for name, run in found.items())
    text = _TABLE.sub(lambda table: table[1] + rows, (BOX / 'README.md').read_text())
    write_text(BOX / 'README.md', _SEED.sub(rf'\g<1>{default["seed"]}', text))


if __name__ == '__main__':
    fill(Path(sys.argv[1] if len(sys.argv) > 1 else 'runs'))
