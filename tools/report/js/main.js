// The order of the page.

const startedMs = performance.now();

// The reader sees the head and the tables at once, the plots a moment later. The self-check waits for nothing.
function afterFirstPaint(work) {
  if (location.hash === '#selftest') work();
  else requestAnimationFrame(() => setTimeout(work));
}

buildHead();
if (content.frf) {
  buildMatrix();
  buildEntry();
  matrix.onselect = (channel) => showEntry(channel, true);
  afterFirstPaint(() => selectPanel(0));
}
if (content.arrays.cmif) buildCmif();
if (content.modes) buildModes();
if (content.validation) buildValidation();
if (content.cost.length > 1) buildCost();
if (content.decisions.length) buildDecisions();
if (content.runs.length || content.steps.length) buildHealth();
buildProvenance();

Object.assign(window.stageidReport, { content, array, channelCurves });
if (location.hash === '#selftest') selfTest(startedMs);
