// Cutting by a plane: a line across the part, and the plane behind it.
import { Vector3 } from 'three';
import type { Edit } from '../protocol/types';
import type { Bench, Spot, Tool } from './tool';

/** A line shorter than this is none, pixels. */
const SHORTEST_STROKE_PIXELS = 12;
/** Places along the line where the part is looked for. */
const PLACES_ALONG_STROKE = 40;

export class Cut implements Tool {
  cursor = 'crosshair';
  private from: Spot | null = null;
  private edit: Edit | null = null;

  constructor(private readonly bench: Bench) {}

  down(spot: Spot): boolean {
    this.from = spot;
    return true;
  }

  drag(spot: Spot): void {
    if (!this.from) return;
    this.edit = this.cut(this.from, spot);
    this.bench.preview(this.edit);
    const { view } = this.bench;
    const ends = [this.from, spot].map((s) => {
      const ray = view.ray(s.x, s.y);
      return ray.at(view.rig.distance() * 0.5, new Vector3());
    });
    view.setLine('helper', new Float32Array(ends.flatMap((p) => p.toArray())));
  }

  private cut(a: Spot, b: Spot): Edit | null {
    if (Math.hypot(a.x - b.x, a.y - b.y) < SHORTEST_STROKE_PIXELS) return null;
    const { view } = this.bench;
    const [r, s] = [view.ray(a.x, a.y), view.ray(b.x, b.y)];
    // The plane of both lines of sight: with parallel ones that through their starts.
    const across = s.origin.clone().add(s.direction).sub(r.origin).sub(r.direction);
    const normal = across.cross(r.direction).normalize();
    // The place of the part nearest to the middle of the line.
    const order = Array.from({ length: PLACES_ALONG_STROKE + 1 }, (_, k) => k / PLACES_ALONG_STROKE).sort(
      (p, q) => Math.abs(p - 0.5) - Math.abs(q - 0.5),
    );
    for (const t of order) {
      const hit = view.pick(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y));
      if (hit) return { edit: 'cut', through: this.bench.world(hit.place), normal: normal.toArray() };
    }
    return null;
  }

  up(): void {
    const edit = this.edit;
    this.leave();
    if (edit) void this.bench.edit(edit);
  }

  key(key: string): boolean {
    if (key !== 'Escape' || !this.from) return false;
    this.leave();
    return true;
  }

  leave(): void {
    this.from = null;
    this.edit = null;
    this.bench.view.setLine('helper', new Float32Array());
    this.bench.preview(null);
  }
}
