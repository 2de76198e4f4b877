// One loop of frames for everything on a page: clocks advance first, then stages draw. It
// runs only while somebody wants another frame.

export const CLOCKS = 0;
export const STAGES = 1;

const steps = [[], []];
let asked = 0;

/** Calls `step(milliseconds)` in every frame that somebody wants; a step that returns true
 * wants the next one too. Returns a function that ends it. */
export function everyFrame(rank, step) {
  steps[rank].push(step);
  return () => { steps[rank] = steps[rank].filter((other) => other !== step); };
}

/** Wants a frame. */
export function wake() {
  asked ||= requestAnimationFrame(run);
}

function run(time_ms) {
  asked = 0;
  for (const rank of steps) for (const step of rank) if (step(time_ms)) wake();
}
