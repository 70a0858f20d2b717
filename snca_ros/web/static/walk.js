// The data of a walk, by frame and by time.
'use strict';

const HELD = 1, LIMP = 2; // as in snca_ros.recording.outcomes.Outcome

class Walk {
  // header: the page's JSON; buffer: the bytes of its arrays, concatenated.
  constructor(header, buffer) {
    Object.assign(this, header);
    this.data = {};
    const types = { uint8: Uint8Array, uint16: Uint16Array, float32: Float32Array };
    let begin = 0;
    for (const { name, type, shape, low, step } of header.arrays) {
      const length = shape.reduce((a, b) => a * b, 1);
      const raw = new types[type](buffer, begin, length);
      const none = type === 'float32' ? NaN : 2 ** (8 * raw.BYTES_PER_ELEMENT) - 1;
      this.data[name] = { raw, low, step, none, row: length / shape[0] };
      begin += raw.byteLength;
    }
    this.places = this.voxels.map((name) => name.split('_').slice(1).map(Number));
  }

  static async load(header, base64) {
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Walk(header, await new Response(stream).arrayBuffer());
  }

  get frames() {
    return this.data.x.raw.length;
  }

  get begin() {
    return 0;
  }

  get duration() {
    return (this.steps - 1) / this.rate;
  }

  timeOf(frame) {
    return (frame * this.stride) / this.rate;
  }

  has(name) {
    return name in this.data;
  }

  // Return a number of a row of an array; NaN if it is unknown.
  at(name, row, column = 0) {
    const { raw, low, step, none, row: width } = this.data[name];
    const value = raw[row * width + column];
    return value === none ? NaN : low + step * value;
  }

  // Return the frames before and after a time, and the fraction of the interval between them.
  around(time) {
    const place = Math.min(Math.max((time * this.rate) / this.stride, 0), this.frames - 1);
    const before = Math.floor(place);
    return [before, Math.min(before + 1, this.frames - 1), place - before];
  }

  // Return a number at a time, interpolated between two frames.
  between(name, time, column = 0) {
    const [a, b, part] = this.around(time);
    return (1 - part) * this.at(name, a, column) + part * this.at(name, b, column);
  }

  // Return the state of a voxel at a control step. HELD: an older answer moves it, LIMP: none does,
  // UNKNOWN: a gap in the recording; late: its message came too late; silent: there is none.
  state(step, voxel) {
    const raw = this.data.state.raw[step * this.voxels.length + voxel] ?? 0;
    return { outcome: raw & 3, late: (raw & 4) > 0, silent: (raw & 8) > 0 };
  }

  // Return the colour that marks a state; none if the voxel's answer and message came in time.
  shade(step, voxel) {
    const { outcome, late, silent } = this.state(step, voxel);
    return outcome === LIMP ? 'limp' : outcome === HELD || late || silent ? 'held' : undefined;
  }

  // Return the corners [m] of a voxel at a time: [[x, y], ...], clockwise from the upper left.
  corners(voxel, time) {
    const x = this.between('x', time), y = this.between('y', time);
    return [0, 2, 4, 6].map((i) => [
      x + this.between('corners', time, 8 * voxel + i),
      y + this.between('corners', time, 8 * voxel + i + 1),
    ]);
  }

  // Return the indices of a voxel's neighbours.
  neighbours(voxel) {
    const [x, y] = this.places[voxel];
    return this.places.flatMap(([a, b], i) => (Math.abs(a - x) + Math.abs(b - y) === 1 ? [i] : []));
  }

  // Return the channels that `from` sends to `to`: those of one side if cells are directional.
  channels(from, to) {
    const all = [...Array(this.channelCount).keys()];
    if (to === undefined || !this.directional) return all;
    const [dx, dy] = [0, 1].map((i) => this.places[to][i] - this.places[from][i]);
    const side = [[0, 1], [-1, 0], [0, -1], [1, 0]].findIndex(([a, b]) => a === dx && b === dy);
    const perSide = this.channelCount / 4;
    return all.slice(side * perSide, (side + 1) * perSide);
  }

  // Return the height [m] of the ground at x [m].
  height(x) {
    const [xs, ys] = this.ground;
    let low = 0, high = xs.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (xs[middle] <= x) low = middle;
      else high = middle;
    }
    const part = Math.min(Math.max((x - xs[low]) / (xs[high] - xs[low]), 0), 1);
    return ys[low] + part * (ys[high] - ys[low]);
  }
}
