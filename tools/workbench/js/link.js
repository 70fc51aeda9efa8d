// The link to the program: a stream of states, results that replace those of the page, and actions.

const bench = { state: null, stage: null, trends: [], edition: 0, loading: false };

// Sections that depend on the model, in resultParts; 'trends' is that of the workbench.
const modelKeys = ['verdict', 'model', 'modes', 'shapes', 'shape_channels', 'geometry', 'decisions', 'cost', 'comparison', 'validation', 'loop'];

const previews = {
  linear: 'Preview: the numerators are fitted, poles and delays not yet', improved: 'Preview after a second of iterations; the fit is running',
  stopped: 'The fit was stopped: this is the best model so far', failed: 'The fit failed; undo, or change it',
};

// Sends an action; the program answers with a text. Only this page can set the header.
async function send(path, kind, body) {
  const answer = await fetch(path + location.search, { method: 'POST', headers: { 'X-Stageid': kind }, body });
  const text = (await answer.text()).trim();
  return { good: answer.ok, text };
}

async function act(action) {
  const answer = await send('act', 'act', JSON.stringify(action)).catch(() => ({ good: false, text: 'the program does not answer' }));
  tellAnswer(action, answer);
  return answer;
}

function stopFit() {
  return send('abort', 'abort', '');
}

async function fetchResults(edition) {
  if (edition <= bench.edition || bench.loading) return;
  bench.loading = true;
  try {
    const answer = await fetch('response.json' + location.search);
    await takeResults(await answer.json());
    bench.edition = edition;
    showResults();
  } finally {
    bench.loading = false;
  }
  if (bench.state.edition > bench.edition) await fetchResults(bench.state.edition);
}

// The measured response remains; the residual follows from the new model.
async function takeResults(fresh) {
  array('response');  // decoded with the arrays that it was packed with
  const unpacked = await unpackAll(fresh.blocks);
  for (const id of ['model_response', 'model_deviation', 'other_response', 'other_model', 'residual']) {
    delete content.arrays[id];
    delete decoded[id];
  }
  Object.assign(blocks, unpacked);
  Object.assign(content.arrays, fresh.arrays);
  if (content.arrays.model_response) {
    content.arrays.residual = { type: 'difference' };
    decoded.residual = difference(array('response'), array('model_response'));
  }
  for (const key of modelKeys) content[key] = fresh.content[key];
  const responses = content.provenance.filter(({ of }) => of !== 'model');
  content.provenance = responses.concat(fresh.content.provenance);
  Object.assign(bench, { stage: fresh.stage, trends: fresh.trends });
  if (previews[fresh.stage]) content.verdict = { level: 'doubt', text: previews[fresh.stage], head: [], reasons: [] };
  lastCurves.channel = null;
}
