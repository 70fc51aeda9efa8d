// Colours of the plots, also distinguishable without red-green vision (after Okabe and Ito). The measurement is a wide
// pale line below the thin strong one of the model: if they agree, both are visible.

const palettes = {
  light: {
    measured: '#4aa5e0', model: '#b83a00', residual: '#3d9970', deviation: '#8a8f98', validation: '#b0569b', other: '#8f7300', otherModel: '#6b4fa0', change: '#5b6b7b',
    grid: '#e3e6ea', frame: '#b9c0c8', text: '#4a525c', ink: '#1c232b', below: '#0072b2', above: '#d55e00', marker: '#d55e00', background: '#ffffff',
    curves: ['#0072b2', '#d55e00', '#3d9970', '#b0569b', '#b58900', '#5b6b7b'],
  },
  dark: {
    measured: '#3c86b8', model: '#ffc078', residual: '#54d3a0', deviation: '#8c96a3', validation: '#e39ad0', other: '#6fe0ee', otherModel: '#b79cf0', change: '#9fb0c2',
    grid: '#2a323c', frame: '#4b5663', text: '#aab4c0', ink: '#e4e9ef', below: '#5ab4e8', above: '#ff9a4d', marker: '#ff9a4d', background: '#171c22',
    curves: ['#5ab4e8', '#ff9a4d', '#54d3a0', '#e39ad0', '#e6c04a', '#9fb0c2'],
  },
};

const darkScheme = window.matchMedia('(prefers-color-scheme: dark)');
let printing = false;

function palette() {
  return darkScheme.matches && !printing ? palettes.dark : palettes.light;
}

// Figures {resize, recolour}: those of dygraphs and others.
const plots = new Set();

function recolour() {
  for (const plot of plots) plot.recolour();
}

darkScheme.addEventListener('change', recolour);

// Plots keep their pixels on paper, so they are resized to the page (class "printing") before printing.
function print(on) {
  printing = on;
  document.documentElement.classList.toggle('printing', on);
  for (const plot of plots) plot.resize();
  recolour();
}

window.addEventListener('beforeprint', () => print(true));
window.addEventListener('afterprint', () => print(false));

// Head and tables are shown at once, the plots a moment later.
function afterFirstPaint(work) {
  requestAnimationFrame(() => setTimeout(work));
}
