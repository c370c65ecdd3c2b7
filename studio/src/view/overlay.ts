// What a tool draws over everything: lines and dots on a canvas of their own. A hand that drags moves them alone; the picture
// below stays as it was drawn.
import { type Camera, Matrix4, Vector3 } from 'three';

/** Lines of a tool, with their colours and widths in pixels. */
const LINES = {
  preview: { color: '#0891b2', width: 3 },
  helper: { color: '#0f172a', width: 1.5 },
} as const;
/** Lines have a light rim this wide, so that they are seen on whatever is below, pixels. */
const HALO = { color: 'rgba(255, 255, 255, 0.75)', width: 1.5 };
/** Radius of dots with their rim, and without it, pixels. */
const DOT = { outer: 6, inner: 3.9, rim: '#ffffff', edge: 'rgba(15, 23, 42, 0.35)' };

const NOTHING = new Float32Array();

export type OverLine = keyof typeof LINES;

export class Overlay {
  private readonly lines = new Map<OverLine, Float32Array>();
  private dots: { positions: Float32Array; colors: Float32Array } = { positions: NOTHING, colors: NOTHING };

  private isBlank = true;
  private readonly context: CanvasRenderingContext2D | null;

  constructor(private readonly canvas: HTMLCanvasElement) {
    // Not bound to the frames of the page: shown a third sooner where a processor draws.
    this.context = canvas.getContext('2d', { desynchronized: true });
  }

  /** Lines from pairs of ends. */
  setLine(name: OverLine, positions: Float32Array): void {
    this.lines.set(name, positions);
  }

  setDots(positions: Float32Array, colors: Float32Array): void {
    this.dots = { positions, colors };
  }

  /** True while there are lines of a kind. */
  has(name: OverLine): boolean {
    return (this.lines.get(name)?.length ?? 0) > 0;
  }

  resize(width: number, height: number, ratio: number): void {
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
  }

  draw(camera: Camera): void {
    const { context } = this;
    const isBlank = this.dots.positions.length === 0 && [...this.lines.values()].every((l) => l.length === 0);
    if (!context || (isBlank && this.isBlank)) return;
    this.isBlank = isBlank;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const ratio = this.canvas.width / Math.max(1, width);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const toScreen = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const at = new Vector3();
    const pixel = (positions: Float32Array, k: number): { x: number; y: number } | null => {
      at.fromArray(positions, 3 * k).applyMatrix4(toScreen);
      // What lies behind the eye has no place on the screen.
      if (!(at.z > -1 && at.z < 1)) return null;
      return { x: ((at.x + 1) / 2) * width, y: ((1 - at.y) / 2) * height };
    };
    context.lineCap = 'round';
    context.lineJoin = 'round';
    for (const [name, positions] of this.lines) {
      if (positions.length === 0) continue;
      const path = new Path2D();
      let last = { x: Number.NaN, y: Number.NaN };
      for (let k = 0; k + 1 < positions.length / 3; k += 2) {
        const [a, b] = [pixel(positions, k), pixel(positions, k + 1)];
        if (!a || !b) continue;
        if (a.x !== last.x || a.y !== last.y) path.moveTo(a.x, a.y);
        path.lineTo(b.x, b.y);
        last = b;
      }
      const { color, width: wide } = LINES[name];
      context.strokeStyle = HALO.color;
      context.lineWidth = wide + 2 * HALO.width;
      context.stroke(path);
      context.strokeStyle = color;
      context.lineWidth = wide;
      context.stroke(path);
    }
    const { positions, colors } = this.dots;
    for (let k = 0; k < positions.length / 3; k++) {
      const p = pixel(positions, k);
      if (!p) continue;
      const [r, g, b] = [0, 1, 2].map((c) => Math.round(255 * (colors[3 * k + c] ?? 0)));
      disc(context, p, DOT.outer + 0.75, DOT.edge);
      disc(context, p, DOT.outer, DOT.rim);
      disc(context, p, DOT.inner, `rgb(${r}, ${g}, ${b})`);
    }
  }
}

function disc(context: CanvasRenderingContext2D, at: { x: number; y: number }, radius: number, color: string): void {
  context.fillStyle = color;
  context.beginPath();
  context.arc(at.x, at.y, radius, 0, 2 * Math.PI);
  context.fill();
}
