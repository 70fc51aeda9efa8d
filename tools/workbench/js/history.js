// The state of the session: undo and redo, the list of fits, the cost while a fit runs, the command line, saving.

const session = {};

function buildBench() {
  const body = section('bench', 'Workbench', 'Workbench', 'Each edit is answered by a preview, then by the fit of the command line below. Nothing is written unless you save.');
  session.undo = plainButton('Undo', () => act({ kind: 'undo' }), { id: 'undo' });
  session.redo = plainButton('Redo', () => act({ kind: 'redo' }), { id: 'redo' });
  session.stop = plainButton('Stop the fit', stopFit, { id: 'stop' });
  session.status = element('output', { class: 'status-text', id: 'status', 'aria-live': 'polite' });
  session.answer = element('p', { class: 'answer', id: 'answer', role: 'status' });
  session.command = element('code', { class: 'command', id: 'command' });
  session.list = element('ol', { class: 'fits', id: 'fits' });
  session.cost = canvasFigure('bench-cost', 'Cost of the fit over its iterations', drawCostLine, 'strip');
  body.append(element('div', { class: 'entry-pick' }, session.undo, session.redo, session.stop, session.status), session.answer, session.cost.node,
    element('div', { class: 'bench-columns' }, buildControls(), element('div', null, element('h3', null, 'Fits'), session.list, buildSave())),
    element('p', { class: 'plot-title' }, 'Command line that reproduces this fit'), session.command);
}

// Ctrl-Z and Ctrl-Y, or with the Command key, unless a text is edited.
function undoKeys() {
  document.addEventListener('keydown', (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.target.closest('input, select')) return;
    const key = event.key.toLowerCase();
    const kind = key === 'y' || (key === 'z' && event.shiftKey) ? 'redo' : key === 'z' ? 'undo' : null;
    if (!kind) return;
    event.preventDefault();
    act({ kind });
  });
}

function buildSave() {
  session.name = element('input', { id: 'save-name', maxlength: '64', pattern: '[A-Za-z0-9_\\-]+', required: '', placeholder: 'name', 'aria-label': 'Name of the model' });
  session.save = element('form', { class: 'entry-pick', id: 'save-form', onsubmit: (event) => {
    event.preventDefault();
    act({ kind: 'save', name: session.name.value });
  } }, session.name, submitButton('Save the model'));
  session.why = element('p', { class: 'quiet' });
  return element('div', null, session.save, session.why, plainButton('Compare with this fit from now on', () => act({ kind: 'keep' }), { id: 'keep' }));
}

function showState(state) {
  bench.state = state;
  const { states, index } = state;
  const running = state.state === 'fitting';
  session.undo.disabled = index === 0;
  session.redo.disabled = index + 1 >= states.length;
  session.stop.disabled = !running;
  session.status.textContent = statusText(state);
  session.command.textContent = state.command || 'none: there is no model yet';
  keepFocus(() => session.list, () => session.list.replaceChildren(...states.map((one, i) => element('li', null, element('button', {
    type: 'button', class: 'plain fit', 'aria-current': i === index ? 'true' : null, onclick: () => act({ kind: 'go', index: i }),
  }, one.what), element('span', { class: 'quiet' }, fitText(one))))));
  const current = states[index];
  session.save.hidden = !state.writable;
  for (const node of session.save.elements) node.disabled = running || current.stage !== 'refined' || Boolean(current.saved);
  session.why.textContent = !state.writable ? 'Read-only: start with --write to save models.'
    : current.saved ? 'Saved as ' + current.saved + '.' : 'Models are saved in ' + (state.directory || 'the current directory') + '.';
  showControls();
  if (stability.figure) showFitBand();
  session.cost.redraw();
}

function statusText({ state, states, index, cost, message }) {
  if (state === 'ended') return 'the program has ended';
  const { stage } = states[index];
  const newest = cost.length ? ', cost ' + number(cost[cost.length - 1], 5) : '';
  if (state === 'fitting') return (stage === 'waiting' ? 'fitting' : 'preview; fitting') + newest;
  return (stage === 'refined' ? 'ready' : stage) + newest + (message ? ': ' + message : '');
}

function fitText({ modes, cost, stage, saved }) {
  return [plural(modes, 'mode'), isNumber(cost) ? 'cost ' + number(cost, 4) : null, stage === 'refined' ? null : stage, saved || null].filter(Boolean).join(', ');
}

function tellAnswer(action, { good, text }) {
  session.answer.textContent = good ? (action.kind === 'save' ? 'Saved ' + text + '.' : '') : text;
  session.answer.classList.toggle('far', !good);
}

// The cost of the running fit on a logarithmic scale.
function drawCostLine(context, width, height) {
  const values = ((bench.state && bench.state.cost) || []).filter((v) => v > 0).map(Math.log);
  if (values.length < 2) return;
  const low = Math.min(...values), range = Math.max(...values) - low || 1;
  context.strokeStyle = palette().curves[0];
  context.lineWidth = 1.5;
  context.beginPath();
  values.forEach((v, i) => context.lineTo(4 + (width - 8) * i / (values.length - 1), 4 + (height - 8) * (1 - (v - low) / range)));
  context.stroke();
}
