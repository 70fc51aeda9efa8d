// Response and CMIF: fetched when the stream announces a new edition, drawn with the code of the report.

function fetchResponse(edition) {
  if (edition <= link.edition || link.loading) return Promise.resolve();
  link.loading = true;
  return fetch('response.json' + link.search).then((answer) => answer.json()).then(setResponse).then(() => {
    link.edition = edition;
    showResponse();
  }).finally(() => { link.loading = false; });
}

function showResponse() {
  if (!matrix.grid) {
    buildMatrix();
    buildEntry();
    selectPanel(0);
    buildCmif();
    for (const id of ['timing', 'events']) moveToEnd(id);
    return;
  }
  redrawMatrix();
  showEntry(entry.channel);
  drawCmif();
}

function moveToEnd(id) {
  const body = document.getElementById(id);
  if (!body) return;
  document.getElementById('main').append(body);
  document.getElementById('contents').append(document.querySelector('#contents a[href="#' + id + '"]'));
}
