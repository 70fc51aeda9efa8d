// One mode on all stages, and the list of the stages.

const among = { graph: null };
const farFromStages = 4;  // standard deviations

function buildStages() {
  const body = section('stages', 'Stages', 'Stages against each other',
    'Median of the frequency of one mode on each stage, with 1.96 standard deviations of its changes over time. A click shows the stage above.');
  among.modes = modesOfStages();
  among.pick = element('select', { id: 'stages-mode', 'aria-label': 'Mode', onchange: drawStages },
    ...among.modes.map((mode, i) => element('option', { value: i }, 'mode ' + mode.number + ', ' + hertz(mode.frequency_hz) + ', ' + plural(mode.tracks.length, 'stage'))));
  among.values = element('p', { class: 'quiet', role: 'status' });
  body.append(element('div', { class: 'entry-pick' }, among.pick,
    saveButtons('stages', () => ({ title: 'Stages: ' + among.pick.selectedOptions[0].textContent, panels: [graphPanel(among.graph)] }))),
  element('p', { class: 'plot-title' }, 'Frequency [Hz]'),
  element('div', { class: 'plot', id: 'stages-plot', role: 'img', 'aria-label': 'Stages against each other' }), among.values, stageTable());
  afterFirstPaint(drawStages);
}

function modesOfStages() {
  const modes = new Map();
  content.stages.forEach((stage, index) => {
    for (const track of stage.tracks) {
      if (!modes.has(track.mode)) modes.set(track.mode, { number: track.mode, tracks: [] });
      modes.get(track.mode).tracks.push({ index, track });
    }
  });
  const middle = (values) => values.sort((a, b) => a - b)[values.length >> 1];
  for (const mode of modes.values()) mode.frequency_hz = middle(mode.tracks.map(({ track }) => track.frequency_hz));
  return Array.from(modes.values()).sort((a, b) => a.number - b.number);
}

function drawStages() {
  removeGraph(among.graph);
  const mode = among.modes[Number(among.pick.value)];
  if (!mode) return;
  const rows = mode.tracks.map(({ index, track }) => [index + 1, [track.frequency_hz, track.spread_hz], null]);
  mode.tracks.forEach(({ track }, i) => { if (Math.abs(track.deviation) > farFromStages) rows[i][2] = rows[i][1]; });
  const label = (v) => (Number.isInteger(v) && content.stages[v - 1] ? xmlEscape(shortened(content.stages[v - 1].name, 12)) : '');  // dygraphs takes HTML
  const series = () => ({ stage: { color: palette().curves[0], plotter: drawBars }, outlier: { color: palette().marker, plotter: drawBars } });
  among.graph = makeGraph('stages-plot', rows, series, {
    labels: ['number', 'stage', 'outlier'], errorBars: true, sigma: 1.96, xRangePad: 14, yRangePad: 14,
    axes: { x: { ticker: (min, max, pixels) => linearTicks(min, max, Math.max(2, pixels / 90), label) }, y: { axisLabelWidth: 58 } },
    highlightCallback: (event, x, points, row) => { among.values.textContent = stageText(mode.tracks[row]); },
    clickCallback: (event, x, points) => {
      showStage(mode.tracks[points[0].idx].index);
      document.getElementById('modes').scrollIntoView({ behavior: 'auto', block: 'start' });
    },
  });
}

function stageText({ index, track }) {
  return content.stages[index].name + ': ' + fixed(track.frequency_hz) + '\u00a0Hz' +
    (isNumber(track.deviation) ? ', ' + deviations(track.deviation) + ' standard deviations from the median of the stages' : '');
}

// A point with a vertical bar per value.
function drawBars(event) {
  const context = event.drawingContext;
  const { plotArea: area, points } = event;
  context.strokeStyle = context.fillStyle = event.color;
  context.lineWidth = 1.3;
  for (const point of points) {
    if (!Number.isFinite(point.yval)) continue;
    drawLine(context, point.canvasx, area.y + point.y_top * area.h, point.canvasx, area.y + point.y_bottom * area.h);
    circle(context, point.canvasx, point.canvasy, 2.6);
    context.fill();
  }
}

function stageTable() {
  const outliers = new Map();
  for (const [identification, , unusual] of content.outliers) {
    if (!unusual) continue;
    const stage = stageOf(identification);
    outliers.set(stage, (outliers.get(stage) || 0) + 1);
  }
  const rows = content.stages.map((stage, index) => ({ ...stage, index, unusual: outliers.get(stage) || 0,
    far: stage.tracks.filter((track) => Math.abs(track.deviation) > farFromStages).length }));
  const counted = (title, key) => [title, (row) => row[key], (row) => flagged(row[key])];
  const show = (row) => element('button', { type: 'button', class: 'plain number', title: 'Show its modes', onclick: () => {
    showStage(row.index);
    document.getElementById('modes').scrollIntoView({ behavior: 'auto', block: 'start' });
  } }, row.name);
  const list = sortableTable([
    ['stage', (row) => row.index, show],
    ['identifications', (row) => row.count, (row) => count(row.count)],
    ['modes', (row) => row.tracks.length, (row) => count(row.tracks.length)],
    counted('modes unlike other stages', 'far'), counted('unusual', 'unusual'), counted('not trustworthy', 'doubtful'), counted('failed', 'failed'),
  ], rows);
  return rows.length > 30 ? folded(plural(rows.length, 'stage'), list) : list;
}
