// The messages that voxels send around the player's time: spikes as ticks, values as colours.
'use strict';

const RASTER_PAST = 1.5, RASTER_FUTURE = 0.5; // seconds shown before and after now

class Raster {
  constructor(canvas, walk) {
    this.canvas = canvas;
    this.walk = walk;
  }

  // Return the rows of a selection: [{label, voxel, channels}].
  groups({ from, to }) {
    const { walk } = this;
    const voxels = from === undefined ? walk.voxels.map((_, i) => i) : [from];
    return voxels.map((voxel) => ({
      label: walk.voxels[voxel].replace('voxel_', '').replace('_', ','),
      voxel,
      channels: walk.channels(voxel, to),
    }));
  }

  draw(time, selection) {
    const groups = this.groups(selection);
    const rows = groups.reduce((sum, group) => sum + group.channels.length, 0);
    const [context, width, height] = cleared(this.canvas);
    const left = 34, row = height / rows;
    const scale = (width - left) / (RASTER_PAST + RASTER_FUTURE);
    const now = left + RASTER_PAST * scale;
    const place = (at) => now + (at - time) * scale;
    let top = height;
    context.font = '12px system-ui, sans-serif';
    context.textBaseline = 'middle';
    for (const { label, voxel, channels } of groups) {
      const below = top;
      this.shades(context, voxel, time, top - channels.length * row, channels.length * row, place);
      for (const channel of channels) {
        top -= row;
        this.channel(context, voxel, channel, time, top, row, place);
      }
      context.clearRect(0, top, left, below - top);
      context.fillStyle = color('ink');
      context.fillText(label, 4, (top + below) / 2);
      context.fillStyle = color('line');
      context.fillRect(0, top, width, 1);
    }
    context.fillStyle = color('accent');
    context.fillRect(now - 1, 0, 2, height);
  }

  // Shade the steps at which a voxel is limp, or its answer or message did not come in time.
  shades(context, voxel, time, top, height, place) {
    const { walk } = this, [first, last] = this.range(time);
    for (let begin = first, step = first; step <= last; step++) {
      const shade = walk.shade(begin, voxel);
      if (step < last && walk.shade(step + 1, voxel) === shade) continue;
      const x = place(begin / walk.rate);
      begin = step + 1;
      if (!shade) continue;
      context.fillStyle = color(shade);
      context.fillRect(x, top, place(begin / walk.rate) - x, height);
    }
  }

  // Return the first and the last step shown.
  range(time) {
    const { walk } = this;
    return [
      Math.max(0, Math.floor((time - RASTER_PAST) * walk.rate)),
      Math.min(walk.steps - 1, Math.ceil((time + RASTER_FUTURE) * walk.rate)),
    ];
  }

  channel(context, voxel, channel, time, top, row, place) {
    const { walk } = this, { raw } = walk.data.messages;
    const [first, last] = this.range(time), colors = [color('spike'), color('late')];
    for (let step = first; step <= last; step++) {
      const index = (step * walk.voxels.length + voxel) * walk.channelCount + channel;
      const x = place(step / walk.rate), next = place((step + 1) / walk.rate);
      const { late } = walk.state(step, voxel);
      if (walk.spiking) {
        context.fillStyle = colors[Number(late)];
        for (let bits = raw[index], h = 0; bits; bits >>= 1, h++)
          if (bits & 1) context.fillRect(x + ((next - x) * h) / 16, top + 1, 1.5, Math.max(row - 2, 1));
      } else {
        const value = walk.at('messages', 0, index);
        if (Number.isNaN(value) && walk.shade(step, voxel)) continue;
        context.globalAlpha = late ? 0.35 : 1;
        context.fillStyle = areaColor(1 - 0.25 * value);
        context.fillRect(x, top, next - x + 0.5, row);
        context.globalAlpha = 1;
      }
    }
  }
}
