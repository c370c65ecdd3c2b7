"""Patches with their displacement maps, evaluated by SciPy: what another program makes of surface and map."""

import json

import numpy as np
from scipy.interpolate import BSpline

from test_relief import pixels


class Patch:
    """A bicubic surface; `control` is (rows, columns, 3), u along a row."""

    def __init__(self, knots_u, knots_v, control):
        self.knots = np.asarray(knots_u, float), np.asarray(knots_v, float)
        self.control = np.asarray(control, float)

    def at(self, u, v, du=0, dv=0):
        """Points, or derivatives, at pairs of parameters."""
        basis = []
        for t, knots, order in ((u, self.knots[0], du), (v, self.knots[1], dv)):
            count = len(knots) - 4
            # The last knot belongs to the last span.
            inside = np.clip(t, knots[3], np.nextafter(knots[count], 0))
            basis.append(np.stack([BSpline(knots, row, 3).derivative(order)(inside) if order else BSpline(knots, row, 3)(inside) for row in np.eye(count)], -1))
        return np.einsum("ki,kj,jid->kd", *basis, self.control)


def displaced(patch, image, uv):
    """The surface moved by its map, at texture coordinates counted from the lower left corner of the image.

    The map is read at the texel that the coordinates hit, which must be its centre. Returns the points, and which of them have
    a frame (at a pole the surface has none).
    """
    height, width, _ = image.shape
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    i, j = np.rint(x).astype(int), np.rint(y).astype(int)
    assert np.abs(x - i).max() < 1e-3 and np.abs(y - j).max() < 1e-3, "no texel centres"
    u, v = i / (width - 1), j / (height - 1)
    vectors = image[height - 1 - j, i].astype(float)
    s_u, s_v = patch.at(u, v, 1, 0), patch.at(u, v, 0, 1)
    area = np.cross(s_u, s_v)
    sound = np.linalg.norm(area, axis=1) > 1e-3 * np.linalg.norm(s_u, axis=1) * np.linalg.norm(s_v, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        t = s_u / np.linalg.norm(s_u, axis=1, keepdims=True)
        n = area / np.linalg.norm(area, axis=1, keepdims=True)
    frame = np.stack([t, np.cross(n, t), n], 1)
    return patch.at(u, v) + np.einsum("kc,kcd->kd", vectors, frame), sound


def images(folder):
    """The maps of a folder in the order of the patches."""
    entries = json.loads((folder / "relief.json").read_text())["patches"]
    return [pixels(folder / entry["file"]) for entry in entries]


def check(patches, maps, meshes, diagonal, tolerance):
    """Every corner of the mesh of every patch is where surface and map put it.

    * `meshes` - for each patch the points of its corners and their texture coordinates
    * `tolerance` - largest distance accepted, in diagonals
    """
    assert len(patches) == len(maps) == len(meshes)
    skipped = total = 0
    for patch, image, (points, uv) in zip(patches, maps, meshes):
        want, sound = displaced(patch, image, uv)
        assert np.linalg.norm(want - points, axis=1)[sound].max() <= tolerance * diagonal
        skipped, total = skipped + (~sound).sum(), total + len(uv)
        # All of the map is used: a corner in each corner of the image.
        size = image.shape[1], image.shape[0]
        np.testing.assert_allclose(uv.min(0), [0.5 / n for n in size], atol=1e-6)
        np.testing.assert_allclose(uv.max(0), [1 - 0.5 / n for n in size], atol=1e-6)
    assert skipped <= 0.01 * total
