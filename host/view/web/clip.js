// Clips: poses of all bodies at equal intervals, as the program sends them (clip.rs).

const MAGIC = 0x31435946;
const HEADER = 48;
/** Poses in all: what a clip of hostile bytes may make a page allocate is bounded by its size too. */
const MOST = 1 << 28;

/** A clip from its bytes. Of body i at sample s, `x[s * bodies + i]` is x in units of `length_m`; `h`, in units
 * of `angle_rad`, is null where there are no headings. Throws where the bytes are no clip. */
export function decode(buffer) {
  const bytes = new Uint8Array(buffer), data = new DataView(buffer);
  const fail = (reason) => { throw new RangeError(`not a clip: ${reason}`); };
  if (bytes.length < HEADER) fail('it is too short');
  const [magic, bodies, samples, flags] = [0, 4, 8, 12].map((at) => data.getUint32(at, true));
  const [first_s, sample_s, length_m, angle_rad] = [16, 24, 32, 40].map((at) => data.getFloat64(at, true));
  if (magic !== MAGIC) fail('it begins otherwise');
  if (flags > 1) fail(`flags ${flags} are unknown`);
  if (![first_s, sample_s, length_m, angle_rad].every(Number.isFinite) || sample_s <= 0 || length_m <= 0) fail('a unit is no number');
  const poses = bodies * samples, channels = 2 + flags;
  // Each number takes a byte at least.
  if (poses > MOST || poses * channels > bytes.length - HEADER) fail('it ends early');
  const values = Array.from({ length: channels }, () => new Int32Array(poses));
  let at = HEADER;
  for (let sample = 0; sample < samples; sample++) {
    for (const channel of values) {
      const here = sample * bodies, before = here - bodies;
      for (let i = 0; i < bodies; i++) {
        let byte = bytes[at++], code = byte & 127;
        for (let unit = 128; byte > 127; unit *= 128) {
          if (unit > 2 ** 28 || at >= bytes.length) fail('a number is too long');
          byte = bytes[at++];
          code += (byte & 127) * unit;
        }
        const step = code % 2 ? -(code + 1) / 2 : code / 2;
        channel[here + i] = sample ? channel[before + i] + step : step;
      }
    }
    if (at > bytes.length) fail('it ends early');
  }
  if (at !== bytes.length) fail('something comes after it');
  return { first_s, sample_s, length_m, angle_rad, bodies, samples, x: values[0], y: values[1], h: values[2] ?? null };
}
