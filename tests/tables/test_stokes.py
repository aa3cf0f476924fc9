"""Stokes bases: the plane of light and viewer with the matrix of a facet makes the Mueller matrices of the model."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb import models
from brdfdb.geometry import unit_vector
from brdfdb.tables import stokes

SURFACE = {"wavelength_nm": 500.0, "sigma_0_um": 0.18, "tau_um": 3.0, "n": 1.5, "k": 0.3, "a": 0.1}
TOLERANCE = 1e-14  # of m_ij / m_00; measured 1.4e-15, at backscatter, poles and the mirror direction, too


def directions(count: int = 4000) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(41)
    theta, phi = np.arccos(rng.random((2, count))), rng.uniform(0.0, 2.0 * np.pi, (2, count))
    theta[1, :200], phi[1, :100] = theta[0, :200], phi[0, :100]  # backscatter in the first hundred
    theta[0, 200:300], theta[1, 300:400] = 0.0, 0.0
    theta[1, 400:600], phi[1, 400:700] = theta[0, 400:600], phi[0, 400:700] + np.pi  # mirror directions, and near them
    theta[0, 700:750] = 1e-9
    theta[:, 750:800], phi[1, 750:800] = np.pi / 2.0, phi[0, 750:800] + np.pi
    return theta[0], phi[0], theta[1], phi[1]


def test_plane_and_facet_make_the_mueller_matrices_of_the_model() -> None:
    angles = directions()
    whole = models.he_torrance_mueller(*angles, **SURFACE)
    f_r = whole[:, 0, 0]
    plane = stokes.plane(*angles)
    facet = models.he_torrance_facet_mueller(plane.theta_d, n=SURFACE["n"], k=SURFACE["k"])
    made = (f_r - SURFACE["a"] / np.pi)[:, None, None] * (plane.viewer @ facet @ plane.light)
    made[:, 0, 0] = f_r
    np.testing.assert_allclose(made / f_r[:, None, None], whole / f_r[:, None, None], rtol=0.0, atol=TOLERANCE)


def test_rotations_keep_intensity_and_circular_light_and_turn_linear_light_twice() -> None:
    assert stokes.rotation(0.0) == pytest.approx(np.eye(4))
    turned = stokes.rotation(np.deg2rad(30.0)) @ [1.0, np.cos(np.deg2rad(60.0)), np.sin(np.deg2rad(60.0)), 0.5]
    assert turned == pytest.approx([1.0, 1.0, 0.0, 0.5])  # linear at 30 degrees from s to p


def test_horizontal_is_normal_to_the_direction_and_to_the_normal() -> None:
    phi = np.linspace(0.0, 6.0, 7)
    s, w = stokes.horizontal(phi), unit_vector(np.full(7, 0.7), phi)
    assert np.sum(s * w, axis=-1) == pytest.approx(np.zeros(7), abs=1e-15)
    assert s == pytest.approx(np.cross([0.0, 0.0, 1.0], w) / np.sin(0.7))
