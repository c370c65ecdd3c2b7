// What the page knows and what is chosen in it: signals, no DOM, no three.
import { computed, signal } from '@preact/signals';
import type { Connection } from '../protocol/client';
import type { Geometry } from '../protocol/frames';
import type { Job, Layer, State, Why } from '../protocol/types';

export const EMPTY: State = {
  revision: 0,
  project: null,
  files: [],
  stages: [],
  corners: [],
  curves: [],
  patches: [],
  features: [],
  faults: [],
  symmetry: null,
  done: [],
  undone: [],
  layers: {},
  resolution: { tolerance: 0.001 },
  live: true,
  figures: {},
  seams: [],
  warnings: [],
  jobs: [],
  cleaned: null,
  left_out: 0,
  holes: [],
  branches: [],
  longest: null,
  peer: null,
  relief_done: [],
  relief_undone: [],
};

export type ToolId =
  | 'select'
  | 'paint'
  | 'feature'
  | 'cut'
  | 'drag'
  | 'hold'
  | 'handles'
  | 'corner'
  | 'split'
  | 'sculpt'
  | 'erase'
  | 'measure'
  | 'lasso'
  | 'carry';
export type PaintMode = 'straight' | 'geodesic' | 'magnetic';
export type BrushMode = 'raise' | 'engrave' | 'smooth' | 'erase';
export type Shading = 'clay' | 'patches' | 'deviation' | 'curvature' | 'zebra';
export type Picked = { kind: 'corner' | 'curve' | 'patch' | 'feature'; index: number };
export type Shape = 'mesh' | 'surfaces' | 'displaced' | 'points' | 'peer';
export type Tab = 'edit' | 'surface' | 'relief' | 'view' | 'history';
/** What colours the points of a scan. */
export type PointColor = 'height' | 'color' | 'normal' | 'noise' | 'confidence' | 'segment' | 'outlier';
/** What a curve is held by when it relaxes or is dragged. */
export type Holds = { picked: Picked; pins: number[]; stretches: { from: number; to: number; curvature: number }[] };

export const state = signal<State>(EMPTY);
export const jobs = signal<Job[]>([]);
export const connection = signal<Connection>('connecting');
export const geometry = signal<ReadonlyMap<Layer, Geometry>>(new Map());

export const tool = signal<ToolId>('select');
export const tab = signal<Tab>('edit');
export const selected = signal<Picked | null>(null);
export const hovered = signal<Picked | null>(null);
export const paintMode = signal<PaintMode>('straight');
export const dragWidth = signal(0.5);
/** What the tool waits for, where its usual hint does not tell. */
export const toolHint = signal('');
export const cursor = signal<[number, number, number] | null>(null);

export const shape = signal<Shape>('mesh');
export const shading = signal<Shading>('clay');
export const show = signal({ curves: true, corners: true, isolines: false, nets: false, angles: false });
export const pointColor = signal<PointColor>('height');
export const holds = signal<Holds | null>(null);
/** How stiff the brush makes a stretch, against what is around it. */
export const stiffness = signal(10);
/** The brush of the relief; its radius and its height are steps from the usual ones. */
export const brush = signal<{ mode: BrushMode; radius: number; height: number }>({
  mode: 'raise',
  radius: 0,
  height: 0,
});
/** Lengths of the brush: the usual ones, of the diagonal, and the steps from them, of a quarter more each. */
export const BRUSH = {
  radius: { usual: 0.04, least: -10, most: 8 },
  height: { usual: 0.005, least: -12, most: 10 },
} as const;
/** A length of the brush, of the diagonal. */
export const brushLength = (which: keyof typeof BRUSH): number => BRUSH[which].usual * 1.25 ** brush.value[which];
/** Takes another length of the brush, in steps; beyond the last it stays there. */
export function setBrush(which: keyof typeof BRUSH, steps: number): void {
  const { least, most } = BRUSH[which];
  brush.value = { ...brush.value, [which]: Math.min(most, Math.max(least, steps)) };
}
/** Control vertices of the tool with handles. */
export const handleCount = signal(8);
/** Pairs of places, on the other project and on this one. */
export const landmarks = signal<{ other: [number, number, number]; own: [number, number, number] | null }[]>([]);
export const section = signal<{ on: boolean; axis: 0 | 1 | 2; at: number; flip: boolean }>({
  on: false,
  axis: 0,
  at: 0.5,
  flip: false,
});
export const isolated = signal<number | null>(null);
/** Patches that are not shown. */
export const hidden = signal<ReadonlySet<number>>(new Set());
/** How strong relief is shown: 1 as it is. */
export const strength = signal(1);
/** End of the colour scale as chosen, as a share of what is found. */
export const scaleShare = signal(1);
export const parallel = signal(false);
export const orbit = signal<'turntable' | 'free'>('turntable');
/** True if the lasso leaves out what lies without it. */
export const lassoOutside = signal(false);
/** Largest angle of a smooth seam, degrees. */
export const largestAngle = signal(0);
export const up = signal<'y' | 'z'>('z');
/** Steps that Undo and Redo go through: with the brush in hand those of the relief. */
export const history = computed(() => {
  const { done, undone, relief_done, relief_undone } = state.value;
  return tool.value === 'sculpt' ? [relief_done.length, relief_undone.length] : [done.length, undone.length];
});
/** Largest deviation of what is shown, and of the colour scale, world units. */
export const scaleFound = signal(0);
export const dark = signal(false);
export const overlay = signal<'none' | 'keys' | 'palette'>('none');

export type Toast = { id: number; kind: 'refused' | 'told'; why: Why };
export const toasts = signal<Toast[]>([]);
let lastToast = 0;

/** Shows a message; the same one is shown once. */
export function toast(kind: Toast['kind'], why: Why): void {
  const others = toasts.value.filter((t) => t.why.message !== why.message).slice(-2);
  toasts.value = [...others, { id: ++lastToast, kind, why }];
}

export function dismiss(id: number): void {
  toasts.value = toasts.value.filter((t) => t.id !== id);
}

/** Takes over a state; what is chosen stays if it is still there. */
export function takeState(next: State): void {
  const before = state.value;
  state.value = next;
  jobs.value = next.jobs;
  const sizes = { corner: next.corners, curve: next.curves, patch: next.patches, feature: next.features };
  const isGone = (picked: Picked | null) => picked !== null && picked.index >= sizes[picked.kind].length;
  const renumbered = before.curves.length !== next.curves.length || before.patches.length !== next.patches.length;
  if (renumbered || isGone(selected.value)) selected.value = null;
  if (renumbered || isGone(hovered.value)) hovered.value = null;
  if (renumbered) {
    isolated.value = null;
    hidden.value = new Set();
    holds.value = null;
  }
  if (next.peer === null) {
    landmarks.value = [];
    if (shape.value === 'peer') shape.value = 'mesh';
  }
  if (!next.cleaned && pointColor.value !== 'color') pointColor.value = 'height';
  if (!canUse(tool.value, next)) tool.value = 'select';
  if (next.layers.points && !next.layers.mesh) shape.value = 'points';
  else if (!before.layers.mesh && shape.value === 'points') shape.value = 'mesh';
  if (!next.layers.surfaces && (shape.value === 'surfaces' || shape.value === 'displaced')) shape.value = 'mesh';
  if (!canShade(shading.value, shape.value)) shading.value = 'clay';
  const kept = [...geometry.value].filter(([layer]) => next.layers[layer]);
  if (kept.length !== geometry.value.size) geometry.value = new Map(kept);
}

/** Whether a tool has something to work on. */
export function canUse(id: ToolId, { layers, patches, curves, files, peer }: State): boolean {
  switch (id) {
    case 'select':
      return true;
    case 'lasso':
      return Boolean(layers.points) && !layers.mesh;
    case 'feature':
      return patches.length > 0;
    case 'sculpt':
      return Boolean(layers.displaced);
    case 'hold':
    case 'handles':
      return curves.length > 0;
    case 'carry':
      return Boolean(layers.mesh) && (files.length > 0 || Boolean(peer));
    default:
      return Boolean(layers.mesh);
  }
}

/** Whether a shading is of use on a shape. */
export function canShade(how: Shading, of: Shape): boolean {
  switch (how) {
    case 'clay':
      return true;
    case 'zebra':
      return of !== 'points' && of !== 'peer';
    case 'curvature':
      return of === 'mesh' || of === 'surfaces';
    case 'patches':
      return of === 'surfaces' || of === 'displaced';
    case 'deviation':
      return of === 'surfaces';
  }
}

/** Shows a shape, with a shading that is of use on it. */
export function showShape(of: Shape): void {
  shape.value = of;
  if (!canShade(shading.value, of)) shading.value = 'clay';
}

/** Layers that are to be shown now. */
export const wanted = computed<Layer[]>(() => {
  const there = state.value.layers;
  const want: Layer[] = [];
  const add = (layer: Layer) => {
    if (there[layer]) want.push(layer);
  };
  if (shape.value === 'points') add('points');
  // Picks are on the mesh, whatever is shown.
  add('mesh');
  add('coarse');
  add('curves');
  add('features');
  if (shape.value === 'surfaces') add('surfaces');
  if (shape.value === 'displaced') {
    add('displaced');
    // Other strengths lie between the two.
    if (strength.value !== 1) add('surfaces');
  }
  if (shape.value === 'peer') add('peer');
  if (show.value.isolines) add('isolines');
  if (show.value.nets) add('nets');
  return want;
});

/** True once the curves on the screen are those of the state, so that their numbers name what is seen. */
export const areCurvesOfNow = computed(() =>
  (['curves', 'features'] as const).every((l) => geometry.value.get(l)?.name === state.value.layers[l]),
);

/** Layers that are to be asked for: those that are neither there nor asked for by the name of now. */
export function missing(asked: ReadonlyMap<Layer, string>): Layer[] {
  const names = state.value.layers;
  return wanted.value.filter((l) => geometry.value.get(l)?.name !== names[l] && asked.get(l) !== names[l]);
}
