// Sections of the page.

// The response, then the results: [id, whether the page has it, what builds it].
const responseParts = [
  ['response', () => content.frf, () => buildMatrix()],
  ['entry', () => content.frf, () => buildEntry()],
  ['cmif', () => content.arrays.cmif, () => buildCmif()],
  ['stabilization', () => content.stabilization, () => buildStabilization()],
];

const resultParts = [
  ['modes', () => content.modes, () => buildModes()],
  ['shapes', () => content.shapes && content.shapes.modes.length, () => buildShapes()],
  ['loop', () => content.loop, () => buildLoop()],
  ['comparison', () => content.comparison, () => buildComparison()],
  ['validation', () => content.validation, () => buildValidation()],
  ['nonlinearity', () => content.frf && content.nonlinearity, () => buildNonlinearity()],
  ['interpolation', () => isZippered(), () => buildInterpolation()],
  ['cost', () => content.cost.length > 1, () => buildCost()],
  ['decisions', () => content.decisions.length, () => buildDecisions()],
  ['health', () => content.runs.length || content.steps.length || content.findings.length, () => buildHealth()],
  ['provenance', () => true, () => buildProvenance()],
];

function buildSections() {
  for (const [, wanted, build] of [...responseParts, ...resultParts]) if (wanted()) build();
  if (content.frf) afterFirstPaint(() => selectPanel(0));
  Object.assign(window.stageidReport, { content, array, channelCurves, shapes });
}

function tellFailure(text) {
  window.stageidReport.errors.push(text);
  document.getElementById('main').append(element('p', { class: 'noscript', role: 'alert' }, text));
}
