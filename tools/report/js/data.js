// What stands in the report itself.

const content = JSON.parse(document.getElementById('content').textContent);

const decoded = {};

// The array of that name, decoded when first asked for; null where the report has none.
function array(id) {
  const about = content.arrays[id];
  if (!about) return null;
  if (!decoded[id]) decoded[id] = decoders[about.type](bytesOf(document.getElementById('data-' + id).textContent), about);
  return decoded[id];
}
