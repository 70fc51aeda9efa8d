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

// The panels for a slide: about 16 to 9, names beside rows and above columns, or in the panels of a list.
function savedMatrix() {
  const { inputs, outputs } = content.frf;
  const channels = Array.from(matrix.panels.keys());
  const columns = isListed() ? 10 : inputs.length;
  const rows = Math.ceil(channels.length / columns);
  const width = Math.max(44, Math.min(300, Math.floor(1240 / columns)));
  const height = Math.max(36, Math.min(220, Math.floor(640 / rows)));
  const [left, top] = isListed() ? [0, 0] : [64, 22];
  const draw = (context) => {
    const colours = palette();
    if (!isListed()) {
      for (const [o, output] of outputs.entries()) drawName(context, output.name, 'right', left - 8, top + (o + 0.5) * height);
      for (const [i, input] of inputs.entries()) drawName(context, input.name, 'center', left + (i + 0.5) * width, top / 2, width);
    }
    channels.forEach((c, place) => {
      const x = left + (isListed() ? place % columns : inputOf(c)) * width;
      const y = top + (isListed() ? Math.floor(place / columns) : outputOf(c)) * height;
      context.save();
      context.translate(x, y);
      clipTo(context, 1, 1, width - 3, height - 3);
      paintPanel(c, context, width - 2, height - 2);
      context.restore();
      context.strokeStyle = colours.frame;
      context.lineWidth = 1;
      context.strokeRect(x + 0.5, y + 0.5, width - 3, height - 3);
      if (isListed()) drawName(context, channelName(c), 'left', x + 4, y + 10, width);
    });
  };
  const legend = traceLegend(['measured', ...(content.arrays.residual ? ['model', 'residual'] : []), otherTrace()]);
  const panel = { width: left + columns * width, height: top + rows * height, draw };
  return { title: 'Frequency response, ' + bandText() + (matrix.timesOmega ? ', times \u03c9\u00b2' : ''), legend, panels: [panel] };
}

// Shortened to about that many pixels.
function drawName(context, name, align, x, y, room = 84) {
  drawText(context, shortened(name, Math.floor(room / 7)), x, y, { align, base: 'middle' });
}
