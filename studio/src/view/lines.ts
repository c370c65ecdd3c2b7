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

/** Lines wider than this mark others, pixels. */
const OVER = 4;

/** Thick lines of one colour. */
export class Thick {
  readonly object: LineSegments2;
  readonly material: LineMaterial;

  constructor(color: string, width: number, inFront = false) {
    this.material = new LineMaterial({ color, linewidth: width, depthTest: !inFront, transparent: inFront });
    // What is pointed at lies over the line that it is.
    this.material.polygonOffset = width > OVER;
    this.material.polygonOffsetFactor = -2;
    this.material.polygonOffsetUnits = -8;
    this.object = new LineSegments2(new LineSegmentsGeometry(), this.material);
    this.object.frustumCulled = false;
    this.object.visible = false;
    if (inFront) this.object.renderOrder = 10;
  }

  set(positions: Float32Array): void {
    this.object.geometry.dispose();
    this.object.geometry = new LineSegmentsGeometry();
    this.object.visible = positions.length > 0;
    if (positions.length > 0) this.object.geometry.setPositions(positions);
  }
}

/** Thin lines of one colour. */
export class Thin {
  readonly object: LineSegments;

  constructor(color: string, opacity: number) {
    const material = new LineBasicMaterial({ color, opacity, transparent: opacity < 1 });
    this.object = new LineSegments(new BufferGeometry(), material);
    this.object.frustumCulled = false;
    this.object.visible = false;
  }

  set(positions: Float32Array): void {
    this.object.geometry.dispose();
    this.object.geometry = new BufferGeometry();
    this.object.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.object.visible = positions.length > 0;
  }
}
