// Colours of the points of a scan: by height, normal, noise, confidence, part, or whether they are outliers.
import type { PointColor } from '../model/store';
import type { Geometry } from '../protocol/frames';

/** What a geometry of points can be coloured by. */
export function colorsOf(points: Geometry | undefined): PointColor[] {
  const all: PointColor[] = ['color', 'normal', 'noise', 'confidence', 'segment', 'outlier'];
  return ['height', ...all.filter((name) => points?.floats.has(name))];
}

type Tint = [number, number, number];
const LOW: Tint = [0.16, 0.36, 0.55];
const HIGH: Tint = [0.8, 0.72, 0.48];
const GOOD: Tint = [0.1, 0.55, 0.5];
const BAD: Tint = [0.85, 0.2, 0.12];
const GREY: Tint = [0.55, 0.58, 0.62];

const mix = (a: Tint, b: Tint, t: number): Tint => [0, 1, 2].map((k) => a[k]! + t * (b[k]! - a[k]!)) as Tint;

/** Parts as far apart in hue as there can be: steps of the golden section. */
function part(n: number): Tint {
  const wave = (offset: number) => 0.5 + 0.32 * Math.cos(2 * Math.PI * (n * 0.618034 + offset));
  return [wave(0), wave(0.33), wave(0.67)];
}

/** The values that 2 and 98 of 100 points lie below: single ones would make all others look alike. */
export function usualRange(values: Float32Array): [number, number] {
  const step = Math.max(1, Math.floor(values.length / 20_000));
  const some: number[] = [];
  for (let k = 0; k < values.length; k += step) some.push(values[k]!);
  some.sort((a, b) => a - b);
  const at = (share: number) => some[Math.floor(share * (some.length - 1))] ?? 0;
  return [at(0.02), at(0.98)];
}

/** A colour for each point. */
export function tints(points: Geometry, how: PointColor, upAxis: 0 | 1 | 2): Float32Array {
  const position = points.floats.get('position') ?? new Float32Array();
  const count = position.length / 3;
  const out = new Float32Array(position.length);
  const put = (k: number, tint: Tint) => out.set(tint, 3 * k);
  const each = (tint: (k: number) => Tint) => {
    for (let k = 0; k < count; k++) put(k, tint(k));
  };
  const values = points.floats.get(how);
  if (how === 'color' && values) return values;
  if (how === 'normal' && values) {
    each((k) => [0, 1, 2].map((x) => 0.5 + 0.45 * values[3 * k + x]!) as Tint);
  } else if (how === 'segment' && values) each((k) => part(values[k]!));
  else if (how === 'outlier' && values) each((k) => (values[k]! > 0.5 ? BAD : GREY));
  else {
    const scalar = values ?? position.filter((_, k) => k % 3 === upAxis);
    const [low, high] = usualRange(scalar);
    const share = (k: number) => Math.max(0, Math.min(1, (scalar[k]! - low) / Math.max(1e-30, high - low)));
    const [from, to] = how === 'noise' ? [GOOD, BAD] : how === 'confidence' ? [BAD, GOOD] : [LOW, HIGH];
    each((k) => mix(from, to, share(k)));
  }
  return out;
}
