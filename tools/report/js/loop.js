// The loop of the model with the controller of the stage: margins, Nyquist curves with 95 % discs, sensitivities.

const loop = { figure: null, shown: 0 };

function buildLoop() {
  const { loops, frequency_hz: f } = content.loop;
  const known = loopCurves().some((curve) => curve.radius_95);
  const body = section('loop', 'Loop', 'Loop with the controller of the stage', 'The loop of the model with the controller, as the stage closes it: hold, delays and sampling are exact. ' +
    'Each loop is opened alone, with the others closed.' + (known ? ' \u00b1 and discs: 95\u00a0%, from the covariance of the fit; what the model lacks is not included.' : ''));
  body.append(figureList(loopFacts()));
  if (content.loop.stable) body.append(sortableTable(marginColumns(), loops));
  const pick = element('select', { id: 'loop-curve', onchange: (event) => showLoop(Number(event.target.value)) });
  loopCurves().forEach((curve, i) => pick.append(element('option', { value: i }, curve.title)));
  loop.figure = canvasFigure('loop-nyquist', 'Nyquist curve of the loop', drawLoop, 'square');
  const text = element('output', { class: 'values' });
  tellUnderPointer(loop.figure, text, loopText);
  body.append(element('div', { class: 'plot-head' }, element('label', { for: 'loop-curve' }, 'Nyquist curve of ', pick), saveButtons('loop Nyquist', savedLoop)),
    loop.figure.node, element('p', { class: 'plot-title' }, text));
  if (f.length < 2) return;
  body.append(element('div', { class: 'plot-head' }, element('p', { class: 'plot-title', id: 'loop-sensitivity-title' },
    'Sensitivity |S| = 1/|1 + L| (solid) and complementary sensitivity |T| (dashed) of ' + loops.map((one) => one.name).join(', '))),
    element('div', { class: 'plot', id: 'loop-sensitivity', role: 'img', 'aria-labelledby': 'loop-sensitivity-title' }), element('p', { class: 'axis-title' }, 'Frequency [Hz]'));
  afterFirstPaint(drawSensitivities);
}

// All curves with their critical points: the loops, then det(I + L).
function loopCurves() {
  const { loops, determinant } = content.loop;
  return [...loops.map((one) => ({ ...one, title: 'loop ' + one.name, critical: -1 })), { ...determinant, title: 'det(I + L)', critical: 0 }];
}

function loopFacts() {
  const { stable, largest_pole: pole, largest_pole_hz: hz, encirclements, unstable_poles: unstable, determinant } = content.loop;
  const figures = [['closed loop', stable ? 'stable' : 'unstable'], ['outermost pole', '|z| = ' + number(pole, 6) + ' at ' + hertz(hz)],
    ['encirclements of 0 by det(I + L)', String(encirclements)], ['unstable open-loop poles', String(unstable ? unstable.open_loop : '')]];
  if (determinant.distance) figures.push(['least |det(I + L)|', marginText(determinant.distance, 1, '')]);
  return figures;
}

// "39.6 +- 0.001 deg at 20.1 Hz"; `scale` converts to the unit.
function marginText(margin, scale, unit) {
  if (!margin || !isNumber(margin.value)) return '\u2013';
  return number(scale * margin.value, 4) + (isNumber(margin.radius_95) ? ' \u00b1 ' + number(scale * margin.radius_95, 2) : '') +
    (unit ? '\u00a0' + unit : '') + ' at ' + hertz(margin.frequency_hz) + (margin.extrapolated ? ' (extrapolated)' : '');
}

function marginColumns() {
  const column = (title, key, scale, unit) => [title, (row) => row[key] && row[key].value, (row) => marginText(row[key], scale, unit)];
  return [['loop', (row) => content.loop.loops.indexOf(row), (row) => row.name],
    column('gain margin', 'gain_margin_db', 1, 'dB'), column('gain reduction', 'gain_reduction_db', 1, 'dB'), column('phase margin', 'phase_margin_deg', 1, '\u00b0'),
    column('delay margin', 'delay_margin_s', 1e3, 'ms'), column('modulus margin', 'modulus_margin', 1, '')];
}

function showLoop(index) {
  loop.shown = index;
  loop.figure.redraw();
}

// The neighbourhood of the critical point, with equal scales.
function loopFrame(curve, width, height) {
  const area = { x: 46, y: 8, w: width - 58, h: height - 48 };
  const unit = 4 / Math.min(area.w, area.h);
  const re0 = curve.critical + 0.5;
  return {
    area, unit, x: (re) => area.x + area.w / 2 + (re - re0) / unit, y: (im) => area.y + area.h / 2 - im / unit,
    re: [re0 - unit * area.w / 2, re0 + unit * area.w / 2], im: [-unit * area.h / 2, unit * area.h / 2],
  };
}

function loopPoints(curve) {
  return curve.re.map((re, k) => ({ k, re, im: curve.im[k], radius: curve.radius_95 ? curve.radius_95[k] : 0 })).filter((p) => isNumber(p.re) && isNumber(p.im));
}

function drawLoop(context, width, height) {
  const curve = loopCurves()[loop.shown];
  const frame = loopFrame(curve, width, height);
  const colours = palette();
  const points = loopPoints(curve);
  drawPlane(context, frame, height, '');
  context.save();
  clipTo(context, frame.area.x, frame.area.y, frame.area.w, frame.area.h);
  context.strokeStyle = colours.frame;
  context.lineWidth = 1;
  circle(context, frame.x(curve.critical + 1), frame.y(0), 1 / frame.unit);
  context.stroke();
  drawCircles(context, frame, points, colours.measured);
  context.strokeStyle = colours.model;
  context.lineWidth = 1.6;
  context.beginPath();
  for (const p of points) context.lineTo(frame.x(p.re), frame.y(p.im));
  context.stroke();
  context.fillStyle = colours.ink;
  circle(context, frame.x(curve.critical), frame.y(0), 4);
  context.fill();
  context.restore();
}

function loopText(event) {
  const curve = loopCurves()[loop.shown];
  const { node } = loop.figure;
  const frame = loopFrame(curve, node.clientWidth, node.clientHeight);
  const points = loopPoints(curve);
  if (!points.length) return '';
  const distance = (p) => Math.hypot(frame.x(p.re) - event.offsetX, frame.y(p.im) - event.offsetY);
  const nearest = points.reduce((a, b) => (distance(b) < distance(a) ? b : a));
  return hertz(content.loop.frequency_hz[nearest.k]) + '   ' + number(nearest.re) + (nearest.im < 0 ? ' \u2212 ' : ' + ') + number(Math.abs(nearest.im)) + 'j' +
    (nearest.radius > 0 ? '   95\u00a0%: \u00b1' + number(nearest.radius, 2) : '') + '   distance to ' + String(curve.critical).replace('-', '\u2212') + ': ' +
    number(Math.hypot(nearest.re - curve.critical, nearest.im));
}

function savedLoop() {
  const curve = loopCurves()[loop.shown];
  return { title: 'Nyquist curve, ' + curve.title, legend: [['model', palette().model]], panels: [canvasPanel(loop.figure)] };
}

function drawSensitivities() {
  const { loops, frequency_hz: f } = content.loop;
  const labels = ['f', ...loops.flatMap((one) => ['S ' + one.name, 'T ' + one.name])];
  const rows = f.map((hz, k) => [hz, ...loops.flatMap(({ re, im }) => {
    const difference = Math.hypot(1 + re[k], im[k]);
    return [1 / difference, Math.hypot(re[k], im[k]) / difference];
  })]);
  const series = () => Object.fromEntries(loops.flatMap((one, i) => {
    const color = palette().curves[i % palette().curves.length];
    return [['S ' + one.name, { color }], ['T ' + one.name, { color, strokePattern: [5, 4] }]];
  }));
  const graph = makeGraph('loop-sensitivity', rows, series, { labels, logscale: true, axes: { x: frequencyAxis, y: magnitudeAxis } });
  savable.set('sensitivity', () => ({ title: 'Sensitivity and complementary sensitivity', panels: [graphPanel(graph)] }));
}
