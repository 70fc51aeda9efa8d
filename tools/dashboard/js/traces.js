// The last two seconds of one actuator and one sensor.

const liveTraces = { pickers: [], pending: null };

function buildTraces() {
  const body = section('traces', 'Traces', 'Forces and motions', 'The last two seconds of an actuator and of a sensor.');
  const all = element('div', { class: 'traces' });
  const add = (title, list, first) => {
    const trace = { first, unit: list[0] ? list[0].unit : '', data: null };
    trace.pick = element('select', { id: 'trace-' + title, onchange: fetchTraces },
      ...list.map((channel, i) => element('option', { value: first + i }, channel.name)));
    trace.figure = canvasFigure('trace-figure-' + title, 'Last two seconds of the ' + title, (context, width, height) => drawTrace(context, width, height, trace), 'trace');
    all.append(element('div', null, element('label', { for: 'trace-' + title }, title + ' ', trace.pick), trace.figure.node));
    liveTraces.pickers.push(trace);
  };
  add('actuator', shown.actuators, 0);
  add('sensor', shown.sensors, shown.actuators.length);
  body.append(all);
}

function fetchTraces() {
  liveTraces.pending = liveTraces.pending || loadTraces().finally(() => { liveTraces.pending = null; });
  return liveTraces.pending;
}

async function loadTraces() {
  try {
    for (const trace of liveTraces.pickers) {
      const place = Number(trace.pick.value);
      const answer = await fetch('trace.json' + (link.search ? link.search + '&' : '?') + 'channel=' + place);
      trace.data = await answer.json();
      trace.unit = [...shown.actuators, ...shown.sensors][place].unit;
      trace.figure.redraw();
    }
  } catch { /* the head of the page reports a lost connection */ }
}

function drawTrace(context, width, height, { data, unit }) {
  if (!data || data.low.length < 2) return;
  const { low, high, bins, bin_s: step } = data;
  const area = { x: 66, y: 6, w: width - 74, h: height - 28 };
  const least = Math.min(...low), range = Math.max(...high) - least || 1;
  const x = (i) => area.x + area.w * (i + 1 - low.length + bins) / bins;
  const y = (value) => area.y + area.h * (1 - (value - least) / range);
  const colours = palette();
  context.fillStyle = colours.curves[0];
  const slice = Math.max(1, area.w / bins);
  low.forEach((value, i) => context.fillRect(x(i) - slice, y(high[i]) - 0.5, slice, Math.max(1, y(value) - y(high[i]) + 1)));
  for (const value of [least, least + range]) drawText(context, quantity(value, unit), area.x - 6, y(value), { align: 'right', base: 'middle' });
  drawText(context, '\u2212' + number(bins * step, 2) + '\u00a0s', area.x, height - 4, { base: 'bottom' });
  drawText(context, 'now', area.x + area.w, height - 4, { align: 'right', base: 'bottom' });
}
