"""A function of one's own to a mesh with sharp edges: python implicit_to_mesh.py [OUTPUT.ply]

A box with a gyroid cut into it. The function is asked for many points at once.
"""

import sys

import numpy as np
from numpy.typing import NDArray

import planish

#: Half the edge of the box, and half the wall of the gyroid.
HALF, WALL = 1.0, 0.35


def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pseudo-distances at points (n, 3): negative inside."""
    box = np.abs(points).max(axis=1) - HALF
    x, y, z = (2.0 * np.pi * points / (2.0 * HALF)).T
    gyroid = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    # The greater of two distances is that of what both have in common: sharp where they cross.
    both: NDArray[np.float64] = np.maximum(box, (np.abs(gyroid) - WALL) / np.pi)
    return both


def main(output: str = "gyroid.ply", *, resolution: int = 65) -> planish.Mesh:
    field = planish.Field(distance, bounds=[[-HALF] * 3, [HALF] * 3])
    mesh = field.mesh(resolution=resolution)
    facts = mesh.diagnose()
    print(f"{mesh}: watertight {facts['watertight']}, genus {facts['genus']}, volume {facts['volume']:.4f}")
    mesh.write(output)
    return mesh


if __name__ == "__main__":
    main(*sys.argv[1:2])
