// A drawing context that writes SVG, so that figures can be drawn into a file as onto the canvas. Implements the part
// of CanvasRenderingContext2D used by the page and dygraphs. Coordinates are rounded to a hundredth of a pixel.

const svgRound = (v) => String(Math.round(v * 100) / 100);

function xmlEscape(text) {
  return String(text).replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c])
    .replace(/[\u0000-\u0008\u000b\u000c\u000e-\u001f\ufffe\uffff]/g, '\ufffd');
}

class SvgContext {
  constructor() {
    Object.assign(this, {
      parts: [], stack: [], path: '', dash: [], open: 0, x: 0, y: 0, strokeStyle: '#000', fillStyle: '#000', lineWidth: 1, globalAlpha: 1,
      font: '10px sans-serif', textAlign: 'start', textBaseline: 'alphabetic', lineJoin: 'miter', lineCap: 'butt', clips: 0,
    });
  }

  save() {
    const { parts, stack, path, clips, ...state } = this;
    stack.push(state);
  }
  restore() {
    const before = this.stack.pop();
    if (!before) return;
    while (this.open > before.open) this.close();
    Object.assign(this, before);
  }
  close() {
    this.parts.push('</g>');
    --this.open;
  }
  translate(x, y) {
    this.x += x;
    this.y += y;
  }
  at(x, y) {
    return svgRound(x + this.x) + ' ' + svgRound(y + this.y);
  }

  beginPath() { this.path = ''; }
  closePath() { if (this.path) this.path += 'Z'; }
  moveTo(x, y) { this.path += 'M' + this.at(x, y); }
  lineTo(x, y) { this.path += (this.path && !this.path.endsWith('Z') ? 'L' : 'M') + this.at(x, y); }
  rect(x, y, w, h) { this.path += 'M' + this.at(x, y) + 'h' + svgRound(w) + 'v' + svgRound(h) + 'h' + svgRound(-w) + 'Z'; }
  arc(x, y, r, from, to) {
    const whole = Math.abs(to - from) >= 2 * Math.PI - 1e-9;
    const end = whole ? from + Math.PI : to;
    const start = this.at(x + r * Math.cos(from), y + r * Math.sin(from));
    const piece = (angle, large) => 'A' + svgRound(r) + ' ' + svgRound(r) + ' 0 ' + large + ' 1 ' + this.at(x + r * Math.cos(angle), y + r * Math.sin(angle));
    this.path += (this.path && !whole ? 'L' : 'M') + start + piece(end, Number(!whole && to - from > Math.PI));
    if (whole) this.path += piece(to, 0) + 'Z';
  }
  clip() {
    const id = 'clip-' + this.clips++;
    this.parts.push('<clipPath id="' + id + '"><path d="' + this.path + '"/></clipPath><g clip-path="url(#' + id + ')">');
    ++this.open;
  }
  setLineDash(dash) { this.dash = Array.from(dash); }
  getLineDash() { return this.dash; }
  clearRect() {}  // a file is empty at the start

  paint(attributes) {
    this.parts.push('<path d="' + this.path + '" ' + attributes + (this.globalAlpha < 1 ? ' opacity="' + svgRound(this.globalAlpha) + '"' : '') + '/>');
  }
  stroke() {
    if (!this.path) return;
    this.paint('fill="none" stroke="' + xmlEscape(this.strokeStyle) + '" stroke-width="' + svgRound(this.lineWidth) + '" stroke-linejoin="' + this.lineJoin + '"' +
      (this.dash.length ? ' stroke-dasharray="' + this.dash.join(' ') + '"' : ''));
  }
  fill() { if (this.path) this.paint('fill="' + xmlEscape(this.fillStyle) + '"'); }
  alone(draw) {
    const { path } = this;
    this.path = '';
    draw();
    this.path = path;
  }
  fillRect(x, y, w, h) { this.alone(() => { this.rect(x, y, w, h); this.fill(); }); }
  strokeRect(x, y, w, h) { this.alone(() => { this.rect(x, y, w, h); this.stroke(); }); }
  fillText(text, x, y) {
    const anchor = { center: 'middle', right: 'end', end: 'end' }[this.textAlign] || 'start';
    const base = { middle: 'central', top: 'hanging', hanging: 'hanging' }[this.textBaseline] || 'alphabetic';
    this.parts.push('<text x="' + svgRound(x + this.x) + '" y="' + svgRound(y + this.y) + '" text-anchor="' + anchor + '" dominant-baseline="' + base +
      '" style="font:' + xmlEscape(this.font) + '" fill="' + xmlEscape(this.fillStyle) + '">' + xmlEscape(text) + '</text>');
  }

  // The file.
  text(width, height, title) {
    while (this.open > 0) this.close();
    return '<svg xmlns="http://www.w3.org/2000/svg" width="' + width + '" height="' + height + '" viewBox="0 0 ' + width + ' ' + height + '" role="img"><title>' +
      xmlEscape(title) + '</title>' + this.parts.join('\n') + '</svg>\n';
  }
}
