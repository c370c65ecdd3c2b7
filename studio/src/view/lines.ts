// Lines: thick ones for what is edited, thin ones for what is looked at.
import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments } from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import type { Geometry } from '../protocol/frames';

/** Courses of a layer: curve k is points `offset[k]` to `offset[k + 1]`. */
export interface Courses {
  position: Float32Array;
  offset: Uint32Array;
}

export function courses(geometry: Geometry | undefined): Courses {
  return {
    position: geometry?.floats.get('position') ?? new Float32Array(),
    offset: geometry?.numbers.get('offset') ?? new Uint32Array([0]),
  };
}

/** Both ends of all pieces of some curves. */
export function pieces({ position, offset }: Courses, which: Iterable<number>): Float32Array {
  const list: number[] = [];
  for (const k of which) {
    for (let p = offset[k]!; p + 1 < offset[k + 1]!; p++) {
      for (let x = 3 * p; x < 3 * p + 6; x++) list.push(position[x]!);
    }
  }
  return new Float32Array(list);
}

/** A place on a curve at a share of its length. */
export function share(all: Courses, curve: number, segment: number, part: number): number {
  let before = 0;
  let whole = 0;
  const first = all.offset[curve]!;
  const last = all.offset[curve + 1]! - 1;
  for (let p = first; p < last; p++) {
    const length = Math.hypot(
      all.position[3 * p + 3]! - all.position[3 * p]!,
      all.position[3 * p + 4]! - all.position[3 * p + 1]!,
      all.position[3 * p + 5]! - all.position[3 * p + 2]!,
    );
    if (p < segment) before += length;
    else if (p === segment) before += part * length;
    whole += length;
  }
  return whole > 0 ? before / whole : 0;
}

/** Both ends of all pieces of a curve between two shares of its length. */
export function stretch({ position, offset }: Courses, curve: number, from: number, to: number): Float32Array {
  const [low, high] = [Math.min(from, to), Math.max(from, to)];
  const points: number[][] = [];
  for (let p = offset[curve]!; p < offset[curve + 1]!; p++) points.push([...position.subarray(3 * p, 3 * p + 3)]);
  const lengths = points.slice(1).map((p, k) => Math.hypot(...p.map((x, c) => x - points[k]![c]!)));
  const whole = lengths.reduce((a, b) => a + b, 0) || 1;
  const out: number[] = [];
  let before = 0;
  lengths.forEach((length, k) => {
    const [a, b] = [before / whole, (before + length) / whole];
    before += length;
    const [s, t] = [Math.max(a, low), Math.min(b, high)];
    if (t <= s) return;
    for (const share of [s, t]) {
      const part = (share - a) / Math.max(1e-12, b - a);
      for (let c = 0; c < 3; c++) out.push(points[k]![c]! + part * (points[k + 1]![c]! - points[k]![c]!));
    }
  });
  return new Float32Array(out);
}

/** The place of a curve at a share of its length. */
export function placeAt(all: Courses, curve: number, at: number): number[] {
  const pieces = stretch(all, curve, 0, at);
  if (pieces.length >= 3) return [...pieces.subarray(pieces.length - 3)];
  const first = all.offset[curve] ?? 0;
  return [...all.position.subarray(3 * first, 3 * first + 3)];
}

/** True if two lists hold the same numbers: what is the same need not be drawn again. */
export function same(a: Float32Array | undefined, b: Float32Array | undefined): boolean {
  if (a === b) return true;
  if (!a || !b || a.length !== b.length) return false;
  for (let k = 0; k < a.length; k++) if (a[k] !== b[k]) return false;
  return true;
}

/** Lines wider than this mark others, pixels. */
const MARKING_PIXELS = 4;

/** Thick lines of one colour. */
export class Thick {
  readonly object: LineSegments2;
  readonly material: LineMaterial;
  private positions: Float32Array = new Float32Array();
  private colors: Float32Array | undefined;

  constructor(color: string, width: number, vertexColors = false) {
    this.material = new LineMaterial({
      color,
      linewidth: width,
      vertexColors,
    });
    // What is pointed at lies over the line that it is.
    this.material.polygonOffset = width > MARKING_PIXELS;
    this.material.polygonOffsetFactor = -2;
    this.material.polygonOffsetUnits = -8;
    this.object = new LineSegments2(new LineSegmentsGeometry(), this.material);
    this.object.frustumCulled = false;
    this.object.visible = false;
  }

  /** Shows pieces; `colors` has three numbers for each end of one. False if they are those that are shown. */
  set(positions: Float32Array, colors?: Float32Array): boolean {
    if (same(positions, this.positions) && same(colors, this.colors)) return false;
    this.positions = positions;
    this.colors = colors;
    this.object.geometry.dispose();
    this.object.geometry = new LineSegmentsGeometry();
    this.object.visible = positions.length > 0;
    if (positions.length > 0) this.object.geometry.setPositions(positions);
    if (positions.length > 0 && colors) this.object.geometry.setColors(colors);
    return true;
  }
}

/** Thin lines of one colour. */
export class Thin {
  readonly object: LineSegments;
  private positions: Float32Array = new Float32Array();

  constructor(color: string, opacity: number) {
    const material = new LineBasicMaterial({ color, opacity, transparent: opacity < 1 });
    this.object = new LineSegments(new BufferGeometry(), material);
    this.object.frustumCulled = false;
    this.object.visible = false;
  }

  /** Shows pieces. False if they are those that are shown. */
  set(positions: Float32Array, _colors?: Float32Array): boolean {
    if (same(positions, this.positions)) return false;
    this.positions = positions;
    this.object.geometry.dispose();
    this.object.geometry = new BufferGeometry();
    this.object.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.object.visible = positions.length > 0;
    return true;
  }
}
