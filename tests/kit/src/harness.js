// Works a page as a user would, and logs what that found to the console.
(async () => {
  const found = {};
  const $ = (id) => document.getElementById(id);
  const check = (name, ok, detail) => { found[name] = ok ? 'ok' : `FAILED ${JSON.stringify(detail)}`; };
  const near = (a, b, by = 1e-6) => Math.abs(a - b) <= by;
  const frames = async (n) => {
    for (let i = 0; i < n; i++) await new Promise((done) => requestAnimationFrame(done));
  };
  const key = (name, target = document.body, options = {}) =>
    target.dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true, cancelable: true, ...options }));
  try {
USER
  } catch (error) {
    found.error = `FAILED ${error.stack}`;
  }
  console.log(`selftest ${JSON.stringify({ found, errors: globalThis.pageErrors })} selftest-end`);
})();
