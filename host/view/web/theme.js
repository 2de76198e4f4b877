// Colours of the page for what is drawn: the custom properties of viewer.css.

const NAMES = [
  'page', 'card', 'ground', 'solid', 'roadmap', 'ink', 'halo', 'contact', 'moving', 'turning', 'waiting', 'parked',
  'planner', 'fail-policy', 'nobody', 'workstation', 'endpoint', 'soft', 'accent',
];

/** By name, as CSS has them; `changes` counts how often they were read. */
export const theme = { changes: 0 };

const heard = new Set();

function read() {
  const style = getComputedStyle(document.documentElement);
  theme.changes++;
  for (const name of NAMES) theme[name] = style.getPropertyValue('--' + name).trim();
}

/** Reads the colours, and calls `hear` whenever they change: light, dark, paper. */
export function onTheme(hear) {
  heard.add(hear);
  return () => heard.delete(hear);
}

const change = () => {
  read();
  for (const hear of heard) hear();
};
read();
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', change);
addEventListener('beforeprint', change);
addEventListener('afterprint', change);

const probe = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
const known = new Map();

/** Red, green, blue and opacity of a CSS colour, each up to 255. */
export function rgba(color) {
  let found = known.get(color);
  if (!found) {
    probe.clearRect(0, 0, 1, 1);
    probe.fillStyle = color;
    probe.fillRect(0, 0, 1, 1);
    known.set(color, found = probe.getImageData(0, 0, 1, 1).data);
  }
  return found;
}
