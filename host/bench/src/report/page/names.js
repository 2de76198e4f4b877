/** Columns by name. */
const columns = Object.fromEntries(data.columns.map((packed) => [packed.name, new Column(packed)]));
const booleans = new Set(data.booleans);

/** How each trial ended, in a few words. */
const outcomes = new Column(data.outcome).codes;
