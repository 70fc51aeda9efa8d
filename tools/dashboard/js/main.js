// Layout of the page, and the stream.

let ended = false;

function showState(state) {
  window.stageidDashboard.state = state;
  showProgress(state);
  showLevels(state);
  showTiming(state);
  showSupervisor(state);
  showEvents(state);
  const loaded = Promise.all([fetchResponse(state.response.edition), showWatch(state), fetchTraces()]);
  if (state.state !== 'ended') return;
  ended = true;
  // If the program does not stay, it waits for this page to disconnect: fetch what is last first.
  loaded.then(() => Promise.all([fetchResponse(state.response.edition), showWatch(state)])).finally(() => {
    if (!state.stays) stream.close();
    window.stageidDashboard.complete = true;
  });
}

buildProgress();
buildLevels();
buildTraces();
buildTiming();
buildEvents();

const stream = new EventSource('events' + link.search);
stream.onmessage = (message) => showState(JSON.parse(message.data));
stream.onerror = () => {
  if (ended) return stream.close();
  head.verdict.className = 'verdict doubt';
  head.text.textContent = 'connection to the program lost; reconnecting';
};
window.addEventListener('pagehide', () => stream.close());
Object.assign(window.stageidDashboard, { shown, array, channelCurves, content: () => content, edition: () => link.edition, traces: () => liveTraces.pickers });
