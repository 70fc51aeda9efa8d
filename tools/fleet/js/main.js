// Layout of the page.

readBlocks().then(buildPage, (error) => {
  window.stageidFleet.errors.push(error.message);
  document.getElementById('main').append(element('p', { class: 'noscript', role: 'alert' }, error.message));
});

function buildPage() {
  placeTracks();
  buildFleetHead();
  buildModes();
  showStage(0);
  buildStages();
  buildOutliers();
  Object.assign(window.stageidFleet, { content, array, valuesOf, reportOf, showStage, over, among });
}

function buildFleetHead() {
  const sum = (key) => content.stages.reduce((total, stage) => total + stage[key], 0);
  const minutes = array('minutes');
  const times = minutes.reduce(([low, high], t) => [Math.min(low, t), Math.max(high, t)], [Infinity, -Infinity]);
  const day = (t) => new Date(60000 * t).toISOString().slice(0, 10);
  document.getElementById('head').append(
    element('p', { class: 'brand' }, 'stageid ' + content.version + ' \u00b7 fleet'),
    element('h1', null, content.title),
    figureList([
      ['stages', count(content.stages.length)], ['identifications', count(sum('count'))], ['time', day(times[0]) + ' \u2013 ' + day(times[1])],
      ['not trustworthy', flagged(sum('doubtful'))], ['failed', flagged(sum('failed'))], ['unusual modes', flagged(content.outliers.filter(([, , unusual]) => unusual).length)],
    ]));
}
