"""Shapes that many tests use; each is made once."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import planish


@pytest.fixture(scope="session")
def ball() -> planish.Mesh:
    """A ball of radius 10 with 20 480 triangles."""
    return planish.sphere(10.0, 5)


@pytest.fixture(scope="session")
def box() -> planish.Mesh:
    """A box of 4 x 3 x 2 with sharp edges."""
    return planish.cuboid((4.0, 3.0, 2.0), cells=8)


@pytest.fixture(scope="session")
def scan() -> planish.Cloud:
    """A noisy scan of the demonstration part, about 12 000 points."""
    return planish.virtual_scan(planish.demo_part(triangles=8_000), points=12_000, seed=3)


@pytest.fixture(scope="session")
def samples(scan: planish.Cloud) -> planish.Samples:
    """The samples of the scan."""
    return scan.clean()


@pytest.fixture(scope="session")
def model(box: planish.Mesh) -> planish.Model:
    """The box fitted."""
    return box.fit(patches=6, tolerance=1e-3)


def on_ball(count: int, radius: float = 1.0, seed: int = 0) -> NDArray[np.float64]:
    """Evenly random points on a ball around the origin."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)
