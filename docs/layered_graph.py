"""A graph drawn in layers, as SVG text: each arrow leads from a layer to one further down."""

from html import escape

WIDTH, ROW, GAP, SPACE, MARGIN = 168, 13, 46, 22, 14
"""Widths of boxes, height of a line, room between layers and between boxes, in pixels."""

_COLORS = {'snca_ros': '#dbe9f6', 'sim_node': '#e3f1dc'}
_STYLE = """
text { font-family: sans-serif; font-size: 10px; fill: #222; }
.name { font-size: 13px; font-weight: bold; }
rect { stroke: #888; rx: 4px; }
path { fill: none; stroke: #667; stroke-width: 1.2px; marker-end: url(#tip); }
.wrong { stroke: #c22; stroke-dasharray: 4 3; marker-end: url(#wrong-tip); }
"""
_TIP = (
    '<marker id="{0}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
    'orient="auto"><path d="M0 0 L8 4 L0 8 z" style="fill: {1}; stroke: none; marker-end: none"/>'
    '</marker>'
)


def draw(
    boxes: dict[str, tuple[str, list[str]]], pairs: set[tuple[str, str]],
    wrong: set[tuple[str, str]],
) -> str:
    """Return the picture.

    Args:
        boxes: name to (what chooses its colour, lines of text), from the top.
        pairs: (from, to); without circles.
        wrong: further pairs, drawn in red.
    """
    layers, paths = _layers(list(boxes), pairs)
    _order(layers, paths)
    lines = {name: _wrap(words) for name, (_, words) in boxes.items()}
    height = {name: 22 + ROW * len(lines[name]) for name in boxes}
    places, size = _places(layers, height)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]} {size[1]}" '
        f'width="{size[0]}" height="{size[1]}">',
        '<title>Rooms of the source and the imports between them</title>',
        f'<style>{_STYLE}</style>',
        f'<defs>{_TIP.format("tip", "#667")}{_TIP.format("wrong-tip", "#c22")}</defs>',
        f'<rect width="{size[0]}" height="{size[1]}" style="fill: white; stroke: none"/>',
    ]
    for pair, way in sorted(paths.items()):
        out.append(_arrow(f'{pair[0]} imports {pair[1]}', [places[point] for point in way]))
    for a, b in sorted(wrong):
        (x1, y1, h1), (x2, y2, h2) = places[a], places[b]
        x1, x2 = x1 + WIDTH // 4, x2 + WIDTH // 4
        curve = f'M{x1} {y1 + h1 // 2} L{x2} {y2 + h2 // 2}'
        title = escape(f'{a} imports {b}, against the order')
        out.append(f'<path class="wrong" d="{curve}"><title>{title}</title></path>')
    for name, (kind, _) in boxes.items():
        x, y, _ = places[name]
        out.append(
            f'<rect x="{x - WIDTH // 2}" y="{y}" width="{WIDTH}" height="{height[name]}" '
            f'fill="{_COLORS[kind]}"/>'
            f'<text class="name" x="{x}" y="{y + 16}" text-anchor="middle">{escape(name)}</text>'
        )
        for i, line in enumerate(lines[name]):
            out.append(
                f'<text x="{x}" y="{y + 30 + ROW * i}" text-anchor="middle">{escape(line)}</text>'
            )
    return '\n'.join([*out, '</svg>']) + '\n'


def _layers(names, pairs):
    """Return layers of names and of the points (a, b, layer) where arrows pass; arrows' ways."""
    depth = dict.fromkeys(names, 0)
    for _ in names:  # as far down as what is above
        for a, b in pairs:
            depth[b] = max(depth[b], depth[a] + 1)
    layers: list[list] = [[] for _ in range(max(depth.values()) + 1)]
    for name in names:
        layers[depth[name]].append(name)
    paths = {}
    for a, b in sorted(pairs):
        points = [(a, b, k) for k in range(depth[a] + 1, depth[b])]
        for point in points:
            layers[point[2]].append(point)
        paths[a, b] = [a, *points, b]
    return layers, paths


def _order(layers, paths):
    """Sort each layer by the middle of its neighbours, down and up a few times."""
    links = [link for way in paths.values() for link in zip(way[:-1], way[1:], strict=True)]
    for sweep in range(12):
        place: dict = {}
        down = sweep % 2 == 0
        for layer in layers if down else reversed(layers):
            for i, point in enumerate(layer):
                place.setdefault(point, (i + 0.5) / len(layer))
            ends: dict = {p: [] for p in layer}
            for a, b in links:
                near, far = (b, a) if down else (a, b)
                if near in ends and far in place:
                    ends[near].append(place[far])
            layer.sort(key=lambda p: (sum(ends[p]) / len(ends[p])) if ends[p] else place[p])
            for i, point in enumerate(layer):
                place[point] = (i + 0.5) / len(layer)


def _places(layers, height):
    """Return (x of the middle, y of the top, height) of all points, and the picture's size."""
    def width(point):
        return WIDTH if isinstance(point, str) else 30

    widths = [sum(map(width, layer)) + SPACE * (len(layer) - 1) for layer in layers]
    places, y = {}, MARGIN
    for layer, taken in zip(layers, widths, strict=True):
        tall = max(height[p] for p in layer if isinstance(p, str))
        x = MARGIN + (max(widths) - taken) // 2
        for point in layer:
            own = height[point] if isinstance(point, str) else tall
            places[point] = (x + width(point) // 2, y, own)
            x += width(point) + SPACE
        y += tall + GAP
    return places, (max(widths) + 2 * MARGIN, y - GAP + MARGIN)


def _arrow(title, places):
    """Return a curve from below the first place to above the last, straight down between."""
    (x, y, h), *rest = places
    curve, y = f'M{x} {y + h}', y + h
    for i, (to, top, h) in enumerate(rest):
        middle = (y + top) // 2
        curve += f' C{x} {middle} {to} {middle} {to} {top}'
        x, y = to, top
        if i < len(rest) - 1:
            curve += f' L{to} {top + h}'
            y = top + h
    return f'<path d="{curve}"><title>{escape(title)}</title></path>'


def _wrap(words, limit=30):
    """Return the words as lines of at most `limit` characters, with commas."""
    lines = ['']
    for word in (f'{word},' for word in words):
        if len(lines[-1]) + len(word) > limit:
            lines.append('')
        lines[-1] += f' {word}' if lines[-1] else word
    return [line for line in [*lines[:-1], lines[-1].rstrip(',')] if line]
