// Zippered experiments: each axis has its own lines, with a local model between them. Shows the residual of that
// model, and the number of independent lines.

function isZippered() {
  return Boolean(content.frf) && content.frf.correlated_lines > 1;
}

// Explanation for readers of the deviations; null for other experiments.
function correlationText() {
  if (!isZippered()) return null;
  const { lines, correlated_lines: each } = content.frf;
  return 'Zippered experiment: between the lines of an axis its response is interpolated by a local model, so errors of neighbouring lines are correlated. ' +
    'The ' + count(lines) + ' lines constrain a smooth model as much as ' + count(Math.round(lines / each)) + ' independent ones (correlated_lines: ' + number(each) + ').';
}

function buildInterpolation() {
  const body = section('interpolation', 'Interpolation', 'Interpolation between the lines of each axis', correlationText());
  if (!content.arrays.interpolation_misfit) {
    body.append(element('p', null, 'The local models were not checked: with one period the noise is estimated from their residual.'));
    return;
  }
  body.append(element('div', { class: 'plot-head' }, element('p', null, misfitText()), saveButtons('interpolation', () => ({
    title: 'Residual of the local models relative to noise', panels: [graphPanel(line.graph, 'Misfit over frequency in Hz')],
  }))), bandPlot('interpolation-plot', '', { 'aria-label': misfitText() }),
    element('p', { class: 'axis-title' }, 'Frequency [Hz]'));
  const misfit = array('interpolation_misfit');
  const line = lineGraph('interpolation-plot', ['f', 'misfit'], Array.from(array('frequency'), (hz, k) => [hz, misfit[k]]), {
    axes: { x: frequencyAxis, y: magnitudeAxis }, ...tiedToBand(),
  });
}

function misfitText() {
  const misfit = array('interpolation_misfit');
  const f = array('frequency');
  const most = misfit.reduce((best, v, k) => (v > misfit[best] ? k : best), 0);
  const sorted = Array.from(misfit).sort((a, b) => a - b);
  return 'Residual of the local models relative to noise: about 1 where they are valid, larger where a resonance is too narrow for the line spacing ' +
    'or the plant is nonlinear; there the error of the response exceeds its standard deviation. Median ' + number(sorted[sorted.length >> 1]) +
    ', largest ' + number(misfit[most]) + ' at ' + hertz(f[most]) + '.';
}
