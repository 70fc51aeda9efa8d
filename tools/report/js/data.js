// Data embedded in the report.

const content = JSON.parse(document.getElementById('content').textContent);

let blocks = {};  // by name, unpacked
const decoded = {};

async function readBlocks() {
  blocks = await unpackAll(Object.fromEntries(Object.keys(content.arrays).map((id) => [id, document.getElementById('data-' + id).textContent])));
}

// The array of that name, decoded on first use; null if the report does not contain it.
function array(id) {
  const about = content.arrays[id];
  if (!about) return null;
  if (!decoded[id]) decoded[id] = decoders[about.type](blocks[id], about, about.base && array(about.base));
  return decoded[id];
}
