// Pairs and bands in which the scatter over realizations is larger than noise: nonlinear distortions.

const distortion = { figure: null };

function buildNonlinearity() {
  const { bands, chance, settled } = content.nonlinearity;
  const body = section('nonlinearity', 'Nonlinearity', 'Nonlinear distortions', 'Each cell is one sensor over one actuator, named at the edges; each bar is one octave, from low to high; ' +
    'the height is the distortion of one realization over |G| on a logarithmic scale from 0.01\u00a0% to 100\u00a0%. ' +
    'Coloured: above noise (p\u00a0<\u00a0' + chance + ' of the F test); grey: within the noise' +
    (settled.every(Boolean) ? '.' : '; outlined: undetermined, the records contain a transient or a drift there.'));
  const text = element('output', { class: 'values' });
  distortion.figure = canvasFigure('nonlinearity-plot', distortionSummary(), drawNonlinearity, 'tall');
  tellUnderPointer(distortion.figure, text, distortionAt);
  body.append(element('div', { class: 'plot-head' }, element('p', null, distortionSummary() + '.'), saveButtons('nonlinear distortions', savedNonlinearity)),
    distortion.figure.node, element('p', { class: 'plot-title' }, text),
    folded('Table of the bands and pairs above noise', distortionTable(bands)));
}

// [{channel, band, p, level, settled}] per pair and band.
function distortionBars() {
  const { p_value: p, distortion: level, settled } = content.nonlinearity;
  return p.flatMap((row, channel) => row.map((value, i) => ({ channel, band: i, p: value, level: level[channel][i], settled: settled[i] })));
}

// All tests that were possible.
function distortionTests() {
  return distortionBars().filter((bar) => bar.settled);
}

function isDistorted(test) {
  return isNumber(test.p) && test.p < content.nonlinearity.chance;
}

function distortionSummary() {
  const tests = distortionTests();
  const found = tests.filter(isDistorted).length;
  const { bands, chance, settled } = content.nonlinearity;
  const open = settled.filter((whether) => !whether).length;
  return count(found) + ' of ' + count(tests.length) + ' pairs and bands scatter by more than noise; expected for a linear plant: about ' +
    number(chance * tests.length, 2) + (open ? '; in ' + count(open) + ' of ' + count(bands.length) + ' bands the records are not settled' : '');
}

function distortionTable(bands) {
  const rows = distortionTests().filter(isDistorted).sort((a, b) => b.level - a.level).slice(0, 200);
  if (!rows.length) return element('p', null, 'None.');
  return sortableTable([
    ['pair', (row) => row.channel, (row) => channelName(row.channel)], ['band', (row) => row.band, (row) => bandName(bands[row.band])],
    ['distortion', (row) => row.level, (row) => percent(row.level)], ['p', (row) => row.p, (row) => number(row.p, 2)],
  ], rows);
}

// Sensors are rows, or columns if the names of many actuators do not fit beside each other.
function distortionFrame(width, height) {
  const { inputs, outputs } = content.frf;
  const area = { x: 64, y: 22, w: width - 70, h: height - 28 };
  const turned = inputs.length > outputs.length && area.w / inputs.length < 36;
  const [columns, rows] = turned ? [outputs, inputs] : [inputs, outputs];
  return { area, turned, columns, rows, cell: [area.w / columns.length, area.h / rows.length] };
}

// 0 at 0.01 %, 1 at 100 %.
function distortionHeight(level) {
  return level > 0 ? Math.min(1, Math.max(0.04, 1 + Math.log10(level) / 4)) : 0.04;
}

function drawNonlinearity(context, width, height) {
  const { area, turned, columns, rows, cell: [w, h] } = distortionFrame(width, height);
  const bands = content.nonlinearity.bands.length;
  const place = (channel) => {
    const at = [inputOf(channel), outputOf(channel)];
    return turned ? at.reverse() : at;
  };
  const colours = palette();
  const [across, down] = [Math.ceil(30 / w), Math.ceil(14 / h)];  // every name, or as many as fit
  rows.forEach((row, r) => { if (r % down === 0) drawName(context, row.name, 'right', area.x - 8, area.y + (r + 0.5) * h, 56); });
  columns.forEach((column, c) => { if (c % across === 0) drawName(context, column.name, 'center', area.x + (c + 0.5) * w, area.y / 2, across * w); });
  const gap = Math.min(8, 0.3 * h);
  context.lineWidth = 1;
  context.strokeStyle = colours.text;
  for (const test of distortionBars().sort((a, b) => isDistorted(a) - isDistorted(b))) {
    const [column, row] = place(test.channel);
    const left = area.x + column * w + 2;
    const bottom = area.y + (row + 1) * h - 0.375 * gap;
    const tall = Math.max(1, (h - gap) * distortionHeight(test.level));
    const wide = (w - 5) / bands;
    if (!test.settled) {
      context.strokeRect(left + test.band * wide + 0.5, bottom - tall + 0.5, Math.max(1, wide - 2), tall - 1);
      continue;
    }
    context.fillStyle = isDistorted(test) ? colours.marker : colours.frame;
    context.fillRect(left + test.band * wide, bottom - tall, Math.max(1, wide - 1), tall);
  }
  context.strokeStyle = colours.grid;
  for (let c = 0; h > 4 && c < channelCount(); ++c) {
    const [column, row] = place(c);
    context.strokeRect(area.x + column * w + 0.5, area.y + row * h + 0.5, w - 2, h - 2);
  }
}

function distortionAt(event) {
  const { node } = distortion.figure;
  const { area, turned, cell: [w, h] } = distortionFrame(node.clientWidth, node.clientHeight);
  const column = Math.floor((event.offsetX - area.x) / w);
  const row = Math.floor((event.offsetY - area.y) / h);
  const [input, output] = turned ? [row, column] : [column, row];
  const { bands, p_value: p, distortion: level, settled } = content.nonlinearity;
  if (!content.frf.inputs[input] || !content.frf.outputs[output]) return '';
  const place = Math.min(bands.length - 1, Math.max(0, Math.floor((event.offsetX - area.x - column * w - 2) / ((w - 5) / bands.length))));
  const channel = channelIndex(output, input);
  return channelName(channel) + ', ' + bandName(bands[place]) + ': ' + percent(level[channel][place]) + (settled[place] ? ', p = ' + number(p[channel][place], 2) : ', not settled');
}

function savedNonlinearity() {
  const legend = [['more than noise', palette().marker], ['within the noise', palette().frame]];
  if (!content.nonlinearity.settled.every(Boolean)) legend.push(['not settled', palette().text]);
  return { title: 'Nonlinear distortions, 0.01 % to 100 % of |G|', legend, panels: [canvasPanel(distortion.figure)] };
}
