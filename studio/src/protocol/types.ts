// Written from the Rust types by a test of planish-studio (PLANISH_TYPES=write): not by hand.

/** An array of a layer. */
export type Array = {
  /** Items. */
  count: number;
  /** Type of its numbers. */
  kind: Kind2;
  /** What it holds: `position`, `normal`, `index`, `offset` ... */
  name: string;
  /** Numbers per item. */
  width: number;
};

/** Edits that were left for others. */
export type Branch = {
  /** Edits from the beginning on. */
  edits: number;
  /** Those of them that the drawing of now does not have, by their names in a script. */
  own: string[];
};

/** What is known of the points of a scan. */
export type Cleaned = {
  /** Standard deviation of the points, world units. */
  noise: number;
  /** Points that are outliers. */
  outliers: number;
  /** Pieces of surface that do not hang together. */
  parts: number;
  /** Distance of neighbouring points, world units. */
  spacing: number;
  /** The edge of a cell that suits them, world units. */
  voxel: number;
};

/** A curve of the network. */
export type Curve = {
  /** Control points along it, if it has surfaces. */
  control?: number | null;
  /** Corners at its ends. */
  ends: [number, number];
  /** What it follows. */
  kind: Kind;
  /** World units. */
  length: number;
};

/** A curve as a script names it: one of the network, or a feature curve. */
export type CurveName = (Name | {
  /** Which one. */
  feature: Name;
});

/** One edit. */
export type Edit = ({
  /** True for a closed curve. */
  closed?: boolean;
  edit: "paint";
  /** What a magnetic stroke is drawn to. */
  magnet?: (Magnetism | null);
  /** How the way between picks is found. */
  mode?: PaintMode;
  /** The picks, in order. */
  picks: Spot[];
  /** Share of the diagonal. */
  snap?: number;
} | {
  /** True to lead it on to its own other end. */
  closed?: boolean;
  /** The curve; the end that it was painted towards is meant if both are free, and of a feature curve always. */
  curve: CurveName;
  edit: "extend";
  /** What a magnetic stroke is drawn to. */
  magnet?: (Magnetism | null);
  /** How the way between picks is found. */
  mode?: PaintMode;
  /** The picks, in order. */
  picks?: Spot[];
  /** Share of the diagonal. */
  snap?: number;
} | {
  edit: "cut";
  /** Normal of the plane. */
  normal: [number, number, number];
  /** Share of the diagonal. */
  snap?: number;
  /** A place on the cut. */
  through: Spot;
} | {
  /** Zero for the nearest places. */
  direction?: [number, number, number];
  edit: "project";
  /** World positions. */
  points: [number, number, number][];
  /** Share of the diagonal. */
  snap?: number;
} | {
  edit: "boundaries";
} | {
  /** Degrees. */
  angle_deg: number;
  edit: "feature_lines";
  /** Lines shorter than this share of the diagonal are left out. */
  shortest?: number;
} | {
  /** Where. */
  at: Spot;
  edit: "add_corner";
  /** Share of the diagonal. */
  snap?: number;
} | {
  /** 0 to 1. */
  at: number;
  /** The curve. */
  curve: CurveName;
  edit: "split_curve";
} | {
  /** The corner. */
  corner: Name;
  edit: "join";
} | {
  /** The curves, numbered as before the edit; feature curves among them. */
  curves: CurveName[];
  edit: "delete_curves";
} | {
  /** The corner. */
  corner: Name;
  edit: "delete_corner";
} | {
  edit: "clear";
} | {
  /** The corner. */
  corner: Name;
  edit: "drag_corner";
  /** How it relaxes. */
  forces?: Forces;
  /** Share of each curve that relaxes. */
  reach?: number;
  /** Where to. */
  to: Spot;
} | {
  /** The curves; none of them on the boundary of the mesh. */
  curves: Name[];
  edit: "continuity";
  /** What their seams are to be. */
  seam: Seam;
} | {
  /** Share of its length; 0 or 1 for an end of a feature curve, which then goes along its side. */
  at: number;
  /** World units. */
  by: [number, number, number];
  /** The curve. */
  curve: CurveName;
  edit: "drag_curve";
  /** How it relaxes. */
  forces?: Forces;
  /** Shares of the length where the curve stays where it is. */
  pins?: number[];
  /** Stretches with weights of their own. */
  stiffness?: Stretch[];
  /** Share of the length that relaxes. */
  width?: number;
} | {
  /** The curve; absent for all of the network that are free to move and do not lie in the plane of symmetry. Of these one stays as it is where it would run into another. */
  curve?: (CurveName | null);
  edit: "relax";
  /** How it relaxes. */
  forces?: Forces;
  /** Shares of the length where the curve stays where it is. */
  pins?: number[];
  /** What it is drawn to. */
  pull?: (Pull | null);
  /** Middle and width of the section, shares of the length. */
  section?: [number, number] | null;
  /** Stretches with weights of their own. */
  stiffness?: Stretch[];
} | {
  /** Control vertices. */
  control: number;
  /** The curve. */
  curve: CurveName;
  edit: "spline";
  /** Moves, one after the other. */
  moves?: SplineMove[];
} | {
  /** A place in the region. */
  at: Spot;
  edit: "split_region";
  /** Turns the split; absent for the flattest corner. */
  from?: number | null;
} | {
  edit: "complete";
  /** Patches to aim at, over the whole mesh. */
  patches: number;
  /** Edges sharper than this become curves, degrees. */
  sharp_angle_deg?: number;
} | {
  edit: "feature";
  /** Which iso-curves it is one of; absent to tell it by the sides that its ends lie nearest to. */
  family?: (Family | null);
  /** What a magnetic stroke is drawn to. */
  magnet?: (Magnetism | null);
  /** How the way between picks is found. */
  mode?: PaintMode;
  /** The picks, from side to side; the patch is that of the middle one. */
  picks: Spot[];
} | {
  edit: "delete_feature";
  /** Its number. */
  feature: Name;
} | {
  /** A place in the patch. */
  at: Spot;
  edit: "sections";
  /** Along u. */
  u?: number[];
  /** Along v. */
  v?: number[];
} | {
  edit: "symmetry";
  /** The plane; absent to find it. */
  plane?: (Plane | null);
} | {
  edit: "mirror";
  /** True for the other way round. */
  swap?: boolean;
} | {
  edit: "carry";
  /** The other model, as the script names it. */
  from: string;
  /** Positions on it with those on this one. */
  landmarks: [[number, number, number], [number, number, number]][];
} | {
  /** How many. */
  count?: number;
  edit: "undo";
} | {
  /** How many. */
  count?: number;
  edit: "redo";
});

/** A place on a mesh: a face and barycentric coordinates that are not negative and sum to one. */
export type FacePoint = {
  /** Weights of its three corners. */
  bary: [number, number, number];
  /** Index of the triangle. */
  face: number;
};

/** Which iso-curves a feature curve is one of. */
export type Family = ("u" | "v");

/** Something to be put right. */
export type Fault = {
  /** An edit that puts it right. */
  offer?: (Offer | null);
  /** What, where and how. */
  why: Why;
};

/** The surface of a patch. */
export type Fitted = {
  /** Cells of its grid along u and v. */
  cells: [number, number];
  /** Control points along u and v. */
  control: [number, number];
  /** Largest distance, world units. */
  max: number;
  /** Root of the mean square distance to the mesh, world units. */
  rms: number;
};

/** How curves relax. */
export type Forces = {
  /** Weight of even spacing. */
  arc_length?: number;
  /** Weight of stiffness. */
  curvature?: number;
  /** Weight of shortness. */
  fairness?: number;
  /** Done when no point moves further in a sweep than this share of their distance. */
  settle?: number;
  /** How points are moved. */
  sweep?: Sweep;
  /** Sweeps at most. */
  sweeps?: number;
};

/** A file to be made. */
export type Format = ("step" | "iges" | "usd" | "glb" | "ply" | "report");

/** What a frame holds. */
export type Header = {
  /** The arrays, one after the other, each from a multiple of four bytes on. */
  arrays: Array[];
  /** Which geometry. */
  layer: Layer;
  /** Its name: the same name is the same geometry. */
  name: string;
  /** Where in all its bytes this piece begins. */
  offset: number;
  /** All its bytes. */
  total: number;
};

/** A hole of a mesh. */
export type Hole = {
  /** Its length around, world units. */
  around: number;
  /** A place on it, world units. */
  place: [number, number, number];
};

/** A running job. */
export type Job = {
  /** True if it can be ended early. */
  can_stop: boolean;
  /** 0 to 1. */
  fraction: number;
  /** Its number. */
  job: number;
  /** The stage that it is at. */
  stage: string;
  /** What it makes. */
  title: string;
};

/** What a curve follows. */
export type Kind = ("smooth" | "feature" | "boundary");

/** Type of the numbers of an array, little-endian. */
export type Kind2 = ("f32" | "u32");

/** Geometry that a view shows. */
export type Layer = ("points" | "mesh" | "coarse" | "curves" | "features" | "surfaces" | "displaced" | "isolines" | "nets" | "peer");

/** What a magnetic stroke is drawn to. */
export type Magnetism = ({
  sharp: number;
} | "creases" | {
  scalar: Scalar;
});

/** What the server says. */
export type Message = ({
  /** Version of the protocol. */
  protocol: number;
  /** Names this run of the server: names of geometry are of one run. */
  run: string;
  type: "welcome";
  /** Version of the program. */
  version: string;
} | {
  /** Edits that were left for others, until the project is put away. */
  branches: Branch[];
  /** What is known of the points of the scan. */
  cleaned?: (Cleaned | null);
  /** Corners of the network. */
  corners: [number, number, number][];
  /** Curves of the network. */
  curves: Curve[];
  /** Edits that can be taken back, oldest first. */
  done: Step[];
  /** What is to be put right before all of the mesh is patches. */
  faults: Fault[];
  /** Feature curves: the patch that each is of. */
  features: number[];
  /** Figures of quality; keys are those of the report. */
  figures: { [key: string]: number };
  /** Projects in the folder, for the start page. */
  files: string[];
  /** Holes of the mesh, the longest first, while they can be closed. */
  holes: Hole[];
  /** Running jobs. */
  jobs: Job[];
  /** Geometry that there is, each with its name of now. */
  layers: { [key: string]: string };
  /** Points of the scan that were left out by hand. */
  left_out: number;
  /** True if surfaces follow every edit. */
  live: boolean;
  /** The longest waves that the relief is shown with, world units. */
  longest?: number | null;
  /** Patches of the network. */
  patches: Patch[];
  /** The other project that is looked at. */
  peer?: (Peer | null);
  /** The project; absent on the start page. */
  project?: (Project | null);
  /** Edits of the relief, oldest first, by their names in a script. */
  relief_done: string[];
  /** Those that can be made again, the next one last. */
  relief_undone: string[];
  /** How fine surfaces are. */
  resolution: Resolution;
  /** Rises with every change of the drawing. */
  revision: number;
  /** Seams, worst first. */
  seams: Seam2[];
  /** The stages in the order of the pipeline. */
  stages: Stage[];
  /** Point and normal of the plane of symmetry. */
  symmetry?: [[number, number, number], [number, number, number]] | null;
  type: "state";
  /** Edits that can be made again, the next one last. */
  undone: Step[];
  /** What the user should know of the surfaces. */
  warnings: string[];
} | {
  /** Number of the request. */
  id: number;
  /** The job that goes on with it. */
  job?: number | null;
  /** What it did, in words. */
  told?: string;
  type: "done";
} | {
  /** Number of the request; 0 for what nobody asked for. */
  id: number;
  type: "refused";
  /** What is wrong and what to do. */
  why: Why;
} | {
  /** Corners that would be new or moved. */
  corners: [number, number, number][];
  /** Courses of curves that would be new or changed, x, y and z in turn. */
  curves: number[][];
  /** Number of the request. */
  id: number;
  type: "tried";
} | {
  /** Control points along u and v. */
  control: [number, number];
  /** Number of the request. */
  id: number;
  /** Largest distance, world units. */
  max: number;
  /** Root of the mean square distance to its grid, world units. */
  rms: number;
  type: "tried_patch";
} | {
  /** Number of the request. */
  id: number;
  /** World positions. */
  points: [number, number, number][];
  type: "handles";
} | {
  /** Texels along u. */
  cols: number;
  /** Heights along the normal, world units, the row of v = 0 first. */
  heights: number[];
  /** Number of the request. */
  id: number;
  /** Largest displacement. */
  most: number;
  /** Root of the mean square displacement. */
  rms: number;
  /** Texels along v. */
  rows: number;
  type: "map";
} | {
  /** All running jobs. */
  jobs: Job[];
  type: "progress";
} | {
  /** Number of the request. */
  id: number;
  /** TOML for `planish edit`. */
  text: string;
  type: "script";
} | {
  /** Its size, bytes. */
  bytes: number;
  /** Number of the request. */
  id: number;
  /** Its name. */
  name: string;
  type: "exported";
  /** Where it is fetched. */
  url: string;
});

/** A corner, a curve of the network or a feature curve as a script names it. */
export type Name = (number | {
  /** World units. */
  near: [number, number, number];
});

/** An edit that puts a fault right. */
export type Offer = ("split_region" | "boundaries" | "delete_corner");

/** How the way between two picks is found. */
export type PaintMode = ("straight" | "geodesic" | "magnetic");

/** A patch of the network. */
export type Patch = {
  /** Its curves. */
  curves: [number, number, number, number];
  /** Its surface, if it has one. */
  fitted?: (Fitted | null);
  /** Sections that its feature curves make along u and along v. */
  parts: [number, number];
  /** Cells of its grid that were asked for, section by section: along u, and along v. Empty where they are left to the program. */
  sections: [number[], number[]];
};

/** Another project that is looked at. */
export type Peer = {
  /** Middle of its box; its geometry is sent relative to it. */
  center: [number, number, number];
  /** Curves of its network. */
  curves: number;
  /** Diagonal of its box. */
  diagonal: number;
  /** Its file name. */
  file: string;
};

/** A place: in space, or on a patch. */
export type Place = ([number, number, number] | {
  /** The patch. */
  patch: number;
  /** From 0 to 1. */
  u: number;
  /** From 0 to 1. */
  v: number;
});

/** A plane through `point` with unit normal `normal`. */
export type Plane = {
  /** Unit normal. */
  normal: [number, number, number];
  /** A point of the plane, world units. */
  point: [number, number, number];
};

/** A project. */
export type Project = {
  /** Middle of the box; geometry is sent relative to it. */
  center: [number, number, number];
  /** True if the vertices of the mesh have colours. */
  coloured: boolean;
  /** Diagonal of the box. */
  diagonal: number;
  /** Its file. */
  file: string;
  /** Its name. */
  name: string;
  /** What to know of how it was opened. */
  notice: string;
  /** Points of the scan. */
  points: number;
  /** True if the file holds all that was done. */
  saved: boolean;
  /** Triangles of the mesh. */
  triangles: number;
  /** Symbol of the unit of length. */
  units: string;
  /** Why it cannot be saved. */
  unsaved?: string | null;
};

/** What a curve is drawn to. */
export type Pull = {
  /** Rounds of blending with the neighbours before, which reach about the root of them in edges. */
  blending?: number;
  /** True to go to low values. */
  low?: boolean;
  /** The scalar; curves go to high values. */
  scalar: Scalar;
  /** Weight against the forces of the curve. */
  weight?: number;
};

/** A part of the surface: what all of its keys name together. */
export type Region = {
  /** Middle of a ball, and of the image. */
  at?: (Place | null);
  /** How far above and below its middle the image reaches, units of the model [default: half the width]. */
  depth?: number | null;
  /** Width of the soft border inside it, units of the model. */
  feather?: number;
  /** File of an image beside the script, laid on the surface as that of a stamp: white, times alpha, is in the region, black is not, and grey is in it by its share. */
  image?: string | null;
  /** All that is not in it. */
  outside?: boolean;
  /** Only these patches; all if none are named. */
  patches?: number[];
  /** Places that a tube runs along in the place of the ball, joined by straight lines in space. The other side of a thin wall is not in it. */
  path?: Place[];
  /** Radius of the ball or the tube, units of the model; 0 beside an image for no ball. */
  radius?: number;
  /** Direction that is up in the image, as it appears seen along the normal. */
  up?: [number, number, number] | null;
  /** Width of the image on the surface, units of the model. */
  width?: number | null;
};

/** An edit. */
export type ReliefEdit = ({
  edit: "scale";
  /** What the layer is multiplied by, on top of what it was. */
  factor: number;
  /** Name of the layer; all of them if it is left out. */
  layer?: string | null;
  /** Only here: makes a layer of the difference. */
  region?: (Region | null);
} | {
  edit: "split";
  /** The wavelengths at which it is parted, units of the model. */
  wavelengths: number[];
} | {
  edit: "blur";
  /** Standard deviation, units of the model. */
  radius: number;
  /** Only here. */
  region?: Region;
} | {
  /** How much of it is added: 1 doubles what is finer than the radius. */
  amount: number;
  edit: "sharpen";
  /** Standard deviation of the blur whose difference is added, units of the model. */
  radius: number;
  /** Only here. */
  region?: Region;
} | {
  edit: "threshold";
  /** Displacements shorter than this are taken away, units of the model. */
  height: number;
  /** Only here. */
  region?: Region;
} | {
  edit: "stroke";
  /** Height in the middle, units of the model; below 0 it engraves. */
  height: number;
  /** The places, joined by straight lines in space. */
  path: Place[];
  /** Radius, units of the model. */
  radius: number;
  /** Only here. */
  region?: Region;
  /** Share of the radius over which it fades: 1 is soft, 0 has an upright border. */
  softness?: number;
} | {
  /** Its middle. */
  at: Place;
  /** How far above and below the middle it reaches, units of the model [default: half the width]. */
  depth?: number | null;
  edit: "stamp";
  /** Height of white, units of the model; below 0 it engraves. */
  height: number;
  /** File of the image, beside the script. */
  image: string;
  /** Only here. */
  region?: Region;
  /** What is there gives way to the stamp where its alpha is 1; else it is added. */
  replace?: boolean;
  /** Direction that is up in the image, as it appears seen along the normal. */
  up: [number, number, number];
  /** Width on the surface, units of the model. */
  width: number;
} | {
  edit: "erase";
  /** Only here. */
  region?: Region;
} | {
  edit: "tile";
  /** The patch that is repeated. */
  from: number;
  /** Only here. */
  region?: Region;
  /** Repeats along `u` and along `v`, every second one mirrored. */
  times?: [number, number];
  /** The patches that get it instead of their own. */
  to: number[];
} | {
  /** Side of the blocks that are joined, units of the model: about twice what recurs in the pattern [default: a third of the shorter side of the patch]. */
  block?: number | null;
  edit: "synthesise";
  /** The patch whose relief is the pattern. */
  from: number;
  /** Only here. */
  region?: Region;
  /** Another number gives another choice of blocks. */
  seed?: number;
  /** The patches that get more of it instead of their own. */
  to: number[];
} | {
  edit: "limit";
  /** Share of the focal radius that a displacement may reach. */
  share?: number;
} | {
  edit: "resample";
  /** Texels along each side of each patch. */
  texels: number;
} | {
  edit: "remove";
  /** Name of the layer. */
  layer: string;
});

/** What the page asks for. Every request is answered once, by `done`, `refused`, or what it asks for. */
export type Request = ({
  /** The edit, as a script has it. */
  edit: Edit;
  /** Number of the request. */
  id: number;
  type: "edit";
} | {
  /** The edit. */
  edit: Edit;
  /** Number of the request. */
  id: number;
  type: "try";
} | {
  /** True to pause at coarse grids, so that one sees early how they run. */
  coarse?: boolean;
  /** Number of the request. */
  id: number;
  type: "fit";
} | {
  /** Along u and v; absent for the fewest that keep the tolerance. */
  control?: [number, number] | null;
  /** Number of the request. */
  id: number;
  /** The patch. */
  patch: number;
  /** Largest RMS distance, world units. */
  tolerance?: number | null;
  type: "try_patch";
} | {
  /** How many. */
  control: number;
  /** The curve. */
  curve: CurveName;
  /** Number of the request. */
  id: number;
  type: "handles";
} | {
  /** Number of the request. */
  id: number;
  /** The patch. */
  patch: number;
  type: "map";
} | {
  /** Number of the request. */
  id: number;
  /** The longest waves that are shown, world units; all if absent. */
  longest?: number | null;
  type: "relief";
} | {
  /** The edit. */
  edit: ReliefEdit;
  /** Number of the request. */
  id: number;
  type: "sculpt";
} | {
  /** How many. */
  count: number;
  /** Number of the request. */
  id: number;
  type: "unsculpt";
} | {
  /** How many. */
  count: number;
  /** Number of the request. */
  id: number;
  type: "resculpt";
} | {
  /** Number of the request. */
  id: number;
  type: "clean";
} | {
  /** Number of the request. */
  id: number;
  /** Corners of the line, from -1 to 1. */
  line: [number, number][];
  /** True to leave out what lies without. */
  outside?: boolean;
  type: "lasso";
  /** From the places that geometry is sent in to clip space, column by column. */
  view: number[];
} | {
  /** Its number. */
  hole: number;
  /** Number of the request. */
  id: number;
  type: "close_hole";
} | {
  /** Its file name; absent to put it away. */
  file?: string | null;
  /** Number of the request. */
  id: number;
  type: "peer";
} | {
  /** Which. */
  branch: number;
  /** Number of the request. */
  id: number;
  type: "branch";
} | {
  /** Number of the request. */
  id: number;
  /** True to make surfaces anew after every edit. */
  live: boolean;
  /** How many control points. */
  resolution: Resolution;
  type: "setting";
} | {
  /** Holes closed (true), left open (false) or as the scan is (absent). */
  close?: boolean | null;
  /** Number of the request. */
  id: number;
  /** Cells along the longest side; those that suit the scan if absent. */
  resolution?: number | null;
  type: "mesh";
  /** The edge of a cell, world units; in place of their number. */
  voxel?: number | null;
} | {
  /** Number of the request. */
  id: number;
  /** The job. */
  job: number;
  type: "cancel";
} | {
  /** Number of the request. */
  id: number;
  /** Which. */
  layer: Layer;
  type: "get";
} | {
  /** What kind of file. */
  format: Format;
  /** Number of the request. */
  id: number;
  type: "export";
} | {
  /** Number of the request. */
  id: number;
  /** True for those of the relief. */
  relief?: boolean;
  type: "script";
} | {
  /** Number of the request. */
  id: number;
  /** Which. */
  sample: Sample;
  type: "sample";
} | {
  /** Its file name. */
  file: string;
  /** Number of the request. */
  id: number;
  type: "open";
} | {
  /** Number of the request. */
  id: number;
  type: "close";
});

/** How fine the control nets are. */
export type Resolution = ({
  control: [number, number];
} | {
  per_curve: number[];
} | {
  tolerance: number;
});

/** A made part. */
export type Sample = ("part" | "scan" | "bracket");

/** A scalar by its name. */
export type Scalar = ("luminance" | {
  channel: {
  /** Name of the attribute. */
  attribute: string;
  /** Channel. */
  channel: number;
};
} | "mean_curvature" | "gaussian_curvature" | "maximum_curvature" | {
  values: number[];
});

/** How two patches are to meet along their curve, whatever the mesh has there. */
export type Seam = ("smooth" | "sharp");

/** A seam between two patches. */
export type Seam2 = {
  /** Largest angle, degrees. */
  angle_deg: number;
  /** Its curve. */
  curve: number;
  /** Largest gap, world units. */
  gap: number;
  /** True if it is sharp on purpose. */
  sharp: boolean;
};

/** A move of a space curve. */
export type SplineMove = ({
  /** World units. */
  by: [number, number, number];
  /** The control vertex. */
  vertex: number;
} | {
  /** 0 to 1. */
  at: number;
  /** World units. */
  by: [number, number, number];
});

/** A place as a script names it. */
export type Spot = ([number, number, number] | FacePoint | {
  /** Its number. */
  corner: number;
});

/** A stage of the pipeline. */
export type Stage = {
  /** How it stands. */
  is: Standing;
  /** Which. */
  name: StageName;
  /** In words: how many, or why it failed. */
  note: string;
};

/** Stages that the strip shows. */
export type StageName = ("scan" | "mesh" | "curves" | "patches" | "surfaces");

/** How a stage stands. */
export type Standing = ("empty" | "partial" | "fresh" | "stale" | "running" | "failed");

/** Everything but geometry. */
export type State = {
  /** Edits that were left for others, until the project is put away. */
  branches: Branch[];
  /** What is known of the points of the scan. */
  cleaned?: (Cleaned | null);
  /** Corners of the network. */
  corners: [number, number, number][];
  /** Curves of the network. */
  curves: Curve[];
  /** Edits that can be taken back, oldest first. */
  done: Step[];
  /** What is to be put right before all of the mesh is patches. */
  faults: Fault[];
  /** Feature curves: the patch that each is of. */
  features: number[];
  /** Figures of quality; keys are those of the report. */
  figures: { [key: string]: number };
  /** Projects in the folder, for the start page. */
  files: string[];
  /** Holes of the mesh, the longest first, while they can be closed. */
  holes: Hole[];
  /** Running jobs. */
  jobs: Job[];
  /** Geometry that there is, each with its name of now. */
  layers: { [key: string]: string };
  /** Points of the scan that were left out by hand. */
  left_out: number;
  /** True if surfaces follow every edit. */
  live: boolean;
  /** The longest waves that the relief is shown with, world units. */
  longest?: number | null;
  /** Patches of the network. */
  patches: Patch[];
  /** The other project that is looked at. */
  peer?: (Peer | null);
  /** The project; absent on the start page. */
  project?: (Project | null);
  /** Edits of the relief, oldest first, by their names in a script. */
  relief_done: string[];
  /** Those that can be made again, the next one last. */
  relief_undone: string[];
  /** How fine surfaces are. */
  resolution: Resolution;
  /** Rises with every change of the drawing. */
  revision: number;
  /** Seams, worst first. */
  seams: Seam2[];
  /** The stages in the order of the pipeline. */
  stages: Stage[];
  /** Point and normal of the plane of symmetry. */
  symmetry?: [[number, number, number], [number, number, number]] | null;
  /** Edits that can be made again, the next one last. */
  undone: Step[];
  /** What the user should know of the surfaces. */
  warnings: string[];
};

/** A step of the history: one to the mesh, or an edit. */
export type Step = {
  /** Corners, curves and patches after it; absent for a step to the mesh. */
  counts?: [number, number, number] | null;
  /** Its name in a script. */
  edit: string;
};

/** A stretch of a curve with weights of its own. */
export type Stretch = {
  /** Factor on the weight of curvature. */
  curvature?: number;
  /** Factor on the weight of fairness. */
  fairness?: number;
  /** Its start as a share of the length of the curve. */
  from: number;
  /** Its end as a share of the length. */
  to: number;
};

/** How points are moved in one sweep. */
export type Sweep = ("single" | "coarse_to_fine" | "solve");

/** Why something was refused. */
export type Why = {
  /** The way out; empty if there is none. */
  hint?: string;
  /** What is wrong. */
  message: string;
  /** Where, world units. */
  place?: [number, number, number] | null;
};
