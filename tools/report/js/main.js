// Layout of the page.

buildHead();
readBlocks().then(buildPage, (error) => tellFailure(error.message));

function buildPage() {
  if (content.frf) {
    buildMatrix();
    buildEntry();
    afterFirstPaint(() => selectPanel(0));
  }
  if (content.arrays.cmif) buildCmif();
  if (content.stabilization) buildStabilization();
  if (content.modes) buildModes();
  if (content.shapes && content.shapes.modes.length) buildShapes();
  if (content.loop) buildLoop();
  if (content.comparison) buildComparison();
  if (content.validation) buildValidation();
  if (content.frf && content.nonlinearity) buildNonlinearity();
  if (isZippered()) buildInterpolation();
  if (content.cost.length > 1) buildCost();
  if (content.decisions.length) buildDecisions();
  if (content.runs.length || content.steps.length || content.findings.length) buildHealth();
  buildProvenance();

  Object.assign(window.stageidReport, { content, array, channelCurves, shapes });
}

function tellFailure(text) {
  window.stageidReport.errors.push(text);
  document.getElementById('main').append(element('p', { class: 'noscript', role: 'alert' }, text));
}
