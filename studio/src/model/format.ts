// Numbers for people.

/** A length with as many digits as tell something. */
export function length(value: number, unit: string): string {
  return `${digits(value)} ${unit}`;
}

/** At most three significant digits, without a useless tail. */
export function digits(value: number): string {
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

/** A whole number with thin gaps between thousands. */
export function count(value: number): string {
  return String(value).replace(/\B(?=(\d{3})+$)/g, '\u202f');
}

/** `1 patch`, `2 patches`. */
export function plural(value: number, one: string, many = `${one}s`): string {
  return `${count(value)} ${value === 1 ? one : many}`;
}
