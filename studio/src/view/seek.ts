// What of the network is under the cursor.
import { Vector3 } from 'three';
import type { Picked } from '../model/store';
import type { State } from '../protocol/types';
import { share } from './lines';
import type { View } from './view';

/** Corners and curves this near are meant, pixels. */
const CORNER_PIXELS = 11;
const CURVE_PIXELS = 8;

export interface Found {
  picked: Picked;
  place: Vector3;
  /** Share of the length of a curve. */
  at: number;
}

/** The corner nearest to a pixel. */
export function cornerAt(view: View, state: State, x: number, y: number): Found | null {
  const center = state.project?.center ?? [0, 0, 0];
  let best: Found | null = null;
  let least = CORNER_PIXELS;
  state.corners.forEach((c, index) => {
    const place = new Vector3(c[0] - center[0], c[1] - center[1], c[2] - center[2]);
    const p = view.project(place);
    const away = Math.hypot(p.x - x, p.y - y);
    if (away < least && view.isSeen(place)) {
      least = away;
      best = { picked: { kind: 'corner', index }, place, at: 0 };
    }
  });
  return best;
}

/** The curve nearest to a pixel. */
export function curveAt(view: View, x: number, y: number, kind: 'curve' | 'feature' = 'curve'): Found | null {
  const all = kind === 'curve' ? view.curves : view.features;
  const camera = view.camera();
  const [width, height] = [view.canvas.clientWidth, view.canvas.clientHeight];
  const p = new Vector3();
  const found: { away: number; curve: number; segment: number; part: number }[] = [];
  for (let k = 0; k + 1 < all.offset.length; k++) {
    let [px, py] = [0, 0];
    let nearest = { away: CURVE_PIXELS, curve: k, segment: -1, part: 0 };
    for (let i = all.offset[k]!; i < all.offset[k + 1]!; i++) {
      p.fromArray(all.position, 3 * i).project(camera);
      const [qx, qy] = [((p.x + 1) / 2) * width, ((1 - p.y) / 2) * height];
      if (i > all.offset[k]!) {
        const [dx, dy] = [qx - px, qy - py];
        const t = Math.max(0, Math.min(1, ((x - px) * dx + (y - py) * dy) / Math.max(1e-9, dx * dx + dy * dy)));
        const away = Math.hypot(px + t * dx - x, py + t * dy - y);
        if (away < nearest.away) nearest = { away, curve: k, segment: i - 1, part: t };
      }
      [px, py] = [qx, qy];
    }
    if (nearest.segment >= 0) found.push(nearest);
  }
  found.sort((a, b) => a.away - b.away);
  for (const { curve, segment, part } of found) {
    const a = new Vector3().fromArray(all.position, 3 * segment);
    const place = a.lerp(new Vector3().fromArray(all.position, 3 * segment + 3), part);
    if (view.isSeen(place)) return { picked: { kind, index: curve }, place, at: share(all, curve, segment, part) };
  }
  return null;
}
