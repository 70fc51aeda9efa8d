// The cost over the iterations.

function buildCost() {
  const body = section('cost', 'Cost', 'Cost over the iterations', 'Half the mean weighted squared error over the lines. It cannot increase while one set of modes is fitted; ' +
    'it may increase when the automatic fit changes the set of modes.');
  body.append(element('div', { class: 'plot-head' }, element('p', { class: 'plot-title' }, 'Cost'),
    saveButtons('cost', () => ({ title: 'Cost over the iterations', panels: [graphPanel(line.graph)] }))),
    element('div', { class: 'plot', id: 'cost-plot', role: 'img', 'aria-labelledby': 'cost-title' }),
    element('p', { class: 'axis-title' }, 'Iteration'));
  const values = content.cost.filter((v) => isNumber(v) && v > 0);
  const label = (v) => (Number.isInteger(v) ? String(v) : '');
  const line = lineGraph('cost-plot', ['iteration', 'cost'], values.map((v, i) => [i, v]), {
    drawPoints: values.length < 200, pointSize: 2.5, xRangePad: 8,
    axes: { x: { ticker: (min, max, pixels) => linearTicks(min, max, Math.max(2, pixels / 60), label) }, y: magnitudeAxis },
  });
}
