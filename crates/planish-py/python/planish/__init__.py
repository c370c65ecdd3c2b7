"""planish turns scans and dense triangle meshes into smooth B-spline patches with displacement maps.

    import planish

    cloud = planish.read("scan.e57")             # Cloud, Mesh, Volume, Field or Model, by the file
    samples = cloud.clean()                      # denoised, oriented
    mesh = samples.mesh(voxel=0.5)               # closed, sharp edges kept
    network = mesh.layout(patches=60)            # four-sided patches
    model = mesh.fit(network, tolerance=1e-4)    # B-spline surfaces, seams, displacement maps
    model.export("part.step")

    planish.run("scan.e57", "out")               # all of that, with every product and a report
    planish.run_many(["a.ply", "b.e57"], "out", jobs=2)

Arrays are NumPy's: positions `(n, 3)` float64 in world units, indices uint32. Long calls release the interpreter's lock,
take `progress=` (True, or a function of the stage's name and the share done) and stop on Ctrl-C. Every failure is a
`planish.Error`, one class below it for each stage. Objects never change after they were made; threads may share them.
"""

from ._batch import Batch, Row, Run, run, run_many
from ._planish import (
    Bricks,
    Cloud,
    CloudError,
    CompareError,
    ContourError,
    Curve,
    CurveError,
    EditError,
    Error,
    Field,
    FieldError,
    FileError,
    FitError,
    Grid,
    GridError,
    InternalError,
    LayoutError,
    Mesh,
    MeshError,
    Model,
    Network,
    NetworkError,
    Relief,
    ReliefError,
    RenderError,
    RunError,
    Samples,
    Surface,
    Volume,
    __version__,
    cuboid,
    demo_part,
    keywords,
    read,
    schema,
    set_threads,
    sphere,
    virtual_scan,
)

__all__ = [
    "Batch",
    "Bricks",
    "Cloud",
    "CloudError",
    "CompareError",
    "ContourError",
    "Curve",
    "CurveError",
    "EditError",
    "Error",
    "Field",
    "FieldError",
    "FileError",
    "FitError",
    "Grid",
    "GridError",
    "InternalError",
    "LayoutError",
    "Mesh",
    "MeshError",
    "Model",
    "Network",
    "NetworkError",
    "Relief",
    "ReliefError",
    "RenderError",
    "Row",
    "Run",
    "RunError",
    "Samples",
    "Surface",
    "Volume",
    "__version__",
    "cuboid",
    "demo_part",
    "keywords",
    "read",
    "run",
    "run_many",
    "schema",
    "set_threads",
    "sphere",
    "virtual_scan",
]
