"""Draws the figures of findings.md into docs/findings/, as `snca study` does."""

from pathlib import Path

from snca_ros.files import write_text
from snca_ros.study.cases import read_cases
from snca_ros.study.comparison import draw_all
from snca_ros.study.contrasts import contrasts, shown_contrasts

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / 'docs' / 'findings'
SHOWN = {
    'paper-main': ('boxes', 'curves', 'frequency', 'luck'),
}
"""Campaign to the kinds of figures that are shown of it."""


def pictures() -> dict[str, str]:
    """Return the SVG text of every figure by its name, such as boxes-biped."""
    found = {}
    for campaign, kinds in SHOWN.items():
        file = ROOT / 'config' / 'experiments' / f'{campaign}.yaml'
        cases = read_cases([ROOT / 'results' / 'paper'], [file])
        for kind, shape, svg in draw_all(cases, shown_contrasts(contrasts(cases))):
            if kind in kinds:
                found[f'{kind}-{shape}'] = svg
    return found


if __name__ == '__main__':
    PICTURES.mkdir(exist_ok=True)
    for name, svg in pictures().items():
        write_text(PICTURES / f'{name}.svg', svg)
