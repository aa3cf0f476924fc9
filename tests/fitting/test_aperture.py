"""Fits of what an instrument with wide openings sees: averages of lobes, and specular parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.fitting.fit import fits
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Instrument, Samples
from brdfdb.measurements.aperture import InstrumentView, averaged, cone
from brdfdb.models import MODELS, he_torrance_aperture_vectors

Array = NDArray[np.float64]

WARD = {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.03, "alpha_y": 0.03}
NOISE = 0.03
DRAWN = 20000  # directions of light and receiver of a mean by chance
MEAN = 0.03  # of a mean by chance, relative; the quadrature itself is off by less
PEAK = 0.02  # of a specular peak, against an average that takes the cones apart; measured: 0.005


def solid_angle(full_deg: float) -> float:
    return float(2.0 * np.pi * (1.0 - np.cos(np.deg2rad(0.5 * full_deg))))


def directions() -> tuple[Array, Array, Array, Array]:
    """Return directions of three lights, steps of a degree about the mirror direction among them."""
    far = np.meshgrid([10.0, 30.0, 50.0], np.arange(0.0, 81.0, 8.0), [0.0, 60.0, 120.0, 180.0], indexing="ij")
    near = np.meshgrid([10.0, 30.0, 50.0], np.arange(-8.0, 9.0, 1.0), [178.0, 180.0], indexing="ij")
    theta_i, theta_r, turn = np.deg2rad(
        [np.concatenate([a.ravel(), b.ravel()]) for a, b in zip(far, near, strict=True)]
    )
    theta_r[far[0].size :] += theta_i[far[0].size :]
    return theta_i, np.zeros_like(theta_i), theta_r, turn


def drawn(brdf: Callable[[Array, Array], Array], wi: Array, wr: Array, half_angles: tuple[float, float]) -> float:
    """Return f_r averaged over both cones by chance, for one pair of directions."""
    rng = np.random.default_rng(5)
    moved = []
    for w, half_angle in zip((wi, wr), half_angles, strict=True):
        _, u, v = np.linalg.qr(np.stack([w, [0.3, 0.5, 0.8], [0.9, 0.1, 0.2]], axis=1))[0].T
        radius, turn = np.tan(half_angle) * np.sqrt(rng.random(DRAWN)), 2.0 * np.pi * rng.random(DRAWN)
        each = w + radius[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v)
        moved.append(each / np.linalg.norm(each, axis=1, keepdims=True))
    weights = (moved[0][:, 2] / wi[2]) * (moved[1][:, 2] / wr[2])
    return float(np.mean(weights * brdf(*moved)))


@pytest.mark.parametrize("alpha", [0.01, 0.02, 0.05])
@pytest.mark.parametrize("off_deg", [0.0, 1.5, 4.0])
def test_one_disk_stands_for_both_cones(alpha: float, off_deg: float) -> None:
    instrument = Instrument(source_solid_angle_sr=solid_angle(1.0), receiver_solid_angle_sr=solid_angle(2.0))

    def brdf(wi: Array, wr: Array) -> Array:
        return np.asarray(MODELS["ward"].vectors(wi, wr, **(WARD | {"alpha_x": alpha, "alpha_y": alpha})))

    wi = unit_vector(np.deg2rad([40.0]), np.zeros(1))
    wr = unit_vector(np.deg2rad([40.0 + off_deg]), np.full(1, np.pi))
    expected = drawn(brdf, wi[0], wr[0], (np.deg2rad(0.5), np.deg2rad(1.0)))
    assert InstrumentView(wi, wr, instrument).mean(brdf, alpha)[0] == pytest.approx(expected, rel=MEAN)


def test_a_mean_over_a_cone_is_that_of_a_function_of_the_second_degree() -> None:
    wr = unit_vector(np.array([0.2, 1.0]), np.array([0.4, 2.0]))
    assert np.max(np.arccos(np.clip(np.sum(cone(wr, 0.03, 3) * wr, axis=2), -1.0, 1.0))) < 0.03
    receiver = Instrument(receiver_solid_angle_sr=solid_angle(4.0))
    flat = averaged(lambda wi, _: np.ones((len(wi), 2)), receiver)(wr, wr)
    assert flat == pytest.approx(np.ones((2, 2)), rel=1e-3)  # the mean of the cosine over a small cone is its middle


def test_a_narrow_lobe_has_its_true_width_where_the_aperture_is_known() -> None:
    theta_i, phi_i, theta_r, phi_r = directions()
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    half = np.deg2rad(1.5)

    def brdf(light: Array, viewer: Array) -> Array:
        return np.asarray(MODELS["ward"].vectors(light, viewer, **WARD))

    values = np.array([drawn(brdf, *pair, (0.0, half)) for pair in zip(wi, wr, strict=True)])[:, np.newaxis]
    values *= 1.0 + NOISE * np.random.default_rng(3).standard_normal(values.shape)
    blind = Samples("narrow", theta_i, phi_i, theta_r, phi_r, ("grey",), None, values)
    told = replace(blind, instrument=Instrument(receiver_solid_angle_sr=solid_angle(3.0)))
    (with_it,), (without,) = (fits(one, ["ward"])[0].fits for one in (told, blind))
    true, biased = with_it.estimates[0], without.estimates[0]
    assert true.name == biased.name == "alpha_x"
    assert true.low < 0.03 < true.high
    assert biased.low > 0.0303
    assert with_it.rms_ln == pytest.approx(NOISE, rel=0.15)
    assert not any("widened" in sentence for sentence in with_it.remarks)
    assert any("has widened it" in sentence for sentence in without.remarks)


SMOOTH: dict[str, Any] = {"wavelength_nm": 600.0, "sigma_0_um": 0.06, "tau_um": 2.0, "n": 1.7, "k": 0.0, "a": 0.2}


def mirror_like(instrument: Instrument, source: float, receiver: float) -> Samples:
    """Return noisy samples of a surface with a coherent peak, as its own average over two cones has them."""
    theta_i, phi_i, theta_r, phi_r = directions()
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    cones = {"incident_solid_angle_sr": source, "received_solid_angle_sr": receiver}
    values = np.asarray(he_torrance_aperture_vectors(wi, wr, **cones, **SMOOTH))[:, np.newaxis]
    values *= 1.0 + NOISE * np.random.default_rng(4).standard_normal(values.shape)
    at = np.array([SMOOTH["wavelength_nm"]])
    return Samples("smooth", theta_i, phi_i, theta_r, phi_r, ("600nm",), at, values, instrument=instrument)


def test_a_specular_part_within_the_aperture_is_part_of_the_fit() -> None:
    cones = solid_angle(0.6), solid_angle(2.4)
    samples = mirror_like(Instrument(source_solid_angle_sr=cones[0], receiver_solid_angle_sr=cones[1]), *cones)
    document, fitted = fits(samples, ["he_torrance"], refractive_index="constant/1.7/0.0")
    (best,) = document.fits
    assert best.at_mirror == 0
    assert document.source_solid_angle_sr == cones[0]
    found = {one.name: (one.low, one.high) for one in best.estimates}
    for name in ("sigma_0_um", "tau_um", "a"):
        assert found[name][0] < SMOOTH[name] < found[name][1]
    assert best.rms_ln == pytest.approx(NOISE, rel=0.2)
    peak = fitted[0].view.from_mirror < 1e-6
    assert np.all(samples.values[peak] > 5.0 * fitted[0].f_r(samples.w_i[peak], samples.w_r[peak]))
    assert fitted[0].seen(fitted[0].view)[peak] == pytest.approx(samples.values[peak], rel=4.0 * NOISE)


def test_where_the_aperture_is_not_known_samples_at_the_mirror_direction_are_left_out() -> None:
    samples = mirror_like(Instrument(), solid_angle(0.6), solid_angle(2.4))
    document, fitted = fits(samples, ["he_torrance", "ward"], refractive_index="constant/1.7/0.0", profiles=False)
    left, other = (next(one for one in document.fits if one.model == name) for name in ("he_torrance", "ward"))
    near = fitted[document.fits.index(left)].view.from_mirror < np.deg2rad(3.0)
    assert 0 < left.at_mirror <= near.sum()
    assert f"{left.at_mirror} samples near the mirror direction are left out" in " ".join(left.remarks)
    assert other.at_mirror == 0
    assert left.rms_ln == pytest.approx(NOISE, rel=0.2)
    found = {one.name: one.value for one in left.estimates}
    assert found["a"] == pytest.approx(0.2, rel=0.05)


def test_the_specular_peak_is_that_of_two_cones() -> None:
    wi = np.repeat(unit_vector(np.array([0.5]), np.zeros(1)), 4, axis=0)
    wr = unit_vector(0.5 + np.deg2rad([0.0, 0.5, 0.9, 1.6]), np.full(4, np.pi))
    cones = solid_angle(1.0), solid_angle(2.0)
    view = InstrumentView(wi, wr, Instrument(source_solid_angle_sr=cones[0], receiver_solid_angle_sr=cones[1]))
    given = SMOOTH | {"a": 0.0, "sigma_0_um": 0.0}
    expected = he_torrance_aperture_vectors(
        wi, wr, incident_solid_angle_sr=cones[0], received_solid_angle_sr=cones[1], **given
    )
    specular = MODELS["he_torrance"].specular
    assert specular is not None
    rho = specular(view.theta_i, **{name: given[name] for name in MODELS["he_torrance"].specular_parameters})
    assert view.mirror * rho == pytest.approx(expected, rel=PEAK)
    alone = InstrumentView(wi, wr, Instrument(receiver_solid_angle_sr=cones[1]))
    assert alone.mirror == pytest.approx([1.0 / (cones[1] * w) for w in wr[:3, 2]] + [0.0])
