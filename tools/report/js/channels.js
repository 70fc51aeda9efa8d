// The response channel by channel.

// Channels of the response in `content` and array().
function channelCount() {
  return content.frf ? content.frf.inputs.length * content.frf.outputs.length : 0;
}

// Channel c = output + outputs * input, as in the paper's vec.
function channelIndex(output, input) {
  return output + content.frf.outputs.length * input;
}

function channelName(channel) {
  const outputs = content.frf.outputs;
  const input = Math.floor(channel / outputs.length);
  return outputs[channel % outputs.length].name + ' \u2190 ' + content.frf.inputs[input].name;
}

// The curves of one channel: magnitudes, one per line; null if unknown.
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
    ...otherCurves(channel, measured),
  };
  const residuals = array('residual');
  if (residuals) {
    const residual = residuals.subarray(2 * channel * lines, 2 * (channel + 1) * lines);
    curves.model = magnitudes(difference(measured, residual));
    curves.residual = magnitudes(residual);
    if (content.frf.responds[channel]) curves.relativeError = relativeRms(curves.residual, curves.measured);
  }
  return curves;
}

// Over the lines with a response.
function relativeRms(errors, values) {
  let sum = 0, used = 0;
  for (let k = 0; k < values.length; ++k) {
    if (!(values[k] > 0)) continue;
    sum += (errors[k] / values[k]) ** 2;
    ++used;
  }
  return used > 0 ? Math.sqrt(sum / used) : null;
}

// Curves of the compared day or model: its magnitudes, and the magnitude of the difference.
function otherCurves(channel, measured) {
  const lines = content.frf.lines;
  const part = (id) => {
    const all = array(id);
    return all ? all.subarray(2 * channel * lines, 2 * (channel + 1) * lines) : null;
  };
  const other = part('other_response');
  const otherModel = part('other_model');
  const residual = part('residual');
  const own = other ? measured : otherModel && residual ? difference(measured, residual) : null;
  return {
    other: other && magnitudes(other), otherModel: otherModel && magnitudes(otherModel),
    change: own && magnitudes(difference(other || otherModel, own)),
  };
}

// Phases of one channel in degrees, -180 to 180.
function channelPhases(channel) {
  const lines = content.frf.lines;
  const part = (id) => array(id).subarray(2 * channel * lines, 2 * (channel + 1) * lines);
  const measured = part('response');
  const of = (id) => (array(id) ? phases(part(id)) : null);
  return {
    measured: phases(measured), model: array('residual') ? phases(difference(measured, part('residual'))) : null,
    other: of('other_response'), otherModel: of('other_model'),
  };
}
