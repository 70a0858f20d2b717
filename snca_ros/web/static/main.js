// Opens the page of a recorded walk or of a running one.
'use strict';

const header = JSON.parse(element('header').textContent);
if (header.history)
  drawHistory(element('plot-history'), header.history, header.historyLabel);
if (header.live) openLive(header);
else
  Walk.load(header, element('frames').textContent).then((walk) => {
    window.player = new Player(walk);
  });
