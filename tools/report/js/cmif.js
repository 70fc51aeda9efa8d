// The complex mode indicator function with its modes.

const cmif = { graph: null };

function buildCmif() {
  const curves = content.arrays.cmif.curves;
  const body = section('cmif', 'CMIF', 'Complex mode indicator function',
    'The squared singular values of \u03c9\u00b2G, which removes the slope of the rigid body.');
  const legend = element('div', { class: 'legend' });
  for (let i = 0; i < curves; ++i) legend.append(element('span', { class: 'swatch', style: '--colour:var(--curve-' + (i % 6) + ')' }, 'curve ' + (i + 1)));
  if (content.candidates.length) legend.append(element('span', { class: 'mark ring' }, 'starting value (' + content.candidates.length + ')'));
  if (identifiedModes().length) legend.append(element('span', { class: 'mark line' }, 'identified mode (' + identifiedModes().length + ')'));
  legend.append(saveButtons('CMIF', savedCmif));
  const plot = element('div', { class: 'plot tall', id: 'cmif-plot', role: 'img', 'aria-labelledby': 'cmif-title', tabindex: '0' });
  plot.addEventListener('keydown', bandKey);
  followBand(() => showBandIn(cmif.graph));
  body.append(legend, plot,
    element('p', { class: 'axis-title' }, 'Frequency [Hz]'),
    content.arrays.cmif_deviation ? element('p', { class: 'quiet' }, 'The shaded bands contain the true values with 95 % probability, to first order in the errors of the elements.') : null);
  afterFirstPaint(drawCmif);
  onColours(() => cmif.graph && cmif.graph.updateOptions({ ...plotColours(), series: cmifSeries() }));
}

function savedCmif() {
  const { curves } = palette();
  const legend = Array.from({ length: content.arrays.cmif.curves }, (_, i) => ['curve ' + (i + 1), curves[i % curves.length]]);
  return { title: 'Complex mode indicator function', legend, panels: [graphPanel(cmif.graph, 'Frequency in Hz')] };
}

function identifiedModes() {
  return (content.modes || []).filter((mode) => isNumber(mode.frequency_hz));
}

function drawCmif() {
  const f = array('frequency');
  const values = array('cmif');
  const curves = content.arrays.cmif.curves;
  let floor = Infinity;
  for (const v of values) if (v > 0 && v < floor) floor = v;
  const deviation = array('cmif_deviation');
  const rows = Array.from(f, (hz, k) => {
    const row = [hz];
    for (let i = 0; i < curves; ++i) row.push(cmifBar(values[i * f.length + k], deviation && deviation[i * f.length + k], floor));
    return row;
  });
  if (cmif.graph) {
    plots.delete(cmif.graph);
    cmif.graph.destroy();
  }
  cmif.graph = new Dygraph(document.getElementById('cmif-plot'), rows, {
    ...plotBasics, ...plotColours(), labels: ['f', ...Object.keys(cmifSeries())], logscale: true,
    customBars: true, series: cmifSeries(), ...tiedToBand(),
    axes: { x: frequencyAxis, y: magnitudeAxis }, underlayCallback: markModes,
  });
  plots.add(cmif.graph);
}

// [low, value, high]: 95 % of a real Gaussian are within 1.96 standard deviations.
function cmifBar(value, deviation, floor) {
  const v = Math.max(value, floor);
  if (!deviation) return [v, v, v];
  return [Math.max(v - 1.96 * deviation, floor), v, v + 1.96 * deviation];
}

function cmifSeries() {
  const colours = palette().curves;
  const { linePlotter } = Dygraph.Plotters;
  const plotter = array('cmif_deviation') ? (event) => { drawBand(event); linePlotter(event); } : linePlotter;
  return Object.fromEntries(Array.from({ length: content.arrays.cmif.curves }, (_, i) => ['curve ' + (i + 1), { color: colours[i % colours.length], plotter }]));
}

// Identified modes as lines behind the curves, chosen ones as rings on their curves.
function markModes(context, area, graph) {
  const f = array('frequency');
  const values = array('cmif');
  const colours = palette();
  const [low, high] = graph.xAxisRange();
  const inside = (hz) => hz >= low && hz <= high;
  // The toDomXCoord() of dygraphs ignores that the axis is logarithmic; its percentage does not.
  const across = (hz) => area.x + graph.toPercentXCoord(hz) * area.w;
  context.save();
  context.strokeStyle = colours.marker;
  context.globalAlpha = 0.45;
  context.lineWidth = 1;
  for (const mode of identifiedModes()) {
    if (!inside(mode.frequency_hz)) continue;
    const x = across(mode.frequency_hz);
    context.beginPath();
    context.moveTo(x, area.y);
    context.lineTo(x, area.y + area.h);
    context.stroke();
  }
  context.globalAlpha = 1;
  context.strokeStyle = colours.text;
  context.lineWidth = 1.5;
  for (const mode of content.candidates) {
    if (!inside(mode.frequency_hz)) continue;
    let k = 0;
    while (k < f.length - 1 && f[k] < mode.frequency_hz) ++k;
    if (k > 0 && mode.frequency_hz - f[k - 1] < f[k] - mode.frequency_hz) --k;
    const curve = Math.min(content.arrays.cmif.curves, Math.max(1, mode.curve)) - 1;
    const v = values[curve * f.length + k];
    if (!(v > 0)) continue;
    context.beginPath();
    context.arc(across(mode.frequency_hz), graph.toDomYCoord(v), 5, 0, 2 * Math.PI);
    context.stroke();
  }
  context.restore();
}
