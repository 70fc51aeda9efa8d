// The visible part of the band, common to the whole page. A change of it updates all figures.

const band = { low: null, high: null, telling: false, followers: [] };

const leastLines = 4;  // minimum after a zoom

function wholeBand() {
  const f = array('frequency');
  return [f[0], f[f.length - 1]];
}

function shownBand() {
  const [low, high] = wholeBand();
  return band.low === null ? [low, high] : [Math.max(low, band.low), Math.min(high, band.high)];
}

function isWholeBand() {
  const [low, high] = wholeBand();
  const shown = shownBand();
  return shown[0] <= low * (1 + 1e-9) && shown[1] >= high * (1 - 1e-9);
}

// Registers follower(low, high), called after another part of the page was zoomed or panned.
function followBand(follower) {
  band.followers.push(follower);
}

function setBand(low, high) {
  if (band.telling || !(high > low)) return;
  const [least, most] = wholeBand();
  const next = [Math.max(least, low), Math.min(most, high)];
  const before = shownBand();
  if (!(next[1] > next[0]) || linesBetween(...next) < Math.min(leastLines, array('frequency').length)) return;
  if (Math.abs(next[0] / before[0] - 1) < 1e-12 && Math.abs(next[1] / before[1] - 1) < 1e-12) return;
  [band.low, band.high] = next;
  tellBand();
}

function resetBand() {
  band.low = band.high = null;
  tellBand();
}

function tellBand() {
  band.telling = true;
  try {
    for (const follower of band.followers) follower(...shownBand());
    for (const plot of plots) if (plot.followsBand) showBandIn(plot);
  } finally {
    band.telling = false;
  }
}

function linesBetween(low, high) {
  const [first, last] = bandLines(low, high);
  return Math.max(0, last - first + 1);
}

// The first line whose frequency is wanted, as are all above it: by bisection.
function firstLine(wanted) {
  const f = array('frequency');
  let from = 0, to = f.length;
  while (from < to) {
    const middle = (from + to) >> 1;
    if (wanted(f[middle])) to = middle;
    else from = middle + 1;
  }
  return from;
}

// First and last line within the band.
function bandLines(low, high) {
  return [firstLine((f) => f >= low), firstLine((f) => f > high) - 1];
}

// The line at that frequency, else the next one, else the last.
function lineFrom(hz) {
  return Math.min(array('frequency').length - 1, firstLine((f) => f >= hz));
}

// Scales the band about its centre (factor) and shifts it (shift, in widths); the axis is logarithmic.
function moveBand(factor, shift) {
  const [low, high] = shownBand().map(Math.log);
  const [least, most] = wholeBand().map(Math.log);
  const width = Math.min((high - low) * factor, most - least);
  const middle = (low + high) / 2 + shift * (high - low);
  const from = Math.min(Math.max(least, middle - width / 2), most - width);
  if (width >= (most - least) * (1 - 1e-9)) resetBand();
  else setBand(Math.exp(from), Math.exp(from + width));
}

const bandKeys = { '+': [0.5, 0], '=': [0.5, 0], '-': [2, 0], PageUp: [1, 0.25], PageDown: [1, -0.25] };

// Keys for zoom and pan in every figure that has the focus. @returns true if the key was one of them.
function bandKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  if (event.key === 'Home') resetBand();
  else if (bandKeys[event.key]) moveBand(...bandKeys[event.key]);
  else return false;
  event.preventDefault();
  return true;
}

function bandText() {
  const digits = (hz) => {
    const [low, high] = shownBand();
    return hertz(Number(hz.toPrecision(Math.min(9, Math.max(4, 2 + Math.ceil(Math.log10(hz / (high - low))))))));
  };
  return shownBand().map(digits).join(' \u2013 ');
}

function bandBar() {
  const text = element('output', { class: 'band-text', 'aria-live': 'polite' }, bandText());
  followBand(() => { text.textContent = bandText(); });
  return element('div', { class: 'band-bar', role: 'group', 'aria-label': 'Visible band of all plots' },
    smallButton('\u25c2', 'To lower frequencies', () => moveBand(1, -0.5)), smallButton('\u25b8', 'To higher frequencies', () => moveBand(1, 0.5)),
    smallButton('+', 'Zoom in', () => moveBand(0.5, 0)), smallButton('\u2212', 'Zoom out', () => moveBand(2, 0)),
    element('button', { type: 'button', class: 'plain small', onclick: resetBand }, 'Whole band'), text);
}

// The element of a dygraph whose keys zoom and pan; `name` is its aria-label or aria-labelledby.
function bandPlot(id, kind, name) {
  return element('div', { class: 'plot ' + kind, id, role: 'img', tabindex: '0', onkeydown: bandKey, ...name });
}

// Options that connect a dygraph to the band: its zooms and pans apply to all figures.
function tiedToBand() {
  return {
    dateWindow: shownBand(),
    drawCallback: (graph, first) => { if (!first) setBand(...graph.xAxisRange()); },
  };
}

function showBandIn(graph) {
  const [low, high] = graph.xAxisRange();
  const shown = shownBand();
  if (Math.abs(low / shown[0] - 1) > 1e-12 || Math.abs(high / shown[1] - 1) > 1e-12) graph.updateOptions({ dateWindow: shown });
}
