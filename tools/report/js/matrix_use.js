// Pointer actions in the matrix, and the matrix as one picture.

// Shorter drags are clicks.
const leastDrag = 6;

// A drag across a panel zooms all of them; a click selects a panel. Touch scrolls the page instead.
function dragAcross(event) {
  const button = event.target.closest('.panel');
  if (!button || event.button !== 0 || event.pointerType === 'touch') return;
  const box = button.getBoundingClientRect();
  const frame = panelFrame(box.width, box.height);
  const within = (x) => Math.min(box.width, Math.max(0, x - box.left));
  const from = within(event.clientX);
  const mark = element('span', { class: 'drag-mark' });
  followPointer((at) => {
    const to = within(at.clientX);
    if (Math.abs(to - from) < leastDrag) return mark.remove();
    mark.style.left = Math.min(from, to) + 'px';
    mark.style.width = Math.abs(to - from) + 'px';
    return button.append(mark);
  }, (at) => {
    const dragged = mark.isConnected;
    mark.remove();
    if (!dragged || at.type !== 'pointerup') return;
    swallowClick(button);
    const [low, high] = [from, within(at.clientX)].sort((a, b) => a - b).map((x) => 10 ** (frame.x0 + (frame.x1 - frame.x0) * x / box.width));
    setBand(low, high);
  });
}

// Calls move(event) until the pointer is released, then stop(event).
function followPointer(move, stop = () => {}) {
  const end = (event) => {
    window.removeEventListener('pointermove', move);
    for (const kind of ['pointerup', 'pointercancel']) window.removeEventListener(kind, end);
    stop(event);
  };
  window.addEventListener('pointermove', move);
  for (const kind of ['pointerup', 'pointercancel']) window.addEventListener(kind, end);
}

function swallowClick(button) {
  const swallow = (click) => click.stopPropagation();
  button.addEventListener('click', swallow, { capture: true, once: true });
  setTimeout(() => button.removeEventListener('click', swallow, { capture: true }));
}

// The whole matrix for a slide: about 16 to 9, names beside rows and above columns.
function savedMatrix() {
  const { inputs, outputs } = content.frf;
  const width = Math.max(80, Math.min(300, Math.floor(1240 / inputs.length)));
  const height = Math.max(70, Math.min(220, Math.floor(640 / outputs.length)));
  const left = 64, top = 22;
  const draw = (context) => {
    const colours = palette();
    for (const [o, output] of outputs.entries()) drawName(context, output.name, 'right', left - 8, top + (o + 0.5) * height);
    for (const [i, input] of inputs.entries()) drawName(context, input.name, 'center', left + (i + 0.5) * width, top / 2);
    for (let c = 0; c < channelCount(); ++c) {
      const x = left + inputOf(c) * width;
      const y = top + outputOf(c) * height;
      context.save();
      context.translate(x, y);
      clipTo(context, 1, 1, width - 3, height - 3);
      paintPanel(c, context, width - 2, height - 2);
      context.restore();
      context.strokeStyle = colours.frame;
      context.lineWidth = 1;
      context.strokeRect(x + 0.5, y + 0.5, width - 3, height - 3);
    }
  };
  const legend = traceLegend(['measured', ...(content.arrays.residual ? ['model', 'residual'] : []), otherTrace()]);
  const panel = { width: left + inputs.length * width, height: top + outputs.length * height, draw };
  return { title: 'Frequency response, ' + bandText() + (matrix.timesOmega ? ', times \u03c9\u00b2' : ''), legend, panels: [panel] };
}

function drawName(context, name, align, x, y) {
  drawText(context, shortened(name, 12), x, y, { align, base: 'middle' });
}
