// Encoded numbers: tools/report_encoding.hpp is the writer.

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

// m 2^(e-15) of pairs of int16 m and one int8 e: (re, im) interleaved.
function fromBlock16(bytes) {
  const count = bytes.length / 5;
  const mantissa = new Int16Array(bytes.buffer, 0, 2 * count);
  const exponent = new Int8Array(bytes.buffer, 4 * count, count);
  const out = new Float64Array(2 * count);
  const scales = Float64Array.from({ length: 256 }, (_, i) => Math.pow(2, i - 128 - 15));
  for (let i = 0; i < count; ++i) {
    const scale = scales[exponent[i] + 128];
    out[2 * i] = mantissa[2 * i] * scale;
    out[2 * i + 1] = mantissa[2 * i + 1] * scale;
  }
  return out;
}

// One byte a number, a logarithmic scale a row; code 0 is zero.
function fromLogBytes(codes, low, step) {
  const columns = codes.length / low.length;
  const out = new Float64Array(codes.length);
  for (let row = 0; row < low.length; ++row) {
    const values = Float64Array.from({ length: 256 }, (_, code) => (code === 0 ? 0 : Math.pow(2, low[row] + (code - 1) * step[row])));
    for (let k = row * columns; k < (row + 1) * columns; ++k) out[k] = values[codes[k]];
  }
  return out;
}

const decoders = {
  f64: (bytes) => new Float64Array(bytes.buffer),
  f32: (bytes) => new Float32Array(bytes.buffer),
  c64: (bytes) => new Float32Array(bytes.buffer),
  c40: fromBlock16,
  log8: (bytes, about) => fromLogBytes(bytes, about.low, about.step),
};

function difference(a, b) {
  const out = new Float64Array(a.length);
  for (let i = 0; i < out.length; ++i) out[i] = a[i] - b[i];
  return out;
}

function magnitudes(pairs) {
  const out = new Float64Array(pairs.length / 2);
  // Not Math.hypot(): ten times slower, and float32 squared neither overflows nor vanishes here.
  for (let k = 0; k < out.length; ++k) out[k] = Math.sqrt(pairs[2 * k] * pairs[2 * k] + pairs[2 * k + 1] * pairs[2 * k + 1]);
  return out;
}

function phases(pairs) {
  const out = new Float64Array(pairs.length / 2);
  for (let k = 0; k < out.length; ++k) out[k] = Math.atan2(pairs[2 * k + 1], pairs[2 * k]) * 180 / Math.PI;
  return out;
}
