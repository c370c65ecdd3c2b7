// Dragging a curve or a corner, with the snake live under the cursor.
import { Plane, Vector3 } from 'three';
import { dragWidth, holds, hovered } from '../model/store';
import type { CurveName, Edit } from '../protocol/types';
import type { Found } from '../view/seek';
import type { Bench, Spot, Tool } from './tool';

/** A curve is not dragged at its very ends: those are corners. */
const END_SHARE = 0.02;

export class Pull implements Tool {
  cursor = 'grab';
  private held: Found | null = null;
  private edit: Edit | null = null;

  constructor(private readonly bench: Bench) {}

  move(spot: Spot): void {
    hovered.value = (spot.corner ?? spot.curve)?.picked ?? null;
  }

  down(spot: Spot): boolean {
    this.held = spot.corner ?? spot.curve;
    this.edit = null;
    return this.held !== null;
  }

  drag(spot: Spot): void {
    const { held, bench } = this;
    if (!held) return;
    // Where the cursor is off the part, the place goes on in the plane of the view.
    const plane = new Plane().setFromNormalAndCoplanarPoint(bench.view.rig.toEye(), held.place);
    const free = bench.view.ray(spot.x, spot.y).intersectPlane(plane, new Vector3());
    const to = spot.place ?? free;
    if (!to) return;
    this.edit = this.editTo(held, to);
    bench.preview(this.edit);
    bench.view.setMarks(new Float32Array(to.toArray()), new Float32Array([1, 0.62, 0.1]));
  }

  private editTo(held: Found, to: Vector3): Edit {
    const { kind, index } = held.picked;
    if (kind === 'corner')
      return { edit: 'drag_corner', corner: index, to: this.bench.world(to), reach: dragWidth.value };
    const by = to.clone().sub(held.place).toArray();
    const curve: CurveName = kind === 'feature' ? { feature: index } : index;
    const at = Math.min(1 - END_SHARE, Math.max(END_SHARE, held.at));
    const kept = holds.value;
    const own = kept && kept.picked.kind === kind && kept.picked.index === index ? kept : null;
    const { pins = [], stretches: stiffness = [] } = own ?? {};
    return {
      edit: 'drag_curve',
      curve,
      at,
      by,
      width: dragWidth.value,
      ...(pins.length > 0 ? { pins } : {}),
      ...(stiffness.length > 0 ? { stiffness } : {}),
    };
  }

  up(): void {
    const edit = this.edit;
    this.leave();
    if (edit) void this.bench.edit(edit);
  }

  key(key: string): boolean {
    if (key !== 'Escape' || !this.held) return false;
    this.leave();
    return true;
  }

  leave(): void {
    this.held = null;
    this.edit = null;
    hovered.value = null;
    this.bench.view.setMarks(new Float32Array(), new Float32Array());
    this.bench.preview(null);
  }
}
