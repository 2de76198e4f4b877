// Forms made of a JSON schema, as plugins describe their options.

import { h, select, number, field } from './dom.js';

/** A schema without references and wrappers: `{type, enum, described, nullable, minimum, maximum, default, description}`. */
export function plain(schema, root, depth = 0) {
  if (schema === true || !schema || depth > 8) return {};
  let out = { ...schema };
  if (out.$ref?.startsWith('#/')) {
    const target = out.$ref.slice(2).split('/').reduce((at, key) => at?.[key.replaceAll('~1', '/').replaceAll('~0', '~')], root);
    const { $ref: _, ...own } = out;
    out = { ...plain(target, root, depth + 1), ...own };
  }
  if (out.allOf?.length === 1) {
    const { allOf, ...own } = out;
    out = { ...plain(allOf[0], root, depth + 1), ...own };
  }
  const choices = out.oneOf ?? out.anyOf;
  if (choices) {
    const rest = choices.filter((choice) => choice.type !== 'null').map((choice) => plain(choice, root, depth + 1));
    const nullable = rest.length < choices.length || out.nullable;
    const { oneOf: _1, anyOf: _2, ...own } = out;
    if (rest.length === 1) out = { ...rest[0], ...own, nullable };
    else if (rest.every((choice) => 'const' in choice || choice.enum)) {
      const described = {};
      const values = rest.flatMap((choice) => {
        for (const value of choice.enum ?? [choice.const]) described[value] = choice.description;
        return choice.enum ?? [choice.const];
      });
      out = { ...own, enum: values, described, nullable };
    }
  }
  if (Array.isArray(out.type)) {
    const types = out.type.filter((type) => type !== 'null');
    out = { ...out, nullable: types.length < out.type.length, type: types.length === 1 ? types[0] : undefined };
  }
  return out;
}

const named = (name) => name.replaceAll('_', ' ');

/** Fields for the properties of an object; `change(values)` is told those that are not the defaults. */
export function schemaForm(schema, values, change, prefix) {
  const whole = plain(schema, schema), properties = Object.entries(whole.properties ?? {});
  const now = { ...values };
  const put = (name, value, fallback) => {
    if (value === undefined || JSON.stringify(value) === JSON.stringify(fallback)) delete now[name];
    else now[name] = value;
    change({ ...now });
  };
  if (!properties.length) return h('p', { class: 'soft' }, 'It has no options.');
  return h('div', { class: 'schema' }, ...properties.map(([name, own]) => {
    const known = plain(own, schema), fallback = known.default ?? whole.default?.[name];
    return schemaField(name, known, now[name] ?? fallback, (value) => put(name, value, fallback), `${prefix}-${name}`, fallback);
  }));
}

function schemaField(name, schema, value, change, key, fallback) {
  const note = schema.description ? sentence(schema.description) : '';
  const id = `about-${key}`.replace(/[^\w-]/g, '-');
  const common = { 'data-key': key, 'aria-describedby': note ? id : undefined };
  let input;
  if (schema.enum) {
    const text = (choice) => choice === null ? 'none' : String(choice);
    const values = schema.nullable && !schema.enum.includes(null) ? [null, ...schema.enum] : schema.enum;
    input = select(values.map((choice) => [JSON.stringify(choice), text(choice)]), JSON.stringify(value ?? null), (chosen) => change(JSON.parse(chosen)), common);
    if (value === undefined) input.selectedIndex = -1;
  } else if (schema.type === 'boolean') {
    input = h('input', { type: 'checkbox', checked: Boolean(value), onchange: () => change(input.checked), ...common });
  } else if (schema.type === 'integer' || schema.type === 'number') {
    // A bound may stand in the format alone, as of unsigned numbers.
    const least = schema.minimum ?? schema.exclusiveMinimum ?? (schema.format?.startsWith('uint') ? 0 : undefined);
    input = number(value, (told) => change(told ?? (schema.nullable ? null : undefined)), {
      min: least, max: schema.maximum ?? schema.exclusiveMaximum, step: schema.type === 'integer' ? 1 : 'any', empty: true,
      placeholder: value === undefined || value === null ? 'not set' : '', ...common,
    });
  } else if (schema.type === 'string') {
    input = h('input', { type: 'text', value: value ?? '', maxLength: schema.maxLength ?? 4096, onchange: () => change(input.value === '' && fallback === undefined ? undefined : input.value), ...common });
  } else {
    // Lists and objects are written as JSON.
    input = h('input', {
      type: 'text', value: value === undefined ? '' : JSON.stringify(value), placeholder: 'JSON', spellcheck: false,
      onchange: () => {
        let told;
        try { told = input.value.trim() === '' ? undefined : JSON.parse(input.value); } catch { return input.setAttribute('aria-invalid', 'true'); }
        input.setAttribute('aria-invalid', 'false');
        change(told);
      },
      ...common,
    });
  }
  const line = field(named(name), input);
  if (schema.type === 'boolean') line.classList.add('switch');
  return note ? h('div', { class: 'described' }, line, h('p', { class: 'note', id }, note)) : line;
}

/** The first sentence of a description. */
export const sentence = (text) => text.replace(/\s+/g, ' ').trim().replace(/^(.{20,}?)[.;](\s.*)?$/, '$1.');

/** Fields that a table lists: `[name, label, kind, choices or bounds]`; a value that is undone goes back to the default. */
export function tableForm(rows, values, change, prefix) {
  return h('div', { class: 'schema' }, ...rows.map(([name, label, kind, extra = {}]) => {
    const common = { 'data-key': `${prefix}-${name}` };
    const put = (value) => change({ ...values, [name]: value === null ? undefined : value });
    if (kind === 'choice') return field(label, select(extra.choices, values[name] ?? extra.fallback, (chosen) => put(extra.numeric ? Number(chosen) : chosen), common));
    if (kind === 'text') {
      const input = h('input', { type: 'text', value: values[name] ?? '', onchange: () => put(input.value), ...common });
      return field(label, input);
    }
    return field(label, number(values[name] ?? extra.fallback, put, { empty: true, placeholder: extra.placeholder ?? '', ...extra.bounds, ...common }), extra.unit);
  }));
}
