// Sections that are built again when the model changes, in their places.

function removeSection(id) {
  const node = document.getElementById(id);
  if (!node) return;
  for (const plot of plots) {
    if (!node.contains(plot.node || plot.graphDiv)) continue;
    plots.delete(plot);
    if (plot.destroy) plot.destroy();
  }
  document.querySelector('#contents a[href="#' + id + '"]').remove();
  node.remove();
}

// Builds the section before the next one of the page that exists.
function rebuild(parts, place) {
  const [id, wanted, build] = parts[place];
  removeSection(id);
  if (!wanted()) return;
  build();
  const next = parts.slice(place + 1).map(([other]) => document.getElementById(other)).find(Boolean);
  if (!next) return;
  next.before(document.getElementById(id));
  document.querySelector('#contents a[href="#' + next.id + '"]').before(document.querySelector('#contents a[href="#' + id + '"]'));
}

const changingParts = new Set(['modes', 'shapes', 'loop', 'comparison', 'trends', 'validation', 'cost', 'decisions', 'provenance']);

function showResults() {
  const top = window.scrollY;
  document.getElementById('head').replaceChildren();
  buildHead('workbench');
  resultParts.forEach(([id], place) => {
    if (changingParts.has(id)) keepFocus(() => document.getElementById(id), () => rebuild(resultParts, place));
  });
  fillMatrixLegend();
  redrawMatrix();
  showEntry(entry.channel);
  if (content.arrays.cmif) drawCmif();
  if (stability.figure) stability.figure.redraw();
  afterFirstPaint(addRemoveButtons);
  window.scrollTo(0, top);
}

// A button per mode in the table of modes, for those who do not use the diagram.
function addRemoveButtons() {
  for (const row of document.querySelectorAll('#modes tbody tr')) {
    const button = row.querySelector('td:nth-child(2) button');
    if (!button || row.querySelector('.remove')) continue;
    const mode = content.modes.find((one) => fixed(one.frequency_hz) === button.textContent);
    if (mode) row.append(element('td', null, element('button', { type: 'button', class: 'plain small remove', 'aria-label': 'Remove the mode at ' + button.textContent + ' Hz',
      onclick: () => removeMode(mode.frequency_hz) }, 'Remove')));
  }
}

function addMode(hz, damping) {
  return act({ kind: 'add', frequency_hz: hz, ...(damping ? { damping_ratio: damping } : {}) });
}

function removeMode(hz) {
  return act({ kind: 'remove', frequency_hz: hz });
}

function fitBand(low, high) {
  return act({ kind: 'band', low_hz: low, high_hz: high });
}
