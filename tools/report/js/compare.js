// Comparison of two days or two models: modes paired by frequency and shape, and their changes.

function buildComparison() {
  const { comparison } = content;
  const overlay = content.arrays.other_response || content.arrays.other_model;
  const body = section('comparison', 'Comparison', 'Compared with ' + comparison.title, 'Differences are ' + comparison.title +
    ' minus this report; deviations are in standard deviations of the difference of two independent estimates.' +
    (overlay ? ' Its curves are shown in the matrix and the element plots.' : ''));
  if (!comparison.pairs) {
    body.append(element('p', null, 'Modes cannot be compared: ' + (content.model ? 'the other result has no model.' : 'this report has no model.')));
    return;
  }
  const { pairs, own, modes } = comparison;
  body.append(comparedFigures(), element('div', { class: 'compared' },
    element('div', null, pairs.length ? sortableTable(pairColumns(), pairs) : element('p', null, 'No modes match.'),
      unpaired('Only in this report', own, pairs.map((pair) => pair.own)), unpaired('Only in ' + comparison.title, modes, pairs.map((pair) => pair.other))),
    comparison.output_mac ? buildMac('compare-mac', 'Cross-MAC', crossMac) : null));
}

function comparedFigures() {
  const { pairs, own, modes } = content.comparison;
  const far = pairs.filter((pair) => Math.abs(pair.frequency_deviation) > 3 || Math.abs(pair.damping_deviation) > 3).length;
  const most = pairs.reduce((a, b) => (Math.abs(b.frequency_difference) > Math.abs(a) ? b.frequency_difference : a), 0);
  const least = pairs.reduce((a, b) => Math.min(a, b.output_mac * b.input_mac), 1);
  const figures = [['modes in both', pairs.length + ' of ' + own.length + ' and ' + modes.length]];
  if (pairs.length) figures.push(['largest frequency change', signedPercent(most)], ['smallest MAC of a pair', least.toFixed(3)]);
  if (pairs.some((pair) => isNumber(pair.frequency_deviation))) figures.push(['pairs that differ by more than 3 \u03c3', String(far)]);
  return figureList(figures);
}

function signedPercent(value) {
  if (!isNumber(value)) return '\u2013';
  if (Math.abs(value) < 1e-9) return percent(0);  // rounding of two equal numbers
  return (value < 0 ? '\u2212' : value > 0 ? '+' : '') + percent(Math.abs(value), 3);
}

function pairColumns() {
  const { own, modes, title } = content.comparison;
  const sigma = (key) => [(row) => Math.abs(row[key]), (row) => deviationCell(row[key])];
  return [
    ['#', (row) => row.own, (row) => (row.own + 1) + ' \u2013 ' + (row.other + 1)],
    ['f\u2080 [Hz]', (row) => own[row.own].frequency_hz, (row) => fixed(own[row.own].frequency_hz)],
    ['f\u2080 of ' + shortened(title, 14), (row) => modes[row.other].frequency_hz, (row) => fixed(modes[row.other].frequency_hz)],
    ['\u0394f\u2080', (row) => Math.abs(row.frequency_difference), (row) => signedPercent(row.frequency_difference)],
    ['\u0394f\u2080/\u03c3', ...sigma('frequency_deviation')],
    ['\u03b6 [%]', (row) => own[row.own].damping_ratio, (row) => hundred(own[row.own].damping_ratio)],
    ['\u03b6 of ' + shortened(title, 14), (row) => modes[row.other].damping_ratio, (row) => hundred(modes[row.other].damping_ratio)],
    ['\u0394\u03b6', (row) => Math.abs(row.damping_difference), (row) => signedPercent(row.damping_difference)],
    ['\u0394\u03b6/\u03c3', ...sigma('damping_deviation')],
    ['MAC sensors', (row) => row.output_mac, (row) => row.output_mac.toFixed(3)],
    ['MAC actuators', (row) => row.input_mac, (row) => row.input_mac.toFixed(3)],
  ];
}

function unpaired(title, modes, paired) {
  const alone = modes.filter((_, i) => !paired.includes(i));
  return alone.length ? element('p', { class: 'quiet' }, title + ': ' + alone.map((mode) => fixed(mode.frequency_hz) + ' Hz').join(', ') + '.') : null;
}

function crossMac(kind) {
  const { own, modes, output_mac: outputs, input_mac: inputs, title } = content.comparison;
  return {
    rows: own.map((mode) => fixed(mode.frequency_hz)), columns: modes.map((mode) => fixed(mode.frequency_hz)), rowTitle: 'here',
    columnTitle: shortened(title, 14), title: 'Cross-MAC with ' + title + ', ' + macKinds[kind], values: macValues(outputs, inputs, kind),
  };
}
