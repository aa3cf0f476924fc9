"""The conventions of directions: units, checks, frames, the fold of the azimuth, half and difference angles."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import DegreesWarning, ParameterError
from brdfdb.geometry import (
    HALF_PI,
    PHI_MAX,
    check_azimuth_deg,
    check_phi,
    check_theta,
    checked_angles,
    checked_vectors,
    degrees,
    directions_from_half_difference,
    finished,
    radians,
    spherical_angles,
    unit_vector,
    vectors_from_half_difference,
)

VECTOR = 1e-15  # components of unit vectors; worst measured: 7e-16


def drawn_directions(count: int = 500) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(1998)
    return np.arccos(rng.uniform(-1.0, 1.0, count)), rng.uniform(-np.pi, np.pi, count)


def test_90_degrees_is_the_horizon_to_the_last_bit() -> None:
    assert radians(90.0) == HALF_PI == np.pi / 2
    assert radians(180) == np.pi
    assert radians([0, 90]).dtype == np.float64


def test_degrees_and_radians_are_inverse() -> None:
    angles = np.linspace(-720.0, 720.0, 1441)
    np.testing.assert_allclose(degrees(radians(angles)), angles, rtol=3e-16)


def test_theta_keeps_float32_and_float64_and_widens_the_rest() -> None:
    for given_as, dtype in (
        (np.float32(0.5), np.float32),
        (np.float64(0.5), np.float64),
        (np.float16(0.5), np.float64),
        (np.longdouble(0.5), np.float64),
        (1, np.float64),
        ([0, 1], np.float64),
        (np.array([], dtype=np.int8), np.float64),
    ):
        assert check_theta("theta", given_as).dtype == dtype
        assert check_phi("phi", given_as).dtype == dtype


def test_theta_from_0_to_pi_is_allowed_and_the_float32_above_pi() -> None:
    for inside in (0.0, -0.0, 5e-324, HALF_PI, np.pi, np.float32(np.pi), np.nan, [0.0, np.nan]):
        np.testing.assert_array_equal(check_theta("theta", inside), inside)
    assert float(np.float32(np.pi)) > np.pi
    with pytest.raises(ValueError, match=r"^theta: "):
        check_theta("theta", np.nextafter(np.float32(np.pi), np.float32(4.0)))


@pytest.mark.parametrize("wide", [12.5664, -PHI_MAX, PHI_MAX, [1e6, np.nan]], ids=repr)
def test_phi_of_two_turns_is_usual_and_of_more_allowed_with_a_warning(wide: Any) -> None:
    for inside in (0.0, -4.0 * np.pi, 4.0 * np.pi, np.nan, [6.0, np.nan]):
        np.testing.assert_array_equal(check_phi("phi", inside), inside)
    with pytest.warns(DegreesWarning, match="^phi: .* rad is more than two turns; angles are radians") as caught:
        np.testing.assert_array_equal(check_phi("phi", wide), wide)
    assert caught[0].filename == __file__


@pytest.mark.parametrize("good", [0, -720, [720.0, 1.5]], ids=repr)
@pytest.mark.parametrize("bad", [720.5, -1e300, np.nan, [0.0, np.inf]], ids=repr)
def test_an_azimuth_in_degrees_has_two_turns_at_most(good: Any, bad: Any) -> None:
    check_azimuth_deg("phi_i", good)
    with pytest.raises(ParameterError, match=r"^phi_i: .* is outside \[-720, 720\] degrees$"):
        check_azimuth_deg("phi_i", bad)


@pytest.mark.parametrize(
    ("check", "wrong", "message"),
    [
        (check_theta, -0.1, "theta: -0.1 rad (-5.72958 degrees) is outside [0, pi] rad"),
        (check_theta, 90, "theta: 90 rad (5156.62 degrees) is outside [0, pi] rad"),
        (check_theta, [[0.1, 4.0], [-1.0, 0.0]], "theta: 4 rad (229.183 degrees) is outside [0, pi] rad"),
        (check_theta, np.inf, "theta: inf rad (inf degrees) is outside [0, pi] rad"),
        (check_theta, True, "theta: True is not a number of radians"),
        (check_theta, "0.1", "theta: '0.1' is not a number of radians"),
        (check_theta, 0.1j, "theta: 0.1j is not a number of radians"),
        (check_theta, None, "theta: None is not a number of radians"),
        (check_theta, [True], "theta: [True] is not a number of radians"),
        (check_theta, ["a"], "theta: ['a'] is not a number of radians"),
        (check_theta, b"1", "theta: b'1' is not a number of radians"),
        (check_theta, {}, "theta: {} is not a number of radians"),
        (check_theta, -1e-300, "theta: -1e-300 rad (-5.72958e-299 degrees) is outside [0, pi] rad"),
        (check_theta, np.nextafter(np.pi, 4.0), "theta: 3.14159265 rad (180 degrees) is outside [0, pi] rad"),
        (check_theta, [[np.nan], [-np.inf]], "theta: -inf rad (-inf degrees) is outside [0, pi] rad"),
        (check_phi, np.inf, "phi: inf rad is outside [-1e+15, 1e+15] rad"),
        (check_phi, [0.0, -np.inf], "phi: -inf rad is outside [-1e+15, 1e+15] rad"),
        (check_phi, 2e15, "phi: 2e+15 rad is outside [-1e+15, 1e+15] rad"),
        (check_phi, False, "phi: False is not a number of radians"),
    ],
)
def test_an_angle_is_refused_with_its_name_value_and_range(check: Callable[..., Any], wrong: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # the whole message is compared
        check(message.split(":")[0], wrong)
    assert str(caught.value) == message


def test_shapes_that_do_not_broadcast_are_named() -> None:
    with pytest.raises(
        ParameterError, match=r"^theta_i, phi_i, theta_r, phi_r: the shapes \(2,\), \(\), \(3,\), \(\) do not"
    ):
        checked_angles([0.1, 0.2], 0.0, [0.1, 0.2, 0.3], 1.0)
    up = np.array([0.0, 0.0, 1.0])
    with pytest.raises(ParameterError, match=r"^wi, wr: the shapes \(2, 3\), \(4, 3\) do not broadcast$"):
        checked_vectors(np.tile(up, (2, 1)), np.tile(up, (4, 1)))


def test_checked_angles_holds_thetas_at_the_horizon_and_notes_what_lies_below() -> None:
    angles = checked_angles([0.1, HALF_PI, np.nextafter(HALF_PI, 2.0), np.pi, np.nan], 0.0, 0.2, 0.0)
    np.testing.assert_array_equal(angles.theta_i, [0.1, HALF_PI, HALF_PI, HALF_PI, np.nan])
    np.testing.assert_array_equal(angles.below, [False, False, True, True, False])
    single = checked_angles(np.float32([0.1, HALF_PI, 1.5707965]), 0.0, np.float32(HALF_PI), 0.0)
    np.testing.assert_array_equal(single.below, [False, False, True])
    np.testing.assert_array_equal(single.theta_i, [np.float32(0.1), HALF_PI, HALF_PI])
    assert single.theta_r == HALF_PI
    assert all(angle.dtype == np.float64 for angle in single.given)


def test_float32_in_is_float32_out_unless_an_array_says_float64() -> None:
    one, two = np.float32(0.1), np.float64(0.1)
    assert checked_angles(one, one, one, one).dtype == np.float32
    assert checked_angles(one, 0.1, [0.1], 1).dtype == np.float32
    assert checked_angles(one, one, two, one).dtype == np.float64
    assert checked_angles(one, one, one, np.array(1)).dtype == np.float64
    assert checked_angles(0.1, 0.1, [0.1], 1).dtype == np.float64


def test_finished_writes_zero_below_the_horizon_and_nan_where_an_angle_is_nan_into_another_array() -> None:
    angles = checked_angles(np.array([0.1, 2.0, np.nan, 2.0]), np.array([0.0, 0.0, 0.0, np.nan]), 0.3, 0.0)
    values = np.array([5.0, 6.0, 7.0, 8.0])
    np.testing.assert_array_equal(finished(values, angles), [5.0, 0.0, np.nan, np.nan])
    np.testing.assert_array_equal(values, [5.0, 6.0, 7.0, 8.0])
    rows = finished(values[:1], checked_angles(np.zeros((3, 1)), 0.0, np.zeros(2), 0.0))
    rows[0, 0] = 9.0
    np.testing.assert_array_equal(rows, [[9.0, 5.0], [5.0, 5.0], [5.0, 5.0]])
    assert values[0] == 5.0
    assert isinstance(finished(np.float64(1.0), checked_angles(0.0, 0.0, 0.0, 0.0)), np.float64)


def test_unit_vectors_of_the_axes() -> None:
    for theta, phi, axis in ((0.0, 0.0, [0, 0, 1]), (HALF_PI, 0.0, [1, 0, 0]), (HALF_PI, HALF_PI, [0, 1, 0])):
        np.testing.assert_allclose(unit_vector(theta, phi), axis, atol=VECTOR)
    np.testing.assert_allclose(unit_vector(np.pi, 0.3), [0, 0, -1], atol=VECTOR)


def test_unit_vectors_have_length_one_and_give_their_angles_back() -> None:
    theta, phi = drawn_directions()
    assert unit_vector(0.0, 0.0).shape == (3,)
    assert unit_vector(theta[:, np.newaxis], np.zeros(5)).shape == (500, 5, 3)
    w = unit_vector(theta, phi)
    np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1.0, atol=VECTOR)
    theta_back, phi_back = spherical_angles(w)
    np.testing.assert_allclose(theta_back, theta, atol=1e-15)
    np.testing.assert_allclose(phi_back, phi, atol=1e-14)
    np.testing.assert_allclose(spherical_angles(7.0 * w)[0], theta, atol=1e-15)  # of any length


def test_angles_at_the_pole_and_in_every_quadrant() -> None:
    assert spherical_angles([0.0, 0.0, 2.0]) == (0.0, 0.0)
    for x, y, phi in ((1, 1, 0.25), (-1, 1, 0.75), (-1, -1, -0.75), (1, -1, -0.25), (-1, 0, 1.0)):
        assert spherical_angles([x, y, 0.0])[1] == phi * np.pi


def test_half_vector_is_the_bisector_and_theta_d_half_the_angle_between() -> None:
    rng = np.random.default_rng(3)
    theta_h, theta_d = rng.uniform(0.0, HALF_PI, (2, 500))
    phi_h, phi_d = rng.uniform(-np.pi, np.pi, (2, 500))
    theta_i, phi_i, theta_r, phi_r = directions_from_half_difference(theta_h, phi_h, theta_d, phi_d)
    light, viewer = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    half = unit_vector(theta_h, phi_h)
    np.testing.assert_allclose(light + viewer, 2.0 * np.cos(theta_d)[:, None] * half, atol=2e-15)
    np.testing.assert_allclose(np.sum(light * half, axis=-1), np.cos(theta_d), atol=2e-15)


def test_half_difference_frame_is_that_of_rusinkiewicz() -> None:
    # the light in the frame turned back by -phi_h about z, then by -theta_h about y, is at (theta_d, phi_d)
    rng = np.random.default_rng(4)
    for theta_h, phi_h, theta_d, phi_d in rng.uniform(0.0, HALF_PI, (50, 4)):
        theta_i, phi_i, _, _ = directions_from_half_difference(theta_h, phi_h, theta_d, phi_d)
        x, y, z = unit_vector(theta_i, phi_i - phi_h)
        turned = [x * np.cos(theta_h) - z * np.sin(theta_h), y, x * np.sin(theta_h) + z * np.cos(theta_h)]
        np.testing.assert_allclose(turned, unit_vector(theta_d, phi_d), atol=2e-15)


def test_vectors_from_half_difference_are_the_unit_vectors_of_its_angles() -> None:
    rng = np.random.default_rng(5)
    theta_h, theta_d = rng.uniform(0.0, HALF_PI, (2, 500))
    phi_h, phi_d = rng.uniform(-np.pi, np.pi, (2, 500))
    for turned in (phi_h, 0.0):
        theta_i, phi_i, theta_r, phi_r = directions_from_half_difference(theta_h, turned, theta_d, phi_d)
        light, viewer = vectors_from_half_difference(theta_h, turned, theta_d, phi_d)
        np.testing.assert_allclose(light, unit_vector(theta_i, phi_i), atol=1e-15)
        np.testing.assert_allclose(viewer, unit_vector(theta_r, phi_r), atol=1e-15)
    given = (np.zeros((4, 1)), 0.0, np.zeros(5), np.zeros((3, 1, 1)))
    assert vectors_from_half_difference(*given)[1].shape == (3, 4, 5, 3)
    assert {np.shape(angle) for angle in directions_from_half_difference(*given)} <= {(3, 4, 5)}
