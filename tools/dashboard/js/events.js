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
  section('events', 'Events', 'Events', 'The newest of each kind. The event log next to the log contains all of them.').append(list);
}

function showEvents(state) {
  const key = JSON.stringify(state.events[state.events.length - 1] || null) + state.events.length;
  if (side.key === key) return;
  side.key = key;
  side.events.replaceChildren(...eventGroups(state.events.filter(Boolean).reverse()).map(({ event, times }) => tableRow(
    [String(event.time_utc).slice(11, 23), String(event.event).replace(/_/g, ' ') + (times > 1 ? ' \u00d7\u00a0' + times : ''), element('td', { class: 'quiet' }, eventText(event))])));
}

// Each kind as its newest event; changes of the stage each by itself.
function eventGroups(events) {
  const groups = [];
  for (const event of events) {
    const same = groups.find((group) => group.event.event === event.event);
    if (same && event.event !== 'change') same.times++;
    else groups.push({ event, times: 1 });
  }
  return groups;
}

const hiddenFields = new Set(['time_utc', 'event', 'measurement_id']);

function eventText(event) {
  if (event.text) return event.text;
  const place = isNumber(event.realization) ? 'realization ' + (event.realization + 1) + ', experiment ' + (event.experiment + 1) : '';
  const rest = Object.entries(event).filter(([name]) => !hiddenFields.has(name) && name !== 'realization' && name !== 'experiment')
    .map(([name, value]) => name.replace(/_s$/, '').replace(/_/g, ' ') + ' ' + (name.endsWith('_s') ? duration(value) : isNumber(value) ? number(value, 6).replace(/\.0+$/, '') : String(value)));
  return [place, ...rest].filter(Boolean).join(', ');
}
