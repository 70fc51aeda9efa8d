// The head: state, progress, and the abort button.

const head = {};
const armedFor_ms = 5000;

function buildProgress() {
  head.verdict = element('p', { class: 'verdict none', id: 'state', role: 'status' }, element('span', { class: 'sign', 'aria-hidden': 'true' }));
  head.text = element('span', null, 'connecting');
  head.verdict.append(head.text);
  head.abort = element('button', { type: 'button', class: 'abort', id: 'abort', onclick: pressAbort, disabled: true }, 'Stop the measurement');
  head.bar = element('span');
  head.track = element('div', { class: 'progress', role: 'progressbar', 'aria-label': 'Progress', 'aria-valuemin': 0, 'aria-valuemax': 100 }, head.bar);
  head.figures = element('dl', { class: 'figures' });
  head.note = element('p', { class: 'quiet', id: 'note' });
  document.getElementById('head').append(
    element('p', { class: 'brand' }, 'stageid \u00b7 ' + shown.backend + (shown.period_s ? '' : ', virtual time')),
    element('h1', null, shown.stage + ': ' + shown.experiment),
    element('div', { class: 'status' }, head.verdict, head.abort), head.track, head.figures, head.note);
}

const stateWords = { starting: 'starting', running: 'measuring', stopping: 'stopping: the excitation is ramped down in closed loop',
  estimating: 'measured; estimating the last response' };

function endOf(state) {
  if (state.exit_code === 0) return ['good', 'done'];
  if (state.exit_code === 3) return ['doubt', 'done, but not to be trusted: ' + state.message];
  if (state.exit_code === 130) return ['doubt', state.message];
  return ['bad', state.message];
}

function showProgress(state) {
  const [level, text] = state.state === 'ended' ? endOf(state) : [state.state === 'running' ? 'running' : 'none', stateWords[state.state]];
  head.verdict.className = 'verdict ' + level;
  // Only on changes, because screen readers read it aloud.
  if (head.text.textContent !== text) head.text.textContent = text;
  head.abort.disabled = state.state !== 'running' && state.state !== 'starting';
  const share = state.seconds_total > 0 ? Math.min(1, state.seconds_done / state.seconds_total) : 0;
  head.bar.style.width = (100 * share).toFixed(2) + '%';
  head.track.setAttribute('aria-valuenow', Math.round(100 * share));
  head.figures.replaceChildren(...described(figures(state)));
  const now = 'Current run: realization ' + (state.run.realization + 1) + ' of ' + shown.realizations + ', experiment ' + (state.run.experiment + 1) + '. ';
  head.note.textContent = (state.state === 'running' ? now : '') + 'Response: ' + state.response.status + '.' + (state.stays ? ' The program ends when this page is closed.' : '');
}

// Relative rms error of the response so far; with a wanted one, the time until it: the variance falls with the number of realizations.
function accuracyFigures({ accuracy, runs_total: runs, runs_done: done, seconds_left: left }) {
  if (!accuracy) return [];
  const list = [['accuracy so far', percent(Math.sqrt(accuracy.variance)) + ' rms']];
  if (accuracy.wanted === null) return list;
  const needed = Math.ceil(accuracy.realizations * accuracy.variance / accuracy.wanted);
  const when = accuracy.variance <= accuracy.wanted ? 'reached' : needed > shown.realizations ? 'not within ' + plural(shown.realizations, 'realization') : 'in ' + duration(left * (needed * runs / shown.realizations - done) / (runs - done));
  return [...list, ['wanted ' + percent(Math.sqrt(accuracy.wanted)), when]];
}

function figures(state) {
  const list = [
    ['runs complete', state.runs_done + ' of ' + state.runs_total],
    ['time left', state.state === 'ended' ? '\u2013' : duration(state.seconds_left)],
    ['measured', duration(state.seconds_done)],
    ...accuracyFigures(state),
    ['stage', state.state === 'ended' ? '\u2013' : state.node_state],
    ...['late', 'missing', 'marked', 'irregular'].map((name) => [name, flagged(state.health[name])]),
  ];
  if (state.timing) list.push(['execution, 99.9 %', percent(state.timing.execution.p99_9_s / shown.period_s) + ' of a period']);
  else list.push(['speed', number(state.speed) + ' \u00d7 real time']);
  return list;
}

// Requires two presses within a few seconds, so that an accidental click does not end a measurement of two hours.
function pressAbort() {
  if (!head.abort.classList.contains('armed')) {
    head.abort.classList.add('armed');
    head.abort.textContent = 'Press again to stop';
    head.disarm = setTimeout(disarm, armedFor_ms);
    return;
  }
  clearTimeout(head.disarm);
  disarm();
  head.abort.disabled = true;
  fetch('abort' + link.search, { method: 'POST', headers: { 'X-Stageid': 'abort' } }).then((answer) => {
    if (!answer.ok) head.text.textContent = 'the program rejected the stop request (' + answer.status + ')';
  }, () => { head.text.textContent = 'the program does not respond; stop it with Ctrl-C'; });
}

function disarm() {
  head.abort.classList.remove('armed');
  head.abort.textContent = 'Stop the measurement';
}
