// The way in: the address that the command printed has a secret after its `#`, which no browser sends. It is exchanged
// for a key of this page's own, which stays in this tab and goes with every request in a header.

import { $ } from './dom.js';

const NAME = 'fleetyard-key';
const tabs = new BroadcastChannel('fleetyard-keys');

export const keyOf = () => sessionStorage.getItem(NAME) ?? '';

// Other tabs of this studio ask for a way in; pages of other ports are of another origin and do not hear it.
tabs.addEventListener('message', ({ data }) => { if (data === 'key?' && keyOf()) tabs.postMessage({ key: keyOf() }); });

/** The key of another tab, if there is one. */
const keyOfOthers = () => new Promise((found) => {
  const hear = ({ data }) => { if (data?.key) found(data.key); };
  tabs.addEventListener('message', hear);
  tabs.postMessage('key?');
  setTimeout(() => { tabs.removeEventListener('message', hear); found(null); }, 250);
});

/** Takes the secret out of an address, so that it is neither shown nor sent on. */
function secretOf(text) {
  const said = new URLSearchParams(text.slice(text.indexOf('#') + 1));
  const secret = said.get('token');
  said.delete('token');
  return [secret, said.toString().replaceAll('%2C', ',')];
}

/** Comes in with a secret. False where it is worth nothing. */
async function enter(secret) {
  const answer = await fetch('/api/enter', { method: 'POST', headers: { Authorization: `Bearer ${secret}` } });
  if (!answer.ok) return false;
  sessionStorage.setItem(NAME, (await answer.json()).key);
  return true;
}

async function isGood(key) {
  const answer = await fetch('/api/studio', { headers: { Authorization: `Bearer ${key}` } });
  return answer.ok;
}

/** Asks for the address until it is the right one. */
function asked() {
  const box = $('door'), input = $('door-address'), said = $('door-said');
  box.addEventListener('cancel', (event) => event.preventDefault());
  return new Promise((done) => {
    $('door-form').onsubmit = async (event) => {
      event.preventDefault();
      const [secret] = secretOf(input.value.trim());
      if (secret && await enter(secret).catch(() => false)) {
        box.close();
        done();
        return;
      }
      said.hidden = false;
      said.textContent = secret ? 'This studio does not know that address: it may be an older one.' : 'The address ends in #token= and letters.';
    };
    box.showModal();
  });
}

/** Resolves once this page has a key. */
export async function comeIn() {
  const [secret, rest] = secretOf(location.hash);
  if (secret) {
    history.replaceState(null, '', '#' + rest);
    if (await enter(secret)) return;
  }
  if (keyOf() && await isGood(keyOf())) return;
  const other = await keyOfOthers();
  if (other && await isGood(other)) {
    sessionStorage.setItem(NAME, other);
    return;
  }
  sessionStorage.removeItem(NAME);
  await asked();
}

// The printed address was put into a tab that is open.
addEventListener('hashchange', () => { if (secretOf(location.hash)[0]) location.reload(); });
