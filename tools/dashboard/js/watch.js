// What a watch of the stage tracks: a card with a light and a ribbon per property, and the changes.

const watched = { body: null, cards: [], periods: -1, loading: false, history: null, changed: new Set() };

// Of each kind of tracked property.
const watchGroups = [['frequency', 'Natural frequencies'], ['damping', 'Damping ratios'], ['sensor_gain', 'Gains of sensors'],
  ['actuator_gain', 'Gains of actuators'], ['delay', 'Delay']];
const bandFactor = 1.96;  // 95 % of a normal distribution
const nearThreshold = 0.7;

function showWatch(state) {
  if (!state.watch) return Promise.resolve();
  if (!watched.body) buildWatch();
  if (watched.cards.length !== state.watch.tracked.length + state.watch.noise.length) buildCards(state.watch);
  watched.cards.forEach((card) => showLight(card, state.watch));
  watched.status.replaceChildren(...described([['periods watched', count(state.watch.periods)], ['skipped', count(state.watch.skipped)],
    ['changes', flagged(state.watch.changes)], ['shown', shownTime()], ['at present', state.watch.learning ? 'learning noise and reference' : 'watching'],
    ['largest statistic', state.watch.learning ? '\u2013' : number(state.watch.statistic) + ' of ' + number(state.watch.threshold)]]));
  return fetchHistory(state.watch.periods);
}

// Of the ribbons.
function shownTime() {
  const time = watched.history ? watched.history.time_s : [];
  return time.length ? duration(time[0]) + ' \u2013 ' + duration(time[time.length - 1]) : '\u2013';
}

function buildWatch() {
  watched.body = section('watch', 'Watch', 'Watch of the stage',
    'Changes from the model. Line: tracked value. Ribbon: its 95 % band. Light: how near the evidence of a change is to the threshold of an alarm.');
  watched.status = element('dl', { class: 'figures' });
  watched.groups = element('div');
  watched.changes = table([], [], '', 'events').querySelector('tbody');
  watched.body.append(watched.status, element('h3', null, 'Changes'), watched.changes.closest('.table-scroll'), watched.groups);
  moveToEnd('timing');
  moveToEnd('events');
}

function buildCards(watch) {
  const properties = watch.tracked.map((property, index) => ({ list: 'tracked', index, kind: property.kind, name: property.name }));
  const noise = watch.noise.map((sensor, index) => ({ list: 'noise', index, kind: 'noise', name: sensor.name }));
  for (const card of watched.cards) if (card.figure) plots.delete(card.figure);
  watched.cards = [...properties, ...noise];
  watched.groups.replaceChildren(...[...watchGroups, ['noise', 'Noise of sensors']].flatMap(([kind, title]) => {
    const cards = watched.cards.filter((card) => card.kind === kind);
    return cards.length ? [element('h3', null, title), element('div', { class: 'watch-cards' }, ...cards.map(buildCard))] : [];
  }));
}

function buildCard(card) {
  card.sign = element('span', { class: 'sign', 'aria-hidden': 'true' });
  card.light = element('span', { class: 'verdict none', role: 'img' }, card.sign);
  card.value = element('span', { class: 'watch-value' });
  card.ratio = element('span', { class: 'quiet' });
  const short = card.name.replace(/^.* at /, '').replace(/^\w+ of (sensor|actuator) /, '').replace(/'/g, '');
  const node = element('div', { class: 'watch-card', title: card.name },
    element('div', { class: 'watch-head' }, card.light, element('span', { class: 'watch-name' }, short), card.value), card.ratio);
  if (card.list === 'tracked') {
    card.figure = canvasFigure('watch-' + card.index, card.name + ' over time', (context, width, height) => drawRibbon(context, width, height, card), 'ribbon');
    node.append(card.figure.node);
  }
  return node;
}

// Relative changes in percent, of the delay in microseconds.
function changeText(card, value) {
  return card.kind === 'delay' ? number(1e6 * value, 2) + '\u00a0\u00b5s' : number(100 * value, 2) + '\u00a0%';
}

function showLight(card, watch) {
  const now = watch[card.list][card.index];
  const share = isNumber(now.statistic) && watch.threshold > 0 ? now.statistic / watch.threshold : null;
  const [level, word] = watched.changed.has(card.name) ? ['bad', 'changed'] : share === null ? ['none', 'learning']
    : share >= 1 ? ['bad', 'above the threshold'] : share > nearThreshold ? ['doubt', 'near the threshold'] : ['good', 'no change'];
  card.light.className = 'verdict ' + level;
  card.light.setAttribute('aria-label', word);
  card.ratio.textContent = word + (share === null ? '' : ': ' + number(now.statistic, 2) + ' of ' + number(watch.threshold, 2));
  card.value.textContent = card.kind === 'noise' ? (isNumber(now.power) ? number(now.power, 2) + ' \u00d7 power' : '')
    : changeText(card, now.change) + ' \u00b1 ' + changeText(card, bandFactor * now.deviation);
}

// Fetched when the stream announces more periods.
function fetchHistory(periods) {
  if (periods === watched.periods || watched.loading) return Promise.resolve();
  watched.loading = true;
  return fetch('watch.json' + link.search).then((answer) => answer.json()).then((fresh) => {
    watched.periods = periods;
    watched.history = fresh.history;
    showChanges(fresh.changes);
    for (const card of watched.cards) if (card.figure) card.figure.redraw();
  }).finally(() => { watched.loading = false; });
}

function showChanges(changes) {
  watched.changed = new Set(changes.map((change) => change.name));
  if (changes.length === 0) {
    watched.changes.replaceChildren(tableRow([element('td', { class: 'quiet' }, 'none')]));
    return;
  }
  watched.changes.replaceChildren(...changes.slice().reverse().map((change) => tableRow(
    [duration(change.time_s), change.kind.replace(/_/g, ' '), element('td', null, change.text)])));
}

// The value with its band over time, and a line at the model. Scaled to show all of both.
function drawRibbon(context, width, height, card) {
  const history = watched.history;
  if (!history || history.time_s.length < 2) return;
  const [time, change, deviation] = [history.time_s, history.change[card.index], history.deviation[card.index]];
  const low = change.map((v, k) => v - bandFactor * deviation[k]);
  const high = change.map((v, k) => v + bandFactor * deviation[k]);
  const [least, most] = [Math.min(0, ...low), Math.max(0, ...high)];
  const x = (t) => width * (t - time[0]) / (time[time.length - 1] - time[0]);
  const y = (v) => 3 + (height - 6) * (most - v) / (most - least || 1);
  const colours = palette();
  context.lineWidth = 1;
  context.strokeStyle = colours.frame;
  drawLine(context, 0, y(0), width, y(0));
  context.fillStyle = context.strokeStyle = colours.curves[0];
  context.globalAlpha = 2 * plotBasics.fillAlpha;
  context.beginPath();
  time.forEach((t, k) => context.lineTo(x(t), y(high[k])));
  for (let k = time.length - 1; k >= 0; --k) context.lineTo(x(time[k]), y(low[k]));
  context.fill();
  context.globalAlpha = 1;
  context.lineWidth = 1.3;
  context.beginPath();
  time.forEach((t, k) => context.lineTo(x(t), y(change[k])));
  context.stroke();
  drawText(context, changeText(card, most), 2, 2, { base: 'top', pixels: 10 });
  drawText(context, changeText(card, least), 2, height - 2, { base: 'bottom', pixels: 10 });
}
