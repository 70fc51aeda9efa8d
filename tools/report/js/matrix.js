// The element-wise Bode matrix: one panel per channel, drawn while it is near the visible part of the page.

const matrix = { panels: new Map(), grid: null, watcher: null, timesOmega: 0, pending: 0, range: null, size: null };

// Factor of the magnitudes: 1 or omega^2 (acceleration instead of position).
function lineScale() {
  const f = array('frequency');
  return matrix.timesOmega ? Float64Array.from(f, (hz) => (2 * Math.PI * hz) ** matrix.timesOmega) : null;
}

function scaled(values, scale) {
  return scale && values ? Float64Array.from(values, (v, k) => v * scale[k]) : values;
}

// Calls use(magnitude) for every `step`-th line of the visible band, of all channels.
function eachMagnitude(id, step, scale, use) {
  const values = array(id);
  if (!values) return;
  const [first, last] = bandLines(...shownBand());
  for (let c = 0; c < channelCount(); ++c) {
    for (let k = first; k <= last; k += step) {
      const at = 2 * (c * content.frf.lines + k);
      use(Math.sqrt(values[at] * values[at] + values[at + 1] * values[at + 1]) * (scale ? scale[k] : 1));
    }
  }
}

// The common range in the visible band: all measured values and most of the residual below them.
function matrixRange(scale) {
  let high = 0;
  let low = Infinity;
  const small = [];
  eachMagnitude('response', 1, scale, (v) => {
    if (v > high) high = v;
    if (v > 0 && v < low) low = v;
  });
  eachMagnitude('residual', 7, scale, (v) => { if (v > 0) small.push(v); });
  if (small.length) low = Math.min(low, Float64Array.from(small).sort()[Math.floor(0.03 * small.length)]);
  if (!(high > 0)) return [-1, 0];
  return [Math.log10(low) - 0.2, Math.log10(high) + 0.3];
}

function buildMatrix() {
  const { inputs, outputs } = content.frf;
  const body = section('response', 'Response', 'Frequency response, element by element',
    'Each panel is one sensor over one actuator' + (isListed() ? '' : ', named at the edges') + ': magnitude over frequency, both logarithmic, ' +
    'with a common scale. Select a panel to enlarge it, drag across one to zoom all; the arrow keys move between panels, ' +
    '+ and \u2212 zoom, Page Up and Page Down pan, Home shows the whole band.');
  const legend = element('div', { class: 'legend' }, element('span', { class: 'legend', id: 'matrix-legend' }));
  const times = element('input', { type: 'checkbox', id: 'times-omega', onchange: () => {
    matrix.timesOmega = times.checked ? 2 : 0;
    redrawMatrix();
    showEntry(entry.channel);
  } });
  legend.append(element('label', { class: 'toggle', for: 'times-omega' }, times, ' times \u03c9\u00b2'));
  matrix.grid = element('div', {
    class: isListed() ? 'matrix list' : 'matrix', role: 'group', 'aria-label': 'Panels', onkeydown: moveFocus, onpointerdown: dragAcross,
    style: '--inputs:' + inputs.length + ';--outputs:' + outputs.length,
  });
  legend.append(saveButtons('frequency response', savedMatrix));
  body.append(legend, bandBar(), ...(isListed() ? [buildSearch()] : []), element('div', { class: 'matrix-scroll' }, matrix.grid),
    element('p', { class: 'quiet', id: 'matrix-scale' }));
  fillMatrixLegend();
  followBand(() => {
    if (!matrix.pending) matrix.pending = requestAnimationFrame(redrawMatrix);
  });
  plots.add({ resize: () => {}, recolour: redrawMatrix });
  watchPanels();
  if (isListed()) fillList();
  else showPanels(Array.from({ length: channelCount() }, (_, channel) => channel));
}

// The names at the edges, and the empty corner between them.
function edgeNames() {
  const name = (kind, place) => ({ name: text }, i) => element('span', { class: kind, style: place + ':' + i, title: text }, element('span', null, text));
  return [element('span', { class: 'corner' }), ...content.frf.inputs.map(name('input-name', '--i')), ...content.frf.outputs.map(name('output-name', '--o'))];
}

// Replaces the panels by those of the channels.
function showPanels(channels) {
  matrix.watcher.disconnect();
  matrix.panels = new Map(channels.map((channel) => [channel, makePanel(channel)]));
  const buttons = Array.from(matrix.panels.values(), ({ button }) => button);
  matrix.grid.replaceChildren(...(isListed() ? [] : edgeNames()), ...buttons);
  for (const button of buttons) matrix.watcher.observe(button);
  markPanel();
}

function fillMatrixLegend() {
  const legend = document.getElementById('matrix-legend');
  legend.replaceChildren(swatch('measured', 'measured'));
  if (content.arrays.residual) legend.append(swatch('model', 'model'), swatch('residual', 'residual'), element('span', { class: 'quiet' }, 'number: relative rms error of the channel; \u2013: no response above the noise'));
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
  const name = channelName(channel);
  const error = element('span', { class: 'error' });
  const button = element('button', {
    type: 'button', class: 'panel', style: '--i:' + inputOf(channel) + ';--o:' + outputOf(channel), 'data-channel': channel,
    title: name, onclick: () => selectPanel(channel),
  }, element('span', { class: 'panel-name' }, name), error);
  return { button, error, canvas: null, near: false };
}

function selectPanel(channel) {
  showEntry(channel);
  markPanel();
}

// The panel of the chosen element is pressed; it, else the first one, is reached by Tab.
function markPanel() {
  const reached = matrix.panels.has(entry.channel) ? entry.channel : matrix.panels.keys().next().value;
  matrix.panels.forEach(({ button }, channel) => {
    button.setAttribute('aria-pressed', String(channel === entry.channel));
    button.tabIndex = channel === reached ? 0 : -1;
  });
}

function moveFocus(event) {
  if (bandKey(event)) return;
  const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
  const from = Number(event.target.dataset.channel);
  if (!step || !matrix.panels.has(from)) return;
  event.preventDefault();
  const channel = isListed() ? nextInList(from, ...step) : nextInMatrix(from, ...step);
  drawPanel(channel);  // with its error, which is read with the name
  matrix.panels.get(from).button.tabIndex = -1;
  const { button } = matrix.panels.get(channel);
  button.tabIndex = 0;
  button.focus();
}

function nextInMatrix(from, down, right) {
  const { inputs, outputs } = content.frf;
  const turned = getComputedStyle(matrix.grid).getPropertyValue('--turned').trim() === '1';
  const within = (place, list) => Math.min(list.length - 1, Math.max(0, place));
  return channelIndex(within(outputOf(from) + (turned ? right : down), outputs), within(inputOf(from) + (turned ? down : right), inputs));
}

// Panels are drawn while they are near the visible part of the page and of the matrix.
function watchPanels() {
  matrix.watcher = new IntersectionObserver((seen) => {
    for (const { target, isIntersecting } of seen) {
      const channel = Number(target.dataset.channel);
      const panel = matrix.panels.get(channel);
      if (!panel) continue;  // replaced meanwhile
      panel.near = isIntersecting;
      refreshPanel(panel, channel);
    }
  }, { rootMargin: '100px', scrollMargin: '100px' });
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
  matrix.range = matrix.size = null;
  matrix.panels.forEach(refreshPanel);
}

// On paper all panels are visible.
function refreshPanel(panel, channel) {
  if (panel.near || printing) drawPanel(channel);
  else if (panel.canvas) {
    panel.canvas.remove();
    panel.canvas = null;
  }
}

function drawPanel(channel) {
  const panel = matrix.panels.get(channel);
  if (!panel.canvas) panel.button.prepend(panel.canvas = element('canvas', { 'aria-hidden': 'true' }));
  // All panels are of one size: measuring each would lay out the page once per panel.
  if (!matrix.size) matrix.size = { width: panel.canvas.clientWidth, height: panel.canvas.clientHeight };
  const { width, height } = matrix.size;
  paintPanel(channel, sharpContext(panel.canvas, width, height), width, height);
  panel.error.textContent = content.arrays.residual ? percent(channelCurves(channel).relativeError) : '';
}

function paintPanel(channel, context, width, height) {
  const scale = lineScale();
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
  if (!matrix.range) {
    matrix.range = matrixRange(lineScale());
    tellScale();
  }
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
    if (high > low) {
      context.lineTo(x, y(low));
      context.lineTo(x, y(high));
    }
    if (last < high) context.lineTo(x, y(last));
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
