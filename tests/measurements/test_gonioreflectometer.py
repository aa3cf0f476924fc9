"""Ward's instrument: pictures, their reduction, and the parameters that a fit to them finds again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats, presets
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats.gonioreflectometer import read_picture, write_picture
from brdfdb.measurements.aperture import averaged
from brdfdb.measurements.gonioreflectometer import CameraPicture, Gonioreflectometer, eq_3, photograph, reduced, traced

SMALL = Gonioreflectometer(width=324, height=240)
PARAMETERS = ("rho_d", "rho_s", "alpha_x", "alpha_y")
# Lights [degrees] of the pictures: the grain of an anisotropic sample is seen from both sides
LIGHTS = ((15.0, 0.0), (30.0, 45.0), (45.0, 90.0), (60.0, 20.0))
WARDS = [name for name, material in presets().items() if material.model == "ward"]


def brdf_of(name: str) -> Any:
    return presets()[name].brdf_at(None)


def taken(name: str, settings: Gonioreflectometer = SMALL, theta_i: float = 30.0, phi_i: float = 40.0) -> CameraPicture:
    return photograph(brdf_of(name), settings, np.radians(theta_i), np.radians(phi_i), 7, name)


@pytest.mark.parametrize("name", ["rolled-brass", "wall-plaster"])
def test_a_reduced_picture_is_f_r_within_its_uncertainty(name: str) -> None:
    picture = taken(name)
    assert (picture.sample[0].max() == SMALL.saturation) == (name == "rolled-brass")  # the peak needs a short exposure
    for thin in (False, True):
        samples = reduced(picture, thin=thin)
        expected = averaged(brdf_of(name), SMALL.instrument)(samples.w_i, samples.w_r)
        deviation = (samples.values - expected) / samples.uncertainty
        chance = 3.0 / np.sqrt(len(samples))  # three standard errors of the mean; thinning leaves 142 of wall-plaster
        assert abs(deviation.mean()) < max(0.05, chance)
        assert abs(deviation.std() - 1.0) < max(0.05, chance / np.sqrt(2.0))
        assert np.degrees(samples.theta_r.max()) < SMALL.largest_theta_r_deg


def test_thinning_leaves_many_pixels_at_the_peak_and_few_elsewhere() -> None:
    picture = taken("rolled-brass")
    dense, thin = reduced(picture, thin=False), reduced(picture)
    assert len(thin) < 0.25 * len(dense)
    bright, thin_bright = (np.count_nonzero(s.values > 0.3 * dense.values.max()) for s in (dense, thin))
    assert thin_bright > 0.4 * bright > 0.0
    assert len(thin) - thin_bright < 0.2 * (len(dense) - bright)


def test_thinning_does_not_follow_the_noise_of_single_pixels() -> None:
    name, light = "latex-gloss-sprayed-sheetrock", np.radians([45.0, 40.0])
    kept = []
    for seed in (1, 2):
        thin = reduced(photograph(brdf_of(name), SMALL, *light, seed, name))
        kept.append({tuple(w) for w in np.round(thin.w_r, 9).tolist()})
    assert len(kept[0] & kept[1]) > 0.93 * len(kept[0] | kept[1])  # 0.76 where each pixel is judged by itself


@pytest.mark.parametrize(
    ("name", "theta_i", "width", "most"),
    [("rolled-brass", 45.0, 324, 1e-3), ("rolled-aluminum", 60.0, 324, 1.5e-3), ("rolled-brass", 45.0, 216, 1.1e-3)],
)
def test_the_lens_that_blurs_wider_along_theta_is_undone(name: str, theta_i: float, width: int, most: float) -> None:
    """Without noise, f_r in the lobe is that of a round aperture; with the blur of the lens it is 2.5 times as far.

    Second derivatives of a picture smoothed over two pixels leave 2.6e-3 of the second and 1.4e-3 of the third.
    """
    height = width * SMALL.height // SMALL.width
    quiet = replace(SMALL, width=width, height=height, full_well=1e9, read_noise=0.0, bits=24)
    samples = reduced(taken(name, quiet, theta_i), thin=False)
    expected = averaged(brdf_of(name), quiet.instrument)(samples.w_i, samples.w_r)
    lobe = expected > 0.1 * expected.max()
    assert np.sqrt(np.mean((samples.values / expected - 1.0)[lobe] ** 2)) < most


def test_eq_3_alone_would_be_off_where_traced_rays_are_not() -> None:
    theta, phi = np.radians([10.0, 40.0, 70.0]), np.radians([20.0, 100.0, 250.0])
    apart = np.degrees(np.arccos(np.sum(eq_3(theta, phi, 0.1) * traced(theta, phi, 0.1), axis=-1)))
    assert np.all(apart < 1.0)
    assert np.all(apart > 0.01)


def test_a_picture_through_a_file_is_the_same(tmp_path: Path) -> None:
    picture = taken("rolled-brass")
    write_picture(picture, tmp_path / "brass.exr")
    again = read_picture(tmp_path / "brass.exr")
    for part in ("sample", "standard", "background"):
        np.testing.assert_array_equal(getattr(again, part), getattr(picture, part))
    assert (again.settings, again.name, again.provenance) == (SMALL, "rolled-brass", "simulated")
    np.testing.assert_allclose([again.theta_i, again.phi_i], [picture.theta_i, picture.phi_i], rtol=1e-14)


def test_files_that_are_no_picture_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "brass.exr"
    write_picture(taken("rolled-brass"), path)
    content = path.read_bytes()
    for changed, sentence in (
        (content[: len(content) // 2], r"brass\.exr"),
        (content.replace(b'"bits": 14', b'"bits": 99'), "bits: 99 is not in"),
        (content.replace(b'"theta_i_deg"', b'"theta_x_deg"'), "it has no 'theta_i_deg'"),
    ):
        path.write_bytes(changed)
        with pytest.raises(FileFormatError, match=sentence):
            formats.read(path)


def test_a_picture_without_light_is_refused() -> None:
    dark = Gonioreflectometer(width=16, height=16, full_well=100.0, read_noise=1000.0)
    with pytest.raises(ParameterError, match="every pixel is dark"):
        reduced(taken("wall-plaster", dark))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"width": 2}, "width: 2 is not in"),
        ({"exposures": (0.5, 0.1)}, "exposures: "),
        ({"exposures": (1.0, 1.0)}, "exposures: "),
        ({"standard_reflectance": 1.5}, "standard_reflectance: 1.5 is not in"),
    ],
)
def test_settings_that_cannot_be_are_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        Gonioreflectometer(**changes)
