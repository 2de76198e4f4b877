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

/** Everything a table or a box shows of values; the second of ascending ones. */
const summary = (values) => summaryOf(sorted(values));

function summaryOf(ascending) {
  if (!ascending.length) return null;
  return {
    count: ascending.length,
    mean: mean(ascending),
    standard_deviation: deviation(ascending),
    mean_interval: meanInterval(ascending),
    min: ascending[0],
    q1: quantile(ascending, 0.25),
    median: quantile(ascending, 0.5),
    q3: quantile(ascending, 0.75),
    p95: quantile(ascending, 0.95),
    max: ascending[ascending.length - 1],
  };
}

/** Mean and its interval, of values in any order. */
const spread = (values) => values.length ? { mean: mean(values), mean_interval: meanInterval(values), count: values.length } : null;

function wilson(successes, trials) {
  if (!trials) return null;
  const share = successes / trials, scale = 1 + Z * Z / trials;
  const center = share + Z * Z / (2 * trials);
  const half = Z * Math.sqrt(share * (1 - share) / trials + Z * Z / (4 * trials * trials));
  return {
    low: successes === 0 ? 0 : (center - half) / scale,
    high: successes === trials ? 1 : (center + half) / scale,
  };
}

function meanInterval(values) {
  if (values.length < 2) return null;
  const center = mean(values);
  const half = studentQuantile(values.length - 1) * deviation(values) / Math.sqrt(values.length);
  return { low: center - half, high: center + half };
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

/** The chance of at most `k` successes in `n` at `p`. */
const binomialAtMost = (k, n, p) => k >= n ? 1 : p <= 0 ? 1 : p >= 1 ? 0 : incompleteBeta(n - k, k + 1, 1 - p);

/** Exact two-sided paired sign test. */
function signTest(positive, negative) {
  const n = positive + negative;
  return n ? Math.min(1, 2 * binomialAtMost(Math.min(positive, negative), n, 0.5)) : 1;
}

function holm(values) {
  const order = values.map((_, i) => i).sort((a, b) => values[a] - values[b]);
  const adjusted = [];
  let most = 0;
  order.forEach((i, rank) => {
    most = Math.max(most, Math.min(1, (values.length - rank) * values[i]));
    adjusted[i] = most;
  });
  return adjusted;
}

/** 95 % percentile bootstrap interval of the median, from the distribution that
 *  resamples come from, so that nothing is drawn.
 *
 *  With ascending x₁ … xₙ the chance that the k-th of a resample is at most xᵢ and the
 *  next one above xⱼ is C(n, k)·(i/n)^k·(1 − j/n)^(n − k) for i ≤ j, a product of a
 *  function of i and one of j. */
function medianInterval(values) {
  const x = sorted(values), n = x.length;
  if (!n) return null;
  const k = Math.ceil(n / 2), even = n % 2 === 0;
  /** The chance that the k-th of a resample is among the first i. */
  const within = (i) => i <= 0 ? 0 : i >= n ? 1 : 1 - binomialAtMost(k - 1, n, i / n);
  if (!even) {
    const at = (level) => {
      let low = 0, high = n;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (within(middle) >= level) high = middle; else low = middle;
      }
      return x[high - 1];
    };
    return { low: at(0.025), high: at(0.975) };
  }
  // Beyond six standard deviations nothing is lost.
  const reach = Math.ceil(3 * Math.sqrt(n)) + 2;
  const from = Math.max(1, k - reach), to = Math.min(n, k + 1 + reach);
  const choose = (logGamma(n + 1) - logGamma(k + 1) - logGamma(n - k + 1)) / n;
  // Halves of the factor, so that neither part is out of range.
  const part = (share, power) => share <= 0 ? 0 : Math.exp(power * (Math.log(share) + choose));
  const a = [], above = [], single = [];
  let before = within(from - 1);
  for (let i = from; i <= to; i++) {
    a.push(part(i / n, k) - part((i - 1) / n, k));
    above.push(part((n - i) / n, n - k));
    const now = within(i);
    single.push(now - before);
    before = now;
  }
  const size = a.length;
  const least = within(from - 1);
  /** The chance that the median of a resample is at most t. */
  const atMost = (t) => {
    let total = 0, j = size - 1;
    for (let i = 0; i < size; i++) {
      // The last j whose mean with i is not above t.
      while (j >= 0 && (x[from - 1 + i] + x[from - 1 + j]) / 2 > t) j--;
      if (j < i) break;
      // All of i, less what goes with a greater j.
      total += single[i] - a[i] * above[j];
    }
    return total + least;
  };
  const at = (level) => {
    let low = x[from - 1], high = x[to - 1];
    if (atMost(low) >= level) return low;
    for (let i = 0; i < 100 && high - low > 1e-13 * Math.max(Math.abs(low), Math.abs(high)); i++) {
      const middle = (low + high) / 2;
      if (atMost(middle) >= level) high = middle; else low = middle;
    }
    return high;
  };
  return { low: at(0.025), high: at(0.975) };
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

const probability = (p) => p === null || p === undefined ? '–' : p < 1e-300 ? '<10⁻³⁰⁰' : p < 1e-3 ? scientific(p) : fixed(p, 3);
