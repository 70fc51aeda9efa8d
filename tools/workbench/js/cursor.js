// One cursor for all figures over frequency, and the line of the chosen element in the complex plane.

// Figures with a frequency axis: {node, left and width of the axis in pixels}.
function cursorFrames() {
  const frames = [];
  const graphs = [entry.magnitude, entry.phase, cmif.graph].filter(Boolean);
  for (const graph of graphs) {
    const area = graph.getArea();
    frames.push({ node: graph.graphDiv.parentElement.classList.contains('plot') ? graph.graphDiv.parentElement : graph.graphDiv, left: area.x, width: area.w });
  }
  if (stability.figure) frames.push({ node: stability.figure.node, left: diagramFrame().area.x, width: diagramFrame().area.w });
  for (const { button, near } of matrix.panels.values()) if (near) frames.push({ node: button, left: 0, width: button.clientWidth });
  return frames;
}

function followWithCursor() {
  window.addEventListener('resize', () => showCursor(null));  // places are in pixels
  document.getElementById('main').addEventListener('pointermove', (event) => {
    const frame = cursorFrames().find(({ node }) => node.contains(event.target));
    if (!frame) return showCursor(null);
    const place = (event.clientX - frame.node.getBoundingClientRect().left - frame.left) / frame.width;
    const [low, high] = shownBand();
    showCursor(place < 0 || place > 1 ? null : low * Math.pow(high / low, place));
  });
}

// Draws the cursor in every figure, and shows the values of the chosen element at that frequency.
function showCursor(hz) {
  bench.cursor = hz;
  const [low, high] = shownBand();
  const share = hz === null ? -1 : Math.log(hz / low) / Math.log(high / low);
  for (const { node, left, width } of cursorFrames()) {
    node.classList.toggle('cursor', share >= 0);
    node.style.setProperty('--cursor', (left + share * width).toFixed(1) + 'px');
  }
  tellValues(hz === null ? null : {}, hz);
  markInPlane(hz);
}

function markInPlane(hz) {
  const data = nyquist.shown;
  if (!nyquist.figure) return;
  const { node } = nyquist.figure;
  const k = hz === null ? -1 : lineFrom(hz);
  const point = data && data.points.find((one) => one.k === k);
  node.classList.toggle('cursor-point', Boolean(point));
  if (!point) return;
  const frame = planeFrame(data, node.clientWidth, node.clientHeight);
  node.style.setProperty('--cursor', frame.x(point.re).toFixed(1) + 'px');
  node.style.setProperty('--cursor-y', frame.y(point.im).toFixed(1) + 'px');
}
