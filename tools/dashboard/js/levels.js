// Levels of every channel against its limit.

const levels = { rows: [] };

function buildLevels() {
  const body = section('levels', 'Levels', 'Levels against limits',
    'Bar: largest magnitude since the last update, a few times per second; thick line: largest so far; thin line: rms. A full bar is at the limit.');
  const group = (title, list, limits, first) => {
    body.append(element('h3', null, title));
    const grid = element('div', { class: 'levels' });
    list.forEach((channel, i) => grid.append(levelRow(channel, limits[i], first + i)));
    body.append(grid);
  };
  group('Actuators', shown.actuators, shown.limits.actuator_n, 0);
  group('Sensors', shown.sensors, shown.limits.position_window_m, shown.actuators.length);
}

function levelRow(channel, limit, place) {
  const row = { bar: element('span', { class: 'level-bar' }), rms: element('span', { class: 'level-rms' }),
    largest: element('span', { class: 'level-largest' }), value: element('span', { class: 'level-value' }), channel, limit };
  row.track = element('span', { class: 'level-track', role: 'meter', 'aria-label': channel.name, 'aria-valuemin': 0, 'aria-valuemax': 100 },
    row.bar, row.rms, row.largest);
  levels.rows[place] = row;
  return element('div', { class: 'level' }, element('span', { class: 'level-name', title: channel.name }, channel.name), row.track, row.value);
}

const prefixes = [[1, ''], [1e-3, 'm'], [1e-6, '\u00b5'], [1e-9, 'n']];

function quantity(value, unit) {
  const [scale, prefix] = prefixes.find(([least]) => Math.abs(value) >= least) || [value === 0 ? 1 : 1e-9, value === 0 ? '' : 'n'];
  return number(value / scale) + '\u00a0' + prefix + unit;
}

function showLevels(state) {
  const { peak, rms, largest_peak: largest } = state.levels;
  levels.rows.forEach((row, i) => {
    // Without a limit, the scale ends at the largest level so far.
    const full = row.limit || largest[i] || 1;
    const part = (v) => 100 * Math.min(1, v / full);
    const share = row.limit ? largest[i] / row.limit : 0;
    row.bar.style.width = part(peak[i]) + '%';
    row.bar.className = 'level-bar' + (share >= 0.98 ? ' at' : share > 0.8 ? ' near' : '');
    row.rms.style.left = 'calc(' + part(rms[i]) + '% - 1px)';
    row.largest.style.left = 'calc(' + part(largest[i]) + '% - 2px)';
    row.value.textContent = quantity(largest[i], row.channel.unit) + (row.limit ? ' of ' + quantity(row.limit, row.channel.unit) : ', no limit');
    row.track.setAttribute('aria-valuenow', part(peak[i]).toFixed(1));
    row.track.setAttribute('aria-valuetext', quantity(peak[i], row.channel.unit));
  });
}
