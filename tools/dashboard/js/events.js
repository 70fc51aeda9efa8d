// Timing, values of the supervisor if there is one, and the newest events.

const side = {};

function buildTiming() {
  if (!shown.period_s) return;
  side.timing = element('div');
  section('timing', 'Timing', 'Timing of the loop').append(side.timing);
}

function showTiming(state) {
  if (side.timing && state.timing) side.timing.replaceChildren(timingBars(state.timing, shown.period_s));
}

// state.supervisor: null, or { state, values: [{ name, value, unit }] }.
function showSupervisor(state) {
  if (!state.supervisor) return;
  if (!side.supervisor) {
    side.supervisor = element('div');
    section('supervisor', 'Supervisor', 'Temperatures and interlocks').append(side.supervisor);
  }
  side.supervisor.replaceChildren(facts([['state', state.supervisor.state],
    ...state.supervisor.values.map((v) => [v.name, number(v.value, 4) + '\u00a0' + v.unit])]));
}

function buildEvents() {
  const list = table([], [], '', 'events');
  side.events = list.querySelector('tbody');
  section('events', 'Events', 'Events', 'Newest first. The event log next to the log contains all of them.').append(list);
}

function showEvents(state) {
  const key = JSON.stringify(state.events[state.events.length - 1] || null) + state.events.length;
  if (side.key === key) return;
  side.key = key;
  side.events.replaceChildren(...state.events.filter(Boolean).reverse().map((event) => tableRow(
    [String(event.time_utc).slice(11, 23), String(event.event).replace(/_/g, ' '), element('td', { class: 'quiet' }, eventText(event))])));
}

const hiddenFields = new Set(['time_utc', 'event', 'measurement_id']);

function eventText(event) {
  if (event.text) return event.text;
  const place = isNumber(event.realization) ? 'realization ' + (event.realization + 1) + ', experiment ' + (event.experiment + 1) : '';
  const rest = Object.entries(event).filter(([name]) => !hiddenFields.has(name) && name !== 'realization' && name !== 'experiment')
    .map(([name, value]) => name.replace(/_s$/, '').replace(/_/g, ' ') + ' ' + (name.endsWith('_s') ? duration(value) : isNumber(value) ? number(value, 6).replace(/\.0+$/, '') : String(value)));
  return [place, ...rest].filter(Boolean).join(', ');
}
