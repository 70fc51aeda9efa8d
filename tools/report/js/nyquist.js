// The chosen element in the complex plane: measured lines with their 95 % circles, and the model.

const nyquist = { figure: null, shown: null, title: null };

function buildNyquist() {
  const figure = canvasFigure('entry-nyquist', 'Element in the complex plane', drawNyquist, 'square');
  const title = element('p', { class: 'plot-title', id: 'nyquist-title' }, 'Nyquist');
  const text = element('output', { class: 'values', id: 'nyquist-values' });
  Object.assign(nyquist, { figure, title });
  tellUnderPointer(figure, text, nearestText);
  figure.node.addEventListener('keydown', bandKey);
  return element('div', { class: 'nyquist' }, element('div', { class: 'plot-head' }, title, saveButtons('Nyquist', savedNyquist)), figure.node,
    element('p', { class: 'plot-title' }, text));
}

// The visible band: the zoom, or else the strongest resonance, since the whole band would only show its steepest part.
function nyquistBand(channel) {
  if (!isWholeBand()) return shownBand();
  const f = array('frequency');
  const { measured } = channelCurves(channel);
  let peak = 0;
  let level = 0;
  for (let k = 1; k < f.length - 1; ++k) {
    const here = measured[k] * f[k] * f[k];
    if (here > level && measured[k] > measured[k - 1] && measured[k] > measured[k + 1]) [peak, level] = [k, here];
  }
  if (level === 0) return shownBand();
  const mode = (content.modes || []).find((one) => isNumber(one.frequency_hz) && Math.abs(one.frequency_hz / f[peak] - 1) < 0.01);
  const half = mode ? Math.max(0.01, 8 * mode.damping_ratio) : 0.05;
  let [low, high] = [f[peak] * (1 - Math.min(0.5, half)), f[peak] * (1 + half)];
  while (linesBetween(low, high) < 12 && high < 2 * f[peak]) [low, high] = [low - (f[peak] - low), high + (high - f[peak])];
  return [Math.max(f[0], low), Math.min(f[f.length - 1], high)];
}

// {points: [{k, re, im, radius}], model: [{k, re, im}], other: [{k, re, im}]} on the lines of that band, with the
// current factor.
function nyquistData(channel, low, high) {
  const [first] = bandLines(low, high);
  const lines = Array.from({ length: linesBetween(low, high) }, (_, i) => first + i);
  const scale = lineScale();
  const factor = (k) => (scale ? scale[k] : 1);
  const pairs = channelPairs(channel);
  const { deviation } = channelCurves(channel);
  const path = (values) => (values ? lines.map((k) => ({ k, re: factor(k) * values[2 * k], im: factor(k) * values[2 * k + 1] })) : []);
  const points = path(pairs.measured).map((p) => ({ ...p, radius: deviation ? factor(p.k) * content.frf.band_factor * deviation[p.k] : 0 }));
  return { points, model: path(pairs.model), other: path(pairs[otherTrace()]) };
}

function showNyquist(channel) {
  const [low, high] = nyquistBand(channel);
  nyquist.shown = { channel, low, high, ...nyquistData(channel, low, high) };
  nyquist.title.textContent = 'Nyquist, ' + bandName([low, high]) + (isWholeBand() ? ' (the strongest resonance)' : '');
  nyquist.figure.node.setAttribute('aria-label', channelName(channel) + ' in the complex plane, ' + hertz(low) + ' to ' + hertz(high) + ', ' +
    plural(nyquist.shown.points.length, 'line'));
  nyquist.figure.redraw();
}

// Equal scales on both axes, the data centred.
function planeFrame(data, width, height) {
  const all = data.points.concat(data.model, data.other);
  const range = (part) => [Math.min(...all.map((p) => p[part])), Math.max(...all.map((p) => p[part]))];
  const [left, right] = range('re');
  const [low, high] = range('im');
  const area = { x: 46, y: 8, w: width - 58, h: height - 48 };
  const unit = Math.max((right - left) / area.w, (high - low) / area.h, 1e-300) * 1.12;
  const re0 = (left + right) / 2, im0 = (low + high) / 2;
  return {
    area, unit, x: (re) => area.x + area.w / 2 + (re - re0) / unit, y: (im) => area.y + area.h / 2 - (im - im0) / unit,
    re: [re0 - unit * area.w / 2, re0 + unit * area.w / 2], im: [im0 - unit * area.h / 2, im0 + unit * area.h / 2],
  };
}

function drawNyquist(context, width, height) {
  const data = nyquist.shown;
  if (!data || data.points.length === 0) return;
  const frame = planeFrame(data, width, height);
  const colours = palette();
  drawPlane(context, frame, height, entryUnit(data.channel));
  context.save();
  clipTo(context, frame.area.x, frame.area.y, frame.area.w, frame.area.h);
  drawCircles(context, frame, data.points, colours.measured);
  const path = (points, colour, thickness) => {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    for (const p of points) context.lineTo(frame.x(p.re), frame.y(p.im));
    context.stroke();
  };
  path(data.points, colours.measured, data.model.length ? 3 : 1.4);
  context.fillStyle = colours.measured;
  if (data.points.length < 400) {
    for (const p of data.points) {
      circle(context, frame.x(p.re), frame.y(p.im), 2.6);
      context.fill();
    }
  }
  if (data.model.length) path(data.model, colours.model, 1.3);
  if (data.other.length) path(data.other, colours[otherTrace()], 1.6);
  context.restore();
}

// Circles that would overlap are omitted: each one shown represents its neighbours.
function drawCircles(context, frame, points, colour) {
  let last = null;
  for (const p of points) {
    const at = [frame.x(p.re), frame.y(p.im)];
    const radius = p.radius / frame.unit;
    if (radius < 1 || (last && Math.hypot(at[0] - last[0], at[1] - last[1]) < 10)) continue;
    last = at;
    circle(context, ...at, radius);
    context.fillStyle = colour;
    context.globalAlpha = 0.12;
    context.fill();
    context.globalAlpha = 0.5;
    context.strokeStyle = colour;
    context.lineWidth = 0.8;
    context.stroke();
    context.globalAlpha = 1;
  }
}

function drawPlane(context, frame, height, quantity) {
  const { area } = frame;
  const largest = Math.max(...frame.re.map(Math.abs), ...frame.im.map(Math.abs));
  const power = 3 * Math.floor(Math.log10(largest) / 3);
  const colours = palette();
  const label = (v, step) => {
    const scaledStep = step / 10 ** power;
    return (v / 10 ** power).toFixed(Math.max(0, -Math.floor(Math.log10(scaledStep) + 1e-9))).replace('-', '\u2212');
  };
  context.lineWidth = 1;
  const line = (x0, y0, x1, y1, axis) => {
    context.strokeStyle = axis ? colours.frame : colours.grid;
    drawLine(context, x0, y0, x1, y1);
  };
  for (const { v, label: text } of linearTicks(...frame.re, Math.max(2, area.w / 70), label)) {
    const x = Math.round(frame.x(v)) + 0.5;
    line(x, area.y, x, area.y + area.h, Math.abs(v) < frame.unit);
    drawText(context, text, x, area.y + area.h + 5, { align: 'center', base: 'top' });
  }
  for (const { v, label: text } of linearTicks(...frame.im, Math.max(2, area.h / 50), label)) {
    const y = Math.round(frame.y(v)) + 0.5;
    line(area.x, y, area.x + area.w, y, Math.abs(v) < frame.unit);
    drawText(context, text, area.x - 5, y, { align: 'right', base: 'middle' });
  }
  const unit = [power ? powerOfTen(power) : '', quantity].filter(Boolean).join('\u00a0');
  drawText(context, 'Re, Im' + (unit ? ' [' + unit + ']' : ''), area.x + area.w / 2, height - 6, { align: 'center' });
}

function nearestText(event) {
  const data = nyquist.shown;
  if (!data || data.points.length === 0) return '';
  const { node } = nyquist.figure;
  const frame = planeFrame(data, node.clientWidth, node.clientHeight);
  const distance = (p) => Math.hypot(frame.x(p.re) - event.offsetX, frame.y(p.im) - event.offsetY);
  const nearest = data.points.reduce((a, b) => (distance(b) < distance(a) ? b : a));
  return number(array('frequency')[nearest.k], 6) + '\u00a0Hz   ' + number(nearest.re) + (nearest.im < 0 ? ' \u2212 ' : ' + ') +
    number(Math.abs(nearest.im)) + 'j' + (nearest.radius > 0 ? '   95\u00a0%: \u00b1' + number(nearest.radius) : '');
}

function savedNyquist() {
  const { channel, low, high, model, other } = nyquist.shown;
  return {
    title: channelName(channel) + ', ' + bandName([low, high]),
    legend: traceLegend(['measured', model.length && 'model', other.length && otherTrace()]), panels: [canvasPanel(nyquist.figure)],
  };
}
