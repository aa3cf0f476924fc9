"""Pictures: white is white under every light, differences by their closed form, files that read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from matplotlib.image import imread

from brdfdb.scenes import image
from brdfdb.scenes.scene import Scene
from brdfdb.spectra import illuminant_spectrum
from tests.scenes import a_scene

ROUNDING = 5e-15  # a sum of 41 products is off by 41 * 2**-53 = 4.6e-15 at most; 1.4e-15 measured, by processor
PUBLISHED = 2e-6  # five decimals are printed, and E308 sums in steps of 1 nm: 1.5e-6 measured
LAB = 1e-13  # CIEDE2000 of greys: that rounding moves L* by 1.2e-13 at most; 1.5e-14 measured, by processor
SINGLE = 1e-7  # relative, of 32 bit floats: 5.5e-8 measured


def scene(**fields: object) -> Scene:
    return a_scene.scene("foam", ambient=1.0, wavelengths_nm=np.arange(380.0, 781.0, 10.0).tolist(), **fields)


@pytest.mark.parametrize("illuminant", ["D65", "A", "E", "FL2", "LED-B1"])
def test_white_is_white_under_every_illuminant(illuminant: str) -> None:
    of = scene(illuminant=illuminant)
    grey = np.array([[0.2], [1.0]]) * np.ones(41)
    assert np.abs(image.linear_srgb(of, grey) - [[0.2], [1.0]]).max() < ROUNDING
    assert np.abs(image.xyz(of, grey)[:, 1] - [0.2, 1.0]).max() < ROUNDING


def test_white_under_d65_has_the_published_tristimulus_values() -> None:
    # CIE 15: X and Z of D65 for the 2 degree observer, over Y
    assert np.abs(image.xyz(scene(), np.ones(41)) - [0.95047, 1.0, 1.08883]).max() < PUBLISHED


def test_exposure_multiplies_what_a_picture_shows() -> None:
    radiance = np.linspace(0.1, 0.3, 41)
    assert np.allclose(image.xyz(scene(exposure=2.5), radiance), 2.5 * image.xyz(scene(), radiance), rtol=ROUNDING)


def test_the_transfer_curve_is_that_of_srgb() -> None:
    # IEC 61966-2-1: 12.92 x up to 0.0031308, then 1.055 x^(1/2.4) - 0.055; white and above are 1
    encoded = image.srgb(scene(), np.array([[0.002], [0.2], [3.0]]) * np.ones(41))
    expected = [12.92 * 0.002, 1.055 * 0.2 ** (1.0 / 2.4) - 0.055, 1.0]
    assert np.abs(encoded - np.array(expected)[:, np.newaxis]).max() < ROUNDING


@pytest.mark.parametrize("illuminant", ["D65", "A"])
def test_the_difference_of_two_greys_is_that_of_their_lightness(illuminant: str) -> None:
    # Of greys: L* = 116 Y^(1/3) - 16, dE = |dL*| / S_L, S_L = 1 + 0.015 m / sqrt(20 + m), m = (mean L* - 50)^2
    of = scene(illuminant=illuminant, exposure=0.5)
    low, high = 0.3, 0.4
    first, second = (116.0 * np.cbrt(0.5 * grey) - 16.0 for grey in (low, high))
    m = ((first + second) / 2.0 - 50.0) ** 2
    expected = (second - first) / (1.0 + 0.015 * m / np.sqrt(20.0 + m))
    assert abs(image.difference(of, np.full(41, low), np.full(41, high)) - expected) < LAB
    assert image.difference(of, np.full(41, low), np.full(41, low)) == 0.0


def test_a_png_has_the_picture_the_right_way_up(tmp_path: Path) -> None:
    radiance = np.zeros((2, 3, 41))
    radiance[0, 2] = 1.0
    image.write_png(tmp_path / "corner.png", scene(), radiance)
    read = imread(tmp_path / "corner.png")[..., :3]
    assert np.array_equal(read, np.repeat((radiance[..., :1] > 0.0).astype(np.float32), 3, axis=-1))


def test_an_exr_has_the_spectrum_times_the_illuminant(tmp_path: Path) -> None:
    of = scene(illuminant="A", exposure=3.0)
    radiance = np.random.default_rng(1).uniform(0.1, 1.0, (4, 5, 41))
    image.write_exr(tmp_path / "picture.exr", of, radiance)
    with OpenEXR.File(str(tmp_path / "picture.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        header = dict(file.header())
    assert len(channels) == 44
    assert header["brdf:illuminant"] == "A"
    light = illuminant_spectrum("A", of.wavelengths_nm)
    assert np.abs(channels["S0.380,0nm"] / (radiance[..., 0] * light[0]) - 1.0).max() < SINGLE
    assert np.abs(channels["S0.560,0nm"] / radiance[..., 18] - 1.0).max() < SINGLE
    assert np.abs(channels["G"] / image.linear_srgb(of, radiance)[..., 1] - 1.0).max() < SINGLE


def test_a_picture_that_cannot_be_written_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="cannot write"):
        image.write_exr(tmp_path / "missing" / "picture.exr", scene(), np.ones((1, 1, 41)))
