// Plots over the whole walk (uPlot), with a line at the player's time.
'use strict';

const mean = (numbers) => {
  const known = numbers.filter((value) => value !== null);
  return known.length ? known.reduce((a, b) => a + b, 0) / known.length : null;
};
const orNull = (value) => (Number.isNaN(value) ? null : value);

const axis = (label, size) => ({
  label, size, labelSize: 20, labelGap: 0, labelFont: '12px system-ui, sans-serif',
  font: '12px system-ui, sans-serif', stroke: () => color('ink'),
  grid: { stroke: () => color('line'), width: 1 },
  ticks: { stroke: () => color('line'), width: 1 },
});

const line = (label, stroke, width) => ({
  label, width, stroke: () => color(stroke), points: { show: false }, spanGaps: false,
});

class Plot {
  // One line, or, for numbers of each voxel, a line per voxel, their mean and the selected voxel.
  constructor(parent, walk, name, label, seek) {
    this.walk = walk;
    this.name = name;
    this.each = walk.data[name].row > 1;
    const voxels = this.each ? walk.voxels.map((_, i) => i) : [];
    this.chart = new uPlot({
      width: 300, height: 150, legend: { show: false },
      scales: { x: { time: false, range: () => this.range() } },
      cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
      axes: [axis('time [s]', 30), axis(label, 44)],
      series: [
        {}, ...voxels.map((i) => line(walk.voxels[i], 'faint', 1)),
        line(this.each ? 'mean' : label, 'ink', 1.5),
        ...(this.each ? [line('selected', 'accent', 2)] : []),
      ],
    }, this.refill(), parent);
    this.needle = document.createElement('div');
    this.needle.className = 'needle';
    this.chart.over.append(this.needle);
    const drag = (event) => {
      if (event.buttons === 0 && event.type === 'pointermove') return;
      const box = this.chart.over.getBoundingClientRect();
      seek(this.chart.posToVal(event.clientX - box.left, 'x'));
    };
    this.chart.over.addEventListener('pointerdown', drag);
    this.chart.over.addEventListener('pointermove', drag);
    new ResizeObserver(() => this.fit(parent)).observe(parent);
    this.fit(parent);
    this.select();
  }

  range() {
    const { begin, duration, rate } = this.walk;
    return [begin, Math.max(duration, begin + 1 / rate)];
  }

  fit(parent) {
    this.chart.setSize({ width: Math.max(parent.clientWidth, 200), height: 150 });
  }

  // Return the data of all lines, and show them if the chart exists.
  refill(selected) {
    const { walk, name } = this, frames = [...Array(walk.frames).keys()];
    const times = frames.map((row) => walk.timeOf(row));
    if (this.each) {
      const lines = walk.voxels.map((_, i) => frames.map((row) => orNull(walk.at(name, row, i))));
      const whole = frames.map((row) => mean(lines.map((values) => values[row])));
      this.data = [times, ...lines, whole, []];
    } else this.data = [times, frames.map((row) => orNull(walk.at(name, row)))];
    if (this.chart) this.select(selected);
    return this.data;
  }

  select(voxel) {
    if (this.each)
      this.data[this.data.length - 1] = voxel === undefined
        ? this.data[0].map(() => null) : this.data[voxel + 1];
    this.chart.setData(this.data);
  }

  draw(time) {
    this.needle.style.left = `${this.chart.valToPos(Math.min(time, this.data[0].at(-1)), 'x')}px`;
  }
}

// The history of a run of evolution: its scores over episodes; `label` is quantity and unit.
function drawHistory(parent, { episodes, best_so_far: soFar, best, median }, label) {
  const chart = new uPlot({
    width: 300, height: 200, scales: { x: { time: false } }, cursor: { y: false },
    axes: [axis('episodes', 30), axis(label, 44)],
    series: [
      { label: 'episodes' }, line('best so far', 'accent', 2), line('best', 'ink', 1),
      line('median', 'faint', 1.5),
    ],
  }, [episodes, soFar, best, median], parent);
  const fit = () => chart.setSize({ width: Math.max(parent.clientWidth, 200), height: 200 });
  new ResizeObserver(fit).observe(parent);
  return chart;
}
