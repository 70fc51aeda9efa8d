// The stabilization diagram as a tool: a click on a pole adds a mode, on a mode's line removes it, a drag selects the band.

const reach = { line: 5, pole: 9 };  // pixels

const drag = { from: null, mark: null };

function equipDiagram() {
  const { node } = stability.figure;
  node.classList.add('tool');
  const hint = element('output', { class: 'values', id: 'diagram-hint' });
  node.before(element('p', { class: 'plot-title' }, 'Click a pole to add a mode, click the line of a mode to remove it, drag to select the band of the fit. ', hint));
  node.addEventListener('pointermove', (event) => {
    const target = targetAt(event);
    hint.textContent = target ? target.text : '';
    node.classList.toggle('aimed', Boolean(target));
    if (drag.from !== null) markDrag(event);
  });
  node.addEventListener('pointerleave', () => { hint.textContent = ''; });
  node.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    drag.from = event.offsetX;
    node.setPointerCapture(event.pointerId);
  });
  node.addEventListener('pointercancel', endDrag);
  node.addEventListener('pointerup', (event) => {
    const { from } = drag;
    endDrag();
    if (from === null) return;
    if (Math.abs(event.offsetX - from) > reach.line) {
      const ends = [from, event.offsetX].map((x) => diagramFrame().hz(x)).sort((a, b) => a - b);
      fitBand(...ends);
    } else {
      const target = targetAt(event);
      if (target) target.click();
    }
  });
  followBand(showFitBand);
  new ResizeObserver(showFitBand).observe(node);
}

// The same axes as drawStabilization().
function diagramFrame() {
  const { clientWidth, clientHeight } = stability.figure.node;
  const area = stabilizationArea(clientWidth, clientHeight);
  const [low, high] = shownBand();
  const ratio = Math.log(high / low);
  return {
    area, x: (hz) => area.x + area.w * Math.log(hz / low) / ratio, y: (order) => area.y + area.h * (1 - order / (lastOrder() + 2)),
    hz: (x) => Math.min(high, Math.max(low, low * Math.exp(ratio * (x - area.x) / area.w))),
  };
}

// What a click at that place does: {text, click}; null: nothing. The line of a mode comes before the poles on it.
function targetAt({ offsetX, offsetY }) {
  const frame = diagramFrame();
  const nearest = (list, distance) => list.reduce((best, one) => (distance(one) < (best ? distance(best) : Infinity) ? one : best), null);
  const mode = nearest(identifiedModes(), (one) => Math.abs(frame.x(one.frequency_hz) - offsetX));
  if (mode && Math.abs(frame.x(mode.frequency_hz) - offsetX) <= reach.line)
    return { text: 'remove the mode at ' + fixed(mode.frequency_hz) + ' Hz', click: () => removeMode(mode.frequency_hz) };
  const distance = ([order, hz]) => Math.hypot(frame.x(hz) - offsetX, frame.y(order) - offsetY);
  const pole = nearest(content.stabilization, distance);
  if (!pole || distance(pole) > reach.pole) return null;
  return { text: 'add a mode at ' + fixed(pole[1]) + ' Hz, ' + percent(pole[2]), click: () => addMode(pole[1], pole[2]) };
}

function markDrag(event) {
  if (!drag.mark) {
    drag.mark = element('span', { class: 'drag-mark' });
    stability.figure.node.append(drag.mark);
  }
  drag.mark.style.left = Math.min(drag.from, event.offsetX) + 'px';
  drag.mark.style.width = Math.abs(event.offsetX - drag.from) + 'px';
}

function endDrag() {
  if (drag.mark) drag.mark.remove();
  Object.assign(drag, { from: null, mark: null });
}

// Shades the lines that the fit does not use.
function showFitBand() {
  const { node } = stability.figure;
  for (const shade of node.querySelectorAll('.outside')) shade.remove();
  const band = bench.state && bench.state.controls.band_hz;
  if (!band) return;
  const frame = diagramFrame();
  const [left, right] = band.map((hz) => Math.min(frame.area.x + frame.area.w, Math.max(frame.area.x, frame.x(hz))));
  const shade = (from, to) => node.append(element('span', { class: 'outside', style: 'left:' + from + 'px;width:' + Math.max(0, to - from) + 'px' }));
  shade(frame.area.x, left);
  shade(right, frame.area.x + frame.area.w);
}
