// Numbers as text, alike in pages and in what the command prints.

/** Three significant digits, but all of those before the point. */
export function digits(value, significant = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e9 || size < 1e-6) return scientific(value);
  const decimals = Math.max(0, significant - 1 - Math.floor(Math.log10(size)));
  return minus(value.toFixed(Math.min(decimals, 9)));
}

/** A number with so many decimals; a dash for none. */
export const fixed = (value, decimals) => value === null || value === undefined || Number.isNaN(value) ? '–' : minus(value.toFixed(decimals));
/** A number as it is, with two decimals at most. */
export const plain = (value) => value === null ? '–' : minus(String(Number(value.toFixed(2))));
/** With a minus sign in place of a hyphen. */
export const minus = (text) => text.replace('-', '−');
/** A share in percent; a dash for none. */
export const percent = (share) => share === null || share === undefined ? '–' : `${fixed(100 * share, 1)} %`;

/** 1.95×10⁻¹⁴ */
export function scientific(value) {
  const [mantissa, power] = value.toExponential(2).split('e');
  const raised = [...power.replace('+', '')].map((c) => c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]).join('');
  return `${minus(mantissa)}×10${raised}`;
}

