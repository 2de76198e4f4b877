// ---- Statistics -------------------------------------------------------------------
// The same as in statistics/, where the sources are.

const Z = 1.959963984540054;

const sum = (values) => {
  let total = 0;
  for (const value of values) total += value;
  return total;
};
const mean = (values) => values.length ? sum(values) / values.length : null;
const sorted = (values) => Float64Array.from(values).sort();

function deviation(values) {
  if (values.length < 2) return null;
  const center = mean(values);
  let squares = 0;
  for (const value of values) squares += (value - center) ** 2;
  return Math.sqrt(squares / (values.length - 1));
}

/** Of ascending values, interpolated linearly. */
function quantile(ascending, level) {
  if (!ascending.length) return null;
  const last = ascending.length - 1, place = last * level, below = Math.floor(place);
  const low = ascending[below], high = ascending[Math.min(below + 1, last)];
  return low + (high - low) * (place - below);
}

const median = (values) => quantile(sorted(values), 0.5);

/** Everything a table or a box shows of ascending values. */
function summaryOf(ascending) {
  if (!ascending.length) return null;
  return {
    count: ascending.length,
    mean: mean(ascending),
    standard_deviation: deviation(ascending),
    min: ascending[0],
    q1: quantile(ascending, 0.25),
    median: quantile(ascending, 0.5),
    q3: quantile(ascending, 0.75),
    p95: quantile(ascending, 0.95),
    max: ascending[ascending.length - 1],
  };
}

/** Of a share of `n` trials, of which neither has to be whole. */
function wilson(share, n) {
  const scale = 1 + Z * Z / n, center = share + Z * Z / (2 * n);
  const half = Z * Math.sqrt(share * (1 - share) / n + Z * Z / (4 * n * n));
  return { low: share <= 0 ? 0 : (center - half) / scale, high: share >= 1 ? 1 : (center + half) / scale };
}

/** Nothing is inferred from fewer. */
const MIN_CLUSTERS = 6;

/** The mean and its interval, from the weight and the weighted sum of the values of each cluster. */
function clusteredMean(counts, sums) {
  const n = sum(counts), center = sum(sums) / n;
  let clusters = 0, squares = 0;
  counts.forEach((count, g) => {
    if (!count) return;
    clusters++;
    squares += (sums[g] - count * center) ** 2;
  });
  if (!n) return null;
  if (clusters < MIN_CLUSTERS) return { mean: center, mean_interval: null };
  const half = studentQuantile(clusters - 1) * Math.sqrt(clusters / (clusters - 1) * squares) / n;
  return { mean: center, mean_interval: { low: center - half, high: center + half } };
}

const students = new Map();

/** The 97.5 % quantile of Student's distribution: where its tail, an incomplete beta
 *  function, is 5 % on both sides together. */
function studentQuantile(degrees) {
  let found = students.get(degrees);
  if (found) return found;
  let low = 1, high = 13;
  for (let i = 0; i < 80; i++) {
    const middle = (low + high) / 2;
    const tails = incompleteBeta(degrees / 2, 0.5, degrees / (degrees + middle * middle));
    if (tails > 0.05) low = middle; else high = middle;
  }
  students.set(degrees, found = (low + high) / 2);
  return found;
}

/** Logarithm of Γ by Stirling's series, after moving the argument up. */
function logGamma(x) {
  let shift = 0;
  while (x < 10) shift -= Math.log(x++);
  const y = 1 / (x * x);
  const series = (1 / 12 - y * (1 / 360 - y * (1 / 1260 - y * (1 / 1680 - y / 1188)))) / x;
  return shift + (x - 0.5) * Math.log(x) - x + 0.9189385332046727 + series;
}

/** Regularised, by its continued fraction. */
function incompleteBeta(a, b, x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  if (x > (a + 1) / (a + b + 2)) return 1 - incompleteBeta(b, a, 1 - x);
  const front = Math.exp(logGamma(a + b) - logGamma(a) - logGamma(b) + a * Math.log(x) + b * Math.log1p(-x)) / a;
  let fraction = 1, c = 1, d = 1 / (1 - (a + b) * x / (a + 1));
  fraction = d;
  for (let m = 1; m < 300; m++) {
    for (const term of [
      m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
      -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
    ]) {
      d = 1 / (1 + term * d);
      c = 1 + term / c;
      fraction *= c * d;
    }
    if (Math.abs(c * d - 1) < 1e-15) break;
  }
  return front * fraction;
}

// ---- Numbers as text --------------------------------------------------------------
// The same as in format.rs.

/** Three significant digits, but all of those before the point. */
function digits(value, significant = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e9 || size < 1e-6) return scientific(value);
  const decimals = Math.max(0, significant - 1 - Math.floor(Math.log10(size)));
  return minus(value.toFixed(Math.min(decimals, 9)));
}

const fixed = (value, decimals) => value === null || value === undefined || Number.isNaN(value) ? '–' : minus(value.toFixed(decimals));
/** A number as it is, with two decimals at most. */
const plain = (value) => value === null ? '–' : minus(String(Number(value.toFixed(2))));
const minus = (text) => text.replace('-', '−');
const percent = (share) => share === null || share === undefined ? '–' : `${fixed(100 * share, 1)} %`;

/** 1.95×10⁻¹⁴ */
function scientific(value) {
  const [mantissa, power] = value.toExponential(2).split('e');
  const raised = [...power.replace('+', '')].map((c) => c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]).join('');
  return `${minus(mantissa)}×10${raised}`;
}

