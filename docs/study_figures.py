"""Draws the figures of campaigns that documents show into docs/figures/, as `snca study` does."""

from pathlib import Path

from snca_ros.comparison.figures import draw_all
from snca_ros.comparison.pairwise import contrasts, shown_contrasts
from snca_ros.comparison.runs import read_cases
from snca_ros.files import write_text

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / 'docs' / 'figures'
FIRST = ROOT / 'results' / 'first-physics'
SHOWN = {
    'first-physics/paper-main': (FIRST / 'paper', ('boxes', 'curves', 'frequency', 'variance')),
    'first-physics/paper-supplement': (FIRST / 'paper', ('medians',)),
    'strategies': (FIRST / 'strategies', ('curves',)),
}
"""Campaign to its results folder, and the kinds of figures that are shown of it."""


def figures() -> dict[str, str]:
    """Return the SVG text of every figure by its name, such as strategies/curves-biped."""
    found = {}
    for campaign, (results, kinds) in SHOWN.items():
        file = ROOT / 'config' / 'experiments' / f'{campaign}.yaml'
        cases = read_cases([results], [file])
        for kind, shape, svg in draw_all(cases, shown_contrasts(contrasts(cases))):
            if kind in kinds:
                found[f'{campaign}/{kind}-{shape}'] = svg
    return found


if __name__ == '__main__':
    for name, svg in figures().items():
        path = FIGURES / f'{name}.svg'
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, svg)
