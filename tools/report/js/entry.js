// One entry of the response, large: magnitude, phase and Nyquist, linked.

const entry = { magnitude: null, phase: null, channel: 0, hidden: new Set(['validation']), order: [] };

const traces = ['measured', 'model', 'residual', 'validation', 'other', 'otherModel', 'change', 'deviation'];  // in the order of drawing

const traceNames = {
  measured: 'measured', model: 'model', residual: 'residual', validation: 'residual, held-back data', deviation: 'standard deviation',
};

function traceName(name) {
  const other = content.comparison ? content.comparison.title : '';
  return traceNames[name] || { other: 'measured, ' + other, otherModel: 'model, ' + other, change: 'difference from ' + other }[name];
}

function buildEntry() {
  const { inputs, outputs } = content.frf;
  const body = section('entry', 'Element', 'One element');
  const pick = (id, label, list) => {
    const select = element('select', { id, onchange: pickEntry });
    list.forEach((channel, i) => select.append(element('option', { value: i }, channel.name)));
    return element('label', { for: id }, label + ' ', select);
  };
  body.append(
    element('div', { class: 'entry-pick' }, pick('entry-output', 'Sensor', outputs), pick('entry-input', 'Actuator', inputs), bandBar(),
      saveButtons('element', savedEntry)),
    element('div', { class: 'legend', id: 'entry-legend' }),
    element('div', { class: 'entry-plots' },
      element('div', { class: 'bode' },
        element('p', { class: 'plot-title', id: 'magnitude-title' }, 'Magnitude'), entryPlot('magnitude', 'tall'),
        element('p', { class: 'plot-title', id: 'phase-title' }, 'Phase'), entryPlot('phase', ''),
        element('p', { class: 'axis-title' }, 'Frequency [Hz]')),
      buildNyquist()),
    buildEntryTable(),
    element('p', { class: 'quiet' }, entryHelp()));
  followBand(() => {
    if (entry.magnitude) showNyquist(entry.channel);
    fillEntryTable();
  });
}

function entryPlot(name, kind) {
  return bandPlot('entry-' + name, kind, { 'aria-labelledby': 'entry-title ' + name + '-title' });
}

function entryHelp() {
  const kind = content.frf.deviation;
  const known = kind ? 'The shaded band contains the true value with 95 % probability (from the ' + (kind === 'total'
    ? 'total variance: noise and nonlinear distortions' : 'noise variance') + '; circular complex Gaussian). ' : '';
  return known + 'Drag to zoom, Shift-drag to pan, double-click for the whole band; all plots of the page move together. ' +
    'Click a name above to show or hide its trace.';
}

function pickEntry() {
  const output = Number(document.getElementById('entry-output').value);
  const input = Number(document.getElementById('entry-input').value);
  selectPanel(channelIndex(output, input));
}

// Shows part of the band, in Hz; used by the table of modes.
function zoomEntry(low, high) {
  setBand(low, high);
  document.getElementById('entry').scrollIntoView({ behavior: 'auto', block: 'start' });
}

// [low, value, high]; a logarithmic axis cannot show values <= 0.
function bar(value, half, floor) {
  const v = Math.max(value, floor);
  return half ? [Math.max(value - half, floor), v, value + half] : [v, v, v];
}

// Where such an axis ends.
function smallestPositive(lists) {
  let least = Infinity;
  for (const values of lists) for (const v of values) if (v > 0 && v < least) least = v;
  return Number.isFinite(least) ? least : 1e-300;
}

// Rows in the format of dygraphs, with the names of the columns.
function magnitudeTable(channel) {
  const scale = lineScale();
  const curves = channelCurves(channel);
  const names = traces.filter((name) => curves[name]);
  const columns = names.map((name) => [scaled(curves[name], scale), scaled(deviationOf(curves, name), scale)]);
  const floor = smallestPositive(columns.map(([values]) => values));
  const half = (deviation, k) => deviation && content.frf.band_factor * deviation[k];
  const rows = Array.from(array('frequency'), (hz, k) => [hz, ...columns.map(([values, deviation]) => bar(values[k], half(deviation, k), floor))]);
  return { rows, names };
}

function deviationOf(curves, name) {
  return { measured: curves.deviation, model: curves.modelDeviation }[name];
}

// Phases wrap: a row of gaps between two lines interrupts the trace there instead of drawing a vertical line.
function phaseTable(channel) {
  const curves = channelCurves(channel);
  const phases = channelPhases(channel);
  const names = traces.filter((name) => phases[name]);
  const f = array('frequency');
  const cut = calmestCut(names.map((name) => phases[name]));
  const turned = (phase) => (phase < cut ? phase + 360 : phase >= cut + 360 ? phase - 360 : phase);
  const columns = names.map((name) => [phases[name].map(turned), curves[name], deviationOf(curves, name)]);
  const rows = [];
  for (let k = 0; k < f.length; ++k) {
    const wraps = columns.map(([phase]) => k > 0 && Math.abs(phase[k] - phase[k - 1]) > 180);
    if (wraps.some(Boolean)) {
      rows.push([Math.sqrt(f[k] * f[k - 1]), ...wraps.map((w) => (w ? [NaN, NaN, NaN] : null))]);
    }
    rows.push([f[k], ...columns.map(([phase, magnitude, deviation]) => phaseBar(phase[k], magnitude[k], deviation && deviation[k], cut))]);
  }
  return { rows, names, cut };
}

// Angle at which to cut the circle, such that the traces wrap least: the phase of a rigid body is -180 degrees, where
// noise would make it jump between the edges. Default: -180 to 180.
function calmestCut(phases) {
  let best = -180;
  let fewest = Infinity;
  for (const cut of [-180, -225, -135, -270, -90, -315]) {
    const turn = (p) => ((p - cut) % 360 + 360) % 360;
    let wraps = 0;
    for (const phase of phases) for (let k = 1; k < phase.length; ++k) if (Math.abs(turn(phase[k]) - turn(phase[k - 1])) > 180) ++wraps;
    if (wraps < fewest) [best, fewest] = [cut, wraps];
  }
  return best;
}

function phaseBar(phase, magnitude, deviation, cut) {
  if (!deviation) return [phase, phase, phase];
  const ratio = content.frf.band_factor * deviation / magnitude;
  const half = ratio >= 1 ? 180 : Math.asin(ratio) * 180 / Math.PI;
  return [Math.max(cut, phase - half), phase, Math.min(cut + 360, phase + half)];
}

function traceStyle(name) {
  const colours = palette();
  const styles = {
    measured: { strokeWidth: 3.2 }, model: { strokeWidth: 1.3 }, residual: { strokeWidth: 0.9 },
    validation: { strokeWidth: 0.9 }, deviation: { strokeWidth: 1.1, strokePattern: [5, 4] },
    other: { strokeWidth: 2 }, otherModel: { strokeWidth: 1.3, strokePattern: [7, 3] }, change: { strokeWidth: 0.9 },
  };
  const banded = (name === 'measured' && content.arrays.deviation) || (name === 'model' && content.arrays.model_deviation);
  return { color: colours[name], plotter: seriesPlotter(banded), ...styles[name] };
}

function traceStyles(names) {
  return Object.fromEntries(names.map((name) => [name, traceStyle(name)]));
}

function plotTable(id, table, axisY, more) {
  return makeGraph(id, table.rows, () => traceStyles(table.names), {
    customBars: true, labels: ['f', ...table.names],
    visibility: table.names.map((name) => !entry.hidden.has(name)),
    axes: { x: frequencyAxis, y: axisY }, highlightCallback: tellValues, unhighlightCallback: () => tellValues(),
    ...tiedToBand(), ...more,
  });
}

function entryUnit(channel) {
  const { inputs, outputs } = content.frf;
  return unitOf(outputs[outputOf(channel)], inputs[inputOf(channel)]) + (matrix.timesOmega ? '\u00a0\u00d7\u00a0(rad/s)\u00b2' : '');
}

function showEntry(channel) {
  entry.channel = channel;
  document.getElementById('entry-title').textContent = channelName(channel);
  document.getElementById('entry-output').value = outputOf(channel);
  document.getElementById('entry-input').value = inputOf(channel);
  document.getElementById('magnitude-title').textContent = 'Magnitude [' + entryUnit(channel) + ']';
  for (const plot of [entry.magnitude, entry.phase]) removeGraph(plot);
  const table = magnitudeTable(channel);
  entry.order = table.names;
  entry.magnitude = plotTable('entry-magnitude', table, magnitudeAxis, { logscale: true });
  const phase = phaseTable(channel);
  entry.phase = plotTable('entry-phase', phase, phaseAxis, { valueRange: [phase.cut - 8, phase.cut + 368] });
  buildLegend();
  showNyquist(channel);
  fillEntryTable();
}

// Names and colours for the legend of a saved figure, without those that are empty.
function traceLegend(names) {
  return names.filter(Boolean).map((name) => [traceName(name), palette()[name]]);
}

function savedEntry() {
  return {
    title: channelName(entry.channel), legend: traceLegend(entry.order.filter((name) => !entry.hidden.has(name))),
    panels: [graphPanel(entry.magnitude, 'Magnitude [' + entryUnit(entry.channel) + ']'), graphPanel(entry.phase, 'Phase over frequency in Hz')],
  };
}

function buildLegend() {
  const legend = document.getElementById('entry-legend');
  keepFocus(() => legend, () => legend.replaceChildren(...entry.order.map((name) => swatch(name, traceName(name), 'button',
    { type: 'button', 'aria-pressed': String(!entry.hidden.has(name)), onclick: () => toggleTrace(name) })), element('output', { id: 'entry-values', class: 'values' })));
}

function toggleTrace(name) {
  // A logarithmic axis needs data for its scale, so the last trace cannot be hidden.
  if (!entry.hidden.has(name) && entry.order.every((other) => other === name || entry.hidden.has(other))) return;
  if (entry.hidden.has(name)) entry.hidden.delete(name);
  else entry.hidden.add(name);
  for (const graph of [entry.magnitude, entry.phase]) {
    const place = graph.getLabels().indexOf(name) - 1;
    if (place >= 0) graph.setVisibility(place, !entry.hidden.has(name));
  }
  buildLegend();
}

function tellValues(event, hz) {
  const output = document.getElementById('entry-values');
  if (!event || !isNumber(hz)) {
    output.textContent = '';
    return;
  }
  const k = lineFrom(hz);
  const curves = channelCurves(entry.channel);
  const phases = channelPhases(entry.channel);
  const parts = [number(array('frequency')[k], 6) + '\u00a0Hz', '|G| ' + number(curves.measured[k]) + ', ' + number(phases.measured[k]) + '\u00b0'];
  if (curves.model) parts.push('|P| ' + number(curves.model[k]) + ', ' + number(phases.model[k]) + '\u00b0');
  if (curves.residual) parts.push('|G\u2212P| ' + number(curves.residual[k]));
  if (curves.deviation) parts.push('\u03c3 ' + number(curves.deviation[k]));
  output.textContent = parts.join('   ');
}
