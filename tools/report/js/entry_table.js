// The numbers of the chosen element in the visible band as a table: for screen readers, and for copying.

const entryTable = { details: null, body: null };

const mostRows = 200;  // zoom to see the rest

function buildEntryTable() {
  entryTable.body = element('div');
  entryTable.details = element('details', { id: 'entry-table', ontoggle: fillEntryTable }, element('summary', null, 'Values in the visible band'), entryTable.body);
  return entryTable.details;
}

function fillEntryTable() {
  if (!entryTable.details || !entryTable.details.open) return;
  const [first, last] = bandLines(...shownBand());
  const { columns, row } = entryColumns(entry.channel);
  const rows = Array.from({ length: Math.min(mostRows, last - first + 1) }, (_, i) => row(first + i));
  const left = last - first + 1 - rows.length;
  entryTable.body.replaceChildren(table(columns, rows,
    channelName(entry.channel) + ', ' + bandText() + (left > 0 ? '; zoom in to see the other ' + plural(left, 'line') : '')));
}

function entryColumns(channel) {
  const f = array('frequency');
  const scale = lineScale();
  const curves = channelCurves(channel);
  const phase = channelPhases(channel);
  const magnitude = (values) => (k) => number(values[k] * (scale ? scale[k] : 1), 5);
  const degrees = (values) => (k) => number(values[k], 4) + '\u00b0';
  const parts = [['f [Hz]', (k) => number(f[k], 7)], ['|G|', magnitude(curves.measured)], ['phase of G', degrees(phase.measured)]];
  if (curves.model) parts.push(['|P|', magnitude(curves.model)], ['phase of P', degrees(phase.model)]);
  if (curves.residual) parts.push(['|G\u2212P|', magnitude(curves.residual)]);
  if (curves.deviation) parts.push(['\u03c3', magnitude(curves.deviation)]);
  return { columns: parts.map(([title]) => title), row: (k) => parts.map(([, text]) => text(k)) };
}
