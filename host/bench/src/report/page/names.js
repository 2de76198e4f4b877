/** Columns by name. */
const columns = Object.fromEntries(data.columns.map((packed) => [packed.name, new Column(packed)]));
const booleans = new Set(data.booleans);

/** How each trial ended, in a word. */
const outcomes = (() => {
  const parts = ['success', 'valid', 'violations', 'fault', 'limit_exceeded', 'termination'].map((name) => columns[name]);
  const { of, groups } = grouped(parts);
  const first = new Int32Array(groups).fill(-1);
  for (let i = 0; i < count; i++) if (first[of[i]] < 0) first[of[i]] = i;
  const values = [], codes = [];
  for (const i of first) {
    const [success, , violations, fault, limit, termination] = parts.map((column) => column.at(i));
    const word = success ? 'success' : fault || (limit ? `over ${limit}` : violations ? 'invalid plan' : termination);
    if (!values.includes(word)) values.push(word);
    codes.push(values.indexOf(word));
  }
  return { values, of: Uint32Array.from(of, (group) => codes[group]) };
})();
