"""Measured data as a source: taken as they are, with what they say of symmetries, and made to keep a law."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.quadrature import reflected_share
from brdfdb.lobes import narrowest
from brdfdb.materials import presets
from brdfdb.materials.source import Evaluate
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.measurements.colours import spectra_of_colours
from brdfdb.measurements.measured_source import LIGHTS_DEG, MARGIN
from brdfdb.measurements.record import Noise
from brdfdb.models import MODELS
from brdfdb.parameters import Floats
from brdfdb.spectra import PICTURE_NM, linear_srgb
from tests.measurements.made_up import scans, scattered, source_of

WI, WR = unit_vector(0.9, 0.2)[np.newaxis], unit_vector(0.4, 2.0)[np.newaxis]


def test_function_is_taken_as_it_is_though_it_breaks_reciprocity_and_energy() -> None:
    source = source_of(lambda wi, _: 3.0 * wi[:, 2:])
    assert source.name == "made-up-1"
    assert not source.reciprocal
    assert source.brdf_at(None)(WI, WR) == pytest.approx(3.0 * WI[:, 2:])


def test_values_below_zero_become_zero_and_their_share_is_stated() -> None:
    source = source_of(lambda wi, _: wi[:, :1] * 0.0 + np.where(wi[:, 2:] > 0.6, 0.1, -0.1))
    assert 0.3 < source.measured.negative < 0.7
    assert source.brdf_at(None)(unit_vector(1.2, 0.0)[np.newaxis], WR) == 0.0


def test_value_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ParameterError, match="values that are not finite"):
        source_of(lambda wi, _: wi[:, 2:] * np.nan)


@pytest.mark.parametrize("channels", [("R", "G", "B"), ("X", "Y", "Z")])
def test_colours_come_back_from_the_spectrum(channels: tuple[str, ...]) -> None:
    given = np.array([0.3, 0.25, 0.2])
    source = source_of(lambda wi, _: np.broadcast_to(given, (len(wi), 3)), channels)
    spectrum = source.brdf_at(PICTURE_NM)(WI, WR)[0]
    rgb = np.asarray(linear_srgb(PICTURE_NM, spectrum))
    assert np.all(spectrum >= 0.0)
    if channels == ("R", "G", "B"):
        assert rgb == pytest.approx(given, abs=1e-6)
    else:  # of XYZ the luminance is Y
        assert rgb @ [0.2126, 0.7152, 0.0722] == pytest.approx(0.25, rel=0.01)


def test_spectra_of_colours_make_white() -> None:
    assert spectra_of_colours().sum(axis=0) == pytest.approx(1.0, abs=1e-6)
    assert spectra_of_colours().min() >= 0.0


def test_isotropic_data_that_turn_are_anisotropic() -> None:
    brushed = source_of(
        lambda wi, wr: 0.1 + 0.3 * ((wi + wr)[:, :1] / np.linalg.norm(wi + wr, axis=1, keepdims=True)) ** 2
    )
    assert brushed.anisotropic
    assert brushed.reciprocal


@pytest.mark.parametrize("alpha", [(0.03, 0.3), (0.03, 0.09), (0.005, 0.05)])
def test_narrow_lobe_that_turns_is_anisotropic(alpha: tuple[float, float]) -> None:
    assert source_of(_lobe(0.1, 0.5, *alpha)).anisotropic
    assert not source_of(_lobe(0.1, 0.5, alpha[0], alpha[0])).anisotropic


def test_narrow_lobe_that_leans_to_one_side_is_not_mirrored() -> None:
    def leaning(wi: Floats, wr: Floats) -> Floats:
        across = wi[:, :1] * wr[:, 1:2] - wi[:, 1:2] * wr[:, :1]
        return 0.3 + 10.0 * np.exp(-(((across - 0.03) / 0.02) ** 2)) * (np.sum(wi * wr * [-1, -1, 1], 1) > 0.9)[:, None]

    assert source_of(leaning).anisotropic


def test_narrow_lobe_that_is_not_reciprocal_is_seen_within_the_noise_of_the_rest() -> None:
    lobe = _lobe(0.0, 0.5, 0.005, 0.005)

    def one_sided(wi: Floats, wr: Floats) -> Floats:
        return 0.1 + lobe(wi, wr) * (1.0 + 0.5 * np.sign(wi[:, 2:] - wr[:, 2:]))

    assert not source_of(one_sided, noise=Noise(median=0.01, p95=0.02)).reciprocal


def _lobe(rho_d: float, rho_s: float, alpha_x: float, alpha_y: float) -> Evaluate:
    def f_r(wi: Floats, wr: Floats) -> Floats:
        values = MODELS["ward"].vectors(wi, wr, rho_d=rho_d, rho_s=rho_s, alpha_x=alpha_x, alpha_y=alpha_y)
        return np.asarray(values).reshape(len(wi), 1)

    return f_r


def test_mean_of_mirror_images_is_taken_and_its_asymmetry_stated() -> None:
    def skewed(wi: Floats, wr: Floats) -> Floats:
        return np.asarray(0.1 + 0.005 * (wi[:, :1] * wr[:, 1:2] - wi[:, 1:2] * wr[:, :1]))

    source = source_of(skewed)
    assert source.measured.mirror.asymmetry.median > 0.005
    assert not source.anisotropic
    assert source.brdf_at(None)(WI, WR) == pytest.approx(0.1)


def test_reciprocal_samples_are_seen_to_be_reciprocal_and_others_not() -> None:
    clay = presets()["clay-vase"].brdf_at(None)
    assert MeasuredSource.of_samples(scattered(clay, 600, 0.03)).reciprocal
    other = MeasuredSource.of_samples(scattered(lambda wi, wr: clay(wi, wr) * (0.3 + wi[:, 2:] ** 2), 600, 0.03))
    assert not other.reciprocal
    assert other.measured.reciprocity.asymmetry.p99 > 0.2


def test_record_of_samples_has_noise_instrument_and_incidences() -> None:
    source = MeasuredSource.of_samples(scans(presets()["clay-vase"].brdf_at(None), np.array([10.0, 30.0, 50.0]), 0.05))
    measured = source.measured
    assert (measured.by, measured.incidences, measured.holes) == ("a made-up goniophotometer", 3, 0)
    assert measured.noise.median == pytest.approx(0.05, rel=0.1)
    assert source.extrapolated(unit_vector(1.3, 0.0)[np.newaxis], WR)[0]


@pytest.mark.parametrize("of_light", [True, False])
def test_conserving_source_has_no_albedo_above_1(of_light: bool) -> None:
    bright = source_of(lambda wi, wr: 0.5 / (wi[:, 2:] + 0.3) if of_light else 0.5 / (wi[:, 2:] + wr[:, 2:]))
    made = bright.made("conserving")
    x, weight = np.polynomial.legendre.leggauss(200)
    cosine = 0.5 * (x + 1.0)
    viewers = np.concatenate([unit_vector(np.arccos(cosine), phi) for phi in (0.3, 1.3)])
    weights = np.tile(0.5 * np.pi * weight * cosine, 2)
    albedos = []
    for theta in (0.0, 0.5, 1.0, 1.5):
        light = np.broadcast_to(unit_vector(theta, 0.0), viewers.shape)
        before, after = (weights @ source.brdf_at(None)(light, viewers)[:, 0] for source in (bright, made))
        assert after <= 1.0
        if of_light:
            assert after == pytest.approx(min(before, 1.0 - MARGIN), rel=0.002)
        albedos.append(after)
    assert max(albedos) > 0.99  # no darker than the law asks for
    change = made.measured.changes[-1]
    assert change.law == "conserving"
    assert 0.0 < change.changed.p99 <= change.changed.max < 1.0


@pytest.mark.parametrize("alpha", [(0.03, 0.03), (0.05, 0.05), (0.03, 0.3)])
def test_conserving_source_has_no_albedo_above_1_though_its_lobe_is_narrow(alpha: tuple[float, float]) -> None:
    ward = {"rho_d": 0.1, "rho_s": 1.0, "alpha_x": alpha[0], "alpha_y": alpha[1]}
    lobe = _lobe(**ward)
    made = source_of(lambda wi, wr: 1.3 * lobe(wi, wr)).made("conserving").brdf_at(None)

    theta = radians(np.array([0.0, 1.2, 12.5, 28.0, 33.0, 38.0, 42.5, 61.0, 88.5]))[:, np.newaxis]
    phi = (0.0, 0.2, 1.3) if alpha[0] < alpha[1] else (0.0,)
    width = narrowest(MODELS["ward"].lobe(np.cos(theta)[..., np.newaxis], **ward))
    albedos, _ = reflected_share(made, theta, phi, width, tolerance=2e-4, most_panels=2000)
    assert np.max(albedos) <= 1.0
    assert np.percentile(albedos, 60) > 0.99  # no darker than the law asks for


def test_a_margin_of_low_lights_leaves_high_ones_as_they_are() -> None:
    white = source_of(lambda wi, _: np.full((len(wi), 1), 1.0 / np.pi)).made("reciprocal")
    made = white.made("conserving", np.where(LIGHTS_DEG > 80.0, 0.05, 0.0)).brdf_at(None)
    # a factor of light and one of viewer: low viewers get sin(10 degrees)^2 = 3 % of the light
    for theta_deg, factor in ((85.0, 0.95**2), (20.0, 1.0)):
        direction = unit_vector(radians(theta_deg), 0.0)[np.newaxis]
        assert made(direction, direction)[0, 0] * np.pi == pytest.approx(factor, rel=0.005)


def test_reciprocal_source_is_the_mean_of_both_ways() -> None:
    made = source_of(lambda wi, _: wi[:, 2:]).made("reciprocal")
    assert made.reciprocal
    assert made.brdf_at(None)(WI, WR) == pytest.approx(0.5 * (WI + WR)[:, 2:])
    assert made.measured.changes[0].changed.median > 0.1
    with pytest.raises(ParameterError, match="neither reciprocal nor conserving"):
        made.made("pretty")


@pytest.mark.parametrize(("lights_deg", "marked"), [((10.0, 40.0, 70.0), True), ((0.0, 45.0, 89.9), False)])
def test_file_is_extrapolated_beyond_the_nodes_that_it_lists(lights_deg: tuple[float, ...], marked: bool) -> None:
    theta_i, theta_r, turn = (
        radians(a.ravel())
        for a in np.meshgrid(np.array(lights_deg), np.array([0.0, 45.0, 89.9]), np.arange(0.0, 181.0, 10.0))
    )
    values = np.full((theta_i.size, 1), 0.2)
    nodes = Samples("nodes", theta_i, 0.0 * theta_i, theta_r, turn, ("grey",), None, values, None)
    source = source_of(lambda wi, _: np.full((len(wi), 1), 0.2), nodes=nodes)
    viewer = unit_vector(radians(np.full(3, 30.0)), radians(np.full(3, 100.0)))
    outside = source.extrapolated(unit_vector(radians(np.array([5.0, 40.0, 80.0])), np.zeros(3)), viewer)
    assert outside.tolist() == [False, False, marked]  # 5 degrees lie between lights of 10 degrees from either side
    assert (source.measured.extent is not None) == marked
    assert (source.measured.extrapolated is not None) == marked
