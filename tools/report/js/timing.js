// Timing of the loop: bins of nanoseconds, collected into one bar per octave.

const shortestBar = 9;  // 2^9 ns: shorter times do not matter

// [[from_s, to_s, count], ...] -> the same, one row per octave.
function octaves(bins) {
  const rows = new Map();
  for (const [from, , n] of bins) {
    const place = Math.max(shortestBar - 1, Math.floor(Math.log2(from * 1e9 + 0.5)));
    rows.set(place, (rows.get(place) || 0) + n);
  }
  return Array.from(rows, ([place, n]) => ({ to: 2 ** (place + 1) * 1e-9, n })).sort((a, b) => a.to - b.to);
}

// One bar of a list, its length in percent.
function lengthBar(name, length, value, { kind = null, note = null }) {
  return element('div', { role: 'listitem' }, element('span', { class: 'step-name' }, name),
    element('span', { class: 'step-bar' }, element('span', { class: kind, style: 'width:' + length.toFixed(1) + '%' })),
    element('span', { class: 'step-time' }, value), element('span', { class: 'quiet' }, note));
}

// Lengths are logarithmic in the count, so that one late cycle among a million is visible.
function histogramBars(title, histogram, period) {
  const rows = octaves(histogram.bins);
  const most = Math.max(...rows.map((row) => row.n), 1);
  const list = element('div', { class: 'steps', role: 'list' });
  for (const row of rows) {
    const width = 4 + 96 * Math.log10(row.n) / Math.max(1, Math.log10(most));
    list.append(lengthBar('< ' + number(row.to * 1e6, 2) + '\u00a0\u00b5s', Math.min(100, width), count(row.n), { kind: period && row.to > period ? 'over' : null }));
  }
  const share = (seconds) => duration(seconds) + (period ? ' (' + percent(seconds / period) + ' of the period)' : '');
  return element('div', { class: 'histogram' }, element('h3', null, title),
    element('p', { class: 'quiet' }, 'median below ' + share(histogram.median_s) + ', 99.9 % below ' + share(histogram.p99_9_s) +
      ', all below ' + duration(histogram.largest_s)), list);
}

function timingBars(timing, period) {
  const both = element('div', { class: 'histograms' },
    histogramBars('Execution time per cycle', timing.execution, period),
    histogramBars('Lateness per cycle', timing.lateness, period));
  return element('div', null, both, element('p', { class: 'quiet' }, 'Number of cycles by time, on a logarithmic scale' +
      (timing.skipped > 0 ? '; ' + plural(timing.skipped, 'period') + ' skipped after late cycles, to keep the phase.' : '; no period was skipped.')));
}
