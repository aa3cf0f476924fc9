"""Misprints of Oren and Nayar 1994: the right form against the reference, the printed one against its figure."""

from __future__ import annotations

import numpy as np

from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.reference import oren_nayar_1994
from brdfdb.reference.torrance_sparrow_1967 import torrance_sparrow
from tests.misprints.an_entry import GENERAL, Entry, close

SLOPES = 1e-6  # integrals over slopes: 4.4e-7


def test_gaf_of_the_larger(entry: Entry) -> None:
    printed, right = entry.both()
    w = entry.where
    angles = w["theta_i"], 0.0, w["theta_r"], w["phi_r"]
    assert right == 0.0 == float(oren_nayar_1994.unidirectional(*angles, 1, w["theta_a"], 0)[0])
    entry.states(f"{printed:.2f}")
    # where nothing is hidden the two are one
    printed, right = entry.both(**GENERAL, theta_a=0.3)
    close(printed, oren_nayar_1994.unidirectional(*GENERAL.values(), 1, 0.3, 0)[0])
    close(printed, right)


def test_shadowed_facet(entry: Entry) -> None:
    printed, right = entry.both()
    w = entry.where
    close(right, oren_nayar_1994.unidirectional(w["theta_i"], 0, 0, 0, 1, w["theta_a"], 0)[0])
    entry.states(f"{printed / right:.2f}")
    # with <s,a> for <v,n> it is <v,n> / <s,a> times the row's right-hand side: cos(0) / cos(75 - 45) degrees
    close(printed / right, 1.0 / np.cos(np.deg2rad(30.0)))
    # where nothing is shadowed the table is right, masked facets included
    close(*entry.both(theta_i=0.2, theta_r=1.3, phi_r=2.0))


def test_visible_and_masked_widths(entry: Entry) -> None:
    printed, right = entry.both()
    assert printed == 0.0
    # rho^2 / pi cos(theta_a) (1 - cos(theta_a))
    close(right, np.sqrt(0.5) * (1.0 - np.sqrt(0.5)) / np.pi)
    entry.states("0", f"{right:.3f}")


def test_normalised_over_the_hemisphere(entry: Entry) -> None:
    printed, right = entry.both()
    w = entry.where
    close(right, oren_nayar_1994.gaussian(w["theta_i"], w["theta_r"], 0.0, w["rho"], w["sigma"])[0], SLOPES)
    close(printed / right, 1.0 / (2.0 * np.pi), SLOPES)
    entry.states(f"{printed / right:.3f}")
    printed, right = entry.both(theta_i=0.0, theta_r=0.0, rho=1.0, sigma=1e-2)
    close(right, 1.0 / np.pi, 1.1e-4)  # Lambert, less sigma^2
    close(printed, 0.5 / np.pi**2, 1.1e-4)


def test_fit_below_zero(entry: Entry) -> None:
    printed, right = entry.both()
    w = entry.where
    assert right == 0.0
    close(printed, sum(oren_nayar_1994.functional(w["theta_i"], w["theta_r"], w["phi_r"], w["rho"], w["sigma"])))
    entry.states(f"{printed * np.pi / w['rho']:.3f}")
    close(*entry.both(**GENERAL))


def test_tangent_at_grazing(entry: Entry) -> None:
    printed, right = entry.both()
    assert printed[0] == np.inf
    assert np.isnan(printed[1])
    for value, delta_phi in zip(right, (0.0, np.pi), strict=True):
        close(value, sum(oren_nayar_1994.functional(np.pi / 2, np.pi / 2, delta_phi, 0.5, 0.5)))
    entry.states("inf", "nan", f"{right[1]:.3f}")
    close(*entry.both(wi=[0.6, 0.0, 0.8], wr=[0.0, -0.8, 0.6]))


def test_surface_radiance_as_brdf(entry: Entry) -> None:
    printed, right = entry.both()
    w = entry.where
    close(right, torrance_sparrow(w["theta_i"], w["theta_r"], w["phi_r"], w["sigma"]))
    close(printed / right, np.cos(w["theta_i"]))
    exchanged, right_exchanged = entry.both(theta_i=w["theta_r"], theta_r=w["theta_i"])
    close(right_exchanged, right)
    entry.states(f"{printed / exchanged:.3f}")


def test_surface_without_e_0(entry: Entry) -> None:
    w = entry.where
    angles, sigma = (w["theta_i"], w["theta_r"], w["phi_r"]), np.deg2rad(42.0)
    body, _, surface = oren_nayar_1994.body_surface(*angles, 0.75, sigma, k_b=1, k_s=0.085)
    for e_0 in (1.0, np.pi, 10.0):
        printed, right = entry.both(e_0=e_0)
        close(printed, body + surface / e_0, 1e-12)
        close(right, body + surface / np.pi, 1e-12)
    # the albedo of the towel, of the two readings
    towel = {"rho": 0.75, "sigma": sigma, "k_s": 0.085}
    most = [
        directional_albedo("oren_nayar_body_surface", np.deg2rad(89.99), tolerance=1e-4, **towel, e_0=e_0).albedo
        for e_0 in (1.0, np.pi)
    ]
    entry.states(f"{most[0]:.2f}", f"{most[1]:.2f}")


def test_interreflection_factor(entry: Entry) -> None:
    printed, right = entry.both()
    w = entry.where
    close(right, oren_nayar_1994.gaussian(w["theta_i"], w["theta_r"], 0.0, w["rho"], w["sigma"])[1], SLOPES)
    entry.states(f"{printed / right:.2f}")
    # both from the same direction: what is masked is what is shadowed on the other facet, and eq. 48 is exact
    close(*entry.both(theta_i=0.5, theta_r=0.5), SLOPES)
