// Text and elements. Names and texts are external: they are only used as text nodes.

// element('p', {class: 'x', onclick: f}, 'text', child, ...)
function element(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? '' : value);
  }
  for (const child of children) if (child !== null && child !== undefined) node.append(child);
  return node;
}

function isNumber(value) {
  return typeof value === 'number' && Number.isFinite(value);
}

const superscripts = { '-': '\u207b' };
Array.from('\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079').forEach((c, i) => { superscripts[i] = c; });

function powerOfTen(exponent) {
  return '10' + Array.from(String(exponent), (c) => superscripts[c]).join('');
}

// 0.00012345 -> "1.23 x 10^-4", 1234.5 -> "1235": `digits` significant digits.
function number(value, digits = 3) {
  if (!isNumber(value)) return '\u2013';
  if (value === 0) return '0';
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -4 || exponent > 5) {
    const [mantissa, power] = value.toExponential(digits - 1).split('e');
    return mantissa.replace('-', '\u2212') + '\u00a0\u00d7\u00a0' + powerOfTen(Number(power));
  }
  return value.toFixed(Math.max(0, digits - 1 - exponent)).replace('-', '\u2212');
}

function percent(value, digits = 2) {
  if (!isNumber(value)) return '\u2013';
  const text = Number((100 * value).toPrecision(digits));
  return (Math.abs(text) < 1e-3 && text !== 0 ? number(text, digits) : String(text)) + '\u00a0%';
}

// In standard deviations, signed: "+1.3".
function deviations(value) {
  if (!isNumber(value)) return '\u2013';
  const text = Math.abs(value).toFixed(1);
  return (text === '0.0' ? '' : value < 0 ? '\u2212' : '+') + text;
}

function hertz(value) {
  if (!isNumber(value)) return '\u2013';
  return value >= 1000 ? number(value / 1000, 4).replace(/\.?0+$/, '') + '\u00a0kHz'
                       : String(Number(value.toPrecision(4))) + '\u00a0Hz';
}

function bandName(band) {
  return band.map(hertz).join(' \u2013 ');
}

function duration(seconds) {
  if (!isNumber(seconds)) return '\u2013';
  if (seconds === 0) return '0\u00a0s';
  if (seconds < 1e-3) return number(1e6 * seconds, 3) + '\u00a0\u00b5s';
  if (seconds < 1) return number(1e3 * seconds, 3) + '\u00a0ms';
  if (seconds < 120) return number(seconds, 3) + '\u00a0s';
  const minutes = Math.floor(seconds / 60);
  if (minutes < 120) return minutes + '\u00a0min ' + Math.round(seconds - 60 * minutes) + '\u00a0s';
  return Math.floor(minutes / 60) + '\u00a0h ' + (minutes % 60) + '\u00a0min';
}

function count(value) {
  return String(value).replace(/\B(?=(\d{3})+(?!\d))/g, '\u202f');
}

function plural(n, noun) {
  return count(n) + ' ' + noun + (n === 1 ? '' : 's');
}

// At most that many characters.
function shortened(text, most) {
  return text.length > most ? text.slice(0, most - 1) + '\u2026' : text;
}

// A count that is emphasized unless it is zero.
function flagged(value) {
  return element('span', { class: value > 0 ? 'far' : null }, count(value));
}

function smallButton(text, name, onclick, title = name) {
  return element('button', { type: 'button', class: 'plain small', 'aria-label': name, title, onclick }, text);
}

// Calls change(), which replaces controls within find(); the focus stays at its place among them.
function keepFocus(find, change) {
  const controls = () => Array.from(find() ? find().querySelectorAll('button, select, input') : []);
  const place = controls().indexOf(document.activeElement);
  change();
  const next = place < 0 ? null : controls().slice(0, place + 1).pop();
  if (next) next.focus({ preventScroll: true });
}

// A section of the page with its entry in the contents; returns the body to fill.
function section(id, short, title, lead) {
  const node = element('section', { id, 'aria-labelledby': id + '-title' },
    element('h2', { id: id + '-title' }, title),
    lead ? element('p', { class: 'lead' }, lead) : null);
  document.getElementById('main').append(node);
  document.getElementById('contents').append(element('a', { href: '#' + id }, short));
  return node;
}

// Pairs [label, value], with a text or an element as value.
function described(pairs) {
  return pairs.map(([label, value]) => element('div', null, element('dt', null, label), element('dd', null, value)));
}

// A list of those pairs that have a value.
function facts(pairs) {
  return element('dl', { class: 'facts' }, ...described(pairs.filter(([, value]) => value !== null && value !== undefined && value !== '')));
}

// A table that scrolls by itself. Heads are titles or elements, rows are lists of texts or elements.
function table(heads, rows, caption, kind) {
  const head = heads.map((title) => (typeof title === 'string' ? element('th', { scope: 'col' }, title) : title));
  const node = element('div', { class: 'table-scroll', tabindex: '0' }, element('table', { class: kind }, caption ? element('caption', null, caption) : null,
    heads.length ? element('thead', null, element('tr', null, ...head)) : null, element('tbody', null, ...rows.map((cells) => tableRow(cells)))));
  overflowing.observe(node);
  return node;
}

// What is too large for its place is scrolled with the keyboard, so it can have the focus; what fits loses it once its size is known.
const overflowing = new ResizeObserver((seen) => {
  for (const { target } of seen) target.tabIndex = target.scrollWidth > target.clientWidth || target.scrollHeight > target.clientHeight ? 0 : -1;
});

function tableRow(cells, kind) {
  return element('tr', { class: kind }, ...cells.map((cell) => (['TD', 'TH'].includes(cell.tagName) ? cell : element('td', null, cell))));
}

// The head of a row.
function rowHead(text, kind) {
  return element('th', { scope: 'row', class: kind }, text);
}
