// Refusals in the words of the page: robots, obstacles and kinds in place of JSON pointers.

const THINGS = [
  [/^\/agents\/(\d+)(?:\/(start|goal))?/, ([, index, end]) => `Robot ${index}${end ? `, its ${end}` : ''}`],
  [/^\/agents$/, () => 'Robots'],
  [/^\/ground\/world\/obstacles\/(\d+)/, ([, index]) => `Obstacle ${index}`],
  [/^\/ground\/world\/movers\/(\d+)/, ([, index]) => `Moving obstacle ${index}`],
  [/^\/ground\/world/, () => 'World'],
  [/^\/ground\/map/, () => 'Map'],
  [/^\/robots\/([^/]+)/, ([, name]) => `Kind of robots “${name.replaceAll('~1', '/').replaceAll('~0', '~')}”`],
  [/^\/views\/(grid|roadmap)(?:\/(\w+))?/, ([, view, name]) => `The ${view}${name ? `: ${name.replaceAll('_', ' ')}` : ''}`],
  [/^\/(?:run|fleet|simulate)\/(?:execute\/)?(\w+?)(?:_ms|_s|_m)?$/, ([, name]) => `Settings: ${name.replaceAll('_', ' ')}`],
];

/** A place in words; places in files stay as they are. Null of a place in a request: what is wrong with it is said. */
export function placeInWords(place) {
  if (!place?.startsWith('/')) return place || null;
  for (const [pattern, words] of THINGS) {
    const found = pattern.exec(place);
    if (found) return words(found);
  }
  return null;
}

/** The key of what a place selects: `s3` or `g3`, `o2`, `m0`; null of others. */
export function keyOfPlace(place) {
  const [, index, end] = /^\/agents\/(\d+)(?:\/(start|goal))?/.exec(place ?? '') ?? [];
  if (index !== undefined) return `${end === 'goal' ? 'g' : 's'}${index}`;
  const [, list, at] = /^\/ground\/world\/(obstacles|movers)\/(\d+)/.exec(place ?? '') ?? [];
  return list ? list[0] + at : null;
}

/** What the command calls agents are robots here. */
export const inRobots = (text) => text.replace(/\b(a)n (?=agent\b)/gi, '$1 ').replace(/\b([Aa])gent(s?)\b/g, (_, a, many) => `${a === 'A' ? 'R' : 'r'}obot${many}`);

/** A text as a sentence. */
export function asSentence(text) {
  const told = inRobots(text);
  return told.charAt(0).toUpperCase() + told.slice(1) + (/[.?!]$/.test(told) ? '' : '.');
}
