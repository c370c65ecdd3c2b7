// Relief at another strength: the surfaces, and from there towards the displaced ones, or past them.
import type { Geometry } from '../protocol/frames';

/** What lies at a share of the way; nothing if both are not of one fit. */
export function blend(smooth: Geometry | undefined, displaced: Geometry, strength: number): Geometry {
  const [a, b] = [smooth?.floats.get('position'), displaced.floats.get('position')];
  if (strength === 1 || !a || !b || a.length !== b.length) return displaced;
  const floats = new Map(displaced.floats);
  for (const name of ['position', 'normal']) {
    const [from, to] = [smooth!.floats.get(name)!, displaced.floats.get(name)!];
    floats.set(
      name,
      from.map((x, k) => x + strength * (to[k]! - x)),
    );
  }
  return { ...displaced, floats };
}
