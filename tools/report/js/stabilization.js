// Poles over orders: those of the plant are stable, those of the noise vary.

const stability = { figure: null };

const poleKinds = ['new', 'stable frequency', 'stable frequency and damping'];

function buildStabilization() {
  const poles = content.stabilization;
  const body = section('stabilization', 'Stabilization', 'Stabilization diagram',
    'Poles of a common-denominator fit of increasing order, independent of the model. A pole is stable if it is within 1\u00a0% in frequency ' +
    'and 5\u00a0% in damping of a pole of the previous order. Background: the first curve of the CMIF and the identified modes.');
  const legend = element('div', { class: 'legend' }, ...poleKinds.map((kind, i) => element('span', { class: 'pole-mark kind-' + i }, kind)),
    saveButtons('stabilization diagram', savedStabilization));
  stability.figure = canvasFigure('stabilization-plot', stabilizationSummary(), drawStabilization, 'tall');
  stability.figure.node.addEventListener('keydown', bandKey);
  followBand(stability.figure.redraw);
  body.append(legend, bandBar(), element('p', { class: 'plot-title' }, 'Order of the fit'), stability.figure.node, element('p', { class: 'axis-title' }, 'Frequency [Hz]'), folded('Stable poles of the largest order', stableTable()));
}

function lastOrder() {
  return content.stabilization.reduce((most, [order]) => Math.max(most, order), 0);
}

function stablePoles() {
  const last = lastOrder();
  return content.stabilization.filter(([order, , , kind]) => order === last && kind === 2);
}

function stabilizationSummary() {
  return 'Stabilization diagram up to order ' + lastOrder() + '; ' + plural(stablePoles().length, 'pole') + ' of the largest order are stable in frequency and damping';
}

// Every stable pole with the nearest identified mode.
function stableTable() {
  const near = (hz) => identifiedModes().reduce((best, mode) => (best === null || Math.abs(mode.frequency_hz - hz) < Math.abs(best.frequency_hz - hz) ? mode : best), null);
  return sortableTable([
    ['f [Hz]', (row) => row.f, (row) => fixed(row.f)], ['\u03b6 [%]', (row) => row.zeta, (row) => hundred(row.zeta)],
    ['nearest mode [Hz]', (row) => row.mode && row.mode.frequency_hz, (row) => fixed(row.mode && row.mode.frequency_hz)],
    ['difference', (row) => row.mode && Math.abs(row.f / row.mode.frequency_hz - 1), (row) => (row.mode ? percent(Math.abs(row.f / row.mode.frequency_hz - 1)) : '\u2013')],
  ], stablePoles().map(([, f, zeta]) => ({ f, zeta, mode: near(f) })));
}

function stabilizationArea(width, height) {
  return { x: 46, y: 8, w: width - 58, h: height - 34 };
}

function drawStabilization(context, width, height) {
  const area = stabilizationArea(width, height);
  const [low, high] = shownBand();
  const most = lastOrder();
  const x = (hz) => area.x + area.w * Math.log(hz / low) / Math.log(high / low);
  const y = (order) => area.y + area.h * (1 - order / (most + 2));
  const colours = palette();
  for (const { v, label } of logTicks(low, high, area.w, frequencyLabel, 46)) {
    if (label) drawText(context, label, x(v), area.y + area.h + 6, { align: 'center', base: 'top' });
  }
  for (const { v, label } of linearTicks(0, most, Math.max(2, area.h / 40), (order) => String(Math.round(order)))) {
    drawText(context, label, area.x - 6, y(v), { align: 'right', base: 'middle' });
  }
  context.save();
  clipTo(context, area.x, area.y, area.w, area.h);
  drawModeLines(context, x, area);
  if (content.arrays.cmif) drawFirstCurve(context, x, area, low, high);
  for (const [order, hz, , kind] of content.stabilization) if (hz >= low && hz <= high) drawPole(context, kind, x(hz), y(order));
  context.restore();
  context.strokeStyle = colours.frame;
  context.lineWidth = 1;
  context.strokeRect(area.x + 0.5, area.y + 0.5, area.w - 1, area.h - 1);
}

function drawModeLines(context, x, area) {
  context.strokeStyle = palette().marker;
  context.globalAlpha = 0.35;
  context.lineWidth = 1;
  context.beginPath();
  for (const mode of identifiedModes()) {
    context.moveTo(x(mode.frequency_hz), area.y);
    context.lineTo(x(mode.frequency_hz), area.y + area.h);
  }
  context.stroke();
  context.globalAlpha = 1;
}

// On its own logarithmic scale that fills the height.
function drawFirstCurve(context, x, area, low, high) {
  const f = array('frequency');
  const [first, last] = bandLines(low, high);
  const logs = Array.from(array('cmif').subarray(first, last + 1), (v) => Math.log(Math.max(v, 1e-300)));
  const least = Math.min(...logs);
  const range = Math.max(...logs) - least || 1;
  context.strokeStyle = palette().frame;
  context.lineWidth = 1.5;
  context.beginPath();
  logs.forEach((v, i) => context.lineTo(x(f[first + i]), area.y + area.h * (1 - 0.95 * (v - least) / range)));
  context.stroke();
}

function drawPole(context, kind, x, y) {
  const colours = palette();
  context.lineWidth = 1.2;
  if (kind === 0) {
    context.beginPath();
    context.strokeStyle = colours.deviation;
    context.moveTo(x - 2.5, y);
    context.lineTo(x + 2.5, y);
    context.moveTo(x, y - 2.5);
    context.lineTo(x, y + 2.5);
    context.stroke();
    return;
  }
  circle(context, x, y, 2.8);
  context.strokeStyle = colours.curves[0];
  context.fillStyle = kind === 2 ? colours.curves[0] : colours.background;
  context.fill();
  context.stroke();
}

function savedStabilization() {
  return { title: stabilizationSummary(), panels: [canvasPanel(stability.figure)] };
}
