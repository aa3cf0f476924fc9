"""Nodes over pairs of directions, against closed forms and the adaptive quadrature of albedos."""

import numpy as np
import pytest

from brdfdb.integrals.pairs import Counts, Symmetry, view_of, views
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import MODELS

COUNTS = Counts(16, 6, 20, 8)
SYMMETRIES = (Symmetry(False, False), Symmetry(True, True), Symmetry(True, False))
PLAIN = 1e-3  # relative; worst measured of the solid angle, for a lobe of 0.05 by 0.16: 4e-4
NARROW = 2e-4  # of the albedo of a view; worst measured: 9e-5
BRASS = {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.05, "alpha_y": 0.16}


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_weights_sum_to_pi_squared(symmetry: Symmetry) -> None:
    # the integral of the cosine over a hemisphere is pi
    every = list(views(lambda _: None, COUNTS, symmetry))
    assert sum(view.weight for view in every) == pytest.approx(np.pi, rel=1e-12)
    total = sum(view.weight * view.weights.sum() for view in every)
    assert total == pytest.approx(np.pi**2, rel=PLAIN)


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.5])
def test_a_view_has_the_albedo_of_its_lobe(alpha: float) -> None:
    surface = {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": alpha, "alpha_y": alpha}
    ward = MODELS["ward"]
    for theta in (0.0, 0.7, 1.3):
        view = view_of(lambda cosine: ward.lobe(cosine, **surface), theta, 0.0, COUNTS, SYMMETRIES[0])
        albedo = view.weights @ ward.vectors(view.wi, view.wr, **surface)
        assert albedo == pytest.approx(float(directional_albedo("ward", theta, **surface).albedo), rel=NARROW)


def test_an_anisotropic_lobe_has_its_mean_albedo() -> None:
    ward = MODELS["ward"]
    every = views(lambda cosine: ward.lobe(cosine, **BRASS), COUNTS, SYMMETRIES[1])
    mean = sum(view.weight * (view.weights @ ward.vectors(view.wi, view.wr, **BRASS)) for view in every) / np.pi
    x, weight = np.polynomial.legendre.leggauss(10)
    theta, phi = (x + 1.0) * np.pi / 4.0, (np.arange(6) + 0.5) * np.pi / 12.0
    albedo = directional_albedo("ward", theta[:, np.newaxis], phi, tolerance=1e-4, **BRASS).albedo.mean(axis=1)
    expected = np.sum(weight * np.pi / 4.0 * 2.0 * np.cos(theta) * np.sin(theta) * albedo)
    assert mean == pytest.approx(float(expected), rel=PLAIN)


def test_counts_grow_along_each_axis() -> None:
    assert Counts(8, 3, 12, 4).finer(1.5) == Counts(12, 5, 18, 6)
