// Texts and tables: the head, the modes, the validation, the decisions, the provenance.

// What is wrong, what to do, and the command to copy.
function problemItem(problem) {
  const remedy = problem.remedy && ' ' + problem.remedy[0].toUpperCase() + problem.remedy.slice(1) + (problem.command ? ':' : '.');
  return element('li', null, element('strong', null, problem.what + '.'), remedy,
    ...(problem.command ? [element('code', { class: 'command' }, problem.command)] : []));
}

// @param page its name
function buildHead(page = 'report') {
  const head = document.getElementById('head');
  const { verdict, model, validation, frf } = content;
  head.append(element('p', { class: 'brand' }, 'stageid ' + content.version + ' \u00b7 ' + page),
    element('h1', null, content.title || 'Report'),
    element('p', { class: 'verdict ' + verdict.level, id: 'verdict' }, element('span', { class: 'sign', 'aria-hidden': 'true' }), verdict.text));
  if (verdict.head.length) head.append(element('ol', { class: 'steps' }, ...verdict.head.map(problemItem)));
  const others = verdict.reasons.slice(verdict.head.length);
  if (others.length)
    head.append(element('details', { class: 'reasons', open: verdict.head.length ? null : '' }, element('summary', null, verdict.head.length ? others.length + ' more' : 'details'),
      element('ul', null, ...others.map((reason) => element('li', null, reason)))));
  const figures = [];
  if (model) {
    figures.push(['modes', String(model.modes)], ['relative rms error', percent(model.relative_rms_error, 3)]);
    figures.push(['iterations' + (model.status ? ' (' + model.status.replace(/_/g, ' ') + ')' : ''), count(model.iterations)]);
  }
  if (validation) {
    figures.push(['rms error, held-back data', percent(validation.relative_rms_error, 3)]);
    if (validation.chi_square_per_dof > 0) figures.push(['chi-square per degree of freedom', number(validation.chi_square_per_dof)]);
  }
  if (frf) {
    figures.push(['lines', count(frf.lines)], ['sensors \u00d7 actuators', frf.outputs.length + ' \u00d7 ' + frf.inputs.length]);
    figures.push(['band', bandName(frf.band_hz)]);
  }
  for (const figure of content.figures) figures.push([figure.label, figure.value]);
  head.append(figureList(figures));
  if (content.notes.length) head.append(element('ul', { class: 'notes' }, ...content.notes.map((note) => element('li', null, note))));
}

function buildModes() {
  const known = content.modes.some((mode) => mode.truth);
  const uncertain = content.modes.some((mode) => isNumber(mode.frequency_std_hz));
  const body = section('modes', 'Modes', 'Modes', known
    ? 'Identified modes and true modes of the simulated plant. Deviations are in standard deviations.' : null);
  if (uncertain && isZippered()) body.append(element('p', { class: 'lead correlated' }, correlationText() + ' The standard deviations include this.'));
  const rows = content.modes.map((mode, i) => ({ ...mode, place: i + 1, rowClass: isNumber(mode.frequency_hz) ? null : 'absent' }));
  const columns = [
    ['#', (row) => row.place, shapeCell],
    ['f\u2080 [Hz]', (row) => row.frequency_hz, frequencyCell],
  ];
  if (uncertain) columns.push(['\u03c3(f\u2080) [Hz]', (row) => row.frequency_std_hz, (row) => number(row.frequency_std_hz, 2)]);
  columns.push(['\u03b6 [%]', (row) => row.damping_ratio, (row) => hundred(row.damping_ratio)]);
  if (uncertain) columns.push(['\u03c3(\u03b6) [%]', (row) => row.damping_std, (row) => number(isNumber(row.damping_std) ? 100 * row.damping_std : null, 2)]);
  if (known) {
    columns.push(['true f\u2080 [Hz]', (row) => row.truth && row.truth.frequency_hz, (row) => fixed(row.truth && row.truth.frequency_hz)],
      ['true \u03b6 [%]', (row) => row.truth && row.truth.damping_ratio, (row) => hundred(row.truth && row.truth.damping_ratio)]);
    if (uncertain) columns.push(['\u0394f\u2080/\u03c3', (row) => row.frequency_deviation, (row) => deviationCell(row.frequency_deviation)],
      ['\u0394\u03b6/\u03c3', (row) => row.damping_deviation, (row) => deviationCell(row.damping_deviation)]);
  }
  body.append(sortableTable(columns, rows));
  const others = content.model.others.map((other) => other.integrators
    ? 'rigid body (1/s' + (other.integrators === 1 ? '' : superscripts[other.integrators] || '^' + other.integrators) + ')'
    : other.order === 0 ? 'direct term' : 'submodel of order ' + other.order);
  if (others.length) body.append(element('p', { class: 'quiet' }, 'Other terms: ' + others.join(', ') + '.'));
  body.append(fitFacts());
}

function deviationCell(value) {
  return element('span', { class: Math.abs(value) > 3 ? 'far' : null }, deviations(value));
}

function hundred(value) {
  return isNumber(value) ? (100 * value).toPrecision(4) : '\u2013';
}

// The number of the mode as a link to its shape.
function shapeCell(row) {
  const index = content.shapes ? content.shapes.modes.findIndex((mode) => mode.frequency_hz === row.frequency_hz) : -1;
  if (index < 0) return String(row.place);
  return element('button', {
    type: 'button', class: 'plain number', title: 'Show its shape', 'aria-label': 'Mode ' + row.place + ': show its shape', onclick: () => {
      showShape(index);
      document.getElementById('shapes').scrollIntoView({ behavior: 'auto', block: 'start' });
    },
  }, String(row.place));
}

function frequencyCell(row) {
  if (!isNumber(row.frequency_hz)) return 'not identified';
  if (!content.frf) return fixed(row.frequency_hz);
  const half = Math.max(0.03, 12 * (row.damping_ratio || 0.01));
  return element('button', {
    type: 'button', class: 'plain number', title: 'Show in the large plot',
    onclick: () => zoomEntry(row.frequency_hz * (1 - Math.min(half, 0.5)), row.frequency_hz * (1 + half)),
  }, fixed(row.frequency_hz));
}

function delayText(delays) {
  const values = new Set(delays);
  if (values.size === 0) return null;
  const most = Math.max(...values);
  return values.size === 1 ? duration(most) : duration(Math.min(...values)) + ' to ' + duration(most);
}

function fitFacts() {
  const model = content.model;
  return facts([
    ['status', model.status && model.status.replace(/_/g, ' ')], ['weighting', model.weighting && model.weighting.replace(/_/g, ' ')],
    ['cost', number(model.cost, 5)], ['iterations', count(model.iterations)], ['hold in the model', model.hold],
    ['delay at the inputs', delayText(model.delay_s.inputs)], ['delay at the outputs', delayText(model.delay_s.outputs)],
    ['band fitted', model.band_hz[1] > 0 ? bandName(model.band_hz) : null],
    ['time', model.seconds > 0 ? duration(model.seconds) : null],
  ]);
}

function buildValidation() {
  const v = content.validation;
  const body = section('validation', 'Validation', 'Validation', 'On data not used in the fit.');
  body.append(facts([
    ['relative rms error', percent(v.relative_rms_error, 3)], ['normalized error', percent(v.normalized_error, 3)],
    ['chi-square per degree of freedom', v.chi_square_per_dof > 0 ? number(v.chi_square_per_dof) + ' (expected from ' + ({noise: 'noise', scatter: 'the scatter of neighbouring lines'}[v.variance] || 'noise and distortion') + ' alone: ' + (v.expected_chi_square > 0 ? number(v.expected_chi_square) : 'unknown') + ')' : 'unknown: too few lines without variances'],
    ['whitened error above its 95 % point', v.chi_square_per_dof > 0 ? percent(v.whitened_above_95) + ' (expected: 5 %)' : null],
    ['largest autocorrelation over lines', v.whiteness_limit > 0 ? number(v.whiteness) + ' (99 % limit ' + number(v.whiteness_limit) + ')' : null],
  ]));
  if (content.frf && v.channel_error.length === channelCount()) body.append(channelErrors(v.channel_error));
}

// Relative rms error per channel, shaded on a logarithmic scale between the smallest and the largest.
function channelErrors(errors) {
  const { inputs, outputs } = content.frf;
  const logs = errors.filter((e) => e > 0).map(Math.log);
  const low = Math.min(...logs), high = Math.max(...logs);
  const shade = (e) => (e > 0 && high > low ? (Math.log(e) - low) / (high - low) : 0);
  const heads = inputs.map((input) => element('th', { scope: 'col', class: 'name' }, input.name));
  const rows = outputs.map((output, o) => [rowHead(output.name, 'name'), ...inputs.map((_, i) => {
    const e = errors[channelIndex(o, i)];
    return element('td', { class: 'heat', style: '--heat:' + shade(e).toFixed(3) }, percent(e));
  })]);
  return table(['sensor', ...heads], rows, 'Relative rms error of each channel', 'heatmap');
}

function buildDecisions() {
  const body = section('decisions', 'Decisions', 'Decisions of the automatic fit');
  const list = element('ol', { class: 'decisions' }, ...content.decisions.map((decision) => element('li', null, decision)));
  body.append(content.decisions.length > 12 ? folded(plural(content.decisions.length, 'decision'), list) : list);
}

function buildProvenance() {
  const body = section('provenance', 'Provenance', 'Provenance');
  const frf = content.frf;
  if (frf) {
    body.append(facts([
      ['realizations', frf.realizations || null], ['experiments per realization', frf.experiments || null], ['periods used', frf.periods || null],
      ['sample rate', frf.sample_rate_hz > 0 ? hertz(frf.sample_rate_hz) : null], ['hold in the data', frf.hold],
      ['compensated', frf.compensated + (frf.compensated === 'none' ? '' : ', ' + duration(frf.delay_s))],
      ['standard deviation from', frf.deviation ? frf.deviation + ' variance' : 'unknown'],
      ['degrees of freedom', frf.deviation ? number(frf.deviation === 'total' ? frf.total_dof : frf.noise_dof) : null],
      ['equivalent independent lines', isZippered() ? count(Math.round(frf.lines / frf.correlated_lines)) + ' of ' + count(frf.lines) : null],
      ['largest condition number of the inputs', isNumber(frf.worst_condition) ? number(frf.worst_condition) : null],
    ]));
    if (frf.excluded.length) body.append(element('p', null, 'Actuators outside the identified part, with their power relative to the inputs: ' +
      frf.excluded.map((channel) => channel.name + ' (' + (isNumber(channel.power) ? number(channel.power) : 'unknown') + ')').join(', ') + '.'));
  }
  for (const { of, content: what } of content.provenance) {
    body.append(folded('Provenance of the ' + of, typeof what === 'string' ? what : JSON.stringify(what, null, 2)));
  }
  for (const { name, text } of content.documents) body.append(folded(name, text));
}
