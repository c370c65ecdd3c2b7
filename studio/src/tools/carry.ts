// Landmarks: a place on the other project, then the same place on this one; with three pairs its network can be carried over.
import type { Vector3 } from 'three';
import { landmarks, shape, state, toolHint } from '../model/store';
import { TEXT } from '../model/texts';
import type { Bench, Spot, Tool } from './tool';

export class Carry implements Tool {
  cursor = 'crosshair';

  constructor(private readonly bench: Bench) {}

  private get waits(): boolean {
    const last = landmarks.value[landmarks.value.length - 1];
    return last !== undefined && last.own === null;
  }

  move(spot: Spot): void {
    this.show(this.place(spot));
  }

  private place(spot: Spot): Vector3 | null {
    return shape.value === 'peer' ? this.bench.view.pickShown(spot.x, spot.y) : spot.place;
  }

  click(spot: Spot): void {
    const peer = state.value.peer;
    const place = this.place(spot);
    if (!peer || !place) return;
    const pairs = [...landmarks.value];
    if (shape.value === 'peer') {
      const [x, y, z] = [0, 1, 2].map((k) => place.getComponent(k) + peer.center[k]!);
      const other: [number, number, number] = [x!, y!, z!];
      if (this.waits) pairs.pop();
      landmarks.value = [...pairs, { other, own: null }];
      shape.value = 'mesh';
    } else if (this.waits) {
      const last = pairs.pop()!;
      landmarks.value = [...pairs, { ...last, own: this.bench.world(place) }];
      shape.value = 'peer';
    }
    this.show(null);
  }

  key(key: string): boolean {
    if (key !== 'Backspace' || landmarks.value.length === 0) return false;
    landmarks.value = landmarks.value.slice(0, -1);
    this.show(null);
    return true;
  }

  leave(): void {
    toolHint.value = '';
    this.bench.view.setMarks(new Float32Array(), new Float32Array());
    if (shape.value === 'peer') shape.value = 'mesh';
  }

  private show(cursor: Vector3 | null): void {
    const onPeer = shape.value === 'peer';
    const center = (onPeer ? state.value.peer?.center : state.value.project?.center) ?? [0, 0, 0];
    const local = (p: [number, number, number]) => p.map((x, k) => x - center[k]!);
    const places = landmarks.value.flatMap((l) => {
      const p = onPeer ? l.other : l.own;
      return p ? [local(p)] : [];
    });
    toolHint.value = !state.value.peer
      ? TEXT.carry.choose
      : onPeer
        ? TEXT.carry.other
        : this.waits
          ? TEXT.carry.own
          : '';
    const all = cursor ? [...places, cursor.toArray()] : places;
    this.bench.view.setMarks(
      new Float32Array(all.flat()),
      new Float32Array(all.flatMap((_, k) => (k < places.length ? [0.03, 0.57, 0.7] : [1, 0.62, 0.1]))),
    );
  }
}
