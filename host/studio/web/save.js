// Saves the document: into the files from which it was opened, or under a name that is asked for.

import { $, h, say } from './dom.js';
import { api } from './api.js';
import { asSentence } from './places.js';

const told = ({ files }) => say(`saved ${files.join(', ')}`);

/** Saves a document that has files; asks for a name of one that has none. */
export async function save(store) {
  if (!store.file) return saveAs(store);
  try {
    told(await api.save().catch(outside));
    await store.load();
  } catch (error) { if (error) store.refuse(error); }
}

/** Asks before a file is written that is not in the document's folder: the task that names it may be anybody's. */
async function outside(error) {
  if (!error.rest?.outside) throw error;
  const box = $('ask-box');
  $('ask-text').textContent = 'Outside of the folder of this document:';
  $('ask-list').replaceChildren(...error.rest.outside.map((file) => h('li', {}, h('code', {}, file))));
  box.returnValue = '';
  box.showModal();
  await new Promise((closed) => { box.addEventListener('close', closed, { once: true }); });
  if (box.returnValue !== 'write') throw null;
  return api.save({ outside: true });
}

/** Asks for a name. A file that is there is replaced only after that is asked for, too. */
export async function saveAs(store) {
  const box = $('save-box'), form = $('save-form'), name = $('save-name'), said = $('save-said'), button = $('save-do');
  let replace = false;
  const meant = (on, text = '') => {
    replace = on;
    said.hidden = !text;
    said.textContent = text;
    button.textContent = on ? 'Replace' : 'Save';
  };
  meant(false);
  name.value = store.document.name === 'untitled' ? '' : store.document.name;
  name.oninput = () => meant(false);
  $('save-cancel').onclick = () => box.close();
  form.onsubmit = async (event) => {
    event.preventDefault();
    button.disabled = true;
    try {
      told(await api.save({ name: name.value.trim(), ...(replace ? { replace } : {}) }));
      box.close();
      await store.load();
    } catch (error) {
      meant(error.rest?.exists === true, [error.message, error.hint].filter(Boolean).map(asSentence).join(' '));
    }
    button.disabled = false;
  };
  box.showModal();
  name.select();
  const { folder } = await api.about();
  $('save-where').textContent = `In the folder ${folder}.`;
}
