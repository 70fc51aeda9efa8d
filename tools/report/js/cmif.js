// The complex mode indicator function with its modes.

const cmif = { graph: null };

function buildCmif() {
  const body = section('cmif', 'CMIF', 'Complex mode indicator function',
    'The squared singular values of \u03c9\u00b2G, which removes the slope of the rigid body.');
  const legend = element('div', { class: 'legend' }, ...curveNames().map((name, i) => swatch('curve-' + (i % 6), name)));
  if (content.candidates.length) legend.append(element('span', { class: 'mark ring' }, 'starting value (' + content.candidates.length + ')'));
  if (identifiedModes().length) legend.append(element('span', { class: 'mark line' }, 'identified mode (' + identifiedModes().length + ')'));
  legend.append(saveButtons('CMIF', savedCmif));
  body.append(legend, bandPlot('cmif-plot', 'tall', { 'aria-labelledby': 'cmif-title' }),
    element('p', { class: 'axis-title' }, 'Frequency [Hz]'),
    content.arrays.cmif_deviation ? element('p', { class: 'quiet' }, 'The shaded bands contain the true values with 95 % probability, to first order in the errors of the elements.') : null);
  afterFirstPaint(drawCmif);
}

function curveNames() {
  return Array.from({ length: content.arrays.cmif.curves }, (_, i) => 'curve ' + (i + 1));
}

function savedCmif() {
  const { curves } = palette();
  const legend = curveNames().map((name, i) => [name, curves[i % curves.length]]);
  return { title: 'Complex mode indicator function', legend, panels: [graphPanel(cmif.graph, 'Frequency in Hz')] };
}

function identifiedModes() {
  return (content.modes || []).filter((mode) => isNumber(mode.frequency_hz));
}

function drawCmif() {
  const f = array('frequency');
  const values = array('cmif');
  const deviation = array('cmif_deviation');
  const floor = smallestPositive([values]);
  // 95 % of a real Gaussian are within 1.96 standard deviations.
  const cell = (place) => bar(Math.max(values[place], floor), deviation && 1.96 * deviation[place], floor);
  const rows = Array.from(f, (hz, k) => [hz, ...curveNames().map((_, i) => cell(i * f.length + k))]);
  removeGraph(cmif.graph);
  cmif.graph = makeGraph('cmif-plot', rows, cmifSeries, {
    labels: ['f', ...curveNames()], logscale: true, customBars: true, ...tiedToBand(),
    axes: { x: frequencyAxis, y: magnitudeAxis }, underlayCallback: markModes,
  });
}

function cmifSeries() {
  const colours = palette().curves;
  const plotter = seriesPlotter(content.arrays.cmif_deviation);
  return Object.fromEntries(curveNames().map((name, i) => [name, { color: colours[i % colours.length], plotter }]));
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
    drawLine(context, x, area.y, x, area.y + area.h);
  }
  context.globalAlpha = 1;
  context.strokeStyle = colours.text;
  context.lineWidth = 1.5;
  for (const mode of content.candidates) {
    if (!inside(mode.frequency_hz)) continue;
    let k = lineFrom(mode.frequency_hz);
    if (k > 0 && mode.frequency_hz - f[k - 1] < f[k] - mode.frequency_hz) --k;
    const curve = Math.min(content.arrays.cmif.curves, Math.max(1, mode.curve)) - 1;
    const v = values[curve * f.length + k];
    if (!(v > 0)) continue;
    circle(context, across(mode.frequency_hz), graph.toDomYCoord(v), 5);
    context.stroke();
  }
  context.restore();
}
