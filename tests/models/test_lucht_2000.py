"""Ross-Li: the integrals that the MODIS product publishes, the kernels where they are simple, and values held at 0."""

import numpy as np
import pytest

from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import MODELS, ross_li
from brdfdb.reference import lucht_2000

ISO, SMALL = 0.5, 1e-3  # such a small weight of a kernel is held at 0 within 0.1 degrees of the horizon only
# Integrals over uniform light, and coefficients of 1, theta^2 and theta^3 [rad] of those over viewers: the MODIS
# BRDF/albedo product's user guide, from Lucht et al. 2000
WHITE_SKY = {"f_vol": 0.189184, "f_geo": -1.377622}
BLACK_SKY = {"f_vol": (-0.007574, -0.070987, 0.307588), "f_geo": (-1.284909, -0.166314, 0.041840)}
# The polynomials are fits: worst measured up to 75 degrees 0.0249, and 0.0062
FIT = {"f_vol": 0.025, "f_geo": 0.0065}
PUBLISHED = 3e-5  # of the white-sky integrals, worst measured: 2.3e-5


def integral(kernel: str, theta_i: np.ndarray) -> np.ndarray:
    """The albedo of a kernel alone, from the difference that a small weight makes."""
    weights = {"f_iso": ISO, "f_vol": 0.0, "f_geo": 0.0} | {kernel: SMALL}
    return (directional_albedo("ross_li", theta_i, tolerance=1e-9, **weights).albedo - ISO) / SMALL


@pytest.mark.parametrize("kernel", WHITE_SKY)
def test_kernels_integrate_to_what_the_modis_product_publishes(kernel: str) -> None:
    x, weight = np.polynomial.legendre.leggauss(16)
    cos_i = 0.5 * (x + 1.0)
    mean = np.sum(weight * cos_i * integral(kernel, np.arccos(cos_i)))
    assert mean == pytest.approx(WHITE_SKY[kernel], abs=PUBLISHED)


@pytest.mark.parametrize("kernel", BLACK_SKY)
def test_polynomials_of_the_modis_product_are_fits_of_the_albedo(kernel: str) -> None:
    theta_i = np.deg2rad([0.0, 15.0, 30.0, 45.0, 60.0, 75.0])
    a, b, c = BLACK_SKY[kernel]
    np.testing.assert_allclose(integral(kernel, theta_i), a + b * theta_i**2 + c * theta_i**3, atol=FIT[kernel])


def test_kernels_are_0_at_the_normal_and_known_at_the_hot_spot() -> None:
    assert np.pi * ross_li(0.0, 0.0, 0.0, 0.0, f_iso=0.2, f_vol=1.0, f_geo=0.5) == pytest.approx(0.2, rel=1e-15)
    # xi = 0: K_vol = pi / 4 (sec - 1), K_geo = sec^2 - sec, where the crown hides its whole shadow
    sec = 2.0
    expected = 0.2 + 0.3 * np.pi / 4.0 * (sec - 1.0) + 0.1 * (sec**2 - sec)
    value = ross_li(np.pi / 3.0, 0.7, np.pi / 3.0, 0.7, f_iso=0.2, f_vol=0.3, f_geo=0.1)
    assert np.pi * value == pytest.approx(expected, rel=1e-14)


def test_a_negative_sum_is_held_at_0() -> None:
    at = (np.deg2rad(85.0), np.deg2rad(10.0), np.deg2rad(100.0))
    assert lucht_2000.ross_li(*at, 0.2, 0.0, 0.2) < 0
    assert ross_li(at[0], 0.0, at[1], at[2], f_iso=0.2, f_vol=0.0, f_geo=0.2) == 0.0


def test_the_excess_is_what_the_model_says() -> None:
    dark = {"f_iso": 1.0, "f_vol": 0.0, "f_geo": 0.5}
    for theta_deg, stated in ((85.0, "1.88 at 85"), (89.5, "19.5 at 89.5")):
        assert stated in MODELS["ross_li"].excess
        albedo = directional_albedo("ross_li", np.deg2rad(theta_deg), tolerance=1e-4, **dark).albedo
        assert albedo == pytest.approx(float(stated.split()[0]), rel=2e-3)
    leaves = {"f_iso": 1.0, "f_vol": 1.0, "f_geo": 0.0}
    albedo = directional_albedo("ross_li", np.deg2rad(89.5), tolerance=1e-4, **leaves).albedo
    assert albedo - 1.0 == pytest.approx(1.47, abs=0.005)
