// The numbers of the page: tools/report_encoding.hpp is the writer.

const content = JSON.parse(document.getElementById('content').textContent);

function bytesOf(id) {
  const text = atob(document.getElementById('data-' + id).textContent);
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

const decoded = {};

// The array of that name, decoded when first asked for; null where the report has none.
function array(id) {
  const about = content.arrays[id];
  if (!about) return null;
  if (!decoded[id]) decoded[id] = decoders[about.type](bytesOf(id), about);
  return decoded[id];
}

const channelCount = content.frf ? content.frf.inputs.length * content.frf.outputs.length : 0;

// Channel c = output + outputs * input, as in the paper's vec.
function channelIndex(output, input) {
  return output + content.frf.outputs.length * input;
}

function channelName(channel) {
  const outputs = content.frf.outputs;
  const input = Math.floor(channel / outputs.length);
  return outputs[channel % outputs.length].name + ' \u2190 ' + content.frf.inputs[input].name;
}

// Everything that the panels draw of one channel: magnitudes, one a line; null where not known.
const curvesOfChannel = new Map();
function channelCurves(channel) {
  if (!curvesOfChannel.has(channel)) curvesOfChannel.set(channel, makeCurves(channel));
  return curvesOfChannel.get(channel);
}

function makeCurves(channel) {
  const lines = content.frf.lines;
  const measured = array('response').subarray(2 * channel * lines, 2 * (channel + 1) * lines);
  const part = (id) => {
    const all = array(id);
    return all ? all.subarray(channel * lines, (channel + 1) * lines) : null;
  };
  const curves = {
    measured: magnitudes(measured),
    model: null,
    residual: null,
    deviation: part('deviation'),
    modelDeviation: part('model_deviation'),
    validationResidual: part('validation_residual'),
    relativeError: null,
  };
  const residuals = array('residual');
  if (residuals) {
    const residual = residuals.subarray(2 * channel * lines, 2 * (channel + 1) * lines);
    curves.model = magnitudes(difference(measured, residual));
    curves.residual = magnitudes(residual);
    let sum = 0;
    for (let k = 0; k < lines; ++k) {
      const relative = curves.residual[k] / curves.measured[k];
      sum += relative * relative;
    }
    curves.relativeError = Math.sqrt(sum / lines);
  }
  return curves;
}

// Phases of one channel in degrees, -180 to 180.
function channelPhases(channel) {
  const lines = content.frf.lines;
  const part = (id) => array(id).subarray(2 * channel * lines, 2 * (channel + 1) * lines);
  const measured = part('response');
  return { measured: phases(measured), model: array('residual') ? phases(difference(measured, part('residual'))) : null };
}

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
