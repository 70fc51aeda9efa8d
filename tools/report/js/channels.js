// The response channel by channel.

// Channels of the response in `content` and array().
function channelCount() {
  return content.frf ? content.frf.inputs.length * content.frf.outputs.length : 0;
}

// Channel c = output + outputs * input, as in the paper's vec.
function channelIndex(output, input) {
  return output + content.frf.outputs.length * input;
}

function outputOf(channel) {
  return channel % content.frf.outputs.length;
}

function inputOf(channel) {
  return Math.floor(channel / content.frf.outputs.length);
}

function channelName(channel) {
  return content.frf.outputs[outputOf(channel)].name + ' \u2190 ' + content.frf.inputs[inputOf(channel)].name;
}

// The numbers of one channel, `each` per line; null if the page does not contain the array.
function partOf(id, channel, each) {
  const all = array(id);
  const size = each * content.frf.lines;
  return all && all.subarray(channel * size, (channel + 1) * size);
}

// Complex numbers of one channel, as pairs; the model is the measurement less the residual.
function channelPairs(channel) {
  const part = (id) => partOf(id, channel, 2);
  const measured = part('response');
  const residual = part('residual');
  return { measured, residual, model: residual && difference(measured, residual), other: part('other_response'), otherModel: part('other_model') };
}

// The curves of one channel: magnitudes, one per line; null if unknown. Only those of the last channel are kept.
const lastCurves = { channel: null, curves: null };
function channelCurves(channel) {
  if (lastCurves.channel !== channel) Object.assign(lastCurves, { channel, curves: makeCurves(channel) });
  return lastCurves.curves;
}

function makeCurves(channel) {
  const pairs = channelPairs(channel);
  // The compared day or model is compared with its own kind.
  const own = pairs.other ? pairs.measured : pairs.otherModel && pairs.model;
  const curves = {
    ...mapValues(pairs, magnitudes),
    change: own && magnitudes(difference(pairs.other || pairs.otherModel, own)),
    deviation: partOf('deviation', channel, 1),
    modelDeviation: partOf('model_deviation', channel, 1),
    validation: partOf('validation_residual', channel, 1),
    relativeError: null,
  };
  if (curves.residual && content.frf.responds[channel]) curves.relativeError = relativeRms(curves.residual, curves.measured);
  return curves;
}

// Applies the function to all values that are not null.
function mapValues(values, apply) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, value && apply(value)]));
}

// The first and the last line to which the model was fitted.
function fittedLines() {
  const [low, high] = content.model ? content.model.band_hz : [0, 0];
  return high > low ? bandLines(low, high) : [0, content.frf.lines - 1];
}

// Over the fitted lines with a response.
function relativeRms(errors, values) {
  let sum = 0, used = 0;
  const [first, last] = fittedLines();
  for (let k = first; k <= last; ++k) {
    if (!(values[k] > 0)) continue;
    sum += (errors[k] / values[k]) ** 2;
    ++used;
  }
  return used > 0 ? Math.sqrt(sum / used) : null;
}

// Phases of one channel in degrees, -180 to 180.
function channelPhases(channel) {
  const { residual, ...responses } = channelPairs(channel);
  return mapValues(responses, phases);
}
