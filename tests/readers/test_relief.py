"""Displacement maps as OpenEXR reads them."""

import json

import numpy as np
import pytest

OpenEXR = pytest.importorskip("OpenEXR")


def pixels(path):
    """The image as an array of rows, columns and channels R, G, B."""
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        if "RGB" in channels:
            return np.asarray(channels["RGB"].pixels)
        return np.stack([np.asarray(channels[c].pixels) for c in "RGB"], axis=-1)


def test_every_map_has_the_size_and_the_largest_displacement_of_its_sidecar(demo, report):
    sidecar = json.loads((demo / "relief" / "relief.json").read_text())
    entries = sidecar["patches"]
    assert len(entries) == report["quality"]["patches.count"]
    total = 0
    for entry in entries:
        image = pixels(demo / "relief" / entry["file"])
        assert image.dtype == np.float32
        assert image.shape == (entry["height"], entry["width"], 3)
        largest = np.linalg.norm(image.astype(np.float64), axis=-1).max()
        assert largest == pytest.approx(entry["largest"], rel=1e-6, abs=1e-12)
        total += image.shape[0] * image.shape[1]
    assert total == report["quality"]["relief.texels"]


def test_the_largest_texel_is_the_reported_largest_displacement(demo, report):
    files = sorted((demo / "relief").glob("*.exr"))
    largest = max(np.linalg.norm(pixels(f).astype(np.float64), axis=-1).max() for f in files)
    assert largest == pytest.approx(report["quality"]["relief.max"], rel=1e-6)
