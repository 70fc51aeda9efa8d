// Lists of figures, and tables that a click sorts.

function figureList(figures) {
  return element('dl', { class: 'figures' }, ...described(figures));
}

// Columns: [title, sort key of a row, cell of a row]. A click on a title sorts by it.
function sortableTable(columns, rows) {
  const heads = columns.map(([title], i) => element('th', { scope: 'col', 'aria-sort': 'none' },
    element('button', { type: 'button', onclick: () => sort(i) }, title)));
  const node = table(heads, []);
  let sorted = -1;
  let up = true;
  const fill = (list) => node.querySelector('tbody').replaceChildren(
    ...list.map((row) => tableRow(columns.map(([, , cell]) => cell(row)), row.rowClass)));
  const sort = (i) => {
    up = sorted === i ? !up : true;
    sorted = i;
    const key = columns[i][1];
    const list = rows.slice().sort((a, b) => {
      const x = key(a), y = key(b);
      if (!isNumber(x) || !isNumber(y)) return Number(isNumber(y)) - Number(isNumber(x));
      return up ? x - y : y - x;
    });
    heads.forEach((head, j) => head.setAttribute('aria-sort', j === i ? (up ? 'ascending' : 'descending') : 'none'));
    fill(list);
  };
  fill(rows);
  return node;
}

function fixed(value) {
  return isNumber(value) ? value.toFixed(value >= 1000 ? 3 : 4) : '\u2013';
}

// An element, or a text as it is, folded under its title.
function folded(title, what) {
  return element('details', null, element('summary', null, title), typeof what === 'string' ? element('pre', null, what) : what);
}
