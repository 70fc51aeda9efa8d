// Modal assurance criteria as a picture with an equivalent table.

const macKinds = { both: 'sensors and actuators', outputs: 'sensors', inputs: 'actuators' };

// ownMac(kind) -> {rows, columns, values, rowTitle, columnTitle, title}
function buildMac(id, name, get) {
  const mac = { kind: 'both', get };
  const pick = element('select', { id: id + '-kind', onchange: (event) => {
    mac.kind = event.target.value;
    tell();
    mac.figure.redraw();
  } }, ...Object.entries(macKinds).map(([kind, title]) => element('option', { value: kind }, title)));
  const list = element('div');
  const text = element('output', { class: 'values', 'aria-live': 'off' });
  mac.figure = canvasFigure(id, 'Modal assurance criterion', (context, width, height) => drawMac(context, width, height, get(mac.kind)), 'square');
  const tell = () => {
    const data = get(mac.kind);
    mac.figure.node.setAttribute('aria-label', macSummary(data));
    list.replaceChildren(macTable(data));
  };
  tellUnderPointer(mac.figure, text, (event) => macAt(mac, event));
  tell();
  return element('div', { class: 'mac' }, element('div', { class: 'plot-head' }, element('label', { for: id + '-kind', class: 'plot-title' }, name + ' of ', pick),
    saveButtons(name, () => ({ title: get(mac.kind).title, panels: [canvasPanel(mac.figure)] }))), mac.figure.node,
    element('p', { class: 'plot-title' }, text), folded(name + ' as a table', list));
}

// MACs of sensors, of actuators, or their product, which is that of the residues.
function macValues(outputs, inputs, kind) {
  if (kind === 'outputs') return outputs;
  if (kind === 'inputs') return inputs;
  return outputs.map((row, i) => row.map((value, j) => value * inputs[i][j]));
}

function ownMac(kind) {
  const names = content.shapes.modes.map((mode) => fixed(mode.frequency_hz));
  return {
    rows: names, columns: names, rowTitle: 'mode', columnTitle: 'mode', title: 'Modal assurance criterion, ' + macKinds[kind],
    values: macValues(content.shapes.output_mac, content.shapes.input_mac, kind),
  };
}

function macSummary(data) {
  let most = 0, pair = '';
  data.values.forEach((row, i) => row.forEach((value, j) => {
    if ((data.rows !== data.columns || i !== j) && value > most) [most, pair] = [value, data.rows[i] + ' Hz and ' + data.columns[j] + ' Hz'];
  }));
  return data.title + (pair ? '. Largest' + (data.rows === data.columns ? ' off the diagonal' : '') + ': ' + number(most) + ' between ' + pair : '');
}

function macFrame(data, width, height) {
  const left = 40, bottom = 40;
  const cell = Math.min((width - left - 8) / data.columns.length, (height - bottom - 8) / data.rows.length);
  return { left, top: 8, cell, height: cell * data.rows.length, width: cell * data.columns.length };
}

function drawMac(context, width, height, data) {
  const frame = macFrame(data, width, height);
  const { cell, left, top } = frame;
  const text = (words, x, y, more) => drawText(context, words, x, y, { align: 'center', base: 'middle', pixels: 11, ...more });
  data.values.forEach((row, i) => row.forEach((value, j) => {
    context.fillStyle = heightColour(value);
    context.fillRect(left + j * cell, top + i * cell, Math.max(1, cell - 1), Math.max(1, cell - 1));
    if (cell >= 34) text(value.toFixed(2), left + (j + 0.5) * cell, top + (i + 0.5) * cell, { colour: palette().ink });
  }));
  const every = Math.max(1, Math.ceil(15 / cell));
  data.rows.forEach((_, i) => {
    if (i % every === 0) text(String(i + 1), left - 6, top + (i + 0.5) * cell, { align: 'right' });
  });
  data.columns.forEach((_, j) => {
    if (j % every === 0) text(String(j + 1), left + (j + 0.5) * cell, top + frame.height + 10);
  });
  text(data.columnTitle, left + frame.width / 2, top + frame.height + 27);
}

function macAt(mac, event) {
  const data = mac.get(mac.kind);
  const frame = macFrame(data, mac.figure.node.clientWidth, mac.figure.node.clientHeight);
  const column = Math.floor((event.offsetX - frame.left) / frame.cell);
  const row = Math.floor((event.offsetY - frame.top) / frame.cell);
  const value = data.values[row] && data.values[row][column];
  return isNumber(value) ? data.rowTitle + ' ' + (row + 1) + ' (' + data.rows[row] + ' Hz), ' + data.columnTitle + ' ' + (column + 1) + ' (' +
    data.columns[column] + ' Hz): ' + value.toFixed(3) : '';
}

function macTable(data) {
  return table([data.rowTitle + ' [Hz]', ...data.columns],
    data.values.map((row, i) => [rowHead(data.rows[i]), ...row.map((value) => (isNumber(value) ? value.toFixed(2) : '\u2013'))]));
}
