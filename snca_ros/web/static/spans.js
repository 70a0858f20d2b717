// The strip above the slider: when a voxel was limp, or its answers or messages were not in time.
'use strict';

const SPANS_PERIOD = 500; // milliseconds between updates while the walk grows

class Spans {
  constructor(canvas, walk) {
    this.canvas = canvas;
    this.walk = walk;
    this.drawn = {};
  }

  // Return the shade of each of n columns: the worst of the steps in it, of one voxel or of all.
  columns(n, { from }) {
    const { walk } = this, begin = Math.round(walk.begin * walk.rate);
    const voxels = from === undefined ? walk.voxels.map((_, i) => i) : [from];
    const length = Math.max(walk.steps - 1 - begin, 1);
    return Array.from({ length: n }, (_, x) => {
      const first = Math.floor((x * length) / n), end = Math.floor(((x + 1) * length) / n);
      let worst;
      for (let step = first; step < Math.max(end, first + 1); step++)
        for (const voxel of voxels) {
          worst = walk.shade(begin + step, voxel) ?? worst;
          if (worst === 'limp') return worst;
        }
      return worst;
    });
  }

  draw(selection) {
    const { clientWidth } = this.canvas, now = performance.now(), last = this.drawn;
    const same = last.width === clientWidth && last.from === selection.from && last.steps === this.walk.steps;
    const soon = last.from === selection.from && last.steps > 1 && now - last.now < SPANS_PERIOD;
    if (same || (soon && last.width === clientWidth)) return;
    this.drawn = { width: clientWidth, from: selection.from, steps: this.walk.steps, now };
    const [context, width, height] = cleared(this.canvas);
    this.columns(Math.max(Math.floor(width), 1), selection).forEach((shade, x) => {
      if (!shade) return;
      context.fillStyle = color(shade);
      context.fillRect(x, 0, 1, height);
    });
  }
}
