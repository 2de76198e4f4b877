// Which planners are offered, and in which order: those to begin with first, then by what they plan on. What is made
// for one robot, or for measuring, is not offered for teams.

/** The first of each that is installed is chosen where nobody has chosen. */
const RECOMMENDED = { map: ['lacam', 'pibt', 'mapf-lns', 'pbs'], world: ['roadmap-pp', 'plane-pp', 'lacam', 'pibt'], cars: ['db-cbs', 'db-lacam'] };
const FOR_FLEETS = ['pibt', 'pbs', 'epibt', 'wppl'];

/** What planners plan on, by the names that the command has for it. */
export const VIEWS = [['grid', 'grid'], ['roadmap', 'roadmap'], ['continuous', 'plane']];
export const viewName = (view) => (VIEWS.find(([key]) => key === view) ?? [view, view])[1];

const number = (planner, feature) => Number(planner.features?.find((name) => name.startsWith(feature))?.slice(feature.length) ?? Infinity);
const plansFor = (planner, agents) => number(planner, 'agents:') >= agents && !planner.features?.includes('for:measuring');

/** Dynamics of cars among the robots of a document: they follow no plan but of planners that know them. */
function carsOf({ agents, robots }, kinds) {
  const names = new Set(agents.map(({ robot }) => robot ?? Object.keys(robots)[0]));
  const models = [...names].map((name) => kinds.profile(name)?.model?.car).filter(Boolean);
  return [...new Set(models.map(({ trailer }) => `dynamics:fleetyard.car${trailer ? '-trailer' : ''}/1`))];
}

/** Groups of planners, `[title, planners]`, for the robots of a document. A team is meant until there are robots. */
export function offered(planners, document, kinds) {
  const cars = carsOf(document, kinds), first = RECOMMENDED[cars.length ? 'cars' : document.ground.map ? 'map' : 'world'];
  const fit = planners.filter((planner) => plansFor(planner, document.agents.length || 2) && cars.every((car) => planner.features?.includes(car)));
  const best = first.map((id) => fit.find((planner) => planner.id === id)).filter(Boolean);
  const rest = fit.filter((planner) => !best.includes(planner));
  return [
    ['Recommended', best],
    ...VIEWS.map(([view, name]) => [`${view === 'continuous' ? 'In' : 'On'} the ${name}`, rest.filter(({ representations = [] }) => representations[0] === view)]),
  ].filter(([, all]) => all.length);
}

/** Planners for robots that get new goals, the recommended ones first. */
export function offeredToFleets(planners) {
  const rank = ({ id }) => (FOR_FLEETS.indexOf(id) + 1) || FOR_FLEETS.length + 1;
  return planners.filter((planner) => plansFor(planner, 2) && planner.representations?.includes('grid') && planner.capabilities?.includes('windowed'))
    .sort((a, b) => rank(a) - rank(b));
}
