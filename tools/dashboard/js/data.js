// Data from the program: constant in the page, then streamed; and the newest response.

const shown = JSON.parse(document.getElementById('content').textContent);
const link = { search: location.search, edition: 0, loading: false };

// The response in the format of the report page; empty until the first realization is complete.
let content = { frf: null, arrays: {}, candidates: [], modes: [] };

async function setResponse(fresh) {
  blocks = await unpackAll(fresh.blocks);
  content = fresh.content;
  decoded = {};
  lastCurves.channel = null;
  matrix.columns = null;
}
