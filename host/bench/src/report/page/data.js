// ---- The trials ------------------------------------------------------------------

/** The bytes of a column (see columns.rs), as whole numbers of `width` bytes. */
function whole(text, width) {
  let bytes;
  if (Uint8Array.fromBase64) {
    bytes = Uint8Array.fromBase64(text);
  } else {
    const binary = atob(text);
    bytes = new Uint8Array(binary.length);
    for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  }
  const Whole = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[width];
  return new Whole(bytes.buffer, 0, bytes.length / width);
}

/** A column of all trials. What is absent is null, and NaN among numbers. */
class Column {
  #packed;
  #bytes;
  #numbers;
  #codes;

  constructor(packed, length = count) {
    this.length = length;
    this.name = packed.name;
    this.doc = packed.doc;
    this.#packed = packed;
  }

  get bytes() {
    const { form, width, bytes } = this.#packed;
    if (this.#bytes === undefined) {
      this.#bytes = form === 'double' ? new Float64Array(whole(bytes, 1).buffer)
        : whole(bytes, form === 'hex' ? 1 : width);
      // The text is not needed any more.
      this.#packed = { ...this.#packed, bytes: '' };
    }
    return this.#bytes;
  }

  at(row) {
    const { form, value, words, width, first, decimals } = this.#packed;
    switch (form) {
      case 'same': return value;
      case 'words': return words[this.bytes[row]];
      case 'hex': {
        let text = '';
        for (let i = row * width; i < (row + 1) * width; i++) text += this.bytes[i].toString(16).padStart(2, '0');
        return text;
      }
      case 'decimal': {
        const code = this.bytes[row];
        return code === 2 ** (8 * width) - 1 ? null : (first + code) / 10 ** decimals;
      }
      default: return Number.isNaN(this.bytes[row]) ? null : this.bytes[row];
    }
  }

  /** All values as numbers. */
  get numbers() {
    if (this.#numbers) return this.#numbers;
    const numbers = new Float64Array(this.length);
    const { form, value, words } = this.#packed;
    const number = (value) => value === null ? NaN : Number(value);
    if (form === 'same') {
      numbers.fill(number(value));
    } else if (form === 'words') {
      const known = words.map(number);
      for (let i = 0; i < this.length; i++) numbers[i] = known[this.bytes[i]];
    } else {
      for (let i = 0; i < this.length; i++) numbers[i] = number(this.at(i));
    }
    return this.#numbers = numbers;
  }

  /** The different values, and which one each trial has. */
  get codes() {
    if (this.#codes) return this.#codes;
    const { form, value, words } = this.#packed;
    if (form === 'same') return this.#codes = { values: [value], of: new Uint8Array(this.length) };
    if (form === 'words') return this.#codes = { values: words, of: this.bytes };
    const seen = new Map(), values = [], of = new Uint32Array(this.length);
    for (let i = 0; i < this.length; i++) {
      const value = this.at(i);
      let code = seen.get(value);
      if (code === undefined) {
        seen.set(value, code = values.length);
        values.push(value);
      }
      of[i] = code;
    }
    return this.#codes = { values, of };
  }
}

/** Numbers that stand for equal values, over several columns. */
function grouped(columns) {
  let { of } = columns[0].codes, groups = columns[0].codes.values.length;
  for (const column of columns.slice(1)) {
    const more = column.codes, seen = new Map(), next = new Uint32Array(count);
    for (let i = 0; i < count; i++) {
      const both = of[i] * more.values.length + more.of[i];
      let code = seen.get(both);
      if (code === undefined) seen.set(both, code = seen.size);
      next[i] = code;
    }
    of = next;
    groups = seen.size;
  }
  return { of, groups };
}
