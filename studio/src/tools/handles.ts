// Handles: a curve through a space curve, whose control vertices are dragged.
import { Plane, Vector3 } from 'three';
import { handleCount, hovered, type Picked, selected, toolHint } from '../model/store';
import { TEXT } from '../model/texts';
import type { CurveName, Edit } from '../protocol/types';
import type { Bench, Spot, Tool } from './tool';

/** A handle this near is meant, pixels. */
const GRAB_PIXELS = 12;

export class Handles implements Tool {
  cursor = 'pointer';
  private curve: CurveName | null = null;
  private points: Vector3[] = [];
  private held = -1;
  private edit: Edit | null = null;
  private asked = 0;

  constructor(private readonly bench: Bench) {}

  private under(spot: Spot): number {
    let [best, least] = [-1, GRAB_PIXELS];
    this.points.forEach((p, k) => {
      const at = this.bench.view.project(p);
      const away = Math.hypot(at.x - spot.x, at.y - spot.y);
      if (away < least) [best, least] = [k, away];
    });
    return best;
  }

  move(spot: Spot): void {
    const found = this.under(spot);
    hovered.value = found < 0 ? (spot.curve?.picked ?? null) : null;
    this.show(found);
  }

  click(spot: Spot): void {
    const picked = spot.curve?.picked;
    if (picked) this.of(picked);
  }

  /** Shows the handles of a curve. */
  of(picked: Picked): void {
    selected.value = picked;
    this.curve = picked.kind === 'feature' ? { feature: picked.index } : picked.index;
    void this.ask();
  }

  /** Asks for the handles of the curve anew. */
  async ask(): Promise<void> {
    if (this.curve === null) return;
    const now = ++this.asked;
    const points = await this.bench.handles(this.curve, handleCount.value);
    if (now !== this.asked) return;
    this.points = points;
    toolHint.value = points.length > 0 ? TEXT.handles.drag : '';
    this.show(-1);
  }

  down(spot: Spot): boolean {
    this.held = this.under(spot);
    return this.held >= 0;
  }

  drag(spot: Spot): void {
    const from = this.points[this.held];
    if (!from || this.curve === null) return;
    const plane = new Plane().setFromNormalAndCoplanarPoint(this.bench.view.rig.toEye(), from);
    const to = this.bench.view.ray(spot.x, spot.y).intersectPlane(plane, new Vector3());
    if (!to) return;
    const by = to.clone().sub(from).toArray();
    this.edit = { edit: 'spline', curve: this.curve, control: this.points.length, moves: [{ vertex: this.held, by }] };
    this.bench.preview(this.edit);
    this.show(this.held, to);
  }

  up(): void {
    const edit = this.edit;
    this.held = -1;
    this.edit = null;
    this.bench.preview(null);
    if (edit) void this.bench.edit(edit).then(() => this.ask());
  }

  key(key: string): boolean {
    if (key !== 'Escape' || this.curve === null) return false;
    this.leave();
    return true;
  }

  leave(): void {
    this.asked++;
    this.curve = null;
    this.points = [];
    this.held = -1;
    this.edit = null;
    hovered.value = null;
    toolHint.value = '';
    this.bench.preview(null);
    this.show(-1);
  }

  private show(hot: number, moved?: Vector3): void {
    const { view } = this.bench;
    const at = this.points.map((p, k) => (k === hot && moved ? moved : p));
    view.setMarks(
      new Float32Array(at.flatMap((p) => p.toArray())),
      new Float32Array(at.flatMap((_, k) => (k === hot ? [1, 0.62, 0.1] : [0.49, 0.23, 0.93]))),
    );
    const pieces = at.slice(1).flatMap((p, k) => [...at[k]!.toArray(), ...p.toArray()]);
    view.setLine('helper', new Float32Array(pieces));
  }
}
