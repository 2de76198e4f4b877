/** Columns by name. */
const columns = Object.fromEntries(data.columns.map((packed) => [packed.name, new Column(packed)]));
const booleans = new Set(data.booleans);

/** The planner of each trial as tables name it, with the view of a task, and what it was asked. */
const entrants = new Column(data.entrants), questions = new Column(data.questions), stores = new Column(data.stores);

/** How each trial ended, in a few words. */
const outcomes = new Column(data.outcome).codes;
