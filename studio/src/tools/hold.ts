// Pins and stiffness by brush: a click on a curve pins it there, a stroke along it makes that stretch stiff.
import { type Holds, holds, hovered, selected, stiffness } from '../model/store';
import type { Found } from '../view/seek';
import type { Bench, Spot, Tool } from './tool';

/** A pin this near to a click is taken out, share of the curve. */
const SAME_PIN_SHARE = 0.03;

export class Hold implements Tool {
  cursor = 'cell';
  private from: Found | null = null;
  private to = 0;

  constructor(private readonly bench: Bench) {}

  private found(spot: Spot): Found | null {
    const curve = spot.curve;
    return curve && (curve.picked.kind === 'curve' || curve.picked.kind === 'feature') ? curve : null;
  }

  /** What holds a curve; nothing yet on another one. */
  private of(found: Found): Holds {
    const { picked } = found;
    const now = holds.value;
    const same = now && now.picked.kind === picked.kind && now.picked.index === picked.index;
    return same ? now : { picked, pins: [], stretches: [] };
  }

  move(spot: Spot): void {
    hovered.value = this.found(spot)?.picked ?? null;
  }

  click(spot: Spot): void {
    const found = this.found(spot);
    if (!found) return;
    const now = this.of(found);
    const others = now.pins.filter((p) => Math.abs(p - found.at) > SAME_PIN_SHARE);
    const pins = others.length < now.pins.length ? others : [...now.pins, found.at].sort((a, b) => a - b);
    holds.value = { ...now, pins };
    selected.value = found.picked;
  }

  down(spot: Spot): boolean {
    this.from = this.found(spot);
    this.to = this.from?.at ?? 0;
    return this.from !== null;
  }

  drag(spot: Spot): void {
    const { from } = this;
    const found = this.found(spot);
    if (!from || !found || found.picked.index !== from.picked.index || found.picked.kind !== from.picked.kind) return;
    this.to = found.at;
    this.bench.view.setLine('hover', this.bench.view.stretch(from.picked, from.at, this.to));
  }

  up(): void {
    const { from, to } = this;
    this.from = null;
    if (!from) return;
    const [a, b] = [Math.min(from.at, to), Math.max(from.at, to)];
    if (b - a < SAME_PIN_SHARE) return;
    const now = this.of(from);
    // The last stroke counts where two lie over each other.
    const rest = now.stretches.filter((s) => s.to <= a || s.from >= b);
    const own = stiffness.value === 1 ? [] : [{ from: a, to: b, curvature: stiffness.value }];
    holds.value = { ...now, stretches: [...rest, ...own].sort((s, t) => s.from - t.from) };
    selected.value = from.picked;
  }

  key(key: string): boolean {
    if (key !== 'Escape' || !holds.value) return false;
    holds.value = null;
    return true;
  }

  leave(): void {
    this.from = null;
    hovered.value = null;
  }
}
