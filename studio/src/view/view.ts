// The view: the scene, its camera, when it is drawn. It shows what the model says and knows nothing of tools.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  ColorManagement,
  LinearSRGBColorSpace,
  Mesh,
  OrthographicCamera,
  PerspectiveCamera,
  Plane,
  Points,
  Ray,
  Scene,
  type ShaderMaterial,
  Vector2,
  Vector3,
  Vector4,
  WebGLRenderer,
} from 'three';
import { MeshBVH } from 'three-mesh-bvh';
import type { Geometry } from '../protocol/frames';
import { type Courses, courses, pieces, placeAt, same, stretch, Thick, Thin } from './lines';
import { cloudMaterial, dotMaterial, MODES, surfaceMaterial } from './materials';
import { type OverLine, Overlay } from './overlay';
import { HALF_FOV, Rig } from './rig';

/** The full mesh comes back so long after the last move, milliseconds. */
const STILL_MS = 150;
const NOTHING = new Float32Array();
/** Renderers that draw with the processor: fewer pixels for them. */
const SOFTWARE_RENDERER = /swiftshader|llvmpipe|software|basic render/i;

ColorManagement.enabled = false;

export interface Hit {
  /** World units, relative to the middle. */
  place: Vector3;
  face: number;
}

export class View {
  readonly rig = new Rig();
  readonly canvas: HTMLCanvasElement;
  readonly scene = new Scene();
  private readonly renderer: WebGLRenderer;
  private readonly perspective = new PerspectiveCamera((2 * HALF_FOV * 180) / Math.PI, 1, 0.01, 100);
  private readonly flat = new OrthographicCamera();
  private isParallel = false;
  private readonly surface = surfaceMaterial();
  private readonly coarseSurface: ShaderMaterial;
  private readonly cloud = cloudMaterial();
  private shown: Mesh | null = null;
  private coarse: Mesh | null = null;
  private points: Points | null = null;
  private pickable: { geometry: BufferGeometry; bvh: MeshBVH | null } | null = null;
  readonly lines = {
    isolines: new Thin('#1f2937', 0.42),
    nets: new Thin('#7c3aed', 0.75),
    smooth: new Thick('#12343b', 2.2),
    sharp: new Thick('#c2410c', 2.6),
    boundary: new Thick('#4d5560', 2.2),
    features: new Thick('#7e22ce', 2),
    angles: new Thick('#ffffff', 4.5, true),
    held: new Thick('#be185d', 5.5),
    hover: new Thick('#0ea5a0', 4.5),
    chosen: new Thick('#f59e0b', 4.5),
    erase: new Thick('#dc2626', 4.5),
  };
  private readonly corners = new Points(new BufferGeometry(), dotMaterial(9, '#12343b'));
  private readonly pins = new Points(new BufferGeometry(), dotMaterial(13, '#ffffff'));
  curves: Courses = courses(undefined);
  features: Courses = courses(undefined);
  private moving = false;
  private stillTimer = 0;
  private queued = false;
  /** True if the scene has changed since it was drawn, and not only what lies over it. */
  private stale = false;
  private frames = 0;
  readonly overlay: Overlay;
  onFrame: (() => void) | null = null;

  constructor(canvas: HTMLCanvasElement, over: HTMLCanvasElement) {
    this.canvas = canvas;
    this.overlay = new Overlay(over);
    const probe = document.createElement('canvas').getContext('webgl2');
    const info = probe?.getExtension('WEBGL_debug_renderer_info');
    const name = info && probe ? String(probe.getParameter(info.UNMASKED_RENDERER_WEBGL)) : '';
    probe?.getExtension('WEBGL_lose_context')?.loseContext();
    const slow = SOFTWARE_RENDERER.test(name);
    this.renderer = new WebGLRenderer({ canvas, antialias: !slow, preserveDrawingBuffer: true });
    // Colours are written as they are named.
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.localClippingEnabled = true;
    this.renderer.setPixelRatio(slow ? 1 : Math.min(2, window.devicePixelRatio));
    this.coarseSurface = this.surface;
    for (const line of Object.values(this.lines)) this.scene.add(line.object);
    for (const dots of [this.corners, this.pins]) {
      dots.frustumCulled = false;
      dots.visible = false;
      this.scene.add(dots);
    }
    // What holds a curve lies over the mark that it is chosen.
    this.lines.held.material.polygonOffsetFactor = -4;
    this.lines.held.material.polygonOffsetUnits = -24;
    this.rig.look('corner');
  }

  /** Draws soon. */
  draw(): void {
    this.stale = true;
    this.drawOver();
  }

  /** Draws soon what lies over the scene, and the scene if it has changed. */
  private drawOver(): void {
    if (this.queued) return;
    this.queued = true;
    requestAnimationFrame(() => {
      this.queued = false;
      this.updateCamera();
      if (this.stale) {
        this.stale = false;
        this.frames++;
        this.renderer.render(this.scene, this.camera());
      }
      this.overlay.draw(this.camera());
      this.onFrame?.();
    });
  }

  get drawn(): number {
    return this.frames;
  }

  get isQueued(): boolean {
    return this.queued || this.moving;
  }

  camera(): PerspectiveCamera | OrthographicCamera {
    return this.isParallel ? this.flat : this.perspective;
  }

  resize(width: number, height: number): void {
    this.renderer.setSize(width, height, false);
    this.overlay.resize(width, height, Math.min(2, window.devicePixelRatio));
    for (const line of Object.values(this.lines)) {
      if (line instanceof Thick) line.material.resolution.set(width, height);
    }
    this.draw();
  }

  aspect(): number {
    return this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
  }

  /** The view moves: the mesh of fewer triangles is shown until it rests. */
  moved(): void {
    this.moving = true;
    this.swap();
    clearTimeout(this.stillTimer);
    this.stillTimer = window.setTimeout(() => {
      this.moving = false;
      this.swap();
      this.draw();
    }, STILL_MS);
    this.draw();
  }

  private swap(): void {
    const light = this.moving && this.coarse !== null && this.shownIsMesh;
    if (this.shown) this.shown.visible = !light;
    if (this.coarse) this.coarse.visible = light;
  }

  setParallel(on: boolean): void {
    this.isParallel = on;
    this.surface.uniforms.parallel!.value = on;
    this.draw();
  }

  setBackground(color: string): void {
    this.scene.background = new Color(color);
    this.draw();
  }

  private updateCamera(): void {
    const { rig } = this;
    const eye = rig.toEye();
    const far = rig.distance() + 3 * rig.radius;
    const near = Math.max(rig.distance() - 2 * rig.radius, 0.02 * rig.distance());
    const place = rig.target.clone().addScaledVector(eye, rig.distance());
    for (const camera of [this.perspective, this.flat]) {
      camera.position.copy(place);
      camera.quaternion.copy(rig.turn);
      camera.near = near;
      camera.far = far;
    }
    this.perspective.aspect = this.aspect();
    this.flat.top = rig.half;
    this.flat.bottom = -rig.half;
    this.flat.right = rig.half * this.aspect();
    this.flat.left = -this.flat.right;
    this.flat.near = -4 * rig.radius;
    for (const camera of [this.perspective, this.flat]) {
      camera.updateProjectionMatrix();
      camera.updateMatrixWorld();
    }
  }

  // ---- what is shown

  private shownIsMesh = false;
  private shownTree: { geometry: BufferGeometry; bvh: MeshBVH } | null = null;

  /** Shows a surface; `value` names what colours it. */
  showSurface(geometry: Geometry | undefined, value: string | null): void {
    if (this.shown) {
      this.scene.remove(this.shown);
      if (this.shown.geometry !== this.pickable?.geometry) this.shown.geometry.dispose();
      this.shown = null;
    }
    this.shownIsMesh = geometry?.layer === 'mesh';
    if (geometry) {
      const buffers = this.shownIsMesh && this.pickable ? this.pickable.geometry : buffersOf(geometry);
      const values = value ? geometry.floats.get(value) : undefined;
      const vertices = buffers.getAttribute('position').count;
      buffers.setAttribute('value', new BufferAttribute(values ?? new Float32Array(vertices), 1));
      this.shown = new Mesh(buffers, this.surface);
      this.hide(this.hidden);
      this.scene.add(this.shown);
    }
    this.swap();
    this.draw();
  }

  private hidden: ReadonlySet<number> = new Set();

  /** Patches that are not shown. */
  hide(patches: ReadonlySet<number>): void {
    this.hidden = patches;
    const buffers = this.shown?.geometry;
    if (!buffers) return;
    const patchOf = buffers.getAttribute('patchOf');
    const hide = new Float32Array(patchOf.count);
    if (patches.size > 0)
      for (let k = 0; k < hide.length; k++) hide[k] = patches.has(Math.round(patchOf.getX(k))) ? 1 : 0;
    buffers.setAttribute('hide', new BufferAttribute(hide, 1));
    this.draw();
  }

  /** The mesh that picks are on, and the stand-in for it. */
  setMesh(geometry: Geometry | undefined): void {
    this.pickable?.geometry.dispose();
    this.pickable = geometry ? { geometry: buffersOf(geometry), bvh: null } : null;
    if (this.pickable) {
      const pickable = this.pickable;
      // Picks are wanted soon, but the picture first.
      setTimeout(() => this.tree(pickable), 60);
    }
  }

  private tree(pickable: { geometry: BufferGeometry; bvh: MeshBVH | null }): MeshBVH {
    pickable.bvh ??= new MeshBVH(pickable.geometry, { indirect: true });
    return pickable.bvh;
  }

  setCoarse(geometry: Geometry | undefined): void {
    if (this.coarse) {
      this.scene.remove(this.coarse);
      this.coarse.geometry.dispose();
      this.coarse = null;
    }
    if (geometry) {
      const buffers = buffersOf(geometry);
      for (const name of ['value', 'hide']) {
        buffers.setAttribute(name, new BufferAttribute(new Float32Array(buffers.getAttribute('position').count), 1));
      }
      this.coarse = new Mesh(buffers, this.coarseSurface);
      this.coarse.visible = false;
      this.scene.add(this.coarse);
    }
  }

  showPoints(geometry: Geometry | undefined, colors: Float32Array): void {
    if (this.points) {
      this.scene.remove(this.points);
      this.points.geometry.dispose();
      this.points = null;
    }
    if (geometry) {
      const buffers = new BufferGeometry();
      buffers.setAttribute('position', new BufferAttribute(geometry.floats.get('position')!, 3));
      buffers.setAttribute('color', new BufferAttribute(colors, 3));
      // Few points are shown larger, so that they make a surface.
      const count = buffers.getAttribute('position').count;
      this.cloud.uniforms.size!.value = count < 20_000 ? 3.5 : count < 100_000 ? 2.5 : 2;
      this.points = new Points(buffers, this.cloud);
      this.points.frustumCulled = false;
      this.scene.add(this.points);
    }
    this.draw();
  }

  shade(mode: keyof typeof MODES, most: number): void {
    this.tell({ mode: MODES[mode], most: Math.max(most, 1e-30) });
  }

  mark(hovered: number, chosen: number, alone: number): void {
    this.tell({ hovered, chosen, alone });
  }

  /** Numbers for the material of surfaces; draws if one is another. */
  private tell(values: Record<string, number>): void {
    for (const [name, value] of Object.entries(values)) {
      const uniform = this.surface.uniforms[name]!;
      if (uniform.value === value) continue;
      uniform.value = value;
      this.draw();
    }
  }

  cut(normal: Vector3, at: number): void {
    const cut = new Vector4(normal.x, normal.y, normal.z, at);
    this.surface.uniforms.cut!.value = cut;
    this.cloud.uniforms.cut!.value = cut;
    (this.corners.material as ShaderMaterial).uniforms.cut!.value = cut;
    const plane = new Plane(normal.clone().negate(), at);
    for (const line of Object.values(this.lines)) {
      const material = line instanceof Thick ? line.material : line.object.material;
      Object.assign(material, { clippingPlanes: normal.lengthSq() > 0 ? [plane] : [] });
    }
    this.draw();
  }

  setCorners(positions: Float32Array, colors: Float32Array): void {
    if (setDots(this.corners, positions, colors)) this.draw();
  }

  /** Places that stay marked: pins and holes. */
  setPins(positions: Float32Array, colors: Float32Array): void {
    if (setDots(this.pins, positions, colors)) this.draw();
  }

  /** Dots of a tool, over everything. */
  setMarks(positions: Float32Array, colors: Float32Array): void {
    this.overlay.setDots(positions, colors);
    this.drawOver();
  }

  setLine(name: keyof View['lines'] | OverLine, positions: Float32Array, colors?: Float32Array): void {
    if (name === 'preview' || name === 'helper') {
      this.overlay.setLine(name, positions);
      return this.drawOver();
    }
    const line = this.lines[name];
    if (!line.set(positions, colors)) return;
    if (line instanceof Thick) line.material.resolution.set(this.canvas.clientWidth, this.canvas.clientHeight);
    this.draw();
  }

  piecesOf(kind: 'curve' | 'feature', which: Iterable<number>): Float32Array {
    return pieces(kind === 'curve' ? this.curves : this.features, which);
  }

  /** Pieces of a curve between two shares of its length. */
  stretch(picked: { kind: string; index: number }, from: number, to: number): Float32Array {
    return stretch(picked.kind === 'feature' ? this.features : this.curves, picked.index, from, to);
  }

  placeAt(picked: { kind: string; index: number }, at: number): number[] {
    return placeAt(picked.kind === 'feature' ? this.features : this.curves, picked.index, at);
  }

  // ---- what is under the cursor

  /** Pixels of the canvas to device coordinates. */
  private device(x: number, y: number): Vector2 {
    return new Vector2((2 * x) / this.canvas.clientWidth - 1, 1 - (2 * y) / this.canvas.clientHeight);
  }

  ray(x: number, y: number): Ray {
    this.updateCamera();
    const p = this.device(x, y);
    const camera = this.camera();
    const near = new Vector3(p.x, p.y, -1).unproject(camera);
    const far = new Vector3(p.x, p.y, 1).unproject(camera);
    return new Ray(near, far.sub(near).normalize());
  }

  /** The place of the mesh under a pixel; what is cut off is not there. */
  pick(x: number, y: number): Hit | null {
    if (!this.pickable) return null;
    const ray = this.ray(x, y);
    const cut = this.surface.uniforms.cut!.value as Vector4;
    const bvh = this.tree(this.pickable);
    const hits = bvh.raycast(ray, 2).sort((a, b) => a.distance - b.distance);
    for (const hit of hits) {
      const p = hit.point;
      if (cut.x * p.x + cut.y * p.y + cut.z * p.z <= cut.w) return { place: p, face: hit.faceIndex ?? 0 };
    }
    return null;
  }

  /** The patch under a pixel, where surfaces are shown. */
  pickPatch(x: number, y: number): number | null {
    if (!this.shown || this.shownIsMesh) return null;
    const bvh = this.treeOfShown(this.shown);
    const alone = this.surface.uniforms.alone!.value as number;
    const patch = this.shown.geometry.getAttribute('patchOf');
    const hits = bvh.raycast(this.ray(x, y), 2).sort((a, b) => a.distance - b.distance);
    for (const hit of hits) {
      const found = Math.round(patch.getX(hit.face?.a ?? 0));
      if ((alone < 0 || found === alone) && !this.hidden.has(found)) return found;
    }
    return null;
  }

  private treeOfShown(shown: Mesh): MeshBVH {
    if (this.shownTree?.geometry !== shown.geometry) {
      this.shownTree = { geometry: shown.geometry, bvh: new MeshBVH(shown.geometry, { indirect: true }) };
    }
    return this.shownTree.bvh;
  }

  /** The place of what is shown under a pixel, whatever it is. */
  pickShown(x: number, y: number): Vector3 | null {
    if (!this.shown) return null;
    const hits = this.treeOfShown(this.shown).raycast(this.ray(x, y), 2);
    return hits.sort((a, b) => a.distance - b.distance)[0]?.point ?? null;
  }

  /** Pixel of a place, and its depth. */
  project(place: Vector3): { x: number; y: number; z: number } {
    this.updateCamera();
    const p = place.clone().project(this.camera());
    return { x: ((p.x + 1) / 2) * this.canvas.clientWidth, y: ((1 - p.y) / 2) * this.canvas.clientHeight, z: p.z };
  }

  /** True if nothing of the mesh lies before a place. */
  isSeen(place: Vector3): boolean {
    const p = this.project(place);
    const hit = this.pick(p.x, p.y);
    if (!hit) return true;
    const eye = this.rig.toEye();
    return hit.place.clone().sub(place).dot(eye) < 0.02 * this.rig.radius;
  }

  picture(): string {
    this.updateCamera();
    this.renderer.render(this.scene, this.camera());
    return this.canvas.toDataURL('image/png');
  }
}

function buffersOf(geometry: Geometry): BufferGeometry {
  const buffers = new BufferGeometry();
  buffers.setAttribute('position', new BufferAttribute(geometry.floats.get('position')!, 3));
  buffers.setAttribute('normal', new BufferAttribute(geometry.floats.get('normal')!, 3));
  buffers.setIndex(new BufferAttribute(geometry.numbers.get('index')!, 1));
  const vertices = buffers.getAttribute('position').count;
  const patch = geometry.floats.get('patch') ?? new Float32Array(vertices).fill(-2);
  buffers.setAttribute('patchOf', new BufferAttribute(patch, 1));
  return buffers;
}

/** Shows dots; false if they are those that are shown. */
function setDots(dots: Points, positions: Float32Array, colors: Float32Array): boolean {
  const shown = (name: string) => (dots.geometry.getAttribute(name)?.array ?? NOTHING) as Float32Array;
  if (same(positions, shown('position')) && same(colors, shown('color'))) return false;
  dots.geometry.dispose();
  dots.geometry = new BufferGeometry();
  dots.geometry.setAttribute('position', new BufferAttribute(positions, 3));
  dots.geometry.setAttribute('color', new BufferAttribute(colors, 3));
  dots.visible = positions.length > 0;
  return true;
}
