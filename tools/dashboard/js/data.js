// What the program tells: once in the page, then in the stream; and the newest response.

const shown = JSON.parse(document.getElementById('shown').textContent);
const link = { search: location.search, edition: 0, loading: false };

// The response as the report page holds it; empty until the first realization is complete.
let content = { frf: null, arrays: {}, candidates: [], modes: [] };
let blocks = {};
let decoded = {};

function array(id) {
  const about = content.arrays[id];
  if (!about) return null;
  if (!decoded[id]) decoded[id] = decoders[about.type](bytesOf(blocks[id]), about);
  return decoded[id];
}

function setResponse(fresh) {
  content = fresh.content;
  blocks = fresh.blocks;
  decoded = {};
  curvesOfChannel.clear();
  matrix.columns = null;
}
