// The start of the workbench: the report, the tools, the stream.

responseParts.unshift(responseParts.pop());  // the diagram is the tool, so it comes first
resultParts.splice(resultParts.findIndex(([id]) => id === 'comparison') + 1, 0,
  ['trends', () => bench.trends.length && bench.trends.some((one) => one.own), () => buildTrends()]);

buildHead('workbench');
readBlocks().then(() => {
  buildBench();
  buildSections();
  if (stability.figure) equipDiagram();
  undoKeys();
  followWithCursor();
  tellProvenance();
  listen();
}, (error) => tellFailure(error.message));

function listen() {
  const stream = new EventSource('events' + location.search);
  stream.onmessage = (message) => {
    showState(JSON.parse(message.data));
    if (bench.state.state === 'ended') stream.close();
    else fetchResults(bench.state.edition);
  };
  stream.onerror = () => { session.status.textContent = 'connection to the program lost; reconnecting'; };
  window.addEventListener('pagehide', () => stream.close());
  Object.assign(window.stageidReport, { bench, act, diagramFrame, trendRows, nyquistShown: () => [nyquist.shown.low, nyquist.shown.high] });
}
