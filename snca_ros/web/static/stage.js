// The robot on its terrain, drawn on a canvas.
'use strict';

// Return a colour of the page's style sheet.
function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// Clear a canvas and fit it to its element; return context, width and height in CSS pixels.
function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  const sizes = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== sizes[0] || canvas.height !== sizes[1]) [canvas.width, canvas.height] = sizes;
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return [context, width, height];
}

// Return orange if contracted, pale at rest, blue if expanded, as sim_node.drawing.area_colors.
function areaColor(ratio) {
  if (Number.isNaN(ratio)) return color('unknown');
  const stops = [[214, 94, 0], [245, 237, 209], [0, 115, 179]];
  const t = Math.min(Math.max((ratio - 0.75) / 0.5, 0), 1) * 2;
  const [low, high, part] = t < 1 ? [stops[0], stops[1], t] : [stops[1], stops[2], t - 1];
  return `rgb(${low.map((c, i) => Math.round(c + part * (high[i] - c)))})`;
}

class Stage {
  constructor(canvas, walk) {
    this.canvas = canvas;
    this.walk = walk;
    const corners = walk.voxels.flatMap((_, i) => walk.corners(i, 0));
    const [xs, ys] = [0, 1].map((i) => corners.map((corner) => corner[i]));
    this.length = Math.max(...xs) - Math.min(...xs);
    this.tall = Math.max(...ys) - Math.min(...ys);
  }

  // Return the point that the camera shows: the mean over a second before and after.
  camera(time) {
    const xs = Array.from({ length: 21 }, (_, i) => this.walk.between('x', time + i / 10 - 1));
    const mean = (numbers) => numbers.reduce((a, b) => a + b, 0) / numbers.length;
    return [mean(xs), mean(xs.map((x) => this.walk.height(x)))];
  }

  look(time, width, height) {
    const [x, y] = this.camera(time);
    const soil = 2.2, above = 0.3 * this.tall + 1.5;
    this.scale = Math.min(width / (1.9 * this.length), height / (soil + this.tall + above));
    this.left = x - width / this.scale / 2;
    this.bottom = y - soil;
    this.high = height;
  }

  pixel([x, y]) {
    return [(x - this.left) * this.scale, this.high - (y - this.bottom) * this.scale];
  }

  draw(time, selection) {
    const [context, width, height] = cleared(this.canvas);
    this.look(time, width, height);
    context.lineJoin = 'round';
    this.ground(context, width, height);
    const shapes = this.walk.voxels.map((_, i) =>
      this.walk.corners(i, time).map((corner) => this.pixel(corner)));
    const [frame] = this.walk.around(time);
    const step = Math.floor(time * this.walk.rate + 1e-6);
    shapes.forEach((shape, i) => this.voxel(context, shape, i, frame, this.walk.shade(step, i)));
    shapes.forEach((shape, i) => this.footprint(context, shape, i, frame));
    this.selected(context, shapes, selection);
    this.shapes = shapes;
  }

  ground(context, width, height) {
    const right = this.left + width / this.scale;
    const inside = this.walk.ground[0].filter((x) => x > this.left && x < right);
    const surface = [this.left, ...inside, right].map((x) => this.pixel([x, this.walk.height(x)]));
    context.fillStyle = color('soil');
    context.strokeStyle = color('surface');
    this.path(context, [...surface, [width, height], [0, height]]);
    context.fill();
    context.beginPath();
    surface.forEach(([x, y]) => context.lineTo(x, y));
    context.lineWidth = 2;
    context.stroke();
    this.marks(context, right, width);
  }

  marks(context, right, width) {
    context.fillStyle = color('surface');
    context.font = '12px system-ui, sans-serif';
    context.textAlign = 'center';
    context.lineWidth = 1;
    for (let mark = Math.ceil(this.left); mark < right; mark++) {
      const [x, y] = this.pixel([mark, this.walk.height(mark)]);
      const long = mark % 5 === 0;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x, y + (long ? 10 : 5));
      context.stroke();
      if (long && x > 20 && x < width - 20) context.fillText(`${mark} m`, x, y + 22);
    }
  }

  path(context, points) {
    context.beginPath();
    points.forEach(([x, y]) => context.lineTo(x, y));
    context.closePath();
  }

  // Draw a voxel in the colour of its area, with an inner square that shows its actuation.
  // A voxel whose answer or message does not come in time is shaded.
  voxel(context, shape, i, frame, shade) {
    this.path(context, shape);
    context.fillStyle = areaColor(this.walk.at('area', frame, i));
    context.strokeStyle = '#2b2b2b';
    context.lineWidth = Math.max(1, 0.1 * this.scale);
    context.fill();
    if (shade) {
      context.fillStyle = color(shade);
      context.fill();
    }
    context.stroke();
    const [level] = this.walk.health?.[this.walk.voxels[i]] ?? [0];
    if (level > 0) this.unhealthy(context, shape, level);
    const command = this.walk.at('actuation', frame, i);
    if (Number.isNaN(command)) return;
    const [x, y] = middle(shape), size = 0.28 - 0.16 * command;
    this.path(context, shape.map(([a, b]) => [x + size * (a - x), y + size * (b - y)]));
    context.lineWidth = 1;
    context.strokeStyle = '#2b2b2b99';
    context.stroke();
  }

  // In a live walk: mark a voxel whose node has an error with a cross, a warning with a stroke.
  unhealthy(context, [a, b, c, d], level) {
    context.strokeStyle = color('accent');
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(...d);
    context.lineTo(...b);
    if (level > 1) {
      context.moveTo(...a);
      context.lineTo(...c);
    }
    context.stroke();
  }

  // Draw the lower side of a voxel that touches the ground.
  footprint(context, shape, i, frame) {
    const touch = this.walk.at('touch', frame, i);
    if (!(touch > 0.05)) return;
    context.globalAlpha = touch;
    context.strokeStyle = color('touch');
    context.lineWidth = Math.max(4, 0.3 * this.scale);
    context.beginPath();
    context.moveTo(...shape[3]);
    context.lineTo(...shape[2]);
    context.stroke();
    context.globalAlpha = 1;
  }

  selected(context, shapes, { from, to }) {
    if (from === undefined) return;
    context.strokeStyle = context.fillStyle = color('accent');
    context.lineWidth = 3;
    this.path(context, shapes[from]);
    context.stroke();
    if (to === undefined) return;
    const [[x, y], [u, v]] = [middle(shapes[from]), middle(shapes[to])];
    const angle = Math.atan2(v - y, u - x);
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(u, v);
    context.stroke();
    this.path(context, [0, 2.6, -2.6].map((turn) =>
      [u + 10 * Math.cos(angle + turn), v + 10 * Math.sin(angle + turn)]));
    context.fill();
  }

  // Return the index of the voxel at a point of the canvas [CSS pixels]; -1 if there is none.
  voxelAt(x, y) {
    return this.shapes.findIndex((shape) => {
      const path = new Path2D();
      shape.forEach(([a, b]) => path.lineTo(a, b));
      const context = this.canvas.getContext('2d');
      context.setTransform(1, 0, 0, 1, 0, 0);
      return context.isPointInPath(path, x, y);
    });
  }
}

function middle(shape) {
  return [0, 1].map((i) => shape.reduce((sum, corner) => sum + corner[i], 0) / shape.length);
}
