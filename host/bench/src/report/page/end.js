
/** For tests of the page. */
const page = globalThis.report = {
  data, filters,
  drawn: 0,
  get drawing() { return drawing; },
  figure: (kind, ...rest) => FIGURES[kind](...rest),
  get story() { return story; },
  get selection() { return selection; },
};
begin();
})();
