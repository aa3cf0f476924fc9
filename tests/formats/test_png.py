"""Pictures as PNG and EXR: the colours of the library, the tones that the file states, and the record."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from matplotlib.image import imread
from PIL import Image

from brdfdb.errors import ParameterError
from brdfdb.formats import exr, png
from brdfdb.formats.exr import SPHERE_PIXELS
from brdfdb.scenes.lit_sphere import linear_sphere, lit_sphere
from brdfdb.tables import slices
from tests.formats.small_tables import ANISOTROPIC, GREY, SPECTRAL, small_table

HALF_STEP = 0.5 / 255.0 + 1e-6  # of eight bits
FLOAT16_RTOL = 2.0**-10


def test_a_sphere_is_that_of_the_library(tmp_path: Path) -> None:
    table = small_table(GREY)
    assert png.write(table, tmp_path / "a.png", size=32.4, verdict="ok").error is None
    image = imread(tmp_path / "a.png")
    assert image.shape == (32, 32, 4)
    np.testing.assert_allclose(image, lit_sphere(table, 32), atol=HALF_STEP)
    with Image.open(tmp_path / "a.png") as picture:
        texts = dict(picture.info)
    assert texts["Title"] == f"{GREY}: sphere"
    assert json.loads(texts["Comment"])["audit"] == "ok"


@pytest.mark.parametrize("name", [ANISOTROPIC, SPECTRAL])
def test_slices_have_the_tones_that_the_file_states(name: str, tmp_path: Path) -> None:
    """f_r = 1/pi is half of the brightest light, 0.7354 of the screen's range; pixels grow with f_r."""
    table = small_table(name, fine_spectrum=name == SPECTRAL)
    png.write(table, tmp_path / "a.png", kind="lobe", theta_i=30.0)
    image = imread(tmp_path / "a.png")
    values = slices.lobe_map(table, theta_i_deg=30.0).values
    assert image.shape[:2] == values.shape[:2]
    if name == ANISOTROPIC:
        x = np.pi * values.astype(np.float64)
        linear = x / (1.0 + x)
        tone = np.where(linear > 0.0031308, 1.055 * linear ** (1.0 / 2.4) - 0.055, 12.92 * linear)
        np.testing.assert_allclose(image[..., 1], tone, atol=HALF_STEP)
    else:
        red, _, blue = image[..., :3].mean(axis=(0, 1))
        assert red > 1.1 * blue  # copper


def test_kinds_of_slices_have_their_own_shape(tmp_path: Path) -> None:
    for kind, shape in (("half_difference", (90, 90)), ("in_plane", (90, 180))):
        png.write(small_table(GREY), tmp_path / "a.png", kind=kind)
        assert imread(tmp_path / "a.png").shape[:2] == shape


def test_a_size_out_of_range_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="size: 3000"):
        png.write(small_table(GREY), tmp_path / "a.png", size=3000.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("half", [False, True])
def test_the_sphere_in_exr_is_linear_and_not_clipped(half: bool, tmp_path: Path) -> None:
    table = small_table(SPECTRAL)
    exr.write(table, tmp_path / "a.exr", kind="sphere", half=half, verdict="ok")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels.copy() for name, channel in file.channels().items()}
        header = dict(file.header())
    linear = linear_sphere(table, SPHERE_PIXELS)
    assert sorted(channels) == ["A", "B", "G", "R"]
    assert channels["G"].dtype == (np.float16 if half else np.float32)
    np.testing.assert_allclose(channels["G"], linear[..., 1] * linear[..., 3], rtol=FLOAT16_RTOL, atol=1e-6)
    np.testing.assert_allclose(channels["A"], linear[..., 3], rtol=FLOAT16_RTOL)
    assert channels["G"].max() > 1.0
    assert json.loads(header["brdf:record"])["audit"] == "ok"
