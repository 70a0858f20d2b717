// The controls of the page: play, pause, seek, select; and everything drawn at one time.
'use strict';

const element = (id) => document.getElementById(id);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

class Player {
  constructor(walk) {
    this.walk = walk;
    this.time = 0;
    this.playing = false;
    this.speed = 1;
    this.selection = {};
    this.stage = new Stage(element('stage'), walk);
    this.raster = walk.has('messages') ? new Raster(element('raster'), walk) : null;
    this.spans = new Spans(element('spans'), walk);
    const seek = (time) => this.seek(time);
    this.plots = [['v_x', 'v_x [m/s]'], ['rate', 'rate [Hz]'], ['threshold', 'threshold [mV]']]
      .filter(([name]) => walk.has(name))
      .map(([name, label]) => new Plot(element(`plot-${name}`), walk, name, label, seek));
    for (const name of ['rate', 'threshold', 'messages'])
      element(`panel-${name}`).hidden = !walk.has(name);
    this.controls();
    this.choices();
    this.draw();
  }

  controls() {
    element('play').addEventListener('click', () => this.toggle());
    const scrub = element('scrub');
    scrub.max = this.walk.steps - 1;
    scrub.addEventListener('input', () => this.seek(scrub.value / this.walk.rate));
    const speed = element('speed');
    speed.replaceChildren(...SPEEDS.map((value) => new Option(`${value} ×`, value)));
    speed.addEventListener('change', () => this.setSpeed(Number(speed.value)));
    this.setSpeed(1);
    element('stage').addEventListener('click', (event) => {
      const voxel = this.stage.voxelAt(event.offsetX, event.offsetY);
      this.select(voxel < 0 || voxel === this.selection.from ? {} : { from: voxel });
    });
    element('choice').addEventListener('change', (event) => {
      const [from, to] = event.target.value.split('>').map((text) => (text ? Number(text) : undefined));
      this.select({ from, to });
    });
    document.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(document.body);
    const redraw = () => {
      this.plots.forEach((plot) => plot.chart.redraw());
      this.spans.drawn = {};
      this.draw();
    };
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
  }

  // Fill the list of what can be selected: all voxels, one, or one of its connections.
  choices() {
    const { walk, selection: { from, to } } = this;
    const options = [new Option('all voxels', ''), ...walk.voxels.map((name, i) => new Option(name, i))];
    if (from !== undefined) {
      const near = walk.neighbours(from);
      const pair = (a, b) => new Option(`${walk.voxels[a]} → ${walk.voxels[b]}`, `${a}>${b}`);
      const at = from + 2;
      options.splice(at, 0, ...near.map((i) => pair(from, i)), ...near.map((i) => pair(i, from)));
    }
    element('choice').replaceChildren(...options);
    element('choice').value = from === undefined ? '' : to === undefined ? from : `${from}>${to}`;
  }

  select(selection) {
    this.selection = selection;
    this.choices();
    this.plots.forEach((plot) => plot.select(selection.from));
    this.draw();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { tagName } = event.target;
    if (tagName === 'BUTTON' && event.key === ' ') return;
    const typing = tagName === 'SELECT' || tagName === 'INPUT';
    const step = 1 / this.walk.rate, voxels = this.walk.voxels.length;
    const speed = SPEEDS.indexOf(this.speed);
    const next = (by) => ({ from: ((this.selection.from ?? (by > 0 ? -1 : 0)) + by + voxels) % voxels });
    const actions = {
      ',': () => this.seek(this.time - step), '.': () => this.seek(this.time + step),
      n: () => this.select(next(1)), p: () => this.select(next(-1)),
      Escape: () => this.select({}),
      '-': () => this.setSpeed(SPEEDS[Math.max(speed - 1, 0)]),
      '+': () => this.setSpeed(SPEEDS[Math.min(speed + 1, SPEEDS.length - 1)]),
      ...(typing ? {} : {
        ' ': () => this.toggle(),
        ArrowLeft: () => this.seek(this.time - 1), ArrowRight: () => this.seek(this.time + 1),
        Home: () => this.seek(this.walk.begin), End: () => this.seek(this.walk.duration),
      }),
    };
    if (!(event.key in actions)) return;
    event.preventDefault();
    actions[event.key]();
  }

  toggle() {
    if (!this.playing && this.time >= this.walk.duration) this.time = 0;
    this.playing = !this.playing;
    if (this.playing) {
      let last = performance.now();
      const tick = (now) => {
        if (!this.playing) return;
        this.time += (Math.max(now - last, 0) / 1000) * this.speed;
        last = now;
        if (this.time >= this.walk.duration) {
          this.time = this.walk.duration;
          this.playing = false;
        }
        this.draw();
        requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }
    this.draw();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.walk.begin), this.walk.duration);
    this.draw();
  }

  setSpeed(speed) {
    this.speed = speed;
    element('speed').value = speed;
  }

  // Return the state of the page and the robot's position and velocity.
  state() {
    const { walk, time, playing, speed, selection } = this;
    return {
      time, playing, speed, ...selection, step: Math.round(time * walk.rate),
      x: walk.between('x', time), y: walk.between('y', time), v_x: walk.between('v_x', time),
    };
  }

  draw() {
    const { x, v_x: velocity } = this.state();
    this.stage.draw(this.time, this.selection);
    this.raster?.draw(this.time, this.selection);
    this.spans.draw(this.selection);
    this.plots.forEach((plot) => plot.draw(this.time));
    element('scrub').value = Math.round(this.time * this.walk.rate);
    element('scrub').setAttribute('aria-valuetext', `${this.time.toFixed(1)} seconds`);
    element('play').setAttribute('aria-label', this.playing ? 'pause' : 'play');
    element('play').classList.toggle('playing', this.playing);
    element('time').textContent = `${this.time.toFixed(2)} s`;
    element('place').textContent = `x ${x.toFixed(1)} m`;
    element('velocity').textContent = Number.isNaN(velocity) ? '' : `v_x ${velocity.toFixed(2)} m/s`;
  }
}
