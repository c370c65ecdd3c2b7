"""A scan to a STEP file, stage by stage: python scan_to_step.py [SCAN] [OUTPUT.step]

Without a scan, the demonstration part is scanned virtually.
"""

import sys

import planish


def main(source: str | None = None, output: str = "part.step", *, points: int = 60_000) -> planish.Model:
    if source is None:
        cloud = planish.virtual_scan(planish.demo_part(), points=points, seed=1)
    else:
        found = planish.read(source)
        if not isinstance(found, planish.Cloud):
            raise SystemExit(f"{source} is no scan")
        cloud = found
    print(cloud)

    samples = cloud.clean(progress=sys.stderr.isatty())
    print(f"{samples}: cells of {samples.voxel:.4f} suit them")

    mesh = samples.mesh()
    print(mesh)

    network = mesh.layout(patches=60)
    print(network)

    model = mesh.fit(network, tolerance=3e-4)
    print(f"{model}: RMS {model.quality['surface.rms_rel']:.4%} of the diagonal")
    for warning in model.warnings:
        print("warning:", warning["message"])

    model.export(output)
    return model


if __name__ == "__main__":
    main(*sys.argv[1:3])
