// The controls: mode by number, band, and the options of the fit with the sentence of the user guide beside each.

// [key of the action, label, choices, sentence of docs/guide.md]
const fitOptions = [
  ['weighting', 'Weighting', ['', 'noise_variance', 'total_variance', 'likelihood', 'relative', 'inverse_magnitude', 'unit'],
    'If the plant is nonlinear, use the total variance; if sensor noise is correlated, the likelihood.'],
  ['damping', 'Damping', ['', 'proportional', 'general'], 'General damping suits modes with non-proportional damping.'],
  ['residue_rank', 'Rank of a mode', ['', '1'], 'Rank 1 suits mechanical modes, and gives a small state space.'],
  ['delay', 'Delay', ['', 'estimate', 'per_channel'], 'Use a delay per channel if each channel has its own anti-alias filter.'],
  ['rigid_body', 'Rigid body', ['', 'auto', 'full', 'none', 'suspension'], 'A suspension replaces the rigid body if springs or gravity compensators carry it.'],
  ['direct_term', 'Direct term', ['', 'full', 'none'], 'The direct term represents modes above the band.'],
];

const controls = { nodes: {} };

function buildControls() {
  const field = (id, label, more) => {
    const input = element('input', { id, type: 'number', step: 'any', min: '0', ...more });
    controls.nodes[id] = input;
    return element('label', { for: id }, label + ' ', input);
  };
  const value = (id) => Number(controls.nodes[id].value);
  const add = element('form', { class: 'entry-pick', id: 'add-form', onsubmit: (event) => {
    event.preventDefault();
    addMode(value('add-hz'), value('add-damping') / 100);
  } }, field('add-hz', 'Mode at [Hz]', { required: '' }), field('add-damping', '\u03b6 [%]', { value: '1', max: '99' }), submitButton('Add mode'));
  const band = element('form', { class: 'entry-pick', id: 'band-form', onsubmit: (event) => {
    event.preventDefault();
    fitBand(value('band-low'), value('band-high'));
  } }, field('band-low', 'Band of the fit [Hz]', { required: '' }), field('band-high', 'to', { required: '' }), submitButton('Set band'),
    plainButton('All lines', () => fitBand(null, null)), plainButton('Visible band', () => fitBand(...shownBand())));
  const options = element('div', { class: 'fit-options' }, ...fitOptions.map(([key, label, list, sentence]) => {
    const select = element('select', { id: 'option-' + key, 'aria-describedby': 'why-' + key, onchange: () => act({ kind: 'refit', [key]: select.value }) },
      ...list.map((word) => element('option', { value: word }, word.replace(/_/g, ' ') || 'default')));
    controls.nodes[key] = select;
    return element('div', null, element('label', { for: 'option-' + key }, label + ' ', select), element('span', { class: 'quiet', id: 'why-' + key }, sentence));
  }));
  return element('div', null, add, band, element('details', { open: '' }, element('summary', null, 'Options of the fit'), options,
    element('p', null, plainButton('Search modes automatically', () => act({ kind: 'refit', modes: 'auto' })))));
}

function submitButton(text) {
  return element('button', { type: 'submit', class: 'plain' }, text);
}

function plainButton(text, onclick, more) {
  return element('button', { type: 'button', class: 'plain', onclick, ...more }, text);
}

// A word that is not among the choices, such as a delay in seconds, is shown as one.
function showControls() {
  const { controls: now } = bench.state;
  for (const [key] of fitOptions) {
    const select = controls.nodes[key];
    const word = key === 'residue_rank' && now[key] === 'full' ? '' : now[key];
    if (!Array.from(select.options).some((option) => option.value === word)) select.append(element('option', { value: word }, word));
    select.value = word;
  }
  const [low, high] = now.band_hz || (content.frf ? content.frf.band_hz : ['', '']);
  if (!document.getElementById('band-form').contains(document.activeElement)) {
    controls.nodes['band-low'].value = low;
    controls.nodes['band-high'].value = high;
  }
}
