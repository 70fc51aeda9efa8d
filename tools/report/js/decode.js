// Decodes packed numbers written by tools/report/report_encoding.hpp.

let blocks = {};  // by name, unpacked, not yet decoded
let decoded = {};

// The array of that name, decoded on first use; null if the page does not contain it.
function array(id) {
  const about = content.arrays[id];
  if (!about) return null;
  if (!decoded[id]) {
    decoded[id] = decoders[about.type](blocks[id], about, about.base && array(about.base));
    delete blocks[id];
  }
  return decoded[id];
}

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

// Uses the browser's own inflate. Without Blob and Response, unpacking stays within one turn of the event loop, so in
// Chromium the page is complete before it counts as loaded, and may be printed.
async function unpack(base64) {
  const inflate = new DecompressionStream('deflate');
  const writer = inflate.writable.getWriter();
  const written = writer.write(bytesOf(base64)).then(() => writer.close());
  const reader = inflate.readable.getReader();
  const pieces = [];
  for (let piece = await reader.read(); !piece.done; piece = await reader.read()) pieces.push(piece.value);
  await written;
  const bytes = new Uint8Array(pieces.reduce((size, piece) => size + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    bytes.set(piece, at);
    at += piece.length;
  }
  return bytes;
}

// Unpacks blocks by name.
async function unpackAll(blocks) {
  if (typeof DecompressionStream === 'undefined')
    throw new Error('This browser is too old to decompress the plot data. Open the page with Chrome or Edge 80, Firefox 113, Safari 16.4 or later.');
  const names = Object.keys(blocks);
  const unpacked = await Promise.all(names.map((name) => unpack(blocks[name])));
  return Object.fromEntries(names.map((name, i) => [name, unpacked[i]]));
}

// Bytes of numbers from byte planes: all lowest bytes first, then the next, ...
function interleaved(planes, width) {
  const count = planes.length / width;
  const bytes = new Uint8Array(planes.length);
  for (let plane = 0; plane < width; ++plane) {
    for (let i = 0; i < count; ++i) bytes[i * width + plane] = planes[plane * count + i];
  }
  return bytes.buffer;
}

// Pairs (re, im) from their expected values: value(guess, i) returns number i. Rounds as encode_each() does.
function expectedPairs(out, about, base, value) {
  const twice = about.order === 2 ? 2 : about.order;
  const once = about.order === 2 ? 1 : 0;
  const last = [0, 0], before = [0, 0];
  for (let i = 0; i < out.length; ++i) {
    const part = i & 1;
    const known = base ? base[i] : 0;
    out[i] = value(known + (twice * last[part] - once * before[part]), i);
    before[part] = last[part];
    last[part] = out[i] - known;
  }
  return out;
}

function signFirst(word) {
  return (word >>> 1) ^ -(word & 1);
}

const largestFloat = 3.4028234663852886e38;

// Words: index in the order of all float32 minus that of the expected number.
function fromComplexFloat32(bytes, about, base) {
  const words = new Uint32Array(interleaved(bytes, 4));
  const number = new Float32Array(1);
  const bits = new Uint32Array(number.buffer);
  return expectedPairs(new Float32Array(words.length), about, base, (guess, i) => {
    number[0] = Math.max(-largestFloat, Math.min(largestFloat, guess + 0));  // -0 is expected as 0
    const place = (bits[0] >>> 31 ? ~bits[0] : bits[0] | 0x80000000) + signFirst(words[i]);
    bits[0] = place >>> 0 >= 0x80000000 ? place & 0x7fffffff : ~place;
    return number[0];
  });
}

// m 2^(e-15), which float32 represents: int16 m minus the expected one modulo 2^16, then int8 e minus the previous one.
function fromBlock16(bytes, about, base) {
  const count = bytes.length / 5;
  const words = new Uint16Array(interleaved(bytes.subarray(0, 4 * count), 2));
  const exponents = runningSum(bytes.subarray(4 * count));
  const scales = Float64Array.from({ length: 256 }, (_, e) => Math.pow(2, (e << 24 >> 24) - 15));
  return expectedPairs(new Float32Array(2 * count), about, base, (guess, i) => {
    const scale = scales[exponents[i >> 1]];
    const expected = Math.max(-32767, Math.min(32767, Math.floor(guess / scale + 0.5)));
    return ((expected + signFirst(words[i])) << 16 >> 16) * scale;
  });
}

// Modulo 256.
function runningSum(bytes) {
  const out = new Uint8Array(bytes.length);
  for (let i = 0, sum = 0; i < out.length; ++i) out[i] = sum += bytes[i];
  return out;
}

// One byte per number, one logarithmic scale per row; code 0 is zero.
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
  f64: (bytes) => new Float64Array(interleaved(bytes, 8)),
  f32: (bytes) => new Float32Array(interleaved(bytes, 4)),
  c64: fromComplexFloat32,
  c40: fromBlock16,
  log8: (bytes, about) => fromLogBytes(runningSum(bytes), about.low, about.step),
};

function difference(a, b) {
  const out = new Float64Array(a.length);
  for (let i = 0; i < out.length; ++i) out[i] = a[i] - b[i];
  return out;
}

function magnitudes(pairs) {
  const out = new Float64Array(pairs.length / 2);
  // Math.hypot() is ten times slower; squares of float32 neither overflow nor vanish here.
  for (let k = 0; k < out.length; ++k) out[k] = Math.sqrt(pairs[2 * k] * pairs[2 * k] + pairs[2 * k + 1] * pairs[2 * k + 1]);
  return out;
}

function phases(pairs) {
  const out = new Float64Array(pairs.length / 2);
  for (let k = 0; k < out.length; ++k) out[k] = Math.atan2(pairs[2 * k + 1], pairs[2 * k]) * 180 / Math.PI;
  return out;
}
