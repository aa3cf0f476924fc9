"""Slices of tables: orientation pinned by physical facts, axes in closed form, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.tables import slices
from tests.formats.test_exr import FLOAT32_RTOL, MIRROR, RETRO, Floats, lobe_position, lobe_towards, slice_of, table


def test_half_difference_axes_in_closed_form() -> None:
    angle_deg = np.arange(90) + 0.5
    theta_h, theta_d = np.deg2rad(angle_deg), np.deg2rad(angle_deg[::-1, np.newaxis])

    def cosine_of_light(theta_i: Floats, _phi_i: Floats, _theta_r: Floats, _phi_r: Floats) -> Floats:
        return np.cos(theta_i)

    def cosine_of_phase_angle(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        return np.asarray(2.0 + np.sum(unit_vector(theta_i, phi_i) * unit_vector(theta_r, phi_r), axis=-1))

    light = slices.half_difference_slice(table(cosine_of_light)).values
    np.testing.assert_allclose(light, np.cos(theta_h) * np.cos(theta_d), rtol=FLOAT32_RTOL)
    phase = slices.half_difference_slice(table(cosine_of_phase_angle)).values
    np.testing.assert_allclose(phase, np.tile(2.0 + np.cos(2.0 * theta_d), (1, 90)), rtol=FLOAT32_RTOL)


def test_half_difference_slice_of_a_half_vector_lobe_depends_on_x_only() -> None:
    def blinn(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        half = unit_vector(theta_i, phi_i) + unit_vector(theta_r, phi_r)
        return np.asarray(half[..., 2] / np.linalg.norm(half, axis=-1))

    values = slices.half_difference_slice(table(blinn)).values
    expected = np.cos(np.deg2rad(np.arange(90) + 0.5))
    # towards the top light and viewer oppose each other and their sum cancels: worst seen 8e-13 before rounding
    np.testing.assert_allclose(values, np.tile(expected, (90, 1)), rtol=FLOAT32_RTOL)
    assert np.all(np.argmax(values, axis=1) == 0)  # the lobe is on the left edge


def test_half_difference_slice_turns_with_phi_h() -> None:
    def along_x(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        half = unit_vector(theta_i, phi_i) + unit_vector(theta_r, phi_r)
        return np.asarray(np.exp(-((half[..., 0] / half[..., 2]) ** 2)))

    across = slices.half_difference_slice(table(along_x), phi_h_deg=90.0)
    assert across.fixed_deg == (("phi_h", 90.0), ("phi_d", 90.0))
    np.testing.assert_allclose(across.values, 1.0, rtol=FLOAT32_RTOL)
    assert slices.half_difference_slice(table(along_x)).values[45, 60] < 0.1


def test_below_the_horizon_is_zero() -> None:
    ones = table(lambda theta_i, _phi_i, _theta_r, _phi_r: np.ones_like(theta_i))
    angle_deg = np.arange(90) + 0.5
    assert np.all(slices.half_difference_slice(ones).values == 1.0)
    assert np.all(slices.in_plane_slice(ones).values == 1.0)
    # with phi_d = 0 the light leans theta_h + theta_d away from the normal; on the diagonal that is 90 degrees
    values = slices.half_difference_slice(ones, phi_d_deg=0.0).values
    lean_deg = angle_deg + angle_deg[::-1, np.newaxis]
    assert np.all(values[lean_deg > 90.0] == 0.0)
    assert np.all(values[lean_deg < 90.0] == 1.0)

    x_deg = (np.arange(256) + 0.5) * 180.0 / 256 - 90.0
    inside = np.hypot(x_deg, x_deg[:, np.newaxis]) < 90.0
    np.testing.assert_array_equal(slices.lobe_map(ones).values, inside.astype(np.float32))


def test_in_plane_lobes_are_on_their_diagonals() -> None:
    rows = np.arange(90)
    theta_i_deg = 89.5 - rows
    mirror = slices.in_plane_slice(table(MIRROR)).values
    np.testing.assert_array_equal(np.argmax(mirror, axis=1) - 89.5, theta_i_deg)
    retro = slices.in_plane_slice(table(RETRO)).values
    np.testing.assert_array_equal(np.argmax(retro, axis=1) - 89.5, -theta_i_deg)
    np.testing.assert_allclose(mirror[rows, 179 - rows], 1.0, rtol=FLOAT32_RTOL)


@pytest.mark.parametrize("phi_i_deg", [0.0, 30.0, -135.0])
@pytest.mark.parametrize(
    ("turned_deg", "right", "up"), [(180.0, 45.0, 0.0), (0.0, -45.0, 0.0), (90.0, 0.0, -45.0), (-90.0, 0.0, 45.0)]
)
def test_the_mirror_is_right_in_lobe_maps(turned_deg: float, right: float, up: float, phi_i_deg: float) -> None:
    lobe = table(lobe_towards(lambda theta_i: theta_i, turned_deg))
    position = lobe_position(slices.lobe_map(lobe, phi_i_deg=phi_i_deg))
    assert position == pytest.approx((right, up), abs=180.0 / 256)


def test_lobe_map_peaks_at_the_mirror_angle_of_its_light() -> None:
    image = slices.lobe_map(table(MIRROR), theta_i_deg=20.0)
    assert image.fixed_deg == (("theta_i", 20.0), ("phi_i", 0.0))
    assert lobe_position(image) == pytest.approx((20.0, 0.0), abs=180.0 / 256)


def test_phi_i_turns_the_surface_under_the_slices() -> None:
    def brushed(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        return np.asarray(2.0 + np.cos(2.0 * phi_i) * (np.sin(theta_i) * np.sin(theta_r) * np.cos(phi_r)) ** 2)

    along = slices.in_plane_slice(table(brushed)).values
    across = slices.in_plane_slice(table(brushed), phi_i_deg=90.0).values
    sine2 = np.sin(np.deg2rad(np.arange(180) - 89.5)) ** 2
    np.testing.assert_allclose(along, 2.0 + sine2[:89:-1, np.newaxis] * sine2, rtol=FLOAT32_RTOL)
    np.testing.assert_allclose(across, 2.0, rtol=FLOAT32_RTOL)
    # at phi_i = 90 degrees the x axis of the surface runs vertically through the lobe map
    lobe = slices.lobe_map(table(brushed), phi_i_deg=90.0).values
    np.testing.assert_allclose(lobe[128, 20:236], 2.0, rtol=1e-4)
    assert np.all(lobe[[20, 235], 128] < 1.6)


@pytest.mark.parametrize("theta_i_deg", [-1.0, 90.5, np.nan])
def test_a_light_below_the_horizon_is_refused(theta_i_deg: float) -> None:
    with pytest.raises(ValueError, match=r"theta_i_deg: \S+ is outside \[0, 90\] degrees"):
        slices.lobe_map(table(MIRROR), theta_i_deg=theta_i_deg)


@pytest.mark.parametrize(
    ("shape", "wavelength_nm"), [((2, 3, 4), None), ((2, 3), np.ones(1)), ((2, 3, 4), np.ones(3)), ((2,), None)]
)
def test_a_slice_of_the_wrong_shape_is_refused(shape: tuple[int, ...], wavelength_nm: Floats | None) -> None:
    with pytest.raises(ValueError, match=r"is not \(height, width"):
        slice_of(np.zeros(shape, dtype=np.float32), wavelength_nm)
