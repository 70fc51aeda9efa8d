// With very many channels the panels are a list, page by page, with a search.

const mostNames = 50;  // sensors or actuators of a matrix
const panelsPerPage = 60;

const panelList = { search: null, place: null, page: 0 };

function isListed() {
  return Math.max(content.frf.inputs.length, content.frf.outputs.length) > mostNames;
}

function buildSearch() {
  panelList.search = element('input', { type: 'search', id: 'matrix-search', oninput: () => turnTo(0) });
  panelList.place = element('output', { class: 'band-text', 'aria-live': 'polite' });
  return element('div', { class: 'entry-pick' }, element('label', { for: 'matrix-search' }, 'Find channels ', panelList.search),
    smallButton('\u25c2', 'Previous panels', () => turnTo(panelList.page - 1)), smallButton('\u25b8', 'Next panels', () => turnTo(panelList.page + 1)),
    panelList.place);
}

function turnTo(page) {
  panelList.page = page;
  fillList();
}

// Channels whose name contains all words, from the page that was turned to; after the last page comes the first.
function fillList() {
  const words = panelList.search.value.toLowerCase().split(/\s+/);
  const found = [];
  for (let c = 0; c < channelCount(); ++c) {
    const name = channelName(c).toLowerCase();
    if (words.every((word) => name.includes(word))) found.push(c);
  }
  const pages = Math.max(1, Math.ceil(found.length / panelsPerPage));
  panelList.page = (panelList.page + pages) % pages;
  const first = panelList.page * panelsPerPage;
  const shown = found.slice(first, first + panelsPerPage);
  panelList.place.textContent = shown.length ? count(first + 1) + ' \u2013 ' + count(first + shown.length) + ' of ' + plural(found.length, 'element') : 'nothing found';
  showPanels(shown);
}

function nextInList(from, down, right) {
  const channels = Array.from(matrix.panels.keys());
  const columns = getComputedStyle(matrix.grid).gridTemplateColumns.split(' ').length;
  const place = channels.indexOf(from) + down * columns + right;
  return place in channels ? channels[place] : from;
}
