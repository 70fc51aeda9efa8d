// Frequency and damping of a mode over all compared results, with 95 % bands, and the differences in deviations.

const trends = { mode: null, figures: [] };

const trendKinds = { frequency_hz: ['frequency_std_hz', 'Natural frequency, difference from this fit [%]'], damping_ratio: ['damping_std', 'Damping ratio, difference from this fit [%]'] };

function buildTrends() {
  const body = section('trends', 'Trends', 'Trends', 'Modes of this fit in the results to compare with, and the newest fit last; bands contain the true value with 95\u00a0% probability. ' +
    'Deviations are in standard deviations of the difference of two independent estimates.');
  const { own = [] } = bench.trends.find((one) => one.own) || {};
  if (trends.mode === null || trends.mode >= own.length) trends.mode = own.length ? strongestShape() : 0;
  const pick = element('select', { id: 'trend-mode', onchange: () => showTrend(Number(pick.value)) },
    ...own.map((mode, i) => element('option', { value: i }, fixed(mode.frequency_hz) + ' Hz')));
  trends.table = element('div', { id: 'trend-table' });
  trends.figures = Object.keys(trendKinds).map((kind) => canvasFigure('trend-' + kind, trendKinds[kind][1], (context, w, h) => drawTrend(context, w, h, kind), 'trend'));
  const curves = element('select', { id: 'compare-with', onchange: () => act({ kind: 'compare', index: curves.value === '' ? null : Number(curves.value) }) },
    element('option', { value: '' }, 'none'), ...bench.state.compared.map((title, i) => element('option', { value: i }, title)));
  curves.value = bench.state.chosen === null ? '' : bench.state.chosen;
  body.append(element('div', { class: 'entry-pick' }, element('label', { for: 'trend-mode' }, 'Mode ', pick), element('label', { for: 'compare-with' }, 'Show the curves of ', curves)),
    element('div', { class: 'trend-figures' }, ...trends.figures.map((figure, i) => element('div', null, element('p', { class: 'plot-title' }, Object.values(trendKinds)[i][1]), figure.node))), trends.table);
  pick.value = trends.mode;
  showTrend(trends.mode);
}

// One row per result: {title, value, std, pair}; those without the mode are omitted.
function trendRows(kind) {
  const rows = [];
  for (const { title, own, modes, pairs } of bench.trends) {
    const pair = (pairs || []).find((one) => one.own === trends.mode);
    if (pair) rows.push({ title, pair, mode: modes[pair.other], own: own[pair.own] });
  }
  const own = bench.trends.map((one) => one.own).find(Boolean);
  if (own && own[trends.mode]) rows.push({ title: 'this fit', pair: null, mode: own[trends.mode], own: own[trends.mode] });
  return rows.map((row) => ({ ...row, value: 100 * (row.mode[kind] / row.own[kind] - 1), half: 196 * (row.mode[trendKinds[kind][0]] || 0) / row.own[kind] }));
}

function showTrend(mode) {
  trends.mode = mode;
  const sigma = (key) => [(row) => Math.abs(row.pair && row.pair[key]), (row) => (row.pair ? deviationCell(row.pair[key]) : '\u2013')];
  trends.table.replaceChildren(sortableTable([
    ['result', (row) => row.title, (row) => row.title],
    ['f\u2080 [Hz]', (row) => row.mode.frequency_hz, (row) => fixed(row.mode.frequency_hz)], ['\u0394f\u2080/\u03c3', ...sigma('frequency_deviation')],
    ['\u03b6 [%]', (row) => row.mode.damping_ratio, (row) => hundred(row.mode.damping_ratio)], ['\u0394\u03b6/\u03c3', ...sigma('damping_deviation')],
    ['MAC sensors', (row) => row.pair && row.pair.output_mac, (row) => (row.pair ? row.pair.output_mac.toFixed(3) : '\u2013')],
  ], trendRows('frequency_hz')));
  for (const figure of trends.figures) figure.redraw();
}

function axisText(value) {
  return value === 0 ? '0' : (value < 0 ? '\u2212' : '+') + String(Number(Math.abs(value).toPrecision(2)));
}

function drawTrend(context, width, height, kind) {
  const rows = trendRows(kind);
  if (!rows.length) return;
  const area = { x: 74, y: 8, w: width - 86, h: height - 34 };
  const most = Math.max(1e-6, ...rows.map((row) => Math.abs(row.value) + row.half)) * 1.1;
  const x = (i) => area.x + area.w * (i + 0.5) / rows.length;
  const y = (value) => area.y + area.h * (0.5 - 0.5 * value / most);
  const colours = palette();
  for (const value of [-most / 1.1, 0, most / 1.1]) {
    drawText(context, axisText(value), area.x - 6, y(value), { align: 'right', base: 'middle' });
    context.strokeStyle = value === 0 ? colours.frame : colours.grid;
    drawLine(context, area.x, y(value), area.x + area.w, y(value));
  }
  context.lineWidth = 1.5;
  rows.forEach((row, i) => {
    context.strokeStyle = context.fillStyle = colours.curves[0];
    drawLine(context, x(i), y(row.value - row.half), x(i), y(row.value + row.half));
    circle(context, x(i), y(row.value), 3.5);
    context.fill();
    drawText(context, shortened(row.title, Math.max(3, Math.floor(area.w / rows.length / 7))), x(i), area.y + area.h + 6, { align: 'center', base: 'top' });
  });
}
