//! The keys of the figures that reports hold, in one table: commands write them, the page and the verdict read them, and the guide
//! explains them.

/// How a figure is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// Yes or no, or a number as it is.
    Plain,
    /// A share of 1.
    Share,
    /// A distance, world units. Most have a second key that ends with `_rel`, the same as a share of the diagonal.
    Length,
    /// An angle.
    Degrees,
}

/// A key with what its figure tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// As reports have it.
    pub name: &'static str,
    /// In words, with a capital and without a full stop.
    pub meaning: &'static str,
    /// How it is read.
    pub reading: Reading,
}

macro_rules! keys {
    ($($constant:ident = $name:literal, $reading:ident, $meaning:literal;)*) => {
        $(#[doc = $meaning] pub const $constant: &str = $name;)*

        /// All keys but those whose names are put together, such as `a_to_b.rms`.
        pub const ALL: &[Key] = &[$(Key { name: $name, meaning: $meaning, reading: Reading::$reading }),*];
    };
}

keys! {
    SCAN_POINTS = "scan.points", Plain, "Points of the scan";
    SCAN_NOT_FINITE = "scan.not_finite", Plain, "Points without a finite place";
    SCAN_REPEATED = "scan.repeated", Plain, "Points at a place that another has";
    SCAN_SCANNERS = "scan.scanners", Plain, "Scanner positions that the file tells";
    SCAN_NOISE = "scan.noise", Length, "Noise of the points, standard deviation";
    SCAN_NOISE_REL = "scan.noise_rel", Share, "The same, as a share of the diagonal";
    SCAN_SPACING = "scan.spacing", Length, "Distance of neighbouring points";
    SCAN_SPACING_REL = "scan.spacing_rel", Share, "The same, as a share of the diagonal";
    SCAN_SAMPLES = "scan.samples", Plain, "Samples fitted to them";
    SCAN_SEGMENTS = "scan.segments", Plain, "Connected parts";
    SCAN_CONFIDENCE = "scan.confidence", Share, "Evidence that agrees with the orientation";
    SCAN_NORMAL_NOISE_DEG = "scan.normal_noise_deg", Degrees, "Typical error of the normals";
    SCAN_OUTLIERS = "scan.outliers", Plain, "Outliers left out";
    SCAN_MOVED_RMS = "scan.moved_rms", Length, "Points moved onto the surface by, root mean square";
    SCAN_CLOSED = "scan.closed", Plain, "Holes were closed";
    SCAN_LIDS = "scan.lids", Plain, "Small holes of an open scan that were closed";
    SCAN_BRICKS = "scan.bricks", Plain, "Bricks that the scan was meshed in";
    SCAN_SPECKS = "scan.specks", Plain, "Specks of noise left out";
    SCAN_TO_MESH_RMS = "scan.to_mesh_rms", Length, "Raw points to the mesh, root mean square";
    SCAN_TO_MESH_MEAN = "scan.to_mesh_mean", Length, "Raw points to the mesh, mean";
    SCAN_POINTS_OUT = "scan.points_out", Plain, "Points that were written";
    SCAN_FEATURE_LINES = "scan.feature_lines", Plain, "Sharp lines between the samples";
    TRUTH_NOISE_REL = "truth.noise_rel", Share, "True noise along the rays";
    TRUTH_OUTLIERS = "truth.outliers", Plain, "True number of wrong ranges";
    TRUTH_MESH_RMS = "truth.mesh_rms", Length, "Mesh to truth, root mean square";
    TRUTH_MESH_MAX = "truth.mesh_max", Length, "Mesh to truth, largest";
    TRUTH_MESH_NORMAL_DEG = "truth.mesh_normal_deg", Degrees, "Normals of the mesh, mean error";
    TRUTH_MESH_ZONE_DEG = "truth.mesh_zone_deg", Degrees, "Normals of the mesh beside true edges, mean error";
    TRUTH_MESH_TOPOLOGY = "truth.mesh_topology", Plain, "The mesh is closed, with the pieces and handles of the truth";
    TRUTH_SURFACE_RMS = "truth.surface_rms", Length, "Surfaces to truth, root mean square";
    TRUTH_SURFACE_NORMAL_DEG = "truth.surface_normal_deg", Degrees, "Normals of the surfaces, mean error";
    TRUTH_DISPLACED_RMS = "truth.displaced_rms", Length, "Displaced surfaces to truth, root mean square";
    TRUTH_DISPLACED_RMS_REL = "truth.displaced_rms_rel", Share, "The same, as a share of the diagonal";
    TRUTH_DISPLACED_MAX = "truth.displaced_max", Length, "Displaced surfaces to truth, largest";
    TRUTH_DISPLACED_NORMAL_DEG = "truth.displaced_normal_deg", Degrees, "Normals of the displaced surfaces, mean error";
    TRUTH_SHARP_LENGTH = "truth.sharp_length", Length, "Length of the true edges above 40°";
    TRUTH_SHARP_FOUND = "truth.sharp_found", Share, "Of that with a seam on it";
    TRUTH_SHARP_MET = "truth.sharp_met", Share, "Of that with the true angle within 3°";
    TRUTH_SHARP_FALSE = "truth.sharp_false", Share, "Sharp seams where the truth is smooth";
    VOLUME_SAMPLES = "volume.samples", Plain, "Samples of the volume";
    VOLUME_SPACING = "volume.spacing", Length, "Distance of its samples";
    MESH_TRIANGLES = "mesh.triangles", Plain, "Triangles of the mesh after repair";
    MESH_BORDER_CUT_SHARE = "mesh.border_cut_share", Share, "Area that went with ragged borders before patches were laid";
    MESH_VERTICES = "mesh.vertices", Plain, "Vertices of the mesh";
    MESH_COMPONENTS = "mesh.components", Plain, "Pieces of the mesh";
    MESH_WATERTIGHT = "mesh.watertight", Plain, "The mesh is closed";
    MESH_MANIFOLD = "mesh.manifold", Plain, "The mesh is manifold";
    MESH_FEATURE_EDGES = "mesh.feature_edges", Plain, "Sharp edges found";
    MESH_AREA = "mesh.area", Plain, "Area of the mesh, square units";
    MESH_VOLUME = "mesh.volume", Plain, "Volume of a closed mesh, cubic units";
    MESH_GENUS = "mesh.genus", Plain, "Handles of a closed mesh";
    MESH_BOUNDARY_LOOPS = "mesh.boundary_loops", Plain, "Boundaries of the mesh";
    MESH_NON_MANIFOLD_EDGES = "mesh.non_manifold_edges", Plain, "Edges with more than two triangles";
    MESH_NON_MANIFOLD_VERTICES = "mesh.non_manifold_vertices", Plain, "Vertices that join surfaces in a point";
    MESH_DUPLICATE_FACES = "mesh.duplicate_faces", Plain, "Triangles that repeat another";
    MESH_DEGENERATE_FACES = "mesh.degenerate_faces", Plain, "Triangles without area";
    MESH_FLIPPED_FACES = "mesh.flipped_faces", Plain, "Triangles that face the other way than their neighbours";
    MESH_UNREFERENCED_VERTICES = "mesh.unreferenced_vertices", Plain, "Vertices without a triangle";
    MESH_SELF_INTERSECTIONS = "mesh.self_intersections", Plain, "Pairs of triangles that cross";
    MESH_FOLDED_BACK = "mesh.folded_back", Plain, "Pairs of neighbours that are folded back";
    MESH_VOXEL = "mesh.voxel", Length, "Edge of a cell";
    MESH_TILES = "mesh.tiles", Plain, "Tiles that were written";
    MESH_CELLS = "mesh.cells", Plain, "Cells that the surface passes";
    MESH_FALLBACK_CELLS = "mesh.fallback_cells", Plain, "Cells whose sharp edge or corner was given up";
    MESH_PUSHED_CELLS = "mesh.pushed_cells", Plain, "Cells that are coarse";
    MESH_CLAMPED_FEATURES = "mesh.clamped_features", Plain, "Vertices of sharp edges that are not at their place";
    MESH_MENDED_HITS = "mesh.mended_hits", Plain, "Places on the lattice that had to be guessed";
    MESH_THIN_EDGES = "mesh.thin_edges", Plain, "Lattice edges that the surface passes more than once";
    MESH_THIN_WIDTH = "mesh.thin_width", Length, "Median distance between these passes";
    MESH_NOISE = "mesh.noise", Length, "Noise of the mesh, standard deviation";
    MESH_KEPT_VERTICES = "mesh.kept_vertices", Plain, "Vertices that stayed where they were";
    MESH_DISTANCE_MAX = "mesh.distance_max", Length, "Largest distance to the input";
    PATCHES_COUNT = "patches.count", Plain, "Four-sided patches";
    PATCHES_IRREGULAR_CORNERS = "patches.irregular_corners", Plain, "Corners where not four patches meet";
    LAYOUT_CONES = "layout.cones", Plain, "Cones of the directions it follows";
    LAYOUT_DEVIATION_DEG = "layout.deviation_deg", Degrees, "Patches off these directions, mean";
    LAYOUT_ALONG_FORM_SHARE = "layout.along_form_share", Share, "Area whose patches follow the form";
    GRID_POINTS = "grid.points", Plain, "Points of all grids";
    GRID_FOLDS = "grid.folds", Plain, "Folded grid cells";
    GRID_SPACING_CV = "grid.spacing_cv", Share, "Unevenness of grid spacing (deviation over mean)";
    SURFACE_CONTROL_POINTS = "surface.control_points", Plain, "Control points of all surfaces";
    SURFACE_TURNED = "surface.turned", Plain, "Patches whose surface points against its grid somewhere";
    SURFACE_UNPROVEN = "surface.unproven", Plain, "Patches of which neither that nor the contrary is proven";
    SURFACE_CROSSINGS = "surface.crossings", Plain, "Pairs of patches that cross, and patches that cross themselves";
    SURFACE_CROSSING_DEPTH = "surface.crossing_depth", Length, "Crossings less deep than this may be missed";
    SURFACE_FOLDS = "surface.folds", Plain, "Patches whose surface folds over";
    SURFACE_RMS = "surface.rms", Length, "Surface to input, root mean square";
    SURFACE_RMS_REL = "surface.rms_rel", Share, "The same, as a share of the diagonal";
    SURFACE_P95 = "surface.p95", Length, "Surface to input, 95 of 100 places are closer";
    SURFACE_MAX = "surface.max", Length, "Surface to input, largest";
    SURFACE_MAX_REL = "surface.max_rel", Share, "The same, as a share of the diagonal";
    SURFACE_PATCH_RMS_MAX = "surface.patch_rms_max", Length, "The largest root mean square of a patch";
    SURFACE_PATCH_RMS_MAX_REL = "surface.patch_rms_max_rel", Share, "The same, as a share of the diagonal";
    SURFACE_PATCH_P95_MAX = "surface.patch_p95_max", Length, "The largest distance that 95 of 100 places of a patch do not exceed";
    SURFACE_PATCH_P95_MAX_REL = "surface.patch_p95_max_rel", Share, "The same, as a share of the diagonal";
    SURFACE_PATCH_MAX = "surface.patch_max", Length, "The largest distance of a patch";
    SURFACE_PATCH_MAX_REL = "surface.patch_max_rel", Share, "The same, as a share of the diagonal";
    DISPLACED_RMS = "displaced.rms", Length, "Displaced surface to input, root mean square";
    DISPLACED_RMS_REL = "displaced.rms_rel", Share, "The same, as a share of the diagonal";
    DISPLACED_P95 = "displaced.p95", Length, "Displaced surface to input, 95 of 100 places are closer";
    DISPLACED_MAX = "displaced.max", Length, "Displaced surface to input, largest";
    SEAM_COUNT = "seam.count", Plain, "Seams between two patches";
    SEAM_GAP_MAX = "seam.gap_max", Length, "Largest gap along a seam";
    SEAM_GAP_BOUND = "seam.gap_bound", Length, "What no gap exceeds, between samples neither";
    SEAM_FOLDED = "seam.folded", Plain, "Smooth seams that are folded over";
    SEAM_INNER_ANGLE_MAX_DEG = "seam.inner_angle_max_deg", Degrees, "Largest angle across a smooth seam, its ends left out";
    SEAM_ANGLE_MAX_DEG = "seam.angle_max_deg", Degrees, "The same with ends, which may have no normal of their own";
    SEAM_REGULAR_ANGLE_MAX_DEG = "seam.regular_angle_max_deg", Degrees, "The same without the first knot span beside corners of less than 25 or more than 150 degrees";
    SEAM_REGULAR_ANGLE_BOUND_DEG = "seam.regular_angle_bound_deg", Degrees, "What that angle nowhere exceeds, between samples neither";
    SEAM_ODD_ENDS = "seam.odd_ends", Plain, "Ends of smooth seams in such corners";
    SEAM_ANGLE_RMS_DEG = "seam.angle_rms_deg", Degrees, "Angle across smooth seams, root mean square";
    SEAM_ANGLE_P95_DEG = "seam.angle_p95_deg", Degrees, "Angle that 95 of 100 of the length of smooth seams do not exceed";
    SEAM_EDGES = "seam.edges", Plain, "Pieces of smooth seams at which the grids meet at an edge: they keep its angle";
    SEAM_EDGES_SHARE = "seam.edges_share", Share, "Share of the length of smooth seams in such pieces";
    RELIEF_TEXELS = "relief.texels", Plain, "Texels of all displacement maps";
    RELIEF_MAX = "relief.max", Length, "Largest displacement";
    RELIEF_ROUNDING_MAX = "relief.rounding_max", Length, "Surface plus displacement, in memory, to the grid, largest";
    RELIEF_ROUNDTRIP_MAX = "relief.roundtrip_max", Length, "Surface plus displacement, read back from the files, to the grid, largest";
    RELIEF_ROUNDTRIP_MAX_REL = "relief.roundtrip_max_rel", Share, "The same, as a share of the diagonal";
    RELIEF_MAP_BYTES = "relief.map_bytes", Plain, "Bytes of all maps";
    RELIEF_MAP_BYTES_PER_TRIANGLE = "relief.map_bytes_per_triangle", Plain, "Bytes of all maps for each triangle of the input";
    RELIEF_MAP_ERROR_MAX = "relief.map_error_max", Length, "What the images hold, to what was written, largest";
    RELIEF_MAP_CRACK_MAX = "relief.map_crack_max", Length, "Places that patches share, apart in the images, largest";
    ALIGN_MEDIAN_BEFORE = "align.median_before", Length, "Median distance before the best fit";
    ALIGN_MEDIAN = "align.median", Length, "Median distance after it";
    ALIGN_TURN_DEG = "align.turn_deg", Degrees, "Angle of its turn";
    DISTANCE_TOLERANCE = "distance.tolerance", Length, "Distance that is asked for";
    DISTANCE_WITHIN_SHARE = "distance.within_share", Share, "Samples that keep it";
    NORMAL_FLIPPED_SHARE = "normal.flipped_share", Share, "Samples whose normals differ by more than 90 degrees";
    SIGNED_MEAN = "signed.mean", Length, "Mean of the distances with their sides";
    SIGNED_DEVIATION = "signed.deviation", Length, "Their standard deviation";
    SIGNED_MIN = "signed.min", Length, "The least of them";
    SIGNED_MAX = "signed.max", Length, "The largest of them";
}

/// A key of the table, by its name.
pub fn of(name: &str) -> Option<&'static Key> {
    ALL.iter().find(|key| key.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn keys_are_different_and_end_as_they_are_read() {
        let names: BTreeSet<&str> = ALL.iter().map(|key| key.name).collect();
        assert_eq!(names.len(), ALL.len());
        for key in ALL {
            assert_eq!(key.name.ends_with("_deg"), key.reading == Reading::Degrees, "{}", key.name);
            assert!(!key.name.ends_with("_rel") || key.reading == Reading::Share, "{}", key.name);
            assert!(!key.meaning.ends_with('.') && of(key.name) == Some(key), "{}", key.name);
        }
    }
}
