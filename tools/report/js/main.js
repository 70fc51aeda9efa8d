// The order of the page.

const startedMs = performance.now();

buildHead();
if (content.frf) {
  buildMatrix();
  buildEntry();
  matrix.onselect = (channel) => showEntry(channel);
  afterFirstPaint(() => selectPanel(0));
}
if (content.arrays.cmif) buildCmif();
if (content.modes) buildModes();
if (content.shapes && content.shapes.modes.length) buildShapes();
if (content.validation) buildValidation();
if (content.cost.length > 1) buildCost();
if (content.decisions.length) buildDecisions();
if (content.runs.length || content.steps.length) buildHealth();
buildProvenance();

Object.assign(window.stageidReport, { content, array, channelCurves, shapes });
if (location.hash === '#selftest') selfTest(startedMs);
