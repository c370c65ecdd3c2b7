// Binds model, view and server: what the state says is shown, what a hand does is asked for.
import { effect } from '@preact/signals';
import { Vector3 } from 'three';
import * as store from './model/store';
import type { Answer, Body } from './protocol/client';
import { Client, Refused } from './protocol/client';
import type { Geometry } from './protocol/frames';
import type { CurveName, Edit, Format, Layer, ReliefEdit, Resolution, Sample, Why } from './protocol/types';
import { Carry } from './tools/carry';
import { AddCorner, Erase, erase, Measure, Select, Split } from './tools/clicks';
import { Cut } from './tools/cut';
import { Handles } from './tools/handles';
import { Hold } from './tools/hold';
import { Lasso } from './tools/lasso';
import { Pull } from './tools/pull';
import { Sculpt } from './tools/sculpt';
import { Stroke } from './tools/stroke';
import type { Bench, Tool } from './tools/tool';
import { blend } from './view/blend';
import { tints } from './view/cloud';
import { courses } from './view/lines';
import { usualMost } from './view/scale';
import type { View } from './view/view';

const NOTHING = new Float32Array();
const CORNER = [0.93, 0.97, 0.97];
const CORNER_HOT = [0.06, 0.72, 0.68];
const CORNER_CHOSEN = [0.98, 0.62, 0.12];
const FAULT = [0.86, 0.15, 0.15];
const PIN = [0.75, 0.1, 0.36];
const HOLE = [0.76, 0.25, 0.05];
/** Seams from no angle to the largest, and those that are sharp on purpose. */
const FLAT = [0.05, 0.46, 0.43];
const BENT = [0.85, 0.12, 0.1];
const SHARP = [0.45, 0.48, 0.52];

type P3 = [number, number, number];
type Lasso16 = Extract<Body, { type: 'lasso' }>['view'];

export class App implements Bench {
  readonly client: Client;
  readonly tools: Record<store.ToolId, Tool>;
  private asked = new Map<Layer, string>();
  private open = 0;
  private wantedTry: Edit | null = null;
  private trying = false;
  private fitted = '';

  constructor(
    readonly view: View,
    token: string,
  ) {
    this.client = new Client(token, {
      state: (state) => store.takeState(state),
      progress: (jobs) => {
        store.jobs.value = jobs;
      },
      geometry: (geometry) => {
        if (store.state.value.layers[geometry.layer] !== geometry.name) return;
        store.geometry.value = new Map(store.geometry.value).set(geometry.layer, geometry);
      },
      connection: (connection) => {
        store.connection.value = connection;
        if (connection !== 'open') this.asked.clear();
      },
      refused: (why) => store.toast('refused', why),
      restarted: () => {
        this.asked.clear();
        store.geometry.value = new Map();
        store.state.value = store.EMPTY;
      },
    });
    this.tools = {
      select: new Select(this),
      paint: new Stroke(this, 'paint'),
      feature: new Stroke(this, 'feature'),
      cut: new Cut(this),
      drag: new Pull(this),
      hold: new Hold(this),
      handles: new Handles(this),
      corner: new AddCorner(this),
      split: new Split(this),
      sculpt: new Sculpt(this),
      erase: new Erase(this),
      measure: new Measure(this),
      lasso: new Lasso(this),
      carry: new Carry(this),
    };
    this.follow();
  }

  tool(): Tool {
    return this.tools[store.tool.value];
  }

  choose(tool: store.ToolId): void {
    if (tool === store.tool.value) return;
    this.tool().leave?.();
    this.view.setMarks(NOTHING, NOTHING);
    store.toolHint.value = '';
    store.tool.value = tool;
    store.tab.value = tool === 'sculpt' ? 'relief' : 'edit';
    if (tool === 'sculpt') store.showShape('displaced');
  }

  world(place: Vector3): [number, number, number] {
    const c = store.state.value.project?.center ?? [0, 0, 0];
    return [place.x + c[0], place.y + c[1], place.z + c[2]];
  }

  private local(p: readonly number[]): Vector3 {
    const c = store.state.value.project?.center ?? [0, 0, 0];
    return new Vector3(p[0]! - c[0], p[1]! - c[1], p[2]! - c[2]);
  }

  // ---- asking

  /** Asks, and tells the user why not. */
  async ask(body: Body): Promise<Answer | null> {
    this.open++;
    try {
      const answer = await this.client.ask(body);
      if (answer.type === 'done' && answer.told) store.toast('told', { message: answer.told });
      return answer;
    } catch (error) {
      this.tell(error);
      return null;
    } finally {
      this.open--;
    }
  }

  private tell(error: unknown): void {
    const why: Why = error instanceof Refused ? error.why : { message: String(error) };
    if (why.message !== 'it was stopped') store.toast('refused', why);
  }

  async edit(edit: Edit): Promise<boolean> {
    return (await this.ask({ type: 'edit', edit })) !== null;
  }

  preview(edit: Edit | null): void {
    this.wantedTry = edit;
    if (!edit) this.view.setLine('preview', NOTHING);
    else if (!this.trying) void this.tryOut();
  }

  /** Tries the last edit that was asked for, one at a time. */
  private async tryOut(): Promise<void> {
    this.trying = true;
    while (this.wantedTry) {
      const edit = this.wantedTry;
      try {
        const answer = await this.client.ask({ type: 'try', edit });
        if (answer.type === 'tried' && this.wantedTry) this.showTried(answer.curves);
      } catch {
        // A place where it cannot be done has no preview; the click tells why.
        this.view.setLine('preview', NOTHING);
      }
      if (this.wantedTry === edit) break;
    }
    this.trying = false;
  }

  private showTried(curves: number[][]): void {
    const c = store.state.value.project?.center ?? [0, 0, 0];
    const list: number[] = [];
    for (const course of curves) {
      for (let p = 0; p + 5 < course.length; p += 3) {
        for (let x = 0; x < 6; x++) list.push(course[p + x]! - c[x % 3]!);
      }
    }
    this.view.setLine('preview', new Float32Array(list));
  }

  /** Takes the last step back: with the brush in hand the last edit of the relief. */
  undo = () => (store.tool.value === 'sculpt' ? this.unsculpt() : this.back(1));
  redo = () => (store.tool.value === 'sculpt' ? this.resculpt() : this.forth(1));

  sculpt = (edit: ReliefEdit) => this.ask({ type: 'sculpt', edit });
  unsculpt = () => this.ask({ type: 'unsculpt', count: 1 });
  resculpt = () => this.ask({ type: 'resculpt', count: 1 });
  async handles(curve: CurveName, control: number): Promise<Vector3[]> {
    const answer = await this.ask({ type: 'handles', curve, control });
    return answer?.type === 'handles' ? answer.points.map((p) => this.local(p)) : [];
  }

  lasso = (view: number[], line: [number, number][]) =>
    this.ask({ type: 'lasso', view: view as Lasso16, line, outside: store.lassoOutside.value });
  back = (count: number) => this.edit({ edit: 'undo', count });
  forth = (count: number) => this.edit({ edit: 'redo', count });
  clean = () => this.ask({ type: 'clean' });
  closeHole = (hole: number) => this.ask({ type: 'close_hole', hole });
  branch = (branch: number) => this.ask({ type: 'branch', branch });
  relief = (longest: number | null) => this.ask(longest === null ? { type: 'relief' } : { type: 'relief', longest });

  /** Looks at another project of the folder, or at none. */
  async peer(file: string | null): Promise<void> {
    const answer = await this.ask(file === null ? { type: 'peer' } : { type: 'peer', file });
    if (answer && file !== null) {
      this.choose('carry');
      store.landmarks.value = [];
      store.shape.value = 'peer';
      store.shading.value = 'clay';
    }
  }

  /** Carries the network of the other project over. */
  async carry(): Promise<void> {
    const from = store.state.value.peer?.file;
    const landmarks = store.landmarks.value.flatMap((l) => (l.own ? [[l.other, l.own] as [P3, P3]] : []));
    if (!from || !(await this.edit({ edit: 'carry', from, landmarks }))) return;
    this.choose('select');
    await this.peer(null);
  }

  fit = () => this.ask({ type: 'fit' });
  fitCoarse = () => this.ask({ type: 'fit', coarse: true });
  complete = (patches: number, sharp: number) => this.edit({ edit: 'complete', patches, sharp_angle_deg: sharp });
  mesh = (close?: boolean, voxel?: number) =>
    this.ask({ type: 'mesh', ...(close === undefined ? {} : { close }), ...(voxel === undefined ? {} : { voxel }) });
  sample = (sample: Sample) => this.ask({ type: 'sample', sample });
  openFile = (file: string) => this.ask({ type: 'open', file });
  close = () => this.ask({ type: 'close' });
  cancel = (job: number) => this.ask({ type: 'cancel', job });
  setting = (resolution: Resolution, live: boolean) => this.ask({ type: 'setting', resolution, live });

  async export(format: Format): Promise<void> {
    const answer = await this.ask({ type: 'export', format });
    if (answer?.type === 'exported') this.save(this.client.url(answer.url), answer.name);
  }

  async script(relief = false): Promise<void> {
    const answer = await this.ask({ type: 'script', relief });
    if (answer?.type !== 'script') return;
    const url = URL.createObjectURL(new Blob([answer.text], { type: 'text/plain' }));
    this.save(url, `${store.state.value.project?.name ?? 'edits'}${relief ? '-relief' : ''}.toml`);
  }

  picture(): void {
    this.save(this.view.picture(), `${store.state.value.project?.name ?? 'picture'}.png`);
  }

  private save(url: string, name: string): void {
    const link = document.createElement('a');
    link.href = url;
    link.download = name;
    link.click();
  }

  async drop(file: File): Promise<void> {
    this.open++;
    try {
      await this.client.upload(file);
    } catch (error) {
      this.tell(error);
    } finally {
      this.open--;
    }
  }

  /** The handles of a curve, with their tool. */
  handlesOf(picked: store.Picked): void {
    this.choose('handles');
    store.selected.value = picked;
    (this.tools.handles as Handles).of(picked);
  }

  /** A place of a patch that is no place of its sides: the node nearest to the middle of them all. */
  insideOf(patch: number): [number, number, number] | null {
    const layers = store.geometry.value;
    const shown = layers.get('displaced') ?? layers.get('surfaces');
    const [position, of] = [shown?.floats.get('position'), shown?.floats.get('patch')];
    if (!position || !of) return null;
    const nodes: Vector3[] = [];
    of.forEach((p, k) => {
      if (Math.round(p) === patch) nodes.push(new Vector3().fromArray(position, 3 * k));
    });
    const middle = nodes.reduce((sum, p) => sum.add(p), new Vector3()).divideScalar(Math.max(1, nodes.length));
    nodes.sort((a, b) => a.distanceToSquared(middle) - b.distanceToSquared(middle));
    return nodes[0] ? this.world(nodes[0]) : null;
  }

  /** Deletes what is selected. */
  remove(): void {
    const picked = store.selected.value;
    if (picked && picked.kind !== 'patch') void this.edit(erase(picked));
  }

  /** Shows all patches again. */
  showAll(): void {
    store.hidden.value = new Set();
    store.isolated.value = null;
  }

  // ---- the view follows the state

  home(): void {
    this.view.rig.fit(new Vector3(), this.view.rig.radius, this.view.aspect());
    this.view.moved();
  }

  /** Flies to a place, and marks it. */
  fly(place: readonly number[]): void {
    const { rig } = this.view;
    rig.target.copy(this.local(place));
    rig.half = Math.min(rig.half, 0.35 * rig.radius);
    this.view.setMarks(new Float32Array(rig.target.toArray()), new Float32Array(FAULT));
    // From outside: along the surface's own direction as far as that is known.
    if (!this.view.isSeen(rig.target)) rig.from(rig.target.clone().addScaledVector(rig.up, 0.2 * rig.radius));
    this.view.moved();
  }

  /** True once all that the state names is on the screen, and nothing moves. */
  isShown(): boolean {
    const shown = store.wanted.value.every((l) => store.geometry.value.get(l)?.name === store.state.value.layers[l]);
    return shown && !this.view.isQueued && store.connection.value === 'open';
  }

  /** True once nothing is asked for, computed, shown or moving. */
  isIdle(): boolean {
    return this.open === 0 && !this.trying && store.jobs.value.length === 0 && this.isShown();
  }

  private follow(): void {
    const { view } = this;
    effect(() => {
      store.geometry.value;
      for (const layer of store.missing(this.asked)) {
        this.asked.set(layer, store.state.value.layers[layer]!);
        this.client.get(layer).catch(() => this.asked.delete(layer));
      }
    });
    effect(() => {
      const project = store.state.value.project;
      const key = project ? `${project.file} ${project.diagonal}` : '';
      if (!project || key === this.fitted) return;
      this.fitted = key;
      view.rig.radius = project.diagonal / 2;
      view.rig.look('corner');
      this.home();
    });
    let mesh: unknown = null;
    let coarse: unknown = null;
    effect(() => {
      const layers = store.geometry.value;
      if (layers.get('mesh') !== mesh) view.setMesh(layers.get('mesh'));
      if (layers.get('coarse') !== coarse) view.setCoarse(layers.get('coarse'));
      mesh = layers.get('mesh');
      coarse = layers.get('coarse');
    });
    let points: unknown = null;
    let tinted = '';
    let shown = '';
    let surface: unknown = null;
    effect(() => {
      const shape = store.shape.value;
      const shading = store.shading.value;
      const layers = store.geometry.value;
      const cloud = shape === 'points' ? layers.get('points') : undefined;
      const how = store.pointColor.value;
      const axis = store.up.value === 'z' ? 2 : 1;
      if (cloud !== points || tinted !== `${how} ${axis}`) {
        view.showPoints(cloud, cloud ? tints(cloud, how, axis) : NOTHING);
      }
      points = cloud;
      tinted = `${how} ${axis}`;
      const plain = shape === 'points' ? undefined : layers.get(shape);
      const { value: strength } = store.strength;
      const now = shape === 'displaced' && plain ? this.blended(layers.get('surfaces'), plain, strength) : plain;
      const value = shading === 'deviation' || shading === 'curvature' ? shading : null;
      if (now !== surface || `${value}` !== shown) view.showSurface(now, value);
      surface = now;
      shown = `${value}`;
      const most = value ? usualMost(now?.floats.get(value)) * store.scaleShare.value : 1;
      store.scaleFound.value = most;
      view.shade(shading, most);
    });
    effect(() => {
      const { curves, isolines, nets } = store.show.value;
      const layers = store.geometry.value;
      view.curves = courses(layers.get('curves'));
      view.features = courses(layers.get('features'));
      const state = store.state.value;
      const of = (kind: string) =>
        state.curves.flatMap((c, k) => (c.kind === kind && k + 1 < view.curves.offset.length ? [k] : []));
      view.setLine('smooth', curves ? view.piecesOf('curve', of('smooth')) : NOTHING);
      view.setLine('sharp', curves ? view.piecesOf('curve', of('feature')) : NOTHING);
      view.setLine('boundary', curves ? view.piecesOf('curve', of('boundary')) : NOTHING);
      const features = Array.from({ length: view.features.offset.length - 1 }, (_, k) => k);
      view.setLine('features', curves ? view.piecesOf('feature', features) : NOTHING);
      const all = (layer: Layer) => {
        const lines = courses(layers.get(layer));
        return { lines, which: Array.from({ length: lines.offset.length - 1 }, (_, k) => k) };
      };
      for (const [layer, on] of [
        ['isolines', isolines],
        ['nets', nets],
      ] as const) {
        const { lines, which } = all(layer);
        view.setLine(layer, on ? piecesOf(lines, which) : NOTHING);
      }
    });
    effect(() => view.hide(store.hidden.value));
    effect(() => {
      // Another part may be of another size: it fills the view as this one does.
      const { peer, project } = store.state.value;
      const diagonal = store.shape.value === 'peer' && peer ? peer.diagonal : project?.diagonal;
      if (!diagonal || view.rig.radius === diagonal / 2) return;
      const ratio = diagonal / 2 / view.rig.radius;
      view.rig.half *= ratio;
      view.rig.target.multiplyScalar(ratio);
      view.rig.radius = diagonal / 2;
      view.moved();
    });
    effect(() => {
      store.geometry.value;
      const { seams, holes } = store.state.value;
      const all = view.curves;
      const smooth = seams.filter((s) => !s.sharp);
      const most = Math.max(1e-6, ...smooth.map((s) => s.angle_deg));
      store.largestAngle.value = smooth.length > 0 ? most : 0;
      const [positions, colors]: number[][] = [[], []];
      for (const seam of store.show.value.angles ? seams : []) {
        if (seam.curve + 1 >= all.offset.length) continue;
        const t = Math.min(1, seam.angle_deg / most);
        const color = seam.sharp ? SHARP : FLAT.map((x, k) => x + t * (BENT[k]! - x));
        const own = view.piecesOf('curve', [seam.curve]);
        positions!.push(...own);
        for (let k = 0; k < own.length; k += 3) colors!.push(...color);
      }
      view.setLine('angles', new Float32Array(positions), new Float32Array(colors));
      const kept = store.holds.value;
      const held = kept?.stretches.flatMap((s) => [...view.stretch(kept.picked, s.from, s.to)]) ?? [];
      view.setLine('held', new Float32Array(held));
      const pins = kept?.pins.map((p) => view.placeAt(kept.picked, p)) ?? [];
      const at = holes.map((h) => this.local(h.place).toArray());
      view.setPins(
        new Float32Array([...pins, ...at].flat()),
        new Float32Array([...pins.map(() => PIN), ...at.map(() => HOLE)].flat()),
      );
    });
    effect(() => {
      const [hovered, selected] = [store.hovered.value, store.selected.value];
      store.geometry.value;
      const line = (picked: store.Picked | null) =>
        picked && (picked.kind === 'curve' || picked.kind === 'feature')
          ? view.piecesOf(picked.kind, [picked.index])
          : NOTHING;
      const danger = store.tool.value === 'erase';
      view.setLine('hover', danger ? NOTHING : line(hovered));
      view.setLine('erase', danger ? line(hovered) : NOTHING);
      view.setLine('chosen', line(selected));
      const patch = (picked: store.Picked | null) => (picked?.kind === 'patch' ? picked.index : -1);
      view.mark(patch(hovered), patch(selected), store.isolated.value ?? -1);
      this.corners();
    });
    effect(() => {
      const { on, axis, at, flip } = store.section.value;
      const sign = flip ? -1 : 1;
      const normal = new Vector3().setComponent(axis, on ? sign : 0);
      const reach = view.rig.radius;
      view.cut(normal, on ? sign * (2 * at - 1) * reach : 1);
    });
    effect(() => {
      view.setParallel(store.parallel.value);
      view.rig.up.set(0, store.up.value === 'y' ? 1 : 0, store.up.value === 'z' ? 1 : 0);
    });
    effect(() => view.setBackground(store.dark.value ? '#171b21' : '#eef1f3'));
  }

  private lastBlend: { key: string; geometry: Geometry } | null = null;

  /** The displaced surfaces at a strength, made once. */
  private blended(smooth: Geometry | undefined, displaced: Geometry, strength: number): Geometry {
    const key = `${smooth?.name} ${displaced.name} ${strength}`;
    if (this.lastBlend?.key !== key) this.lastBlend = { key, geometry: blend(smooth, displaced, strength) };
    return this.lastBlend.geometry;
  }

  private corners(): void {
    const { corners } = store.state.value;
    const is = (picked: store.Picked | null, k: number) => picked?.kind === 'corner' && picked.index === k;
    if (!store.show.value.corners) return this.view.setCorners(NOTHING, NOTHING);
    const positions = new Float32Array(corners.flatMap((c) => this.local(c).toArray()));
    const color = (k: number) =>
      is(store.selected.value, k) ? CORNER_CHOSEN : is(store.hovered.value, k) ? CORNER_HOT : CORNER;
    this.view.setCorners(positions, new Float32Array(corners.flatMap((_, k) => color(k))));
  }
}

function piecesOf(lines: { position: Float32Array; offset: Uint32Array }, which: number[]): Float32Array {
  let count = 0;
  for (const k of which) count += Math.max(0, lines.offset[k + 1]! - lines.offset[k]! - 1);
  const out = new Float32Array(6 * count);
  let at = 0;
  for (const k of which) {
    for (let p = lines.offset[k]!; p + 1 < lines.offset[k + 1]!; p++) {
      out.set(lines.position.subarray(3 * p, 3 * p + 6), at);
      at += 6;
    }
  }
  return out;
}
