// Timing and health of the measurement, and duration of the steps.

const runTotals = { cycles: 0, late: 0, missing: 0, marked: 0, seconds: 0, recorded_s: 0 };
for (const run of content.runs) for (const key of Object.keys(runTotals)) runTotals[key] += run[key];

function buildHealth() {
  const body = section('health', 'Health', 'Timing and data health');
  if (content.findings.length) body.append(findingTable());
  if (content.runs.length) {
    const incomplete = content.runs.filter((run) => !run.complete).length;
    const lateness = Math.max(...content.runs.map((run) => run.largest_lateness_s));
    body.append(facts([
      ['runs', count(content.runs.length) + (incomplete ? ', ' + incomplete + ' incomplete' : ', all complete')],
      ['cycles', count(runTotals.cycles)], ['late', count(runTotals.late)],
      ['missing', flagged(runTotals.missing)], ['marked', flagged(runTotals.marked)], ['largest lateness', duration(lateness)],
      ['recorded', runTotals.recorded_s > 0 ? duration(runTotals.recorded_s) : null],
      ['wall time', runTotals.seconds > 0 ? duration(runTotals.seconds) : null],
      ['speed', runTotals.seconds > 0 && runTotals.recorded_s > 0 ? number(runTotals.recorded_s / runTotals.seconds) + ' \u00d7 real time' : null],
    ]));
  }
  if (content.timing) body.append(timingBars(content.timing, content.period_s));
  if (content.steps.length) body.append(stepBars());
  if (content.runs.length) body.append(folded('Every run', runTable()));
}

// Findings of the checks of the data; words in addition to colours.
function findingTable() {
  const grave = { fault: 2, doubt: 1, 'not checked': 0 };
  const rows = content.findings.map(({ severity, channel, what, figure, remedy }) => [element('span', { class: 'severity level-' + grave[severity] }, severity),
    element('td', { class: 'name' }, channel || 'all'), what, figure || '\u2013', remedy || '\u2013']);
  return table(['severity', 'channel', 'finding', 'figure', 'remedy'], rows, 'Findings of the data checks, the most important first', 'findings');
}

function stepBars() {
  const total = content.steps.reduce((sum, step) => sum + step.seconds, 0);
  const longest = Math.max(...content.steps.map((step) => step.seconds), 1e-12);
  const list = element('div', { class: 'steps', role: 'list' });
  for (const step of content.steps) {
    list.append(lengthBar(step.name, 100 * step.seconds / longest, duration(step.seconds), { note: step.note }));
  }
  return element('div', null, element('h3', null, 'Time per step, ' + duration(total) + ' in total'), list);
}

function runTable() {
  const plain = (key) => [(row) => row[key], (row) => count(row[key])];
  return sortableTable([
    ['run', (row) => row.place, (row) => row.name],
    ['realization', ...plain('realization')], ['experiment', ...plain('experiment')], ['samples', ...plain('samples')],
    ['complete', (row) => Number(row.complete), (row) => (row.complete ? 'yes' : element('span', { class: 'far' }, 'no'))],
    ['late', ...plain('late')], ['missing', ...plain('missing')], ['marked', ...plain('marked')],
    ['largest lateness', (row) => row.largest_lateness_s, (row) => duration(row.largest_lateness_s)],
    ['wall time', (row) => row.seconds, (row) => duration(row.seconds)],
    ['started', (row) => row.place, (row) => row.started_utc || '\u2013'],
  ], content.runs.map((run, i) => ({ ...run, place: i })));
}
