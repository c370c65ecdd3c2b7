// The lasso: points of a scan within a line around them are left out.
import { Matrix4, Vector3 } from 'three';
import type { Bench, Spot, Tool } from './tool';

/** Corners of the line are this far apart at least, pixels. */
const STEP_PIXELS = 5;

export class Lasso implements Tool {
  cursor = 'crosshair';
  private line: { x: number; y: number }[] = [];

  constructor(private readonly bench: Bench) {}

  down(spot: Spot): boolean {
    this.line = [{ x: spot.x, y: spot.y }];
    return true;
  }

  drag(spot: Spot): void {
    const last = this.line[this.line.length - 1];
    if (!last || Math.hypot(last.x - spot.x, last.y - spot.y) < STEP_PIXELS) return;
    this.line.push({ x: spot.x, y: spot.y });
    const { view } = this.bench;
    const at = this.line.map(({ x, y }) =>
      view
        .ray(x, y)
        .at(view.rig.distance() * 0.5, new Vector3())
        .toArray(),
    );
    const pieces = at.flatMap((p, k) => [...p, ...(at[k + 1] ?? at[0]!)]);
    view.setLine('helper', new Float32Array(pieces));
  }

  up(): void {
    const { view } = this.bench;
    const line = this.line.map(({ x, y }): [number, number] => [
      (2 * x) / view.canvas.clientWidth - 1,
      1 - (2 * y) / view.canvas.clientHeight,
    ]);
    this.leave();
    if (line.length < 3) return;
    view.ray(0, 0);
    const camera = view.camera();
    const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    void this.bench.lasso(matrix.elements, line);
  }

  key(key: string): boolean {
    if (key !== 'Escape' || this.line.length === 0) return false;
    this.leave();
    return true;
  }

  leave(): void {
    this.line = [];
    this.bench.view.setLine('helper', new Float32Array());
  }
}
