// Drawing of a mode shape at one instant of its cycle.

function displacement(point) {
  return point.re * Math.cos(shapes.phase) - point.im * Math.sin(shapes.phase);
}

function drawShape(context, width, height) {
  if (!shapes.scene) return;
  if (shapes.scene.placed.length) drawStage(context, width, height);
  else drawBars(context, width, height);
}

const lift = 0.2;  // largest deflection relative to the size of the stage
const mostLabels = 60;  // more would cover each other

// Oblique view from above after a rotation about the vertical axis; no perspective, so parallels stay parallel.
function stageView(width, height) {
  const scale = Math.min(width / 1.4, height / 1.05);
  const [sine, cosine] = [Math.sin(shapes.turn), Math.cos(shapes.turn)];
  return (x, y, z) => {
    const [across, deep] = [x * cosine - y * sine, x * sine + y * cosine];
    return { x: width / 2 + scale * across, y: height / 2 - scale * (0.5 * deep + 0.82 * z), depth: deep };
  };
}

function drawStage(context, width, height) {
  const { scene } = shapes;
  const view = stageView(width, height);
  if (scene.grid) drawSurface(context, scene, view);
  const colours = palette();
  const seen = scene.placed.map((point) => {
    const { position_m: at, direction } = point.place;
    const rest = [(at[0] - scene.middle[0]) / scene.size, (at[1] - scene.middle[1]) / scene.size, at[2] / scene.size];
    const move = lift * displacement(point) / scene.most;
    return { point, rest: view(...rest), now: view(...rest.map((v, axis) => v + move * direction[axis])) };
  }).sort((a, b) => b.rest.depth - a.rest.depth);
  for (const { point, rest, now } of seen) {
    context.strokeStyle = colours.text;
    context.lineWidth = 1;
    context.globalAlpha = 0.5;
    drawLine(context, rest.x, rest.y, now.x, now.y);
    context.globalAlpha = 1;
    drawChannel(context, point.kind, now.x, now.y);
    // For a sensor and an actuator at the same position, names on either side.
    const [shift, align] = point.kind === 'outputs' ? [-7, 'right'] : [7, 'left'];
    if (seen.length <= mostLabels) drawText(context, point.name.slice(0, 12), now.x + shift, now.y - 7, { align, base: 'middle', pixels: 11, colour: colours.ink });
  }
}

function drawChannel(context, kind, x, y) {
  const colours = palette();
  context.beginPath();
  if (kind === 'outputs') circle(context, x, y, 4.5);
  else context.rect(x - 3.5, y - 3.5, 7, 7);
  context.fillStyle = kind === 'outputs' ? colours.ink : colours.background;
  context.fill();
  context.strokeStyle = colours.ink;
  context.lineWidth = 1.3;
  context.stroke();
}

// Cells from back to front, coloured by their height.
function drawSurface(context, scene, view) {
  const corners = scene.grid.map((point) => {
    const z = displacement(point) / scene.most;
    return { ...view(point.x, point.y, lift * z), z };
  });
  const cells = [];
  for (let i = 0; i < gridCells; ++i) {
    for (let j = 0; j < gridCells; ++j) {
      const first = i * (gridCells + 1) + j;
      const four = [first, first + 1, first + gridCells + 2, first + gridCells + 1].map((place) => corners[place]);
      cells.push({ four, depth: four[0].depth + four[2].depth, z: (four[0].z + four[1].z + four[2].z + four[3].z) / 4 });
    }
  }
  cells.sort((a, b) => b.depth - a.depth);
  context.strokeStyle = palette().frame;
  context.lineWidth = 0.5;
  for (const { four, z } of cells) {
    context.beginPath();
    for (const corner of four) context.lineTo(corner.x, corner.y);
    context.closePath();
    context.fillStyle = heightColour(z);
    context.fill();
    context.stroke();
  }
}

// From blue through the colour of the paper to orange.
function heightColour(z) {
  const { background, below, above } = palette();
  const end = z < 0 ? below : above;
  const share = Math.min(1, Math.abs(z)) * 0.85;
  const part = (hex, i) => parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16);
  return 'rgb(' + [0, 1, 2].map((i) => Math.round(part(background, i) * (1 - share) + part(end, i) * share)).join(',') + ')';
}

// Without positions: one bar per channel, sensors first.
function drawBars(context, width, height) {
  const { points, most } = shapes.scene;
  const colours = palette();
  const step = (width - 20) / (points.length + 1);
  const middle = height / 2;
  const tall = height / 2 - 34;
  context.strokeStyle = colours.frame;
  context.lineWidth = 1;
  drawLine(context, 10, middle, width - 10, middle);
  points.forEach((point, i) => {
    const x = 10 + (i + (point.kind === 'inputs' ? 1 : 0)) * step;
    const z = displacement(point) / most;
    context.fillStyle = heightColour(z);
    context.fillRect(x + 0.15 * step, Math.min(middle, middle - z * tall), 0.7 * step, Math.abs(z) * tall);
    drawChannel(context, point.kind, x + 0.5 * step, middle - z * tall);
    if (step >= 18) drawText(context, point.name.slice(0, Math.max(2, Math.floor(step / 7))), x + 0.5 * step, height - 10, { align: 'center', pixels: 11 });
  });
}
