// Files that tests drop on the page.

/** A sphere of radius 1 as OBJ: a cube whose faces are cut into squares and blown up. */
export function sphere(cuts: number): string {
  const names = new Map<string, number>();
  const lines: string[] = [];
  const vertex = (p: number[]): number => {
    const size = Math.hypot(...p);
    const text = p.map((x) => (x / size).toFixed(9)).join(' ');
    let name = names.get(text);
    if (name === undefined) {
      name = names.size + 1;
      names.set(text, name);
      lines.push(`v ${text}`);
    }
    return name;
  };
  const faces: string[] = [];
  for (const axis of [0, 1, 2]) {
    for (const side of [-1, 1]) {
      const at = (i: number, j: number) => {
        const p = [0, 0, 0];
        p[axis] = side;
        p[(axis + 1) % 3] = Math.tan(((2 * i) / cuts - 1) * (Math.PI / 4));
        p[(axis + 2) % 3] = Math.tan(((2 * j) / cuts - 1) * (Math.PI / 4));
        return vertex(p);
      };
      for (let i = 0; i < cuts; i++) {
        for (let j = 0; j < cuts; j++) {
          const [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
          faces.push(side > 0 ? `f ${a} ${b} ${c}\nf ${a} ${c} ${d}` : `f ${a} ${c} ${b}\nf ${a} ${d} ${c}`);
        }
      }
    }
  }
  return `${lines.join('\n')}\n${faces.join('\n')}\n`;
}

/** Random numbers of a seed (mulberry32). */
function random(seed: number): () => number {
  let a = seed;
  return () => {
    a = (a + 0x6d2b79f5) | 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** A noisy scan of an ellipsoid with a few outliers, as XYZ. */
export function scan(points: number, noise: number): string {
  const next = random(1);
  const normal = () => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
  const lines: string[] = [];
  for (let k = 0; k < points; k++) {
    const z = 2 * next() - 1;
    const t = 2 * Math.PI * next();
    const r = Math.sqrt(1 - z * z);
    const far = k % 500 === 0 ? 1.6 : 1 + noise * normal();
    lines.push([10 * r * Math.cos(t), 8 * r * Math.sin(t), 6 * z].map((x) => (x * far).toFixed(5)).join(' '));
  }
  return `${lines.join('\n')}\n`;
}

/** Four places of the unit sphere around the middle of the first view, and that middle. */
export function square(): { corners: number[][]; middle: number[] } {
  const unit = (p: number[]) => p.map((x) => x / Math.hypot(...p));
  const cross = (a: number[], b: number[]) => [
    a[1]! * b[2]! - a[2]! * b[1]!,
    a[2]! * b[0]! - a[0]! * b[2]!,
    a[0]! * b[1]! - a[1]! * b[0]!,
  ];
  const middle = unit([-0.85, -0.75, 0.6]);
  const u = unit(cross([0, 0, 1], middle));
  const v = cross(middle, u);
  const at = (a: number, b: number) => unit(middle.map((x, k) => x + a * u[k]! + b * v[k]!));
  return { corners: [at(-0.4, -0.4), at(0.4, -0.4), at(0.4, 0.4), at(-0.4, 0.4)], middle };
}
