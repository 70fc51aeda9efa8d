// Logarithmic axes for dygraphs, whose own ticks are too dense on a narrow plot.

// Ticks of a logarithmic axis: labels at decades, at 1-3 or 1-2-5 if there is room, linear within a decade.
function logTicks(min, max, pixels, label, spacing) {
  const decades = Math.log10(max / min);
  if (!(decades > 0)) return [];
  const room = Math.max(2, Math.floor(pixels / spacing));
  if (decades < 0.9) return linearTicks(min, max, room, label);
  const every = Math.max(1, Math.ceil(decades / room));
  const labelled = decades * 3 <= room ? [2, 5] : decades * 2 <= room ? [3] : [];
  const ticks = [];
  for (let d = Math.floor(Math.log10(min)); d <= Math.ceil(Math.log10(max)); ++d) {
    for (let m = 1; m < 10; ++m) {
      const v = m * Math.pow(10, d);
      if (v < min * (1 - 1e-9) || v > max * (1 + 1e-9)) continue;
      if (m === 1) ticks.push({ v, label: d % every === 0 ? label(v) : '' });
      else if (labelled.includes(m)) ticks.push({ v, label: label(v) });
      else if (pixels / decades > 60) ticks.push({ v, label: '' });
    }
  }
  return ticks;
}

function linearTicks(min, max, room, label) {
  const rough = (max - min) / Math.min(room, 8);
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const ticks = [];
  for (let i = Math.ceil(min / step); i * step <= max; ++i) ticks.push({ v: i * step, label: label(i * step, step) });
  return ticks;
}

function frequencyLabel(f, step) {
  if (step) return f.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  return f >= 1000 ? Number((f / 1000).toPrecision(3)) + 'k' : String(Number(f.toPrecision(3)));
}

function magnitudeLabel(v, step) {
  const power = Math.floor(Math.log10(v) + 1e-9);
  const mantissa = v / Math.pow(10, power);
  if (!step && Math.abs(mantissa - 1) < 1e-6) return power >= -1 && power <= 2 ? String(Number(v.toPrecision(1))) : powerOfTen(power);
  const digits = step ? Math.max(0, power - Math.floor(Math.log10(step) + 1e-9)) : 0;
  return power >= -2 && power <= 3 ? String(Number(v.toPrecision(digits + 1)))
                                   : mantissa.toFixed(digits) + '\u00b7' + powerOfTen(power);
}

const frequencyAxis = {
  logscale: true,
  ticker: (min, max, pixels) => logTicks(min, max, pixels, frequencyLabel, 46),
  axisLabelFormatter: frequencyLabel,
};

const magnitudeAxis = {
  logscale: true,
  axisLabelWidth: 58,
  ticker: (min, max, pixels) => logTicks(min, max, pixels, magnitudeLabel, 30),
};

function phaseTicks(min, max, pixels) {
  const room = pixels / 28;
  const step = [15, 30, 45, 90, 180].find((s) => (max - min) / s <= room) || 180;
  const ticks = [];
  for (let v = Math.ceil(min / step) * step; v <= max; v += step) ticks.push({ v, label: String(v).replace('-', '\u2212') + '\u00b0' });
  return ticks;
}

const phaseAxis = { axisLabelWidth: 58, ticker: phaseTicks };

// A plot of dygraphs in the element with that id; series() returns the styles of its lines in the current colours.
function makeGraph(id, rows, series, options) {
  const graph = new Dygraph(document.getElementById(id), rows, { ...plotBasics, ...plotColours(), series: series(), ...options });
  graph.recolour = () => graph.updateOptions({ ...plotColours(), series: series() });
  graph.followsBand = Boolean(options.dateWindow);
  plots.add(graph);
  return graph;
}

// A plot of one line, drawn a moment later. @returns {graph}
function lineGraph(id, labels, rows, options) {
  const line = { graph: null };
  const series = () => ({ [labels[1]]: { color: palette().curves[0] } });
  afterFirstPaint(() => { line.graph = makeGraph(id, rows, series, { labels, logscale: true, ...options }); });
  return line;
}

function removeGraph(graph) {
  if (!graph) return;
  plots.delete(graph);
  graph.destroy();
}

// Options shared by all plots, in the current colours.
function plotColours() {
  const colours = palette();
  return { gridLineColor: colours.grid, axisLineColor: colours.frame };
}

// Draws the line of a series, if it is banded above its band.
function seriesPlotter(banded) {
  const { linePlotter } = Dygraph.Plotters;
  return banded ? (event) => { drawBand(event); linePlotter(event); } : linePlotter;
}

// Draws the band of one series as one polygon: dygraphs draws a quadrangle between any two lines, which takes most of
// the time of a plot.
function drawBand(event) {
  const context = event.drawingContext;
  const area = event.plotArea;
  context.save();
  context.fillStyle = event.color;
  context.globalAlpha = plotBasics.fillAlpha;
  let run = [];
  const fill = () => {
    context.beginPath();
    for (const point of run) context.lineTo(point.canvasx, area.y + point.y_top * area.h);
    for (const point of run.reverse()) context.lineTo(point.canvasx, area.y + point.y_bottom * area.h);
    context.fill();
    run = [];
  };
  for (const point of event.points) {
    if (Number.isFinite(point.y_top) && Number.isFinite(point.y_bottom)) run.push(point);
    else if (Number.isNaN(point.yval)) fill();  // a wrap; null is a line of another series
  }
  fill();
  context.restore();
}

const plotBasics = {
  legend: 'never', fillAlpha: 0.18, highlightCircleSize: 3, strokeWidth: 1.3, axisLabelFontSize: 12,
  connectSeparatedPoints: true, animatedZooms: false, rightGap: 12, xRangePad: 0, yRangePad: 10,
};
