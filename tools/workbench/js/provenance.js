// Where a number comes from, as the title of the element under the pointer.

const measuredSections = new Set(['response', 'entry', 'cmif', 'stabilization', 'nonlinearity', 'interpolation', 'health']);

function tellProvenance() {
  document.addEventListener('pointerover', (event) => {
    const node = event.target.closest && event.target.closest('td, dd, output.values, .panel, .fit');
    const part = node && node.closest('section, header');
    if (part && /\d/.test(node.textContent)) node.title = [channelTitle(node), provenanceOf(part.id)].filter(Boolean).join('\n');
  });
}

function channelTitle(node) {
  return node.dataset.channel === undefined ? '' : channelName(Number(node.dataset.channel));
}

function inputsOf(of) {
  const found = content.provenance.find((one) => one.of === of);
  return found && typeof found.content === 'object' ? found.content : {};
}

function provenanceOf(id) {
  const frf = inputsOf('frequency response');
  const measured = 'Frequency response' + (frf.logs ? ' of ' + frf.logs.join(', ') : '') + ': ' +
    [plural(content.frf.realizations, 'realization'), plural(content.frf.periods, 'period'), 'stageid ' + (frf.stageid_version || '?')].join(', ');
  if (measuredSections.has(id) || !content.model) return measured;
  const model = inputsOf('model');
  const inputs = (model.inputs || []).map(({ file, fingerprint }) => file + ' (' + fingerprint + ')').join(', ');
  return [previews[bench.stage] || 'Fit ' + (bench.state.index + 1) + ' to ' + (inputs || 'unknown data') + ', stageid ' + (model.stageid_version || '?'),
    bench.state.command, measured].filter(Boolean).join('\n');
}
