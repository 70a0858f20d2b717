"""Bundles the robust controller of each case of the paper's campaign.

    python scripts/bundle_controllers.py [RUNS]

Of each case it is that of the run whose robust controller has the largest mean of v_x over the
starts 101 to 120, by the table in results/paper/. RUNS (default runs/) is where the run folders of
the campaign are: configuration and history of the default controller are bundled too.
"""

import shutil
import sys
from pathlib import Path

from snca_ros.bundled import DEFAULT_CONTROLLER
from snca_ros.comparison.runs import ROBUST, Run, read_cases
from snca_ros.files import write_text

ROOT = Path(__file__).resolve().parents[1]
BUNDLED, RESULTS = ROOT / 'config' / 'controllers', ROOT / 'results' / 'paper'
CAMPAIGN = ROOT / 'config' / 'experiments' / 'paper-main.yaml'

README = """# Bundled controllers

One of each shape and type of controller of the paper's main campaign
(`config/experiments/paper-main.yaml`), whose results are in `results/paper/`. A run is 30,000
evaluations in the batched engine. Its robust controller is the one of its last whole population
with the best mean of v_x over 20 starts pushed by up to 1e-6 m (starts 1 to 20, in the engine of
the run). Here is the robust controller with the largest mean over 20 other starts (101 to 120, in
pymunk); `python scripts/bundle_controllers.py` copies it. [findings.md](../../docs/findings.md)
compares all runs, and [robustness.md](../../docs/robustness.md) has figures of the bipeds.

| name | run | v_x [m/s]: mean ± deviation over pushed starts | mean over unseen terrains |
|---|---|---|---|
{rows}
`{default}` is what `snca walk` runs if nothing is named; `.yaml` and `.csv` beside it are
its run (`config.yaml`) and its whole history, a row per generation. The same campaign gives the
same files, bit for bit, on the same C library and versions of numpy, numba and pymunk (the header
of a file tells the versions).
"""
"""The README beside them; its rows are those of `row_of`."""


def champions(results: Path = RESULTS, campaign: Path = CAMPAIGN) -> dict[str, Run]:
    """Return the run of each shape and type of controller, by the name of what is bundled."""
    return {
        f'{shape}-{controller.architecture}-{controller.neuron_model}':
            max(runs, key=lambda run: run.value(ROBUST))
        for shape, of_shape in read_cases([results], [campaign]).items()
        for controller, runs in of_shape.items()
    }


def row_of(name: str, run: Run) -> str:
    """Return the row of a controller in the README."""
    mean, std, unseen = (run.value(f'v_x_robust_{what}') for what in ('mean', 'std', 'unseen'))
    return f'| `{name}` | `{run.row["run"]}` | {mean:.2f} ± {std:.2f} | {unseen:.2f} |\n'


def readme(found: dict[str, Run]) -> str:
    """Return the README of a folder that holds the robust controllers of these runs."""
    rows = ''.join(row_of(name, run) for name, run in found.items())
    return README.format(rows=rows, default=DEFAULT_CONTROLLER)


def controller_of(run: Run) -> Path:
    """Return the file of the robust controller of a run."""
    return run.history.parents[1] / 'controllers' / f'{run.row["run"]}-robust.npz'


def fill(runs: Path, found: dict[str, Run], folder: Path = BUNDLED) -> None:
    """Replace the bundled controllers."""
    for name, run in found.items():
        shutil.copyfile(controller_of(run), folder / f'{name}.npz')
    default = runs / found[DEFAULT_CONTROLLER].row['run']
    for file, suffix in (('config.yaml', '.yaml'), ('history.csv', '.csv')):
        shutil.copyfile(default / file, folder / f'{DEFAULT_CONTROLLER}{suffix}')
    write_text(folder / 'README.md', readme(found))


if __name__ == '__main__':
    fill(Path(sys.argv[1] if len(sys.argv) > 1 else 'runs'), champions())
