
/** For tests of the page. */
const page = globalThis.report = {
  data, columns, filters, changed, cards,
  get story() { return story; },
  get selection() { return selection; },
};
begin();
})();
