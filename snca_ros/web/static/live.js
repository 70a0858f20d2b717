// The page of a running walk: it receives frames over a WebSocket and sends commands.
'use strict';

class LiveWalk extends Walk {
  constructor(header) {
    super({ ...header, arrays: [] }, new ArrayBuffer(0));
    this.times = [];
    const each = this.voxels.length;
    const rows = {
      x: 1, y: 1, corners: 8 * each, area: each, touch: each, actuation: each, v_x: 1,
      ...(this.spiking ? { rate: each } : {}),
    };
    for (const [name, row] of Object.entries(rows))
      this.data[name] = { raw: [], low: 0, step: 1, none: null, row };
    this.data.state = { raw: [], low: 0, step: 1, none: undefined, row: each };
    this.data.messages = { raw: [], low: 0, step: 1, none: undefined, row: each * this.channelCount };
  }

  get frames() {
    return this.times.length;
  }

  get steps() {
    return Math.round(this.duration * this.rate) + 1;
  }

  // The page has no frames from before it was opened.
  get begin() {
    return this.times[0] ?? 0;
  }

  get duration() {
    return this.times.at(-1) ?? 0;
  }

  timeOf(frame) {
    return this.times[frame];
  }

  around(time) {
    let low = 0, high = this.frames - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= time) low = middle;
      else high = middle;
    }
    const length = this.times[high] - this.times[low];
    return [low, high, length ? Math.min(Math.max((time - this.times[low]) / length, 0), 1) : 1];
  }

  // Unlike in a recording, the corners are absolute.
  corners(voxel, time) {
    return [0, 2, 4, 6].map((i) => [0, 1].map((j) => this.between('corners', time, 8 * voxel + i + j)));
  }

  // Add a frame; return false if it is of another episode, after a reset.
  append({ step, messages, ages, health, ...numbers }) {
    const time = step / this.rate;
    if (time < this.duration) return false;
    for (const [at, voxel, channels] of messages)
      channels.forEach((value, i) => {
        this.data.messages.raw[(at * this.voxels.length + voxel) * this.channelCount + i] = value;
      });
    for (const [at, row] of ages)
      row.forEach((age, voxel) => {
        const state = age === 0 ? 0 : 4 | (age > 0 ? HELD : LIMP);
        this.data.state.raw[at * this.voxels.length + voxel] = state;
      });
    this.health = health;
    if (time === this.duration && this.frames) return true;
    this.times.push(time);
    for (const name of ['x', 'y', 'corners', 'area', 'touch', 'actuation'])
      this.data[name].raw.push(...[numbers[name]].flat());
    const second = Math.max(time - 1, this.times[0]);
    this.data.v_x.raw.push(time > second ? (numbers.x - this.between('x', second)) / (time - second) : null);
    if (this.spiking) this.data.rate.raw.push(...this.rates(step));
    return true;
  }

  // Return the mean firing rate [Hz] of each voxel's channels over the last second.
  rates(step) {
    const { raw } = this.data.messages, each = this.voxels.length, n = this.channelCount;
    return this.voxels.map((_, voxel) => {
      let spikes = 0, received = 0;
      for (let at = Math.max(step - this.rate, 0); at < step; at++) {
        const first = (at * each + voxel) * n;
        if (raw[first] === undefined || this.state(at, voxel).late) continue;
        received++;
        for (let i = 0; i < n; i++)
          for (let bits = raw[first + i]; bits; bits &= bits - 1) spikes++;
      }
      return received ? (spikes / n) * (this.rate / received) : null;
    });
  }
}

class LivePlayer extends Player {
  constructor(walk, socket) {
    super(walk);
    this.following = true;
    this.drawn = 0;
    element('speed').hidden = true;
    element('panel-node').hidden = false;
    for (const action of ['kill', 'revive', 'noise'])
      element(action).addEventListener('click', () =>
        socket.send(JSON.stringify({ action, voxel: walk.voxels[this.selection.from] })));
    this.draw();
  }

  // "Play" follows the newest frame; after pausing or seeking the page stays at its time.
  toggle() {
    this.following = !this.following;
    this.arrive();
  }

  seek(time) {
    this.following = false;
    super.seek(time);
  }

  arrive() {
    element('scrub').min = Math.round(this.walk.begin * this.walk.rate);
    element('scrub').max = this.walk.steps - 1;
    if (this.following) this.time = this.walk.duration;
    this.draw();
    if (performance.now() - this.drawn < 500) return;
    this.drawn = performance.now();
    this.plots.forEach((plot) => plot.refill(this.selection.from));
  }

  draw() {
    this.playing = this.following;
    super.draw();
    const { from } = this.selection, name = this.walk.voxels[from];
    const [level, text] = this.walk.health?.[name] ?? [0, ''];
    element('node').textContent = from === undefined ? 'Click a voxel.' : `${name}: ${text}`;
    element('node').dataset.level = level;
    for (const action of ['kill', 'revive', 'noise'])
      element(action).disabled = from === undefined;
  }
}

function openLive(header) {
  const socket = new WebSocket(`ws://${location.host}/`);
  let walk = new LiveWalk(header), player = null;
  socket.addEventListener('message', ({ data }) => {
    const frame = JSON.parse(data);
    if (!walk.append(frame)) location.reload(); // the simulation was reset
    else if (player) player.arrive();
    else window.player = player = new LivePlayer(walk, socket);
  });
  socket.addEventListener('open', () => (element('state').textContent = ''));
  socket.addEventListener('close', () => (element('state').textContent = 'The walk has ended.'));
}
