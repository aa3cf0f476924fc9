"""Measured Mueller matrices: polarisers, frames, physical realisability and convex sums, by closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import vectors_from_half_difference
from brdfdb.measurements.mueller import (
    HalfDifferenceAngles,
    PhysicalShare,
    block_of,
    coherency_eigenvalues,
    convex_weights,
    elements_of,
    frame_doubt,
    from_frame,
    half_difference_angles,
    of_polarisers,
    polarised_sentences,
    reflected_polarisation,
)
from brdfdb.measurements.samples import Samples

DEPOLARISER = np.diag([1.0, 0.0, 0.0, 0.0])
TRANSPOSING = np.diag([1.0, 1.0, 1.0, -1.0])  # meets the Stokes criterion, but has an eigenvalue of -1/2


def polariser(angle: float) -> np.ndarray:
    """An ideal polariser at an angle [rad] from s towards p (closed form of any textbook)."""
    c, s = np.cos(2.0 * angle), np.sin(2.0 * angle)
    return 0.5 * np.array([[1, c, s, 0], [c, c * c, c * s, 0], [s, c * s, s * s, 0], [0, 0, 0, 0]])


def ellipsometric(theta: float, n: complex) -> np.ndarray:
    """A mirror of index n - ik at theta [rad] as ellipsometers write it (Azzam and Bashara: psi, delta)."""
    cosine = np.cos(theta)
    within = np.sqrt(1.0 - (np.sin(theta) / n) ** 2 + 0j)
    r_p = (n * cosine - within) / (n * cosine + within)
    r_s = (cosine - n * within) / (cosine + n * within)
    psi, delta = np.arctan(abs(r_p / r_s)), np.angle(r_p / r_s)
    big_n, s, c = np.cos(2 * psi), np.sin(2 * psi) * np.sin(delta), np.sin(2 * psi) * np.cos(delta)
    return np.array([[1, -big_n, 0, 0], [-big_n, 1, 0, 0], [0, 0, c, s], [0, 0, -s, c]])


def by_amplitudes(theta: float, n: complex) -> np.ndarray:
    """The same mirror by fields E_s, E_p ~ exp(-i omega t), index n + ik: U + iV = 2 E_s conj(E_p), p = s x k."""
    cosine = np.cos(theta)
    within = np.sqrt(1.0 - (np.sin(theta) / n) ** 2 + 0j)
    jones = np.diag([(cosine - n * within) / (cosine + n * within), (n * cosine - within) / (n * cosine + within)])

    def stokes(e: np.ndarray) -> np.ndarray:
        cross = 2.0 * e[0] * np.conj(e[1])
        return np.array([abs(e[0]) ** 2 + abs(e[1]) ** 2, abs(e[0]) ** 2 - abs(e[1]) ** 2, cross.real, cross.imag])

    fields = (np.array([1, 0]), np.array([0, 1]), np.array([1, 1]), np.array([1, -1j]))
    lights = np.stack([stokes(e) for e in fields], axis=1)
    matrix = np.stack([stokes(jones @ e) for e in fields], axis=1) @ np.linalg.inv(lights)
    return matrix / matrix[0, 0]


def samples(mueller: np.ndarray, theta_deg: tuple[float, ...] = (30.0, 45.0, 60.0), **more: object) -> Samples:
    theta = np.radians(np.repeat(theta_deg, 3))
    viewer = theta + np.radians(np.tile([-4.0, 0.0, 4.0], len(theta_deg)))
    zero = np.zeros(theta.size)
    matrices = np.broadcast_to(mueller, (theta.size, 1, 4, 4))
    return Samples(
        "made", theta, zero, viewer, zero + np.pi, ("633nm",), np.array([633.0]), zero[:, None] + 0.1,
        mueller=matrices, **more,
    )  # fmt: skip


def test_light_between_polarisers_is_that_of_the_matrix() -> None:
    f_r, matrix = of_polarisers(*(np.array([value]) for value in (0.4, 0.1, 0.06, 0.24)))
    known = matrix[0, :2, :2]
    assert f_r == pytest.approx(0.4)  # mean over the light of the sums over the viewer: (0.5 + 0.3) / 2
    assert np.isnan(matrix[0]).sum() == 12
    for light, letter in ((1.0, 0), (-1.0, 1)):
        reflected = f_r[0] * known @ [1.0, light]
        assert 0.5 * (reflected[0] + reflected[1]) == pytest.approx([0.4, 0.06][letter])  # seen through s
        assert 0.5 * (reflected[0] - reflected[1]) == pytest.approx([0.1, 0.24][letter])  # seen through p


def test_a_lambertian_depolariser_shows_half_of_its_f_r_through_each_polariser() -> None:
    half = np.full(3, 0.5 * 0.8 / np.pi)
    f_r, matrix = of_polarisers(half, half, half, half)
    assert f_r == pytest.approx(np.full(3, 0.8 / np.pi))
    assert matrix[:, :2, :2] == pytest.approx(np.broadcast_to(DEPOLARISER[:2, :2], (3, 2, 2)), abs=1e-15)


@pytest.mark.parametrize("index", [(1.5, 0.0), (0.2, 3.4), (2.5, 3.0)])
@pytest.mark.parametrize("theta_deg", [10.0, 45.0, 70.0, 85.0])
def test_the_frame_p_is_that_of_ellipsometers(index: tuple[float, float], theta_deg: float) -> None:
    theta = np.radians(theta_deg)
    file = ellipsometric(theta, complex(index[0], -index[1]))
    assert from_frame(file, "p") == pytest.approx(by_amplitudes(theta, complex(*index)), abs=1e-12)


def test_a_rotated_polariser_keeps_its_axis_in_the_other_frame() -> None:
    angle = np.radians(25.0)  # from s towards p, which is 65 degrees from p towards s
    assert from_frame(polariser(np.pi / 2.0 - angle), "p") == pytest.approx(polariser(angle))
    assert from_frame(polariser(angle), "s") == pytest.approx(polariser(angle))
    assert coherency_eigenvalues(polariser(angle)[np.newaxis])[0] == pytest.approx([0, 0, 0, 1], abs=1e-15)
    with pytest.raises(ParameterError, match="mueller_frame: 'q' is not one of s, p"):
        from_frame(DEPOLARISER, "q")


def test_blocks_that_make_a_table_are_told_from_others() -> None:
    full = np.ones((5, 1, 4, 4))
    for rows, columns in ((2, 2), (3, 3), (3, 4), (4, 3), (4, 4)):
        matrix = full.copy()
        matrix[..., rows:, :] = matrix[..., :, columns:] = np.nan
        assert block_of(matrix) == (rows, columns)
        assert len(elements_of(rows, columns)) == rows * columns - 1
    matrix = np.full((5, 1, 4, 4), np.nan)
    matrix[..., 0, :2] = 1.0  # light of two polarisations, and no polariser before the detector
    with pytest.raises(ParameterError, match=r"columns ss, sp, ps and pp.*the file has m00, m01"):
        block_of(matrix)


def test_the_stokes_criterion_is_that_of_closed_forms() -> None:
    gain = np.diag([1.0, 1.3, 0.0, 0.0])
    mixed = DEPOLARISER.copy()
    mixed[1, 0] = mixed[0, 1] = 0.7  # Q of 1.4 from I of 1.7 at most
    found = reflected_polarisation(np.stack([DEPOLARISER, TRANSPOSING, gain, mixed]))
    assert found.degree == pytest.approx([0.0, 1.0, 1.3, 1.4], abs=1e-12)
    assert found.excess == pytest.approx([-1.0, 0.0, 0.3, 0.4], abs=1e-12)  # the last of Q = -1: I = 0.3, Q = 0.7


def test_known_blocks_are_judged_by_the_states_that_they_know() -> None:
    matrix = np.full((1, 4, 4), np.nan)
    matrix[0, :2, :2] = [[1.0, 0.5], [0.9, 0.5]]  # of Q = -1: I = 0.5, Q = 0.4; of Q = 1: 1.5, 1.4
    found = reflected_polarisation(matrix)
    assert found.excess == pytest.approx([-0.1])
    assert found.degree == pytest.approx([1.4 / 1.5])


def test_the_share_of_physical_matrices_is_counted_where_it_is_low() -> None:
    rng = np.random.default_rng(7)
    count = 3000
    angles = HalfDifferenceAngles(
        np.radians(rng.uniform(16.0, 29.0, count)),
        np.radians(rng.uniform(31.0, 49.0, count)),
        np.radians(rng.uniform(-44.0, 44.0, count)),
    )
    matrices = np.broadcast_to(DEPOLARISER, (count, 2, 4, 4)).copy()
    bad = rng.permutation(count)[:330]  # 330 of 6000: 5.5 %
    matrices[bad, 1] = TRANSPOSING
    angles.theta_d[bad] = np.radians(85.0)
    matrices[::100, 0] = np.nan  # 30 holes
    share = PhysicalShare(np.array([414.0, 950.0]))
    share.add(matrices, angles)
    assert share.count == 5970
    assert share.share == 5640 / 5970
    assert share.stokes_share == 1.0
    assert share.smallest == pytest.approx(-0.5)
    first, second = share.sentences()
    assert "Physical: 94.5 % of 5970 Mueller matrices (eigenvalues" in first
    assert "Stokes criterion, reflected light at most fully polarised: 100 %" in first
    # 330 matrices, of which no hole is one
    assert second == (
        "Of the unphysical matrices, 100 % are at theta_d 80 to 90 degrees and 950 nm, where 0 % are physical."
    )


def unphysical_at(bad: NDArray[np.bool_], angles: HalfDifferenceAngles) -> PhysicalShare:
    """Count matrices at six wavelengths, which are unphysical where `bad` (N, 6) is true."""
    share = PhysicalShare(np.linspace(450.0, 700.0, 6))
    share.add(np.where(bad[..., np.newaxis, np.newaxis], TRANSPOSING, DEPOLARISER), angles)
    return share


def test_the_cause_is_named_alone_and_each_of_two_causes_is() -> None:
    rng = np.random.default_rng(11)
    theta_h, theta_d = np.radians(rng.uniform(0.0, 90.0, (2, 20_000)))
    above = theta_h + theta_d < 0.5 * np.pi  # as at the horizon, so that theta_h is small where theta_d is large
    angles = HalfDifferenceAngles(theta_h[above], theta_d[above], rng.uniform(-np.pi, np.pi, above.sum()))
    chance = rng.random((above.sum(), 6))
    cause = (angles.theta_d < np.radians(30.0))[:, np.newaxis] & (chance < 0.2)
    (region,) = unphysical_at(cause, angles).regions()
    assert region.place == "theta_d 0 to 30 degrees"
    assert region.share == pytest.approx(0.8, abs=0.01)
    assert region.part == 1.0
    grazing = np.broadcast_to((angles.theta_d > np.radians(70.0))[:, np.newaxis], chance.shape)
    lamp = np.isin(np.arange(6), [1, 4]) & (chance < 0.3)
    places = {region.place for region in unphysical_at(grazing | lamp, angles).regions()}
    assert places == {"theta_d 70 to 90 degrees", "500, 650 nm"}
    assert unphysical_at(chance < 0.05, angles).regions() == []


def test_angles_are_those_that_directions_are_made_of() -> None:
    rng = np.random.default_rng(3)
    theta_h, theta_d, phi_d = rng.uniform(0.0, 1.4, 200), rng.uniform(0.01, 1.5, 200), rng.uniform(-3.1, 3.1, 200)
    light, viewer = vectors_from_half_difference(theta_h, rng.uniform(0.0, 6.2, 200), theta_d, phi_d)
    found = half_difference_angles(light, viewer)
    for angle, expected in zip(found, (theta_h, theta_d, phi_d), strict=True):
        assert angle == pytest.approx(expected, abs=1e-12)


def test_weights_are_convex_and_have_the_place_as_their_mean() -> None:
    rng = np.random.default_rng(5)
    points = rng.random((400, 3))
    wanted = 0.2 + 0.6 * rng.random((50, 3))
    number, weight = convex_weights(points, np.zeros(400, np.int64), wanted)
    assert weight.min() >= 0.0
    assert weight.sum(axis=1) == pytest.approx(np.ones(50))
    assert np.einsum("nk,nkd->nd", weight, points[number]) == pytest.approx(wanted, abs=1e-3)


def test_the_sign_of_m01_in_the_mirror_direction_betrays_the_frame() -> None:
    mirror = ellipsometric(np.radians(45.0), 1.5)
    (doubt,) = frame_doubt(samples(mirror))
    assert "m01 is -0." in doubt
    assert "--mueller-frame p" in doubt
    assert frame_doubt(samples(from_frame(mirror, "p"))) == ()
    assert frame_doubt(samples(DEPOLARISER)) == ()  # says nothing of s and p
    (back,) = frame_doubt(samples(mirror, record={"mueller_frame": "p"}))
    assert "--mueller-frame s" in back


def test_sentences_say_what_was_measured() -> None:
    text = " ".join(polarised_sentences(samples(DEPOLARISER)))
    assert "all sixteen elements" in text
    assert "Physical: 100 % of 9" in text
    two = np.full((4, 4), np.nan)
    two[:2, :2] = np.diag([1.0, 0.0])
    said = " ".join(polarised_sentences(samples(two)))
    assert "largest degree of polarisation of reflected light 0, allowed 1.004; eigenvalues need all sixteen" in said
    two[1] = np.nan
    two[0, :2] = 1.0
    assert "No polarised table" in " ".join(polarised_sentences(samples(two)))
    assert polarised_sentences(replace(samples(two), mueller=None)) == ()


def test_what_the_eigenvalues_allow_the_stokes_criterion_allows() -> None:
    rng = np.random.default_rng(17)
    pure = np.array([by_amplitudes(theta, 1.5 + 0j) for theta in np.linspace(0.2, 1.3, 2000)])
    noisy = pure + 0.001 * rng.normal(size=pure.shape)
    noisy[:, 0, 0] = 1.0
    smallest = coherency_eigenvalues(noisy)[:, 0]
    assert np.all(reflected_polarisation(noisy).excess <= np.maximum(-4.0 * smallest, 0.0) + 1e-12)
    share = PhysicalShare(None)
    share.add(noisy[:, np.newaxis], HalfDifferenceAngles(np.zeros(2000), np.zeros(2000), np.zeros(2000)))
    assert share.share == np.mean(smallest >= -0.001)
    assert share.stokes_share >= share.share
    assert "100 % at least -0.01" in share.sentences()[0]
