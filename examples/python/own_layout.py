"""A patch layout of one's own: python own_layout.py [OUTPUT.step]

Eight corners and twelve curves of a cube, drawn on a ball: six patches, which are then fitted.
"""

import sys
from itertools import product

import numpy as np

import planish


def main(output: str = "ball.step", *, level: int = 5) -> planish.Model:
    mesh = planish.sphere(radius=10.0, level=level)
    corners = np.array(list(product([-1.0, 1.0], repeat=3))) * 10.0 / np.sqrt(3.0)
    # Corners of a cube that differ in one coordinate are joined.
    edges = [(a, b) for a in range(8) for b in range(a) if np.sum(corners[a] != corners[b]) == 1]

    model = mesh.model()
    for a, b in edges:
        model = model.edit("paint", picks=corners[[a, b]], mode="geodesic")
    left = model.diagnose()
    print(f"{model.network}: {left['patches']} patches, finished {left['finished']}")

    model = model.fit(control=[10, 10])
    worst = max(abs(np.linalg.norm(s.sample(*[np.linspace(0, 1, 20)] * 2), axis=2) - 10.0).max() for s in model.surfaces)
    print(f"{model}: at most {worst:.2e} off the ball, seams within {model.quality['seam.angle_max_deg']:.3f} degrees")
    model.export(output)
    return model


if __name__ == "__main__":
    main(*sys.argv[1:2])
