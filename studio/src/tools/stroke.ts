// Painting: clicks along a curve, shown as it will run.
import type { Vector3 } from 'three';
import { paintMode, toolHint } from '../model/store';
import { TEXT } from '../model/texts';
import type { Edit } from '../protocol/types';
import type { Bench, Spot, Tool } from './tool';

/** A click this near to the first pick closes the curve, pixels. */
const CLOSE_PIXELS = 12;

export class Stroke implements Tool {
  cursor = 'crosshair';
  private picks: Vector3[] = [];

  constructor(
    private readonly bench: Bench,
    private readonly kind: 'paint' | 'feature',
  ) {}

  private editOf(picks: Vector3[], closed: boolean): Edit {
    const places = picks.map((p) => this.bench.world(p));
    const mode = paintMode.value;
    // A magnetic stroke is drawn to creases unless told otherwise.
    const magnet = mode === 'magnetic' ? { magnet: 'creases' as const } : {};
    if (this.kind === 'feature') return { edit: 'feature', picks: places, mode, ...magnet };
    return { edit: 'paint', picks: places, mode, ...(closed ? { closed } : {}), ...magnet };
  }

  private closes(spot: Spot): boolean {
    const first = this.picks[0];
    if (this.kind === 'feature' || !first || this.picks.length < 3) return false;
    const p = this.bench.view.project(first);
    return Math.hypot(p.x - spot.x, p.y - spot.y) < CLOSE_PIXELS;
  }

  /** Where a pick goes: to a corner or curve that is near, else where it is. */
  private target(spot: Spot): Vector3 | null {
    return spot.corner?.place ?? spot.curve?.place ?? spot.place;
  }

  move(spot: Spot): void {
    const target = this.target(spot);
    const closes = this.closes(spot);
    this.marks(closes ? (this.picks[0] ?? null) : target);
    if (this.picks.length === 0 || !target) return this.bench.preview(null);
    this.bench.preview(this.editOf(closes ? this.picks : [...this.picks, target], closes));
  }

  click(spot: Spot): void {
    if (this.closes(spot)) return void this.finish(true);
    const target = this.target(spot);
    if (!target) return;
    this.picks.push(target.clone());
    this.marks(null);
    const meets = this.kind === 'paint' && (spot.corner !== null || spot.curve !== null);
    if (meets && this.picks.length > 1) void this.finish(false);
    else toolHint.value = this.picks.length > 1 ? TEXT.tool.enterEnds : TEXT.tool.clickNext;
  }

  doubleClick(): void {
    void this.finish(false);
  }

  key(key: string): boolean {
    if (key === 'Enter' && this.picks.length > 1) void this.finish(false);
    else if (key === 'Backspace' && this.picks.length > 0) {
      this.picks.pop();
      this.marks(null);
      this.bench.preview(this.picks.length > 1 ? this.editOf(this.picks, false) : null);
    } else if (key === 'Escape' && this.picks.length > 0) this.leave();
    else return false;
    return true;
  }

  private async finish(closed: boolean): Promise<void> {
    const picks = this.picks;
    if (picks.length < 2) return;
    this.picks = [];
    toolHint.value = '';
    const made = await this.bench.edit(this.editOf(picks, closed));
    this.bench.preview(null);
    // What was refused can be mended: the picks are still there.
    if (!made && this.picks.length === 0) this.picks = picks;
    this.marks(null);
  }

  leave(): void {
    this.picks = [];
    toolHint.value = '';
    this.marks(null);
    this.bench.preview(null);
  }

  private marks(cursor: Vector3 | null): void {
    const all = cursor ? [...this.picks, cursor] : this.picks;
    const positions = new Float32Array(all.flatMap((p) => p.toArray()));
    const colors = new Float32Array(
      all.flatMap((_, k) => (k < this.picks.length ? [0.03, 0.57, 0.7] : [1, 0.62, 0.1])),
    );
    this.bench.view.setMarks(positions, colors);
  }
}
