"""Glints: their values, power and sampler against integrals by hand, and the rule between lights."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from brdfdb.geometry import unit_vector
from brdfdb.measurements.glints import Glint, Glints, offsets_deg
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import glints_of
from tests.measurements.made_up import source_of


def _vector(theta_deg: float, phi_deg: float) -> np.ndarray:
    return unit_vector(np.deg2rad(theta_deg), np.deg2rad(phi_deg)).reshape(1, 3)


def _integral(glints: Glints, wi: np.ndarray, step_deg: float = 0.02, reach_deg: float = 6.0) -> np.ndarray:
    """Sum f_r cos theta_r around the mirror direction, by midpoints of theta and phi."""
    theta_m = np.rad2deg(np.arccos(wi[0, 2]))
    low, high = max(theta_m - reach_deg, 0.0), min(theta_m + reach_deg, 90.0)
    theta = np.deg2rad(np.arange(low + step_deg / 2, high, step_deg))
    half = np.pi if low == 0.0 else np.deg2rad(min(reach_deg / np.sin(np.deg2rad(low)), 180.0))
    turn = np.arctan2(wi[0, 1], wi[0, 0]) + np.pi
    phi, width = np.linspace(turn - half, turn + half, 1201, retstep=True)
    phi = phi[:-1] + width / 2
    total = np.zeros(glints.channels)
    for ring in theta:
        wr = unit_vector(np.full(phi.size, ring), phi)
        f_r = glints.f_r(np.broadcast_to(wi, wr.shape), wr)
        total += f_r.sum(axis=0) * np.cos(ring) * np.sin(ring) * np.deg2rad(step_deg) * width
    return total


@pytest.mark.parametrize(
    ("theta", "in_plane", "across", "width"), [(0, 0, 0, 0.4), (30, 0.7, -1.5, 0.3), (75, -1, 0.4, 0.8)]
)
def test_the_integral_of_f_r_cos_is_the_power(theta: float, in_plane: float, across: float, width: float) -> None:
    glint = Glint(
        theta_i_deg=theta, in_plane_deg=in_plane, across_deg=across, width_deg=width, resolved=True, power=(0.21, 0.03)
    )
    glints = Glints(glints=(glint,))
    np.testing.assert_allclose(_integral(glints, _vector(theta, 0.0)), [0.21, 0.03], rtol=2e-3)
    np.testing.assert_allclose(glints.power(_vector(theta, 0.0)), [[0.21, 0.03]], rtol=1e-12)


def test_a_glint_through_a_sample_has_its_value_and_its_gaussian_around() -> None:
    wi, wr = _vector(75.0, 20.0), _vector(74.5, 199.0)
    glint = Glint.through(wi[0], wr[0], np.array([5334.1]), 0.5, resolved=False, error=0.01)
    assert glint.theta_i_deg == pytest.approx(75.0)
    assert glint.phi_i_deg == pytest.approx(20.0)
    glints = Glints(glints=(glint,))
    assert glints.f_r(wi, wr)[0, 0] == pytest.approx(5334.1, rel=1e-6)
    smooth = np.array([0.1])
    assert glints.error(wi, wr, smooth, 0.0)[0, 0] == pytest.approx(53.341, rel=1e-6)
    assert glints.error(wi, wr, smooth, 0.05)[0, 0] == pytest.approx(0.05 * 5334.1, rel=1e-6)  # noise of the sample
    # Width and shape are not known: off the sample f_r is anything from 0 to that of the sample
    for off_deg in (0.05, 0.5, 1.5):
        off = _vector(74.5 + off_deg, 199.0)
        f_r, error = glints.f_r(wi, off)[0, 0], glints.error(wi, off, smooth, 0.0)[0, 0]
        assert f_r - error <= 1e-6 * f_r
        assert f_r + error >= 5334.1 * (1.0 - 1e-3)
    far = _vector(74.5 + 2.4, 199.0)  # 4.8 widths away, where samples around it show that it is faint
    assert glints.error(wi, far, np.array([10.0]), 0.0) == pytest.approx(glints.f_r(wi, far))
    # One width away a Gaussian has exp(-1/2) of its height
    beside = _vector(75.0, 199.0)
    assert glints.f_r(wi, beside)[0, 0] == pytest.approx(5334.1 * np.exp(-0.5), rel=1e-3)
    assert glints.near(wi, _vector(72.1, 199.0))[0]
    assert not glints.near(wi, _vector(71.9, 199.0))[0]
    assert glints.f_r(wi, _vector(71.9, 199.0))[0, 0] == 0.0


def test_a_glint_follows_the_mirror_direction_between_its_lights_and_is_marked() -> None:
    lights = tuple(
        Glint(theta_i_deg=theta, in_plane_deg=offset, width_deg=width, resolved=True, power=(power,), error=0.1)
        for theta, offset, width, power in ((30.0, 0.0, 0.5, 0.1), (60.0, 1.0, 1.0, 0.4))
    )
    glints = Glints(glints=lights)
    wi, wr = _vector(40.0, 70.0), _vector(40.0 + 1.0 / 3.0, 250.0)
    assert glints.power(wi)[0, 0] == pytest.approx(0.2)
    s = np.deg2rad(2.0 / 3.0)
    assert glints.f_r(wi, wr)[0, 0] == pytest.approx(
        0.2 / (2 * np.pi * s**2 * np.cos(np.deg2rad(40 + 1 / 3))), rel=1e-3
    )
    assert glints.near(wi, wr, extrapolated=True)[0]
    assert np.isnan(glints.error(wi, wr, np.ones(1), 0.1)[0, 0])
    assert not glints.near(_vector(30.0, 70.0), _vector(30.0, 250.0), extrapolated=True)[0]
    assert not glints.near(wi, _vector(20.0, 0.0), extrapolated=True)[0]  # no glint there
    assert glints.power(_vector(10.0, 0.0))[0, 0] == pytest.approx(0.1)  # those of the first light
    assert glints.power(_vector(80.0, 0.0))[0, 0] == pytest.approx(0.4)
    dark = glints.with_dark_lights(np.array([30.0, 45.0, 45.0, 60.0]), np.array([0.0, 0.0, 90.0, 0.0]))
    assert dark.power(_vector(45.0, 0.0))[0, 0] == 0.0
    assert dark.power(_vector(40.0, 0.0))[0, 0] == pytest.approx(0.1 / 3.0)


def test_glints_of_a_turned_surface_depend_on_the_azimuth_of_the_light() -> None:
    lights = tuple(
        Glint(theta_i_deg=45.0, phi_i_deg=phi, width_deg=1.0, resolved=True, power=(power,))
        for phi, power in ((10.0, 0.1), (100.0, 0.4), (280.0, 0.2))
    )
    turned = Glints(glints=lights, turned=True)
    for phi, power in ((10.0, 0.1), (55.0, 0.25), (190.0, 0.3), (325.0, 0.15), (355.0, 0.1 + 0.1 / 6)):
        assert turned.power(_vector(45.0, phi))[0, 0] == pytest.approx(power), phi
    assert turned.near(_vector(45.0, 55.0), _vector(45.0, 235.0), extrapolated=True)[0]
    assert not turned.near(_vector(45.0, 280.0), _vector(45.0, 100.0), extrapolated=True)[0]
    with pytest.raises(ValidationError, match="two glints of track 0 have one light"):
        Glints(glints=lights)


def test_drawn_viewers_have_the_density_and_their_weights_the_power() -> None:
    """The mean of f_r cos / density is the power, and counts are those of a round Gaussian, by standard errors."""
    first = Glint(theta_i_deg=50.0, in_plane_deg=1.0, width_deg=0.5, resolved=True, power=(0.3,))
    second = Glint(theta_i_deg=50.0, across_deg=-4.0, width_deg=1.0, resolved=True, power=(0.1,), track=1)
    glints = Glints(glints=(first, second))
    u = np.random.default_rng(20261129).random((2, 20000))
    wi = np.broadcast_to(_vector(50.0, 15.0), (20000, 3))
    wr = glints.draw(*u, wi)
    np.testing.assert_allclose(np.linalg.norm(wr, axis=1), 1.0, atol=1e-12)
    weight = glints.f_r(wi, wr)[:, 0] * wr[:, 2] / glints.density(wi, wr)
    error = weight.std() / np.sqrt(weight.size)
    assert abs(weight.mean() - 0.4) < 4 * error
    across = offsets_deg(wi, wr)[1]
    assert abs(np.mean(across < -2.0) - 0.25) < 4 * np.sqrt(0.25 * 0.75 / 20000)
    chosen = across > -2.0
    inside = np.hypot(offsets_deg(wi, wr)[0] - 1.0, across)[chosen] < 0.5  # 1 - exp(-1/2) of a round Gaussian
    assert abs(inside.mean() - (1 - np.exp(-0.5))) < 4 * np.sqrt(0.24 / chosen.sum()) + 1e-3
    assert np.all(glints.density(wi[:3], _vector(50.0, 15.0)) == 0.0)


def test_below_the_horizon_there_is_no_glint() -> None:
    glints = Glints(glints=(Glint(theta_i_deg=89.0, width_deg=1.0, resolved=True, power=(0.5,)),))
    assert glints.f_r(_vector(89.0, 0.0), _vector(90.5, 180.0))[0, 0] == 0.0
    assert glints.power(_vector(91.0, 0.0))[0, 0] == 0.0
    assert glints.f_r(_vector(91.0, 0.0), _vector(89.0, 180.0))[0, 0] == 0.0


def test_glints_are_a_record_and_refuse_what_none_is() -> None:
    glint = Glint(theta_i_deg=10.0, width_deg=1.0, resolved=False, power=(0.1, 0.2))
    glints = Glints(glints=(glint,))
    assert Glints.model_validate_json(glints.model_dump_json()) == glints
    np.testing.assert_allclose(glints.mixed(np.array([[1.0], [0.5]])).power(_vector(10.0, 0.0)), [[0.2]])
    for wrong in ({"width_deg": 0.0}, {"theta_i_deg": 90.0}, {"power": ()}, {"power": (-0.1,)}):
        with pytest.raises(ValidationError):
            Glint(**(glint.model_dump() | wrong))
    with pytest.raises(ValidationError, match="different numbers of wavelengths"):
        Glints(glints=(glint, glint.model_copy(update={"power": (0.1,)})))


def test_a_sentence_names_the_strongest_glints() -> None:
    own = Glint(theta_i_deg=75.0, in_plane_deg=0.3, across_deg=0.4, width_deg=0.5, resolved=False, power=(0.1, 0.3))
    wide = Glint(theta_i_deg=30.0, width_deg=2.0, resolved=True, power=(0.01, 0.01))
    dark = Glint(theta_i_deg=10.0, width_deg=2.0, resolved=True, power=(0.0, 0.0))
    assert Glints(glints=(own, wide, dark)).sentence == (
        "2 glints kept beside the grid, which cannot hold such peaks: of light at 30 degrees, in the mirror direction, "
        "4.7 degrees wide at half its height, reflects 1 %; of light at 75 degrees, 0.5 degrees from the mirror "
        "direction, at most 1.2 degrees wide at half its height, reflects at most 20 %"
    )


def test_no_sentence_names_glints_without_power() -> None:
    dark = Glints(glints=(Glint(theta_i_deg=10.0, width_deg=2.0, resolved=True, power=(0.0,)),))
    made = source_of(lambda wi, wr: np.full((len(wi), 1), 0.6 / np.pi) + 0.0 * wr[:, :1]).recorded(glints=dark)
    assert dark.lit == ()
    assert "glint" not in " ".join(made.measured.in_words())
    assert glints_of(Layout(made, Grid({"theta_i": [0, 80], "theta_r": [0, 80], "delta_phi": [0, 90, 180]}))) is None


def test_a_glint_of_one_sample_reflects_no_more_than_all_light() -> None:
    """A sample of 5590 /sr at 75 degrees may be a Gaussian of 1 degree by its neighbours: 2 pi s^2 f cos is 2.77."""
    wi, wr = _vector(75.0, 0.0), _vector(75.0, 180.0)
    made = Glint.through(wi[0], wr[0], np.array([5590.0, 2795.0]), 1.0, resolved=False)
    assert made.power == pytest.approx((1.0, 0.5), rel=1e-3)
    assert made.width_deg == pytest.approx(1.0 / np.sqrt(2.77), rel=1e-2)
    np.testing.assert_allclose(Glints(glints=(made,)).f_r(wi, wr), [[5590.0, 2795.0]], rtol=1e-3)
    assert "reflects at most 75 %" in made.phrase
    assert max(Glint.through(wi[0], wr[0], np.array([5590.0]), 1.0, resolved=True).power) > 2.5  # which is measured


def test_glints_of_data_that_are_made_to_conserve_energy_take_what_is_left() -> None:
    """A matt surface of albedo 0.6 leaves 0.4, less a margin: half of the power of a glint of 0.8."""
    matt = source_of(lambda wi, wr: np.full((len(wi), 1), 0.6 / np.pi) + 0.0 * wr[:, :1])
    for resolved in (True, False):
        glint = Glint(theta_i_deg=50.0, width_deg=0.5, resolved=resolved, power=(0.8,))
        made = matt.recorded(glints=Glints(glints=(glint,))).made("conserving", 0.004).glints
        assert made is not None
        assert made.glints[0].power[0] == pytest.approx(0.396, abs=1e-3)
        wi, wr = _vector(50.0, 0.0), _vector(50.0, 180.0)
        before = Glints(glints=(glint,)).f_r(wi, wr)[0, 0]
        assert made.f_r(wi, wr)[0, 0] == pytest.approx(before * (0.396 / 0.8 if resolved else 1.0), rel=3e-3)
        assert made.glints[0].width_deg == pytest.approx(0.5 if resolved else 0.5 * np.sqrt(0.396 / 0.8), rel=3e-3)
    weak = Glint(theta_i_deg=50.0, width_deg=0.5, resolved=False, power=(0.1,))
    assert matt.recorded(glints=Glints(glints=(weak,))).made("conserving").glints == Glints(glints=(weak,))
