// The part of the address after `#`: tab, camera, time, selection, job, tool. It survives a reload, and can be sent.

const REST_MS = 250;
let timer = 0;

export function readLink() {
  const said = new URLSearchParams(location.hash.slice(1));
  const numbers = (name) => (said.get(name) ?? '').split(',').filter((text) => text !== '').map(Number).filter(Number.isFinite);
  return {
    tab: said.get('tab'), tool: said.get('tool'), camera: numbers('at').length === 3 ? numbers('at') : null,
    time: said.has('t') && Number.isFinite(Number(said.get('t'))) ? Number(said.get('t')) : null,
    selection: (said.get('sel') ?? '').split(',').filter((key) => /^[sgom]\d+$/.test(key)), watched: numbers('watch'), robot: said.has('robot') ? Number(said.get('robot')) : null,
    follow: said.has('follow'),
    trial: said.get('trial'),
    layers: (said.get('layers') ?? '').split(',').filter(Boolean),
  };
}

/** Writes what `state()` says, once changes have come to rest. */
export function writeLink(state) {
  clearTimeout(timer);
  timer = setTimeout(() => {
    const said = new URLSearchParams();
    for (const [name, value] of Object.entries(state())) if (value !== null && value !== undefined && value !== '') said.set(name, value);
    // Commas stay readable.
    history.replaceState(null, '', '#' + said.toString().replaceAll('%2C', ','));
  }, REST_MS);
}
