// The cost over the iterations.

const cost = { graph: null };

function buildCost() {
  const body = section('cost', 'Cost', 'Cost over the iterations', 'Half the mean weighted squared error over the lines. It cannot increase while one set of modes is fitted; ' +
    'it may increase when the automatic fit changes the set of modes.');
  body.append(element('div', { class: 'plot-head' }, element('p', { class: 'plot-title' }, 'Cost'),
    saveButtons('cost', () => ({ title: 'Cost over the iterations', panels: [graphPanel(cost.graph)] }))),
    element('div', { class: 'plot', id: 'cost-plot', role: 'img', 'aria-labelledby': 'cost-title' }),
    element('p', { class: 'axis-title' }, 'Iteration'));
  afterFirstPaint(drawCost);
  onColours(() => recolourGraph(cost.graph, costSeries()));
}

function drawCost() {
  const values = content.cost.filter((v) => isNumber(v) && v > 0);
  cost.graph = makeGraph('cost-plot', values.map((v, i) => [i, v]), {
    labels: ['iteration', 'cost'], logscale: true, drawPoints: values.length < 200, pointSize: 2.5,
    series: costSeries(), xRangePad: 8,
    axes: { x: { ticker: (min, max, pixels) => linearTicks(min, max, Math.max(2, pixels / 60), (v) => (Number.isInteger(v) ? String(v) : '')) }, y: magnitudeAxis },
  });
}

function costSeries() {
  return { cost: { color: palette().curves[0] } };
}
