"""To and from the objects of other libraries. Each is imported only when it is asked for.

Meshes and clouds: trimesh, Open3D, PyVista, meshio; large clouds: Parquet by pyarrow. Surfaces: SciPy's `NdBSpline`, splipy, and dicts in the manner of geomdl.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._planish import Cloud, FileError, Mesh, Surface

if TYPE_CHECKING:
    from collections.abc import Iterator
    from os import PathLike

    import numpy as np
    from numpy.typing import NDArray


def to_trimesh(mesh: Mesh) -> Any:
    """A trimesh.Trimesh with the same vertices, faces and, if there are any, colours."""
    import trimesh

    colors = mesh.attributes.get("color")
    return trimesh.Trimesh(
        mesh.points, mesh.triangles, process=False, vertex_colors=None if colors is None else _bytes(colors)
    )


def from_trimesh(mesh: Any) -> Mesh:
    """A mesh from a trimesh.Trimesh, with its vertex colours if it has some."""
    attributes = {}
    if mesh.visual.kind == "vertex":
        attributes["color"] = _shares(mesh.visual.vertex_colors)
    return Mesh(mesh.vertices, mesh.faces, attributes=attributes)


def to_open3d(mesh: Mesh) -> Any:
    """An open3d.geometry.TriangleMesh with the same vertices, triangles and, if there are any, colours."""
    # Open3D takes arrays that can be written to, and copies them once more.
    import open3d

    vector = open3d.utility.Vector3dVector
    made = open3d.geometry.TriangleMesh(vector(mesh.points.copy()), open3d.utility.Vector3iVector(mesh.triangles.astype("int32")))
    if (colors := mesh.attributes.get("color")) is not None:
        made.vertex_colors = vector(colors[:, :3].astype("float64"))
    return made


def from_open3d(shape: Any) -> Mesh | Cloud:
    """A mesh from an open3d.geometry.TriangleMesh, a cloud from a PointCloud, with their colours and normals."""
    import numpy as np

    if hasattr(shape, "triangles"):
        attributes = {"color": np.asarray(shape.vertex_colors)} if shape.has_vertex_colors() else {}
        return Mesh(np.asarray(shape.vertices), np.asarray(shape.triangles), attributes=attributes)
    return Cloud(
        np.asarray(shape.points),
        normals=np.asarray(shape.normals) if shape.has_normals() else None,
        colors=np.asarray(shape.colors) if shape.has_colors() else None,
    )


def to_pyvista(mesh: Mesh) -> Any:
    """A pyvista.PolyData with the same points, faces and attributes."""
    import numpy as np
    import pyvista

    triangles = mesh.triangles.astype("int64")
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    made = pyvista.PolyData(mesh.points.copy(), faces)
    for name, values in mesh.attributes.items():
        made.point_data[name] = values.copy()
    return made


def from_pyvista(data: Any) -> Mesh | Cloud:
    """A mesh from a pyvista.PolyData with faces (which are triangulated), a cloud from one without; with its point data."""
    arrays = {str(name): data.point_data[name] for name in data.point_data.keys()}
    attributes = {name: values for name, values in arrays.items() if values.ndim <= 2 and values.dtype.kind in "fiub"}
    if len(data.faces) == 0:
        return Cloud(data.points, attributes=attributes)
    triangles = data.triangulate()
    return Mesh(triangles.points, triangles.faces.reshape(-1, 4)[:, 1:], attributes=attributes)


def to_meshio(mesh: Mesh) -> Any:
    """A meshio.Mesh with one block of triangles and the attributes as point data."""
    import meshio

    data = {name: values.copy() for name, values in mesh.attributes.items()}
    return meshio.Mesh(mesh.points.copy(), [("triangle", mesh.triangles.astype("int64"))], point_data=data)


def from_meshio(mesh: Any) -> Mesh:
    """A mesh from the triangles and quads (each cut in two) of a meshio.Mesh, with its point data."""
    import numpy as np

    blocks = [block.data for block in mesh.cells if block.type == "triangle"]
    for quads in (block.data for block in mesh.cells if block.type == "quad"):
        blocks += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    if not blocks:
        raise ValueError("mesh: it has no triangles and no quads")
    points = np.asarray(mesh.points, dtype="float64")
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    kept = {name: values for name, values in mesh.point_data.items() if np.ndim(values) <= 2}
    return Mesh(points, np.concatenate(blocks), attributes=kept)


def cloud_to_trimesh(cloud: Cloud) -> Any:
    """A trimesh.PointCloud with the same points and, if there are any, colours."""
    import trimesh

    colors = cloud.attributes.get("color")
    return trimesh.PointCloud(cloud.points, colors=None if colors is None else _bytes(colors))


def cloud_to_open3d(cloud: Cloud) -> Any:
    """An open3d.geometry.PointCloud with the same points and, if there are any, normals and colours."""
    import open3d

    vector = open3d.utility.Vector3dVector
    made = open3d.geometry.PointCloud(vector(cloud.points.copy()))
    if (normals := cloud.attributes.get("normal")) is not None:
        made.normals = vector(normals.astype("float64"))
    if (colors := cloud.attributes.get("color")) is not None:
        made.colors = vector(colors[:, :3].astype("float64"))
    return made


def cloud_to_pyvista(cloud: Cloud) -> Any:
    """A pyvista.PolyData of the points with their attributes."""
    import pyvista

    made = pyvista.PolyData(cloud.points.copy())
    for name, values in cloud.attributes.items():
        made.point_data[name] = values.copy()
    return made


def from_parquet(
    path: str | PathLike[str],
    points: tuple[str, str, str] = ("x", "y", "z"),
    *,
    normals: tuple[str, str, str] | None = None,
    piece: int = 65536,
) -> Iterator[Cloud]:
    """The points of a Parquet file in pieces of so many rows: what `Bricks.create` takes, so that memory does not grow with the file.

    * points, normals: names of the columns; missing values are points that are not numbers, which no stage uses

    Raises FileError if a column is missing or holds no numbers.
    """
    import numpy
    from pyarrow import ArrowInvalid, parquet

    columns = [*points, *(normals or ())]
    with parquet.ParquetFile(path) as file:
        names = file.schema_arrow.names
        missing = [name for name in columns if name not in names]
        if missing:
            raise FileError(f"{path}: has no column {missing[0]} - hint: its columns are {', '.join(names)}")
        for batch in file.iter_batches(batch_size=piece, columns=columns):
            try:
                rows = [batch.column(name).cast("float64").to_numpy(zero_copy_only=False) for name in columns]
            except ArrowInvalid as error:
                raise FileError(f"{path}: {error} - hint: name columns of numbers") from error
            table = numpy.column_stack(rows)
            yield Cloud(table[:, :3], normals=table[:, 3:] if normals else None)


def surface_to_scipy(surface: Surface) -> Any:
    """A scipy.interpolate.NdBSpline of degree 3: called with (v, u), it returns positions."""
    from scipy.interpolate import NdBSpline

    return NdBSpline((surface.knots_v.copy(), surface.knots_u.copy()), surface.control.copy(), 3)


def surface_from_scipy(spline: Any) -> Surface:
    """A surface from a bicubic, clamped NdBSpline over [0, 1]² in (v, u) with three numbers at each place."""
    if tuple(spline.k) != (3, 3):
        raise ValueError(f"spline: degrees {tuple(spline.k)}; planish has bicubic surfaces")
    return Surface(spline.c, knots_u=spline.t[1], knots_v=spline.t[0])


def surface_to_geomdl(surface: Surface) -> dict[str, Any]:
    """A dict in the manner of geomdl's `BSpline.Surface`: control points with v running fastest, knots and degrees."""
    rows, cols, _ = surface.control.shape
    return {
        "type": "spline",
        "rational": False,
        "dimension": 3,
        "degree_u": 3,
        "degree_v": 3,
        "size_u": cols,
        "size_v": rows,
        "knotvector_u": surface.knots_u.tolist(),
        "knotvector_v": surface.knots_v.tolist(),
        "control_points": {"points": surface.control.transpose(1, 0, 2).reshape(-1, 3).tolist()},
    }


def surface_from_geomdl(shape: dict[str, Any]) -> Surface:
    """A surface from such a dict; knots are brought to 0 to 1. Rational surfaces and other degrees are refused."""
    import numpy as np

    if shape.get("rational"):
        raise ValueError("shape: rational; planish has polynomial surfaces")
    if (shape["degree_u"], shape["degree_v"]) != (3, 3):
        raise ValueError(f"shape: degrees {(shape['degree_u'], shape['degree_v'])}; planish has bicubic surfaces")
    points = np.asarray(shape["control_points"]["points"], dtype="float64")
    net = points.reshape(shape["size_u"], shape["size_v"], 3).transpose(1, 0, 2)
    return Surface(net, knots_u=_unit(shape["knotvector_u"]), knots_v=_unit(shape["knotvector_v"]))


def surface_to_splipy(surface: Surface) -> Any:
    """A splipy.Surface in (u, v)."""
    import splipy

    bases = [splipy.BSplineBasis(4, knots.tolist()) for knots in (surface.knots_u, surface.knots_v)]
    # splipy runs through the first parameter fastest.
    return splipy.Surface(*bases, surface.control.reshape(-1, 3).copy())


def surface_from_splipy(surface: Any) -> Surface:
    """A surface from a bicubic splipy.Surface; knots are brought to 0 to 1."""
    if surface.rational or tuple(surface.order()) != (4, 4):
        raise ValueError("surface: rational or not bicubic; planish has polynomial bicubic surfaces")
    u, v = surface.bases
    return Surface(surface.controlpoints.transpose(1, 0, 2), knots_u=_unit(u.knots), knots_v=_unit(v.knots))


def _unit(knots: Any) -> NDArray[np.float64]:
    """Knots brought to 0 to 1."""
    import numpy as np

    given: NDArray[np.float64] = np.asarray(knots, dtype="float64")
    unit: NDArray[np.float64] = (given - given[0]) / (given[-1] - given[0])
    return unit


def _bytes(colors: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours from 0 to 1 as bytes."""
    return (colors.clip(0.0, 1.0) * 255.0).round().astype("uint8")


def _shares(colors: NDArray[Any]) -> NDArray[np.float32]:
    """Colours as bytes from 0 to 1."""
    return (colors / 255.0).astype("float32")
