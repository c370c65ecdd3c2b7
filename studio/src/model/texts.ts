// Words of tools, stages and keys, in one place.
import type { ToolId } from './store';

export const TOOLS: { id: ToolId; key: string; name: string; hint: string }[] = [
  {
    id: 'select',
    key: 'V',
    name: 'Select',
    hint: 'Click a corner, a curve or a patch. Drag turns the view, right drag moves it, the wheel zooms.',
  },
  {
    id: 'paint',
    key: 'P',
    name: 'Paint a curve',
    hint: 'Click along the curve. It ends on another curve, by a click on its start, or with Enter. Backspace takes a pick back, Esc drops it.',
  },
  {
    id: 'cut',
    key: 'C',
    name: 'Cut by a plane',
    hint: 'Drag a line across the part: the plane behind it cuts a curve where the line meets the part.',
  },
  {
    id: 'drag',
    key: 'D',
    name: 'Drag a curve',
    hint: 'Drag a curve or a corner: the curve follows as a snake on the mesh.',
  },
  { id: 'corner', key: 'K', name: 'Add a corner', hint: 'Click a curve to divide it, or a place on the mesh.' },
  {
    id: 'split',
    key: 'S',
    name: 'Split a region',
    hint: 'Click a region of 3, 5 or 6 sides: lines show how it becomes four-sided patches.',
  },
  {
    id: 'feature',
    key: 'F',
    name: 'Feature curve',
    hint: 'Click from one side of a patch across to another: the grid of the patch follows the curve. Enter ends it.',
  },
  { id: 'erase', key: 'X', name: 'Delete', hint: 'Click a curve to delete it, or a corner to join its two curves.' },
  { id: 'measure', key: 'M', name: 'Measure', hint: 'Click two places: their distance is shown.' },
];

export const EDITS: Record<string, string> = {
  paint: 'Curve painted',
  extend: 'Curve led on',
  cut: 'Cut by a plane',
  project: 'Polyline brought on',
  boundaries: 'Boundaries drawn',
  feature_lines: 'Sharp edges drawn',
  add_corner: 'Corner added',
  split_curve: 'Curve divided',
  join: 'Curves joined',
  delete_curves: 'Curves deleted',
  delete_corner: 'Corner deleted',
  clear: 'All curves deleted',
  drag_corner: 'Corner dragged',
  continuity: 'Seam changed',
  drag_curve: 'Curve dragged',
  relax: 'Curves relaxed',
  spline: 'Curve smoothed',
  split_region: 'Region split',
  complete: 'Patches laid out',
  feature: 'Feature curve painted',
  delete_feature: 'Feature curve deleted',
  sections: 'Section refined',
  symmetry: 'Plane of symmetry',
  mirror: 'Mirrored',
  carry: 'Network carried over',
};

export const STAGES: Record<string, string> = {
  scan: 'Scan',
  mesh: 'Mesh',
  curves: 'Curves',
  patches: 'Patches',
  surfaces: 'Surfaces',
};

export const STANDING: Record<string, string> = {
  empty: 'nothing yet',
  partial: 'not finished',
  fresh: 'up to date',
  stale: 'of earlier curves',
  running: 'at work',
  failed: 'failed',
};

export const SHAPES = { points: 'Points', mesh: 'Mesh', surfaces: 'Surfaces', displaced: 'With relief' } as const;
export const SHADINGS = {
  clay: 'Clay',
  patches: 'Patches',
  deviation: 'Deviation',
  curvature: 'Curvature',
  zebra: 'Zebra',
} as const;
export const FORMATS = [
  { format: 'step', name: 'STEP', note: 'for CAD' },
  { format: 'iges', name: 'IGES', note: 'for older CAD' },
  { format: 'usd', name: 'USD', note: 'patches and mesh' },
  { format: 'glb', name: 'GLB', note: 'mesh with relief' },
  { format: 'ply', name: 'PLY', note: 'mesh with relief' },
  { format: 'report', name: 'Report', note: 'what was measured' },
] as const;

export const KEYS: { keys: string; what: string }[] = [
  ...TOOLS.map((t) => ({ keys: t.key, what: t.name })),
  { keys: 'Ctrl Z', what: 'Undo' },
  { keys: 'Ctrl Shift Z', what: 'Redo' },
  { keys: 'Ctrl K', what: 'All commands' },
  { keys: 'Delete', what: 'Delete what is selected' },
  { keys: 'Enter', what: 'End the curve' },
  { keys: 'Esc', what: 'Drop the curve, or deselect' },
  { keys: 'Home', what: 'Fit the view' },
  { keys: '1 to 6', what: 'Front, back, right, left, top, bottom' },
  { keys: 'O', what: 'Perspective or parallel' },
  { keys: 'Arrows', what: 'Turn the view' },
  { keys: '+ and -', what: 'Zoom' },
  { keys: '?', what: 'This overview' },
];
