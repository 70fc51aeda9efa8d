// Animated mode shapes at the positions of actuators and sensors; bars if no positions are known.

const shapes = { index: 0, phase: 0, turn: -0.6, playing: false, visible: false, frames: 0, figure: null, scene: null };

const reducedMotion = window.matchMedia('(prefers-reduced-motion: reduce)');
const cycleMs = 1800;  // of the animation; the true one is shown as text

function buildShapes() {
  const { modes } = content.shapes;
  const body = section('shapes', 'Shapes', 'Mode shapes', content.geometry
    ? 'Real part over one cycle, slowed down. Actuators and sensors are scaled to the same rms, because their ratio is unknown. ' +
      'The surface is a guide to the eye between the channels. Drag or use the arrow keys to rotate it.'
    : 'Real part over one cycle, slowed down. Positions are unknown: add the stage file, or the log that contains it, to the report to show the shapes on the stage.');
  const pick = element('select', { id: 'shape-mode', onchange: (event) => showShape(Number(event.target.value)) },
    ...modes.map((mode, i) => element('option', { value: i }, (i + 1) + ': ' + fixed(mode.frequency_hz) + ' Hz')));
  shapes.play = element('button', { type: 'button', class: 'plain', id: 'shape-play', onclick: () => playShapes(!shapes.playing) }, 'Play');
  shapes.text = element('p', { class: 'plot-title', 'aria-live': 'polite' });
  shapes.table = element('div');
  shapes.figure = canvasFigure('shape-plot', 'Mode shape', drawShape, 'tall');
  shapes.figure.node.addEventListener('keydown', shapeKey);
  shapes.figure.node.addEventListener('pointerdown', turnShape);
  body.append(
    element('div', { class: 'entry-pick' }, element('label', { for: 'shape-mode' }, 'Mode ', pick), smallButton('\u25c2', 'Previous mode', () => stepShape(-1)),
      smallButton('\u25b8', 'Next mode', () => stepShape(1)), shapes.play, saveButtons('mode shape', savedShape)),
    element('div', { class: 'entry-plots' }, element('div', null, shapes.text, shapes.figure.node, legendOfShapes(), folded('Shape as a table', shapes.table)),
      buildMac('shape-mac', 'MAC', ownMac)));
  new IntersectionObserver(([seen]) => {
    shapes.visible = seen.isIntersecting;
    runShapes();
  }).observe(shapes.figure.node);
  showShape(strongestShape());
  playShapes(!reducedMotion.matches);
}

function legendOfShapes() {
  return element('div', { class: 'legend' }, element('span', { class: 'mark disc' }, 'sensor'), element('span', { class: 'mark square' }, 'actuator'));
}

// The first mode within the fitted band; those outside do not represent single modes.
function strongestShape() {
  const [low, high] = content.model.band_hz;
  const first = content.shapes.modes.findIndex((mode) => !(high > low) || (mode.frequency_hz >= low && mode.frequency_hz <= high));
  return Math.max(0, first);
}

function stepShape(by) {
  const count_ = content.shapes.modes.length;
  showShape((shapes.index + by + count_) % count_);
}

function showShape(index) {
  const mode = content.shapes.modes[index];
  shapes.index = index;
  document.getElementById('shape-mode').value = index;
  shapes.scene = makeScene(mode);
  const mass = isNumber(mode.modal_mass) ? '; modal mass ' + number(mode.modal_mass, 4) + ' (shapes of norm one)' : '';
  shapes.text.textContent = shapeTitle(index) + mass +
    (mode.not_rank_one > 0.01 ? '; second singular value ' + percent(mode.not_rank_one) + ' of the first' : '');
  shapes.figure.node.setAttribute('aria-label', shapes.text.textContent + '. The table below lists the values.');
  shapes.table.replaceChildren(shapeTable(mode));
  if (!shapes.playing) shapes.phase = 0;
  shapes.figure.redraw();
}

// Channels with their complex components, scaled to equal rms; and the grid of the surface.
function makeScene(mode) {
  const points = ['outputs', 'inputs'].flatMap((kind) => content.shape_channels[kind].map(({ name }, i, { length }) => ({
    name, kind, re: Math.sqrt(length) * mode[kind][2 * i], im: Math.sqrt(length) * mode[kind][2 * i + 1],
    place: content.geometry && content.geometry[kind][i],
  })));
  const most = Math.max(...points.map((p) => Math.hypot(p.re, p.im)), 1e-12);
  const placed = points.filter((p) => p.place);
  return { points, placed, most, ...(placed.length ? surfaceOf(placed) : { grid: null }) };
}

const gridCells = 16;

// Size and centre of the stage, and heights on a grid from the channels that act or measure perpendicular to its
// plane.
function surfaceOf(placed) {
  const range = (axis) => {
    const values = placed.map((p) => p.place.position_m[axis]);
    return [Math.min(...values), Math.max(...values)];
  };
  const [x0, x1] = range(0), [y0, y1] = range(1);
  const size = Math.max(x1 - x0, y1 - y0, 1e-9);
  const middle = [(x0 + x1) / 2, (y0 + y1) / 2];
  const unit = (p) => [(p.place.position_m[0] - middle[0]) / size, (p.place.position_m[1] - middle[1]) / size];
  const upright = placed.filter((p) => Math.abs(p.place.direction[2]) > 0.9);
  const frame = { size, middle };
  if (upright.length < 4) return { ...frame, grid: null };
  const parts = ['re', 'im'].map((part) => plateThrough(upright.map(unit), upright.map((p) => p[part] * Math.sign(p.place.direction[2]))));
  if (!parts[0] || !parts[1]) return { ...frame, grid: null };
  const grid = [];
  for (let i = 0; i <= gridCells; ++i) {
    for (let j = 0; j <= gridCells; ++j) {
      const x = (x0 - middle[0] + (x1 - x0) * i / gridCells) / size;
      const y = (y0 - middle[1] + (y1 - y0) * j / gridCells) / size;
      grid.push({ x, y, re: parts[0](x, y), im: parts[1](x, y) });
    }
  }
  return { ...frame, grid };
}

function playShapes(on) {
  shapes.playing = on;
  shapes.play.textContent = on ? 'Pause' : 'Play';
  shapes.play.setAttribute('aria-pressed', String(on));
  runShapes();
}

function runShapes() {
  if (shapes.running || !shapes.playing || !shapes.visible) return;
  shapes.running = true;
  let before = null;
  const frame = (now) => {
    if (!shapes.playing || !shapes.visible) {
      shapes.running = false;
      return;
    }
    if (before !== null) shapes.phase = (shapes.phase + 2 * Math.PI * (now - before) / cycleMs) % (2 * Math.PI);
    before = now;
    ++shapes.frames;
    shapes.figure.redraw();
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

function shapeKey(event) {
  const turn = { ArrowLeft: -0.15, ArrowRight: 0.15 }[event.key];
  if (turn) shapes.turn += turn;
  else if (event.key === 'ArrowUp' || event.key === 'ArrowDown') stepShape(event.key === 'ArrowUp' ? -1 : 1);
  else if (event.key === ' ') playShapes(!shapes.playing);
  else return;
  event.preventDefault();
  shapes.figure.redraw();
}

function turnShape(event) {
  let last = event.clientX;
  followPointer((at) => {
    shapes.turn += (at.clientX - last) * 0.008;
    last = at.clientX;
    shapes.figure.redraw();
  });
}

function shapeTable(mode) {
  const part = (kind, title) => content.shape_channels[kind].map(({ name }, i) =>
    [rowHead(name, 'name'), title, number(mode[kind][2 * i]), number(mode[kind][2 * i + 1])]);
  return table(['channel', 'kind', 'real', 'imaginary'], [...part('outputs', 'sensor'), ...part('inputs', 'actuator')]);
}

function savedShape() {
  return { title: shapeTitle(shapes.index), panels: [canvasPanel(shapes.figure)] };
}

function shapeTitle(index) {
  const mode = content.shapes.modes[index];
  return 'Mode ' + (index + 1) + ': ' + fixed(mode.frequency_hz) + ' Hz, \u03b6 ' + hundred(mode.damping_ratio) + ' %';
}
