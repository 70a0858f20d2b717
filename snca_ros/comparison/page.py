"""The page of a study, one self-contained HTML file."""

import html
import re
from collections.abc import Sequence

from snca_ros.comparison.rank_test import LEVEL
from snca_ros.comparison.runs import Cases, evidence
from snca_ros.comparison.style import INK, PAPER
from snca_ros.comparison.tables import Table
from snca_ros.recording.gait import VIBRATION

FIGURES = {
    'boxes': (
        'Speed at the end of evolution and on unseen terrains',
        'Left box of each pair: v_x of the best controller in the engine in which it evolved; '
        'right box, paler: its mean over the 16 unseen terrains. Boxes are quartiles, whiskers '
        'extend to 1.5 times the interquartile range, dots are runs. The p-values are two-sided '
        "Mann-Whitney, with Holm's correction in brackets: above the boxes for the left ones, "
        'below for the right ones.',
    ),
    'medians': (
        'Architecture × neuron model',
        'Medians of v_x [m/s], coloured on one scale for all tables of this page.',
    ),
    'curves': (
        'Best so far over episodes',
        'Median and quartiles of the best v_x so far, in the engine in which each run evolved.',
    ),
    'vibration': (
        'Vibration',
        f'Share of the power of the actuation of all voxels together above {VIBRATION:g} Hz, of '
        'each run, and their median. Runs above the dotted line count as vibrating.',
    ),
    'frequency': (
        'Vibration, by its peak',
        'Frequency at which the power of the actuation of all voxels together peaks, of each run, '
        'and their median; the largest possible is 30 Hz. Runs above the dotted line count as '
        'vibrating.',
    ),
    'variance': (
        'Variance of the best controllers',
        'v_x at the end of evolution, of one episode, against v_x in the other engine, also of one '
        'episode (rings), and against mean and standard deviation over pushed starts (discs). On '
        'the dotted line both are equal; below it, the episode of evolution overestimates v_x.',
    ),
}
"""Heading and caption of each kind of figure."""

_WIDE = 400.0  # pt; a figure as wide scrolls on a phone instead of shrinking

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1, h2 { line-height: 1.2; }
.warning { border-left: 4px solid #d55e00; padding: 0.1rem 1rem; }
.figures { display: flex; flex-wrap: wrap; gap: 1rem; }
figure { margin: 0; flex: 1 1 20rem; max-width: 100%; break-inside: avoid; }
figure.wide { flex-basis: 100%; overflow-x: auto; }
figure svg { display: block; width: 100%; height: auto; max-width: 44rem; }
figure.wide svg { min-width: 34rem; }
figcaption { font-size: 0.8rem; opacity: 0.8; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.85rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.7rem; text-align: left; white-space: nowrap; }
tr { border-bottom: 1px solid #8888; }
@media print {
  :root { color-scheme: light; }
  body { max-width: none; font-size: 11px; }
  table { font-size: 8px; }
  th, td { padding: 0.1rem 0.3rem; white-space: normal; }
  .table, figure.wide { overflow: visible; }
}
"""

_METHOD = f"""
Tests are two-sided Mann-Whitney U tests, exact if no two values are equal and both groups have
fewer than 50. Holm's correction is for the family of all pairs of controllers on one shape in one
measure. A is Vargha and Delaney's A: the probability that a run of the first controller is faster
than one of the second; 0.5 means no effect. Its {100 * LEVEL:g} % interval is Newcombe's (method
5). End of evolution: one episode of the run's best controller in the engine in which it evolved,
the paper's measure. Other engine: one episode in the other engine. Pushed mean: the mean over 20
starts whose masses are pushed by up to a micrometre, in pymunk; since a single episode is chaotic,
this is the measure for judgements. Unseen terrains: the mean over 16 terrains, in pymunk. Robust:
the controller is the individual of the last whole population with the best mean over 20 pushed
starts in the run's engine, the value is its mean over 20 other starts in pymunk. Runs of the first
physics have no robust controller, and their best one was often chosen by pymunk among the best
quarter, so a curve may end above its value.
"""


def page(
    cases: Cases, missing: Sequence[str], warned: Sequence[str], tables: Sequence[Table],
    figures: Sequence[tuple[str, str, str]],
) -> str:
    """Return the HTML of a study.

    Args:
        cases: the runs of the study.
        missing, warned: lines about missing runs, and warnings.
        tables: tables of the page.
        figures: kind, shape and SVG text of each figure, see `comparison.figures.draw_all`.
    """
    n_runs = sum(len(runs) for of_shape in cases.values() for runs in of_shape.values())
    title = f'{n_runs} runs: {", ".join(cases)}'
    parts = [f'<h1>{html.escape(title)}</h1>']
    parts += [*_list('Warnings', warned), *_list('Missing', missing)]
    drawn = {kind for kind, *_ in figures}
    for kind, (heading, caption) in FIGURES.items():
        if kind not in drawn:
            continue
        parts += [f'<h2>{heading}</h2>', f'<p>{html.escape(caption)}</p>', '<div class="figures">']
        parts += [
            _figure(kind, shape, svg, evidence(cases[shape]))
            for of_kind, shape, svg in figures if of_kind == kind
        ]
        parts.append('</div>')
    parts += [_table(table) for table in tables]
    parts += ['<h2>Method</h2>', f'<p>{html.escape(_METHOD.strip())}</p>']
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n'
        + '\n'.join(parts) + '\n</body>\n</html>\n'
    )


def _list(heading: str, lines: Sequence[str]) -> list[str]:
    if not lines:
        return []
    items = ''.join(f'<li>{html.escape(line)}</li>' for line in lines)
    return [f'<div class="warning"><h2>{heading}</h2><ul>{items}</ul></div>']


def _figure(kind: str, shape: str, svg: str, evidence_text: str) -> str:
    """Return the HTML of a figure: SVG in the colours of the page, with unique identifiers."""
    svg = svg[svg.index('<svg') :].replace(INK, 'currentColor').replace(PAPER, 'none')
    svg = re.sub(r'( id="|href="#|url\(#)', rf'\g<1>{kind}-{shape}-', svg)
    label = html.escape(f'{FIGURES[kind][0]}: {shape}')
    svg = svg.replace('<svg', f'<svg role="img" aria-label="{label}"', 1)
    wide = ' class="wide"' if float(svg.partition('width="')[2].partition('pt"')[0]) > _WIDE else ''
    caption = html.escape(f'{shape}: {evidence_text}')
    return f'<figure{wide}>{svg}<figcaption>{caption}</figcaption></figure>'


def _table(table: Table) -> str:
    head = ''.join(f'<th scope="col">{html.escape(cell)}</th>' for cell in table.header)
    rows = ''.join(
        '<tr>' + ''.join(f'<td>{html.escape(cell)}</td>' for cell in row) + '</tr>\n'
        for row in table.rows
    )
    return (
        f'<h2>{html.escape(table.title)}</h2>\n<div class="table"><table>\n'
        f'<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>'
    )
