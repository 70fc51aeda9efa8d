// Lines, circles and texts of the figures on a canvas.

const figureFont = 'system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif';

function drawLine(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

// The path, to fill or stroke.
function circle(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
}

// Only the inside of the rectangle is drawn from now on.
function clipTo(context, x, y, width, height) {
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
}

function drawText(context, text, x, y, { align = 'start', base = 'alphabetic', pixels = 12, weight = '', colour = palette().text } = {}) {
  context.font = (weight ? weight + ' ' : '') + pixels + 'px ' + figureFont;
  context.fillStyle = colour;
  context.textAlign = align;
  context.textBaseline = base;
  context.fillText(text, x, y);
}
