// Tools of one click: select, add a corner, split a region, delete; and measure, of two.
import type { Vector3 } from 'three';
import { length } from '../model/format';
import { hovered, isolated, selected, shape, state, tab, toolHint } from '../model/store';
import { TEXT } from '../model/texts';
import type { Edit } from '../protocol/types';
import type { Bench, Spot, Tool } from './tool';

export class Select implements Tool {
  constructor(private readonly bench: Bench) {}

  private found(spot: Spot) {
    const line = spot.corner ?? spot.curve;
    if (line) return line.picked;
    if (shape.value !== 'surfaces' && shape.value !== 'displaced') return null;
    const patch = this.bench.view.pickPatch(spot.x, spot.y);
    return patch === null || patch >= state.value.patches.length ? null : { kind: 'patch' as const, index: patch };
  }

  move(spot: Spot): void {
    hovered.value = this.found(spot);
  }

  click(spot: Spot): void {
    selected.value = this.found(spot);
    if (selected.value) tab.value = 'edit';
  }

  key(key: string): boolean {
    if (key === 'Escape') {
      if (selected.value === null && isolated.value === null) return false;
      selected.value = null;
      isolated.value = null;
      return true;
    }
    return false;
  }

  leave(): void {
    hovered.value = null;
  }
}

export class AddCorner implements Tool {
  cursor = 'crosshair';

  constructor(private readonly bench: Bench) {}

  move(spot: Spot): void {
    const place = spot.curve?.place ?? spot.place;
    this.bench.view.setMarks(new Float32Array(place?.toArray() ?? []), new Float32Array(place ? [1, 0.62, 0.1] : []));
  }

  click(spot: Spot): void {
    const place = spot.curve?.place ?? spot.place;
    if (place) void this.bench.edit({ edit: 'add_corner', at: this.bench.world(place) });
  }

  leave(): void {
    this.bench.view.setMarks(new Float32Array(), new Float32Array());
  }
}

export class Split implements Tool {
  cursor = 'pointer';

  constructor(private readonly bench: Bench) {}

  private edit(place: Vector3): Edit {
    return { edit: 'split_region', at: this.bench.world(place) };
  }

  move(spot: Spot): void {
    this.bench.preview(spot.place ? this.edit(spot.place) : null);
  }

  click(spot: Spot): void {
    if (spot.place) void this.bench.edit(this.edit(spot.place)).then(() => this.bench.preview(null));
  }

  leave(): void {
    this.bench.preview(null);
  }
}

export class Erase implements Tool {
  cursor = 'pointer';

  constructor(private readonly bench: Bench) {}

  move(spot: Spot): void {
    hovered.value = (spot.corner ?? spot.curve)?.picked ?? null;
  }

  click(spot: Spot): void {
    const found = spot.corner ?? spot.curve;
    if (found) void this.bench.edit(erase(found.picked));
  }

  leave(): void {
    hovered.value = null;
  }
}

/** What deletes a corner or a curve. */
export function erase(picked: { kind: string; index: number }): Edit {
  if (picked.kind === 'corner') return { edit: 'delete_corner', corner: picked.index };
  if (picked.kind === 'feature') return { edit: 'delete_feature', feature: picked.index };
  return { edit: 'delete_curves', curves: [picked.index] };
}

export class Measure implements Tool {
  cursor = 'crosshair';
  private from: Vector3 | null = null;

  constructor(private readonly bench: Bench) {}

  private target(spot: Spot): Vector3 | null {
    return spot.corner?.place ?? spot.curve?.place ?? spot.place;
  }

  private show(to: Vector3): void {
    const { view } = this.bench;
    const ends = this.from ? [this.from, to] : [to];
    view.setMarks(
      new Float32Array(ends.flatMap((p) => p.toArray())),
      new Float32Array(ends.flatMap(() => [1, 0.62, 0.1])),
    );
    if (!this.from) return;
    view.setLine('helper', new Float32Array(ends.flatMap((p) => p.toArray())));
    toolHint.value = TEXT.tool.distance(length(this.from.distanceTo(to), state.value.project?.units ?? ''));
  }

  move(spot: Spot): void {
    const target = this.target(spot);
    if (target && this.from && !this.done) this.show(target);
  }

  private done = false;

  click(spot: Spot): void {
    const target = this.target(spot);
    if (!target) return;
    if (this.from && !this.done) {
      this.show(target);
      this.done = true;
      return;
    }
    this.leave();
    this.from = target.clone();
    this.show(target);
    toolHint.value = TEXT.tool.clickOther;
  }

  key(key: string): boolean {
    if (key !== 'Escape' || !this.from) return false;
    this.leave();
    return true;
  }

  leave(): void {
    this.from = null;
    this.done = false;
    toolHint.value = '';
    this.bench.view.setMarks(new Float32Array(), new Float32Array());
    this.bench.view.setLine('helper', new Float32Array());
  }
}
