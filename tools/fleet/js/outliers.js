// Identifications that failed, are not to be trusted, or have unusual modes, with the reason.

const mostOutliers = 500;

function buildOutliers() {
  const all = content.outliers.map(([identification, doubt, unusual]) => ({ identification, doubt, unusual, time: array('minutes')[identification] }))
    .sort((a, b) => b.time - a.time);
  const body = section('outliers', 'Outliers', 'Outliers', all.length > mostOutliers
    ? 'The newest ' + mostOutliers + ' of ' + count(all.length) + '; \u201cstageid fleet query STORE outliers\u201d lists all.'
    : all.length === 0 ? 'There are none.' : 'The newest first. The date opens the report of that day.');
  if (all.length === 0) return;
  body.append(table(['time', 'stage', 'reason'], all.slice(0, mostOutliers).map((row) => [
    element('td', null, reportLink(row.identification)), element('td', null, stageOf(row.identification).name), reasonCell(row)]), '', 'findings'));
}

const verdictLevels = [null, 'level-1', 'level-2'];
const verdictWords = ['', 'not trustworthy', 'failed'];

function reasonCell({ identification, doubt, unusual }) {
  const verdict = array('verdict')[identification];
  const sign = verdict > 0 ? element('span', { class: 'severity ' + verdictLevels[verdict] }, verdictWords[verdict] + ': ') : null;
  return element('td', null, sign, [doubt, unusual].filter(Boolean).join('; '));
}
