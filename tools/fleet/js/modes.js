// The modes of one stage over time: all of them as relative changes, or one in hertz.

const over = { stage: null, shown: new Set(), graph: null };

function buildModes() {
  const body = section('modes', 'Modes over time', 'Modes over time',
    'Bands: 95\u00a0%, from the standard deviations of the fits. Change: relative to the median of the mode. A click opens the report of that day.');
  over.pickStage = element('select', { id: 'stage', 'aria-label': 'Stage', onchange: () => showStage(Number(over.pickStage.value)) },
    ...content.stages.map((stage, i) => element('option', { value: i }, stage.name)));
  over.pickMode = element('select', { id: 'mode', 'aria-label': 'Mode', onchange: drawModes });
  over.legend = element('div', { class: 'legend' });
  over.title = element('p', { class: 'plot-title' });
  over.values = element('p', { class: 'quiet', id: 'shown-values', role: 'status' });
  over.table = element('div');
  body.append(element('div', { class: 'entry-pick' }, over.pickStage, over.pickMode,
    saveButtons('modes over time', () => ({ title: over.stage.name + ': ' + over.title.textContent, panels: [graphPanel(over.graph)],
      legend: shownTracks().map((track) => [modeName(track), colourOf(track)]) }))),
  over.legend, over.title, element('div', { class: 'plot tall', id: 'modes-plot', role: 'img', 'aria-label': 'Modes over time' }), over.values, over.table);
}

function showStage(index) {
  over.pickStage.value = String(index);
  over.stage = content.stages[index];
  over.values.textContent = '';
  over.pickMode.replaceChildren(element('option', { value: '' }, 'all modes'),
    ...over.stage.tracks.map((track, i) => element('option', { value: i }, modeName(track))));
  over.shown = new Set(over.stage.tracks);
  over.legend.replaceChildren(...over.stage.tracks.map(legendButton));
  over.table.replaceChildren(modeTable(over.stage));
  drawModes();
}

function legendButton(track) {
  const button = element('button', { type: 'button', class: 'swatch', 'aria-pressed': 'true', style: '--colour:' + colourOf(track),
    onclick: () => {
      if (!over.shown.delete(track)) over.shown.add(track);
      button.setAttribute('aria-pressed', String(over.shown.has(track)));
      drawModes();
    } }, hertz(track.frequency_hz));
  return button;
}

function colourOf(track) {
  const { curves } = palette();
  return curves[over.stage.tracks.indexOf(track) % curves.length];
}

function shownTracks() {
  if (over.pickMode.value !== '') return [over.stage.tracks[Number(over.pickMode.value)]];
  return over.stage.tracks.filter((track) => over.shown.has(track));
}

function drawModes() {
  removeGraph(over.graph);
  over.graph = null;
  const { stage } = over;
  const tracks = shownTracks();
  const relative = over.pickMode.value === '';
  over.legend.style.display = relative ? '' : 'none';
  over.title.textContent = relative ? 'Change of the frequency [%]' : 'Frequency [Hz]';
  if (tracks.length === 0 || stage.count === 0) return;
  const scaled = (track, pair) => pair && (relative ? [100 * (pair[0] / track.frequency_hz - 1), 100 * pair[1] / track.frequency_hz] : pair);
  const columns = tracks.map((track) => valuesOf(stage, track).map((pair) => scaled(track, pair)));
  const rows = Array.from({ length: stage.count }, (_, i) => [timeOf(stage.first + i), ...columns.map((column) => column[i])]);
  const labels = ['time', ...tracks.map(modeName)];
  const series = () => Object.fromEntries(tracks.map((track) => [modeName(track), { color: colourOf(track), plotter: seriesPlotter(true) }]));
  over.graph = makeGraph('modes-plot', rows, series, {
    labels, errorBars: true, sigma: 1.96, labelsUTC: true, drawPoints: stage.count < 40, pointSize: 2, xRangePad: 6,
    axes: { y: { axisLabelWidth: 58 } },
    highlightCallback: (event, x, points, row) => tellDay(stage, row, points, relative),
    clickCallback: (event, x, points) => openReport(stage.first + points[0].idx),
  });
}

function tellDay(stage, row, points, relative) {
  const one = points.length === 1;
  over.values.replaceChildren(reportLink(stage.first + row), ': ' + (one
    ? points[0].name + ': ' + number(points[0].yval, 6) + (relative ? '\u00a0%' : '\u00a0Hz')
    : plural(points.length, 'mode')));
}

function openReport(identification) {
  const address = reportOf(identification);
  if (address) element('a', { href: address, target: '_blank', rel: 'noopener' }).click();
}

function modeTable(stage) {
  const rows = stage.tracks.map((track) => ({ ...track, share: track.seen / stage.count }));
  return sortableTable([
    ['mode', (row) => row.mode, (row) => String(row.mode)],
    ['median f\u2080 [Hz]', (row) => row.frequency_hz, (row) => fixed(row.frequency_hz)],
    ['spread over time [%]', (row) => row.spread_hz / row.frequency_hz, (row) => number(100 * row.spread_hz / row.frequency_hz, 2)],
    ['\u03b6 [%]', (row) => row.damping_ratio, (row) => number(100 * row.damping_ratio, 3)],
    ['identified', (row) => row.share, (row) => percent(row.share, 3)],
    ['against other stages [\u03c3]', (row) => row.deviation, deviationFromStages],
  ], rows);
}

function deviationFromStages(row) {
  return element('span', { class: Math.abs(row.deviation) > farFromStages ? 'far' : null }, deviations(row.deviation));
}
