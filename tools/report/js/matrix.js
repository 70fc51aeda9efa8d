// The element-wise Bode matrix: one small canvas per channel, drawn when it becomes visible.

const matrix = { panels: [], timesOmega: 0, pending: 0 };

// Factor of the magnitudes: 1 or omega^2 (acceleration instead of position).
function lineScale() {
  const f = array('frequency');
  return matrix.timesOmega ? Float64Array.from(f, (hz) => (2 * Math.PI * hz) ** matrix.timesOmega) : null;
}

function scaled(values, scale) {
  return scale && values ? Float64Array.from(values, (v, k) => v * scale[k]) : values;
}

// The common range in the visible band: all measured values and most of the residual below them.
function matrixRange(scale) {
  let high = 0;
  let low = Infinity;
  const small = [];
  const [first, last] = bandLines(...shownBand());
  for (let c = 0; c < channelCount(); ++c) {
    const curves = channelCurves(c);
    const measured = scaled(curves.measured, scale);
    for (let k = first; k <= last; ++k) {
      if (measured[k] > high) high = measured[k];
      if (measured[k] > 0 && measured[k] < low) low = measured[k];
    }
    const residual = scaled(curves.residual, scale);
    if (residual) for (let k = first; k <= last; k += 7) if (residual[k] > 0) small.push(residual[k]);
  }
  if (small.length) low = Math.min(low, Float64Array.from(small).sort()[Math.floor(0.03 * small.length)]);
  if (!(high > 0)) return [-1, 0];
  return [Math.log10(low) - 0.2, Math.log10(high) + 0.3];
}

function buildMatrix() {
  const { inputs, outputs } = content.frf;
  const body = section('response', 'Response', 'Frequency response, element by element',
    'Each panel is one sensor over one actuator, named at the edges: magnitude over frequency, both logarithmic, ' +
    'with a common scale. Select a panel to enlarge it, drag across one to zoom all; the arrow keys move between panels, ' +
    '+ and \u2212 zoom, Page Up and Page Down pan, Home shows the whole band.');
  const legend = element('div', { class: 'legend' }, element('span', { class: 'legend', id: 'matrix-legend' }));
  const times = element('input', { type: 'checkbox', id: 'times-omega', onchange: () => {
    matrix.timesOmega = times.checked ? 2 : 0;
    redrawMatrix();
    showEntry(entry.channel);
  } });
  legend.append(element('label', { class: 'toggle', for: 'times-omega' }, times, ' times \u03c9\u00b2'));
  const grid = element('div', {
    class: 'matrix', role: 'group', 'aria-label': 'Panels', onkeydown: moveFocus, onpointerdown: dragAcross,
    style: '--inputs:' + inputs.length + ';--outputs:' + outputs.length,
  });
  inputs.forEach((input, i) => grid.append(element('span', { class: 'input-name', style: '--i:' + i, title: input.name }, input.name)));
  outputs.forEach((output, o) => grid.append(element('span', { class: 'output-name', style: '--o:' + o, title: output.name }, output.name)));
  for (let c = 0; c < channelCount(); ++c) grid.append(makePanel(c));
  legend.append(saveButtons('frequency response', savedMatrix));
  body.append(legend, bandBar(), element('div', { class: 'matrix-scroll' }, grid),
    element('p', { class: 'quiet', id: 'matrix-scale' }));
  fillMatrixLegend();
  followBand(() => {
    if (!matrix.pending) matrix.pending = requestAnimationFrame(redrawMatrix);
  });
  plots.add({ resize: () => {}, recolour: redrawMatrix });
  watchPanels();
}

function fillMatrixLegend() {
  const legend = document.getElementById('matrix-legend');
  legend.replaceChildren(swatch('measured', 'measured'));
  if (content.arrays.residual) legend.append(swatch('model', 'model'), swatch('residual', 'residual'), element('span', { class: 'quiet' }, 'number: relative rms error of the channel'));
  if (otherTrace()) legend.append(swatch(otherTrace(), traceName(otherTrace())));
}

// The trace of the compared day or model: its measurement, else its model.
function otherTrace() {
  if (content.arrays.other_response) return 'other';
  return content.arrays.other_model ? 'otherModel' : null;
}

// The name of a trace beside its colour.
function swatch(kind, text, tag = 'span', more = {}) {
  return element(tag, { class: 'swatch ' + kind, style: '--colour:var(--' + kind + ')', ...more }, text);
}

function makePanel(channel) {
  const canvas = element('canvas', { 'aria-hidden': 'true' });
  const error = element('span', { class: 'error' });
  const button = element('button', {
    type: 'button', class: 'panel', style: '--i:' + inputOf(channel) + ';--o:' + outputOf(channel), 'data-channel': channel,
    tabindex: channel === 0 ? '0' : '-1', title: channelName(channel), 'aria-label': channelName(channel),
    'aria-pressed': 'false', onclick: () => selectPanel(channel),
  }, canvas, error);
  matrix.panels[channel] = { button, canvas, error, drawn: false };
  return button;
}

function selectPanel(channel) {
  matrix.panels.forEach(({ button }, i) => {
    button.setAttribute('aria-pressed', String(i === channel));
    button.tabIndex = i === channel ? 0 : -1;
  });
  showEntry(channel);
}

function moveFocus(event) {
  if (bandKey(event)) return;
  const outputs = content.frf.outputs.length;
  const inputs = content.frf.inputs.length;
  const turned = getComputedStyle(event.currentTarget).getPropertyValue('--turned').trim() === '1';
  const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
  if (step && turned) step.reverse();
  const from = Number(event.target.dataset ? event.target.dataset.channel : NaN);
  if (!step || !Number.isInteger(from)) return;
  event.preventDefault();
  const output = Math.min(outputs - 1, Math.max(0, outputOf(from) + step[0]));
  const input = Math.min(inputs - 1, Math.max(0, inputOf(from) + step[1]));
  matrix.panels[from].button.tabIndex = -1;
  const target = matrix.panels[channelIndex(output, input)].button;
  target.tabIndex = 0;
  target.focus();
}

// Visible panels are drawn at once, the others when the browser is idle.
function watchPanels() {
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) drawPanel(Number(entry.target.dataset.channel));
  }, { rootMargin: '200px' });
  for (const panel of matrix.panels) seen.observe(panel.button);
  const idle = window.requestIdleCallback || ((f) => setTimeout(() => f({ timeRemaining: () => 8 }), 30));
  let next = 0;
  const work = (deadline) => {
    while (next < matrix.panels.length && deadline.timeRemaining() > 3) drawPanel(next++);
    if (next < matrix.panels.length) idle(work);
  };
  idle(work);
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if (window.innerWidth === width) return;
    width = window.innerWidth;
    redrawMatrix();
  });
}

function redrawMatrix() {
  cancelAnimationFrame(matrix.pending);
  matrix.pending = 0;
  matrix.range = null;
  for (const panel of matrix.panels) panel.drawn = false;
  matrix.panels.forEach((panel, channel) => drawPanel(channel));
}

function drawPanel(channel) {
  const panel = matrix.panels[channel];
  if (panel.drawn) return;
  const width = panel.canvas.clientWidth;
  const height = panel.canvas.clientHeight;
  if (width === 0) return;
  panel.drawn = true;
  paintPanel(channel, sharpContext(panel.canvas, width, height), width, height);
  panel.error.textContent = '';
  if (!array('residual')) return;
  const { relativeError } = channelCurves(channel);
  if (relativeError !== null) panel.error.textContent = percent(relativeError);
  panel.button.setAttribute('aria-label', channelName(channel) + (relativeError === null ? ', no response above the noise' : ', relative rms error ' + percent(relativeError)));
}

function paintPanel(channel, context, width, height) {
  const scale = lineScale();
  if (!matrix.range) {
    matrix.range = matrixRange(scale);
    tellScale();
  }
  const frame = panelFrame(width, height);
  drawDecades(context, frame);
  const curves = channelCurves(channel);
  const colours = palette();
  context.globalAlpha = 0.7;
  drawCurve(context, frame, scaled(curves.residual, scale), colours.residual, 0.6);
  context.globalAlpha = 1;
  drawCurve(context, frame, scaled(curves.measured, scale), colours.measured, curves.model ? 2.8 : 1.2);
  drawCurve(context, frame, scaled(curves[otherTrace()], scale), colours[otherTrace()], 1.2);
  drawCurve(context, frame, scaled(curves.model, scale), colours.model, 0.8);
}

function tellScale() {
  const [low, high] = matrix.range;
  const units = new Set();
  for (const output of content.frf.outputs) for (const input of content.frf.inputs) units.add(unitOf(output, input));
  const unit = units.size === 1 ? ' ' + [...units][0] : ' (units differ between channels)';
  document.getElementById('matrix-scale').textContent =
    'Across: ' + bandText() + ', up: ' + magnitudeLabel(10 ** low, 10 ** low) + ' to ' +
    magnitudeLabel(10 ** high, 10 ** high) + unit + (matrix.timesOmega ? ', times \u03c9\u00b2' : '') + '.';
}

function unitOf(output, input) {
  return (output.unit || '1') + '/' + (input.unit || '1');
}

function panelFrame(width, height) {
  const [x0, x1] = shownBand().map(Math.log10);
  const [y0, y1] = matrix.range;
  return {
    width, height, x0, x1, y0, y1,
    x: (lg) => (x1 > x0 ? (lg - x0) / (x1 - x0) : 0.5) * width,
    y: (lg) => (1 - (lg - y0) / (y1 - y0)) * height,
  };
}

function drawDecades(context, frame) {
  context.strokeStyle = palette().grid;
  context.lineWidth = 1;
  context.beginPath();
  for (const { v, label } of logTicks(10 ** frame.x0, 10 ** frame.x1, frame.width, frequencyLabel, 46)) {
    if (!label) continue;
    const x = Math.round(frame.x(Math.log10(v))) + 0.5;
    context.moveTo(x, 0);
    context.lineTo(x, frame.height);
  }
  for (let d = Math.ceil(frame.y0); d <= frame.y1; ++d) {
    const y = Math.round(frame.y(d)) + 0.5;
    context.moveTo(0, y);
    context.lineTo(frame.width, y);
  }
  context.stroke();
}

// The half-pixel column of every line; the same for all curves of that width and band.
function columnsOf(frame) {
  const { width, x0, x1 } = frame;
  const { columns } = matrix;
  if (!columns || columns.width !== width || columns.x0 !== x0 || columns.x1 !== x1) {
    const x = Float64Array.from(array('frequency'), (f) => frame.x(Math.log10(f)));
    matrix.columns = { width, x0, x1, x, column: Int32Array.from(x, (v) => Math.floor(2 * v)) };
  }
  return matrix.columns;
}

// First, smallest, largest and last value per half-pixel column, so that peaks of a single line remain visible.
function drawCurve(context, frame, values, colour, width) {
  if (!values) return;
  const { x: places, column: columns } = columnsOf(frame);
  const y = (v) => frame.y(Math.log10(Math.max(v, 1e-300)));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineJoin = 'round';
  context.beginPath();
  let column = -1, low = 0, high = 0, last = 0, x = 0;
  const flush = () => {
    context.lineTo(x, y(low));
    context.lineTo(x, y(high));
    context.lineTo(x, y(last));
  };
  // One line beyond the band on either side, so that curves reach the edge.
  const [inside, end] = bandLines(...shownBand());
  const start = Math.max(0, inside - 1);
  for (let k = start; k <= Math.min(values.length - 1, end + 1); ++k) {
    const here = columns[k];
    if (here !== column) {
      if (column >= 0) flush();
      column = here;
      x = places[k];
      low = high = values[k];
      if (k === start) context.moveTo(x, y(values[k]));
      else context.lineTo(x, y(values[k]));
    }
    if (values[k] < low) low = values[k];
    if (values[k] > high) high = values[k];
    last = values[k];
  }
  flush();
  context.stroke();
}
