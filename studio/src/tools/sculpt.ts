// The brush of the relief: raises, engraves, smooths or erases along the way of the cursor.
import { Vector3 } from 'three';
import { type BrushMode, brush, brushLength, setBrush } from '../model/store';
import type { ReliefEdit } from '../protocol/types';
import type { Bench, Spot, Tool } from './tool';

/** Places of a stroke are this far apart at least, of its radius. */
const STEP_SHARE = 0.25;
/** Corners of the ring that shows how wide the brush is. */
const RING = 48;
/** A brush that smooths blurs by this share of its radius: what is as wide as the brush stays. */
const BLUR_SHARE = 1 / 3;

const NOTHING = new Float32Array();

/** The edit that a stroke of the brush makes; lengths in world units. */
export function strokeOf(
  mode: BrushMode,
  path: [number, number, number][],
  radius: number,
  height: number,
): ReliefEdit {
  const region = { path, radius, feather: radius };
  switch (mode) {
    case 'raise':
      return { edit: 'stroke', path, radius, height };
    case 'engrave':
      return { edit: 'stroke', path, radius, height: -height };
    case 'smooth':
      return { edit: 'blur', radius: BLUR_SHARE * radius, region };
    case 'erase':
      return { edit: 'erase', region };
  }
}

export class Sculpt implements Tool {
  cursor = 'crosshair';
  private path: Vector3[] = [];

  constructor(private readonly bench: Bench) {}

  move(spot: Spot): void {
    this.ring(spot.place);
  }

  down(spot: Spot): boolean {
    this.path = spot.place ? [spot.place.clone()] : [];
    return this.path.length > 0;
  }

  drag(spot: Spot): void {
    const { place } = spot;
    const last = this.path[this.path.length - 1];
    if (!place || !last) return;
    this.ring(place);
    if (place.distanceTo(last) < STEP_SHARE * this.length('radius')) return;
    this.path.push(place.clone());
    const pieces = this.path.flatMap((p, k) => (k > 0 ? [...this.path[k - 1]!.toArray(), ...p.toArray()] : []));
    this.bench.view.setLine('preview', new Float32Array(pieces));
  }

  click(spot: Spot): void {
    if (spot.place) this.make([spot.place]);
  }

  up(): void {
    const { path } = this;
    this.leave();
    this.make(path);
  }

  key(key: string): boolean {
    if (key === '[' || key === ']') {
      setBrush('radius', brush.value.radius + (key === '[' ? -1 : 1));
      return true;
    }
    if (key !== 'Escape' || this.path.length === 0) return false;
    this.leave();
    return true;
  }

  leave(): void {
    this.path = [];
    this.bench.view.setLine('preview', NOTHING);
    this.bench.view.setLine('helper', NOTHING);
  }

  /** World units. */
  private length(which: 'radius' | 'height'): number {
    return 2 * this.bench.view.rig.radius * brushLength(which);
  }

  private make(places: Vector3[]): void {
    if (places.length === 0) return;
    const path = places.map((p) => this.bench.world(p));
    void this.bench.sculpt(strokeOf(brush.value.mode, path, this.length('radius'), this.length('height')));
  }

  private ring(place: Vector3 | null): void {
    const { view } = this.bench;
    if (!place) return view.setLine('helper', NOTHING);
    const right = new Vector3(1, 0, 0).applyQuaternion(view.rig.turn).multiplyScalar(this.length('radius'));
    const up = new Vector3(0, 1, 0).applyQuaternion(view.rig.turn).multiplyScalar(this.length('radius'));
    const at = (k: number) => {
      const turn = (2 * Math.PI * k) / RING;
      return place.clone().addScaledVector(right, Math.cos(turn)).addScaledVector(up, Math.sin(turn)).toArray();
    };
    view.setLine('helper', new Float32Array(Array.from({ length: RING }, (_, k) => [...at(k), ...at(k + 1)]).flat()));
  }
}
