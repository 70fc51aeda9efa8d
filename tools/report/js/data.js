// Data embedded in the report.

const content = JSON.parse(document.getElementById('content').textContent);

async function readBlocks() {
  blocks = await unpackAll(Object.fromEntries(Object.keys(content.arrays).map((id) => [id, document.getElementById('data-' + id).textContent])));
}
