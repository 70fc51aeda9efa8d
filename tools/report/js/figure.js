// Figures on a canvas, and export of all figures as SVG and PNG.

// Calls draw(context, width, height) on a canvas whenever its element, the colours or the medium change.
function canvasFigure(id, label, draw, kind) {
  const canvas = element('canvas', { 'aria-hidden': 'true' });
  const node = element('div', { class: 'plot ' + (kind || ''), id, role: 'img', 'aria-label': label, tabindex: '0' }, canvas);
  const redraw = () => {
    const { clientWidth: width, clientHeight: height } = node;
    if (width > 0 && height > 0) draw(sharpContext(canvas, width, height), width, height);
  };
  const figure = { node, draw, redraw, resize: redraw, recolour: redraw };
  plots.add(figure);
  new ResizeObserver(redraw).observe(node);
  return figure;
}

// An empty canvas of that size on the page, with all pixels of the screen.
function sharpContext(canvas, width, height) {
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  const pixels = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

// While the pointer is on the figure, the element contains what tell(event) says of that place.
function tellUnderPointer(figure, text, tell) {
  figure.node.addEventListener('pointermove', (event) => { text.textContent = tell(event); });
  figure.node.addEventListener('pointerleave', () => { text.textContent = ''; });
}

// Figures that can be saved: name -> {title, legend, panels}; a panel is {width, height, draw}.
const savable = new Map();

// Buttons that save a figure. describe() returns its current {title, legend: [[name, colour]], panels}.
function saveButtons(name, describe) {
  savable.set(name, describe);
  const button = (kind) => smallButton(kind, 'Save as ' + kind + ': ' + name, () => saveFigure(name, kind), 'Save as ' + kind);
  return element('span', { class: 'save', role: 'group', 'aria-label': 'Save figure' }, button('SVG'), button('PNG'));
}

function canvasPanel(figure) {
  return { width: figure.node.clientWidth, height: figure.node.clientHeight, draw: figure.draw };
}

// dygraphs draws into the given context; its labels are elements of the page.
function graphPanel(graph, title) {
  return { width: graph.width_, height: graph.height_, title, draw: (context) => drawGraph(graph, context) };
}

function drawGraph(graph, context) {
  const { hidden_ctx_: own, plotter_: plotter } = graph;
  graph.hidden_ctx_ = plotter.elementContext = context;
  context.save();
  try {
    graph.renderGraph_(false);
  } finally {
    graph.hidden_ctx_ = plotter.elementContext = own;
    context.restore();
  }
  graph.renderGraph_(false);
  const frame = graph.graphDiv.getBoundingClientRect();
  for (const label of graph.graphDiv.querySelectorAll('.dygraph-axis-label')) {
    const box = label.getBoundingClientRect();
    const across = label.classList.contains('dygraph-axis-label-y');
    drawText(context, label.textContent, (across ? box.right : (box.left + box.right) / 2) - frame.left, (box.top + box.bottom) / 2 - frame.top,
      { align: across ? 'right' : 'center', base: 'middle' });
  }
}

const savedMargin = 14;

function savedSize({ legend, panels }) {
  return {
    width: Math.max(...panels.map((panel) => panel.width)) + 2 * savedMargin,
    height: 2 * savedMargin + 22 + (hasLegend(legend) ? 24 : 0) + panels.reduce((sum, panel) => sum + panel.height + (panel.title ? 20 : 0), 0),
  };
}

function hasLegend(legend) {
  return Boolean(legend) && legend.length > 0;
}

function drawSaved(context, { title, legend, panels }, { width, height }) {
  const colours = palette();
  context.fillStyle = colours.background;
  context.fillRect(0, 0, width, height);
  drawText(context, title, savedMargin, savedMargin + 12, { pixels: 15, weight: '600', colour: colours.ink });
  let y = savedMargin + 22;
  if (hasLegend(legend)) y = drawLegend(context, legend, y);
  for (const panel of panels) {
    if (panel.title) {
      drawText(context, panel.title, savedMargin, y + 13, { pixels: 12.5 });
      y += 20;
    }
    context.save();
    context.translate(savedMargin, y);
    panel.draw(context, panel.width, panel.height);
    context.restore();
    y += panel.height;
  }
}

// The file's text, and its size.
function svgOf(name) {
  const figure = savable.get(name)();
  const size = savedSize(figure);
  const context = new SvgContext();
  drawSaved(context, figure, size);
  return { ...size, text: context.text(size.width, size.height, figure.title) };
}

function drawLegend(context, legend, y) {
  let x = savedMargin;
  context.lineWidth = 3;
  for (const [text, colour] of legend) {
    context.strokeStyle = colour;
    drawLine(context, x, y + 9, x + 20, y + 9);
    drawText(context, text, x + 26, y + 13, { pixels: 12.5 });
    x += 26 + 7.2 * text.length + 18;
  }
  return y + 24;
}

// Pixels for a slide: twice the size on the page.
function pngOf(name, scale = 2) {
  const figure = savable.get(name)();
  const size = savedSize(figure);
  const canvas = element('canvas', { width: Math.round(size.width * scale), height: Math.round(size.height * scale) });
  const context = canvas.getContext('2d');
  context.scale(scale, scale);
  context.clearRect = () => {};  // as in SvgContext: a plot would clear the background
  drawSaved(context, figure, size);
  return canvas;
}

function download(blob, file) {
  const address = URL.createObjectURL(blob);
  element('a', { href: address, download: file }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

function saveFigure(name, kind) {
  const file = name.replace(/[^\w]+/g, '_') + '.' + kind.toLowerCase();
  if (kind === 'PNG') pngOf(name).toBlob((blob) => download(blob, file));
  else download(new Blob([svgOf(name).text], { type: 'image/svg+xml' }), file);
}
