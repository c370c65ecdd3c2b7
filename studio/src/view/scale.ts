// Ends of colour scales.

/** The size that 98 of 100 values do not pass: single ones would make all others look alike. */
export function usualMost(values: ArrayLike<number> | undefined): number {
  if (!values || values.length === 0) return 1;
  const step = Math.max(1, Math.floor(values.length / 20_000));
  const sizes: number[] = [];
  for (let k = 0; k < values.length; k += step) sizes.push(Math.abs(values[k]!));
  sizes.sort((a, b) => a - b);
  return sizes[Math.floor(0.98 * (sizes.length - 1))] || sizes[sizes.length - 1] || 1;
}
