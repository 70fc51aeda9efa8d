// check_report.py appends this file to the script of a page, because the functions of the page are local to its script.
// The promise window.selfTest resolves to the findings as JSON.

window.selfTest = selfTest().finally(() => { window.selfTestEnded = true; });

function delay(ms) {
  return new Promise((done) => setTimeout(done, ms));
}

async function selfTest() {
  const { errors } = window.stageidReport;
  while (!window.stageidReport.shapes) {  // until the page is built
    if (errors.length) throw new Error(errors.join('; '));
    await delay(20);
  }
  await new Promise(afterFirstPaint);
  await delay(100);  // figures are drawn when they get their size
  const findings = {
    title: document.title, verdict: content.verdict.level, sections: Array.from(document.querySelectorAll('main > section'), (s) => s.id),
    width: window.innerWidth, overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    injected: document.querySelectorAll('main img, main iframe, main script, header img, header script, [onerror]').length,
  };
  if (content.frf) {
    matrix.panels.forEach((_, channel) => drawPanel(channel));
    const seen = Array.from(matrix.panels.values(), (panel) => pixelsOf(panel.canvas));
    Object.assign(findings, {
      panels: matrix.panels.size, panels_with_ink: seen.filter(hasInk).length,
      panels_with_peak: seen.filter((pixels, channel) => showsPeak(channel, pixels)).length,
      panel_sizes: smallestPanel(), arrays: Object.fromEntries(Object.keys(content.arrays).map((id) => [id, summaryOf(array(id))])),
      entries: Array.from(matrix.panels.keys(), entrySummary),
    });
  }
  findings.plots = Object.fromEntries(Array.from(document.querySelectorAll('.plot'), (plot) => [plot.id, inkOf(plot)]));
  findings.rows = Object.fromEntries(Array.from(document.querySelectorAll('section'), (s) => [s.id, s.querySelectorAll('tbody tr').length]));
  if (content.frf) Object.assign(findings, { zoom: zoomCheck(), use: useCheck(), nyquist: nyquistCheck(), drag: dragCheck(), table: tableCheck() });
  findings.diagrams = diagramCheck();
  findings.correlated = Array.from(document.querySelectorAll('#interpolation p, .correlated, #provenance dd'), (node) => node.textContent).join(' | ');
  if (content.comparison) findings.comparison = { ...content.comparison, rows: document.querySelectorAll('#comparison .compared > div:first-child tbody tr').length };
  if (content.shapes) findings.shapes = shapesCheck();
  findings.saved = savedCheck();
  findings.timed_cycles = Array.from(document.querySelectorAll('.histogram .step-time'), (cell) => Number(cell.textContent.replace(/\u202f/g, '')))
    .reduce((a, b) => a + b, 0);
  findings.errors = errors;
  return JSON.stringify(findings);
}

// Once per canvas: browsers warn about more.
function pixelsOf(canvas) {
  const { width, height } = canvas;
  return width > 0 && height > 0 ? canvas.getContext('2d').getImageData(0, 0, width, height) : null;
}

function hasInk(pixels) {
  return pixels !== null && new Set(new Uint32Array(pixels.data.buffer)).size > 8;
}

// The highest line of the acceleration must be visible in the panel, however many lines share its pixel.
function showsPeak(channel, pixels) {
  const f = array('frequency');
  const { measured } = channelCurves(channel);
  let peak = 0;
  for (let k = 1; k < f.length; ++k) if (measured[k] * f[k] * f[k] > measured[peak] * f[peak] * f[peak]) peak = k;
  const { canvas } = matrix.panels.get(channel);
  const frame = panelFrame(canvas.clientWidth, canvas.clientHeight);
  const ratio = canvas.width / canvas.clientWidth;
  const x = Math.min(canvas.width - 2, frame.x(Math.log10(f[peak])) * ratio);
  const y = frame.y(Math.log10(measured[peak])) * ratio;
  for (let row = Math.round(y) - 1; row <= Math.round(y) + 1; ++row) {
    for (let column = Math.round(x) - 2; column < Math.round(x) + 2; ++column) {
      const [red, green, blue, alpha] = pixels.data.subarray(4 * (row * canvas.width + column));
      if (alpha > 100 && Math.max(red, green, blue) - Math.min(red, green, blue) > 40) return true;  // not the grey grid
    }
  }
  return false;
}

function inkOf(plot) {
  return Array.from(plot.querySelectorAll('canvas'), pixelsOf).some(hasInk);
}

function smallestPanel() {
  const panels = Array.from(matrix.panels.values());
  const widths = panels.map((panel) => panel.canvas.clientWidth);
  const heights = panels.map((panel) => panel.canvas.clientHeight);
  return { width: Math.min(...widths), height: Math.min(...heights) };
}

// Detects wrong order, sign, scale or type: count, extremes, and a sum weighted by index.
function summaryOf(values) {
  let low = Infinity, high = -Infinity, weighted = 0;
  values.forEach((v, i) => {
    low = Math.min(low, v);
    high = Math.max(high, v);
    weighted += v * ((i % 1009) + 1);
  });
  return { count: values.length, low, high, weighted, first: values[0], last: values[values.length - 1] };
}

// Content of the large plot: the traces and the extremes of each.
function entrySummary(channel) {
  const table = magnitudeTable(channel);
  const phase = phaseTable(channel);
  const extremes = table.names.map((name, i) => {
    const values = table.rows.map((row) => row[i + 1][1]);
    return [name, { low: values.reduce((a, b) => Math.min(a, b)), high: values.reduce((a, b) => Math.max(a, b)) }];
  });
  return { traces: table.names, phases: phase.names, lines: table.rows.length, extremes: Object.fromEntries(extremes) };
}

// A zoom of the magnitude must move all the others, and back.
function zoomCheck() {
  const f = array('frequency');
  const ranges = () => ({ magnitude: entry.magnitude.xAxisRange(), phase: entry.phase.xAxisRange(), matrix: matrixBand(), ...(cmif.graph ? { cmif: cmif.graph.xAxisRange() } : {}) });
  const matrixBand = () => {
    redrawMatrix();
    const frame = panelFrame(100, 100);
    return [10 ** frame.x0, 10 ** frame.x1];
  };
  const whole = ranges();
  const asked = [f[Math.floor(f.length / 4)], f[Math.floor(f.length / 2)]];
  entry.magnitude.updateOptions({ dateWindow: asked });
  const zoomed = { ranges: ranges(), points: nyquist.shown.points.length, wanted: Math.floor(f.length / 2) - Math.floor(f.length / 4) + 1 };
  document.getElementById('entry-phase').dispatchEvent(new KeyboardEvent('keydown', { key: 'Home', bubbles: true }));
  return { asked, ...zoomed, whole, restored: ranges() };
}

// The table of the last ten lines must contain their numbers, to its five digits.
function tableCheck() {
  const f = array('frequency');
  entryTable.details.open = true;
  setBand(f[f.length - 10], f[f.length - 1]);
  fillEntryTable();
  const cells = Array.from(entryTable.body.querySelectorAll('tbody tr'), (row) => Array.from(row.children, (cell) => cell.textContent));
  const { measured } = channelCurves(entry.channel);
  const right = cells.every(([hz, g], i) => hz === number(f[f.length - 10 + i], 7) && g === number(measured[f.length - 10 + i], 5));
  resetBand();
  entryTable.details.open = false;
  return { rows: cells.length, right };
}

// A drag over the right half of the first panel must show the upper half of the (logarithmic) band everywhere.
function dragCheck() {
  const { button } = matrix.panels.get(0);
  const box = button.getBoundingClientRect();
  const at = (share) => ({ clientX: box.left + share * box.width, clientY: box.top + 5, bubbles: true, pointerType: 'mouse', button: 0 });
  button.dispatchEvent(new PointerEvent('pointerdown', at(0.5)));
  window.dispatchEvent(new PointerEvent('pointermove', at(0.8)));
  window.dispatchEvent(new PointerEvent('pointerup', at(1)));
  const got = shownBand();
  button.dispatchEvent(new KeyboardEvent('keydown', { key: '+', bubbles: true }));
  const nearer = shownBand();
  resetBand();
  return { got, nearer, whole: wholeBand() };
}

// The points, circles and model of the first and the last element, over the whole band.
function nyquistCheck() {
  const flat = (points) => points.flatMap((p) => [p.re, p.im]);
  return [0, channelCount() - 1].map((channel) => {
    const { points, model } = nyquistData(channel, ...wholeBand());
    return { channel, measured: summaryOf(flat(points)), model: model.length ? summaryOf(flat(model)) : null, radius: summaryOf(points.map((p) => p.radius)) };
  });
}

// Content of the diagrams: symbols counted in the files that would be saved.
function diagramCheck() {
  const symbols = (name, fill) => (savable.has(name) ? svgOf(name).text.split('fill="' + fill + '"').length - 1 : 0);
  const severity = document.querySelector('.findings .severity');
  return {
    stabilization: { poles: content.stabilization || [], drawn: symbols('stabilization diagram', palette().curves[0]) },
    distorted: symbols('nonlinear distortions', palette().marker), distortion_text: content.nonlinearity ? distortionSummary() : '',
    loops: document.querySelectorAll('#loop tbody tr').length, loop_margin: (document.querySelector('#loop tbody td:nth-child(2)') || {}).textContent,
    loop_discs: savable.has('loop Nyquist') ? svgOf('loop Nyquist').text.split('opacity="0.12"').length - 1 : 0,
    findings: document.querySelectorAll('.findings tbody tr').length,
    first_finding: severity && severity.textContent,
  };
}

// The numbers of shapes and MACs; and the distance of the surface from a plane and from given values.
function shapesCheck() {
  const corners = [[-0.5, -0.5], [0.5, -0.4], [0.4, 0.5], [-0.5, 0.4], [0.1, 0]];
  const plane = plateThrough(corners, corners.map(([x, y]) => 1 + 2 * x - 3 * y));
  const values = [1, -1, 0.5, 2, 0.3];
  const exact = plateThrough(corners, values, 0);
  return {
    ...content.shapes, places: shapes.scene.placed.length, surface: Boolean(shapes.scene.grid), text: shapes.text.textContent,
    plane_error: Math.abs(plane(0.2, 0.3) - (1 + 0.4 - 0.9)), meet_error: Math.max(...corners.map(([x, y], i) => Math.abs(exact(x, y) - values[i]))),
    on_a_line: plateThrough([[0, 0], [1, 1], [2, 2], [3, 3]], [1, 2, 3, 4], 0) === null,
  };
}

// Every figure as a file: SVG that can be parsed and has valid numbers only, non-empty PNG; the peak must be at the
// right place.
function savedCheck() {
  const saved = {};
  for (const name of savable.keys()) {
    const { text, width, height } = svgOf(name);
    const file = new DOMParser().parseFromString(text, 'image/svg+xml');
    const png = pngOf(name, 1);
    saved[name] = {
      bytes: text.length, width, height, broken: Boolean(file.querySelector('parsererror')) || /NaN|Infinity|undefined/.test(text.replace(/<text.*?<\/text>|<title>.*?<\/title>/gs, '')),
      marks: file.querySelectorAll('path, text').length, ink: hasInk(pixelsOf(png)), png: [png.width, png.height],
    };
  }
  if (saved.element) saved.element.peak = savedPeak();
  return saved;
}

// Height of the highest point of the measured trace in the file, and the height expected from its magnitude.
function savedPeak() {
  const file = new DOMParser().parseFromString(svgOf('element').text, 'image/svg+xml');
  const heights = Array.from(file.querySelectorAll('path[stroke-width="3.2"]')).slice(0, 1)
    .flatMap((path) => Array.from(path.getAttribute('d').matchAll(/[ML]\S+ (\S+?)(?=[MLZ]|$)/g), (m) => Number(m[1])));
  const most = Math.max(...magnitudeTable(entry.channel).rows.map((row) => row[1][1]));
  const [low, high] = entry.magnitude.yAxisRange();
  const area = entry.magnitude.getArea();
  const top = savedMargin + 22 + 24 + 20 + area.y;
  return { found: Math.min(...heights), wanted: top + area.h * Math.log(high / most) / Math.log(high / low) };
}

// Actions of a reader: choose a panel, move with the keys, hide a trace, multiply by omega squared.
function useCheck() {
  const last = channelCount() - 1;
  const title = document.getElementById('entry-title');
  const use = { last: channelName(last) };
  matrix.panels.get(last).button.click();
  use.clicked = title.textContent;
  selectPanel(0);
  matrix.panels.get(0).button.focus();
  matrix.panels.get(0).button.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true, cancelable: true }));
  use.walked = Number(document.activeElement.dataset.channel);
  toggleTrace('measured');
  const only = entry.order.length === 1;
  use.hidden = entry.magnitude.visibility()[0] === only && entry.phase.visibility()[0] === only;
  if (!only) toggleTrace('measured');
  const before = magnitudeTable(0).rows[0][1][1];
  document.getElementById('times-omega').click();
  use.scaled = magnitudeTable(0).rows[0][1][1] / before / (2 * Math.PI * array('frequency')[0]) ** 2;
  document.getElementById('times-omega').click();
  return use;
}
