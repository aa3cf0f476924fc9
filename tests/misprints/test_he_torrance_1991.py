"""Misprints of He et al. 1991: the right form against the reference, the printed one against its figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import fresnel
from brdfdb.misprints import he_torrance_1991 as he_forms
from brdfdb.reference import he_torrance_1991, mp
from tests.misprints.an_entry import EXACT, GENERAL, Entry, close

SERIES = 5e-12  # the sum of eq. 78: 7.1e-13


def is_jones(values: NDArray[np.complex128], *arguments: Any) -> None:
    """Assert that values are the Jones matrix of the reference."""
    expected = np.array(he_torrance_1991.jones(*arguments).tolist(), dtype=complex)
    np.testing.assert_allclose(values, expected, rtol=0.0, atol=EXACT)


def test_uniform_diffuse_without_pi(entry: Entry) -> None:
    printed, right = entry.both()
    close(right, he_torrance_1991.uniform_diffuse(0.9))
    entry.states(f"{np.pi * printed:.2f}")
    # blue plastic, section 4: rho_dh = 0.195 with a = 0.15 and a first surface of about 4.5 %
    printed, right = entry.both(a=0.15)
    assert abs(np.pi * right + 0.045 - 0.195) < 1e-12
    assert np.pi * printed + 0.045 > 0.5


def test_shadowing_divided_by_cosines(entry: Entry) -> None:
    printed, right = entry.both()
    slope = entry.where["slope"]
    assert np.isnan(printed)
    close(right, np.sqrt(np.pi) / (2.0 * slope))
    entry.states(f"{right:.2f}")
    printed, right = entry.both(cos_theta=np.cos(1.3))
    close(right, he_torrance_1991.shadowing(1.3, slope, 1) / mp.cos(1.3))
    close(printed, right)


def test_lambda_without_gaussian(entry: Entry) -> None:
    printed, right = entry.both()
    close(right, he_torrance_1991.shadowing(*entry.numbers("theta", "slope"), 1))
    entry.states(f"{printed / right:.3f}")
    # nowhere worse, at any slope: 15 % of S_1, and 28 % of the product of two
    thetas = np.deg2rad(np.linspace(1.0, 89.9, 300))
    worst = min(np.min(np.divide(*entry.both(theta=thetas, slope=slope))) for slope in (0.05, 0.16, 0.5, 2.0))
    assert 0.849 < worst < 0.85
    assert 0.72 < worst**2 < 0.722


def test_hemispherical_for_bidirectional(entry: Entry) -> None:
    printed, right = entry.both()
    assert printed == 1.0  # both directions are at 45 degrees
    theta, *surface = entry.numbers("theta_i", "wavelength_nm", "sigma_0_um", "tau_um", "n", "k")
    back, specular = (he_torrance_1991.directional_diffuse(theta, theta, x, *surface) for x in (0, mp.pi))
    close(right, back / specular, SERIES)
    entry.states("1.00", f"{right:.0e}".replace("e-0", "e-"))


def test_one_matrix_for_two(entry: Entry) -> None:
    printed, right = entry.both()
    is_jones(right, *entry.numbers("theta_i", "theta_r", "phi_r", "n", "k"))
    # in the mirror direction p_i and p_r are 2 theta apart, and s is as it should be
    for theta in np.deg2rad([20.0, 45.0]):
        printed, right = entry.both(theta_i=theta, theta_r=theta, phi_r=np.pi)
        np.testing.assert_allclose(printed[0, 0], right[0, 0], rtol=1e-12)
        np.testing.assert_allclose(abs(printed[1, 1] / right[1, 1]), np.cos(2.0 * theta), atol=1e-12)
    entry.states(f"{abs(printed[1, 1]) ** 2:.2f}", f"{abs(right[1, 1]) ** 2:.2f}", "45")


def test_two_pi_in_the_cone(entry: Entry) -> None:
    printed, right = entry.both()
    close(right, he_torrance_1991.specular_reflectance(0, 500, 0, 1, 1.5, 0))
    close(printed / right, 4.0 * np.pi**2)
    entry.states(f"{printed:.2f}", f"{right:.2f}")


def test_intensities_without_shadowing(entry: Entry) -> None:
    printed, right = entry.both()
    S = [he_torrance_1991.shadowing(theta, 0.28, 1.77) for theta in entry.numbers("theta_i", "theta_r")]
    close(right / printed, S[0] * S[1])
    x, weights = np.polynomial.legendre.leggauss(200)
    theta_r = (x[:, np.newaxis] + 1.0) * np.pi / 4.0
    phi_r = (np.arange(360) + 0.5) * np.pi / 180.0
    measure = weights * np.pi / 4.0 * 2.0 * np.pi * (np.sin(theta_r) * np.cos(theta_r))[:, 0]
    printed, right = (measure @ f_r.mean(axis=1) for f_r in entry.both(theta_r=theta_r, phi_r=phi_r))
    entry.states(f"{printed:.1f}", f"{right:.2f}")


def test_squares_without_moduli(entry: Entry) -> None:
    printed, right = entry.both()
    close(right, he_torrance_1991.fresnel_unpolarised(*entry.numbers("cos_theta", "n", "k")))
    entry.states(f"{printed.real:.2f}", f"{printed.imag:.2f}i", f"{right:.3f}")
    # glass has real amplitudes: there it does not matter
    printed, right = entry.both(n=1.5, k=0.0)
    close(printed.real, right)
    assert printed.imag == 0.0


def test_local_normal_for_z(entry: Entry) -> None:
    printed, right = entry.both()
    is_jones(right, *entry.numbers("theta_i", "theta_r", "phi_r", "n", "k"))
    np.testing.assert_allclose(printed - np.diag(np.diag(printed)), 0.0, atol=1e-12)
    entry.states("0", f"{abs(right[1, 0]) ** 2:.2f}")
    # what is reflected of unpolarised light is the same
    close(np.sum(np.abs(printed) ** 2), np.sum(np.abs(right) ** 2))


def test_amplitudes_over_cross_product(entry: Entry) -> None:
    printed, right = entry.both()
    assert np.isnan(printed).all()
    theta_i, theta_r, *index = entry.numbers("theta_i", "theta_r", "n", "k")
    is_jones(right, theta_i, theta_r, 0, *index)
    entry.states(f"{0.5 * np.sum(np.abs(right) ** 2):.2f}", "nan")
    # the same matrix elsewhere, with the minus sign that eq. 64 lacks
    for form in entry.both(**GENERAL):
        is_jones(form, GENERAL["theta_i"], GENERAL["theta_r"], GENERAL["phi_r"] - GENERAL["phi_i"], *index)


def test_sign_of_m_ps(entry: Entry) -> None:
    printed, right = entry.both()
    is_jones(right, *entry.numbers("theta_i", "theta_r", "phi_r", "n", "k"))
    # a perfect mirror: all its light comes back, however polarised; 2e-10 is lost to n + ik = 0.001 + 10000i
    np.testing.assert_allclose(right.conj().T @ right, np.eye(2), rtol=0.0, atol=1e-9)
    most, least = np.linalg.svd(printed, compute_uv=False) ** 2
    entry.states(f"{least:.3f}", f"{most:.3f}")


def test_four_dot_products(entry: Entry) -> None:
    printed, right = entry.both()
    assert np.isnan(printed).all()
    # |v| = 2 at backscatter: 4 / cos^2(theta_i)
    np.testing.assert_allclose(right, [4.0 / np.cos(np.deg2rad(40.0)) ** 2, 4.0], rtol=EXACT)
    entry.states(f"{right[1]:.2f}", "nan")
    close(*entry.both(**GENERAL))


def test_v_without_wave_number(entry: Entry) -> None:
    # the reflectance of a good mirror is divided out
    mirror = (0.001, 10000)
    directional = entry.numbers("theta_i", "theta_r", "phi_r", "wavelength_nm", "sigma_0_um", "tau_um")
    reflected = he_torrance_1991.fresnel_unpolarised(mp.cos(entry.where["theta_r"] / 2), *mirror)
    close(entry.both()[1], he_torrance_1991.directional_diffuse(*directional, *mirror) / reflected, SERIES)
    # in the mirror direction v_xy is 0, and the unit of v does not matter
    close(*entry.both(theta_i=0.3, theta_r=0.3, phi_r=np.pi), SERIES)
    # the albedo for light along the normal
    x, weights = np.polynomial.legendre.leggauss(100)
    theta_r = (x + 1.0) * np.pi / 4.0
    measure = weights * np.pi / 4.0 * 2.0 * np.pi * np.sin(theta_r) * np.cos(theta_r)
    printed, right = (measure @ f_r for f_r in entry.both(theta_r=theta_r))
    assert 0.99 < right < 1.0
    aluminum = fresnel.unpolarised(np.cos(theta_r / 2.0), 0.8126, 6.048)
    of_aluminum = measure @ (entry.both(theta_r=theta_r)[0] * aluminum)
    entry.states(f"{of_aluminum:.1f}", f"{printed:.1f}")


def test_ten_terms(entry: Entry) -> None:
    printed, right = entry.both()
    for value, g in zip(right, (9, 18.5, 800), strict=True):
        close(value, he_torrance_1991.series(g, 0), SERIES)
    held = printed / right
    assert held[2] == 0.0
    assert np.exp(-745.0) > 0.0 == np.exp(-746.0)
    entry.states(f"{100 * held[0]:.0f} %", f"{100 * held[1]:.0f} %", "745")
    close(*entry.both(g=0.1), 1e-11)  # where ten terms do


def test_beckmanns_limit(entry: Entry) -> None:
    printed, right = entry.both()
    for value, b in zip(right, (0, 8), strict=True):
        close(value, he_torrance_1991.series(18.5, 18.5 * b), SERIES)
    off = 100 * (printed / right - 1.0)
    entry.states(f"{off[0]:.0f} %", f"{off[1]:.0f} %")
    b = np.array([0.0, 8.0])
    first_order = printed * (1.0 + (b**2 / 2.0 - 2.0 * b + 1.0) / 18.5)
    np.testing.assert_allclose(first_order, right, rtol=0.021)  # measured: -0.7 %, 2.1 %
    printed, right = entry.both(g=1e6, V=1e6)
    close(printed, right, 1e-6)  # at b = 1 it is 1 / (2 g) off


def test_root_search(entry: Entry, monkeypatch: pytest.MonkeyPatch) -> None:
    printed, right = entry.both()
    effective = he_torrance_1991.effective_roughness(*entry.numbers("theta_i", "theta_r", "slope"), 1)
    close(right, mp.sqrt((entry.where["slope"] / effective) ** 2 - 1))
    assert printed == 0.0
    entry.states(str(he_forms.STEPS), f"{right:.3f}")
    close(*entry.both(theta_i=np.deg2rad(80.0), theta_r=np.deg2rad(80.0)))  # there it converges
    # at the odd steps it is at the other end, ten times too far out: it goes to and fro for ever
    monkeypatch.setattr(he_forms, "STEPS", 49)
    assert entry.both()[0] > 9.9 * right
