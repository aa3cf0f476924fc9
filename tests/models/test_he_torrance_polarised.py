"""He et al. 1991 in polarised light: published values, the paper's formulas state by state, and what is physical."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb import fresnel, models
from brdfdb.geometry import unit_vector
from brdfdb.models import he_torrance_jones, he_torrance_mueller, he_torrance_specular_mueller
from brdfdb.reference import he_torrance_1991, mp
from tests.models.agreement import HALF_PI, rows

ROWS = [{name: float(value) for name, value in row.items()} for row in rows("he_torrance_polarised.csv")]
ALUMINUM: dict[str, float] = {"wavelength_nm": 500.0, "sigma_0_um": 0.28, "tau_um": 1.77}
Z = np.diag([1.0, -1.0])

# Each just above the worst measured, which stands behind it
PUBLISHED = 2e-15  # of 40 rows: 6.7e-16
AMPLITUDE = 2e-14  # of F, J and M over |F|^2, n above 0.1: 4.4e-15
CONTRACTED = 1e-13  # of M times a Stokes vector of length up to 20: 4.4e-15
REFLECTANCE = 1e-14  # relative, n above 0.1: 2.9e-15
ELEMENT_00 = 5e-13  # relative: 9.7e-14, exponents of either sum are rounded on their own
EIGENVALUE = 1e-14  # relative to the first element: -5.7e-16

Complexes = NDArray[np.complex128]


def directions(rng: np.random.Generator, count: int) -> tuple[NDArray[np.float64], ...]:
    """Anywhere; a quarter next to backscatter, a quarter next to the mirror direction, some at the poles."""
    theta_i, theta_r = rng.uniform(0.0, HALF_PI, (2, count))
    phi_i, phi_r = rng.uniform(-4.0, 4.0, (2, count))
    quarter = count // 4
    near = 10.0 ** rng.uniform(-16.0, -1.0, quarter)
    for part, turn in ((slice(quarter), 0.0), (slice(quarter, 2 * quarter), np.pi)):
        theta_r[part] = np.minimum(theta_i[part] * (1.0 + near), HALF_PI)
        phi_r[part] = phi_i[part] + turn + rng.permutation(near)
    theta_i[-10:] = 0.0
    theta_r[-5:] = 0.0
    return theta_i, phi_i, theta_r, phi_r


def indices(rng: np.random.Generator, count: int, lowest: float = 0.1) -> dict[str, NDArray[np.float64]]:
    k = np.where(rng.uniform(size=count) < 0.3, 0.0, 10.0 ** rng.uniform(-4.0, 4.0, count))
    return {"n": 10.0 ** rng.uniform(np.log10(lowest), 2.0, count), "k": k}


def test_amplitudes_against_the_reference_and_the_reflectance_of_unpolarised_light() -> None:
    rng = np.random.default_rng(44)
    for _ in range(400):
        cos_theta, n, k = rng.uniform(), 10.0 ** rng.uniform(-1.0, 2.0), rng.choice([0.0, 10.0 ** rng.uniform(-4.0, 4)])
        expected = [complex(each) for each in he_torrance_1991._fresnel(cos_theta, mp.mpf(f"{n:.15f}"), k)]
        np.testing.assert_allclose(fresnel.amplitudes(cos_theta, n, k), expected, atol=AMPLITUDE)
        half = fresnel.half_sum_and_difference(cos_theta, n, k)
        np.testing.assert_allclose([half[0] + half[1], half[0] - half[1]], expected, atol=AMPLITUDE)
    cosines = np.concatenate([rng.uniform(size=20_000), 10.0 ** rng.uniform(-16.0, 0.0, 20_000)])
    index = indices(rng, 40_000)
    index["n"][::7] = 1.0 + 10.0 ** rng.uniform(-14.0, -1.0, index["n"][::7].size)
    both = sum(abs(each) ** 2 for each in fresnel.amplitudes(cosines, **index)) / 2
    np.testing.assert_allclose(both, fresnel.unpolarised(cosines, index["n"], index["k"]), rtol=REFLECTANCE)


def test_amplitudes_have_their_limits() -> None:
    for n, k in ((1.5, 0.0), (0.2, 3.9), (1.000001, 0.0)):
        F_s, F_p = fresnel.amplitudes(1.0, n, k)
        assert F_p == pytest.approx((complex(n, k) - 1.0) / (complex(n, k) + 1.0), rel=1e-9)
        assert F_s == pytest.approx(-F_p, rel=1e-15)
        assert fresnel.half_sum_and_difference(1.0, n, k)[0] == 0.0
        assert fresnel.amplitudes(np.cos(HALF_PI), n, k) == pytest.approx((-1.0, -1.0), abs=1e-12)
    brewster = 1.0 / np.hypot(1.0, 1.5)
    assert fresnel.amplitudes(brewster, 1.5, 0.0)[1] == pytest.approx(0.0, abs=1e-15)
    cos_theta = np.cos(np.linspace(0.0, HALF_PI, 10))
    assert all((each == 0.0).all() for each in fresnel.amplitudes(cos_theta, 1.0, 0.0))


def test_published_reflectances_have_the_reflected_polarisation_first() -> None:
    assert len(ROWS) == 40
    for case in ROWS:
        J = he_torrance_jones(case["theta_i"], 0.3, case["theta_r"], case["delta_phi"] + 0.3, n=case["n"], k=case["k"])
        expected = np.array([[case["R_ss"], case["R_sp"]], [case["R_ps"], case["R_pp"]]])
        assert (abs(abs(J) ** 2 - expected) <= PUBLISHED).all(), case


def test_jones_against_the_reference() -> None:
    rng = np.random.default_rng(61)
    cases = [*zip(*rng.uniform(0.0, HALF_PI, (2, 150)), rng.uniform(-4.0, 4.0, 150), strict=True)]
    cases += [(0.7, 0.7, 0.0), (0.7, 0.7, 1e-9), (HALF_PI, HALF_PI, np.pi), (0.0, 0.0, 0.4), (0.0, 0.6, 2.0)]
    for theta_i, theta_r, delta_phi in cases:
        n, k = 10.0 ** rng.uniform(-1.0, 1.0), rng.choice([0.0, 3.0])
        expected = he_torrance_1991.jones(theta_i, theta_r, delta_phi, mp.mpf(f"{n:.15f}"), k)
        J = he_torrance_jones(theta_i, 0.0, theta_r, delta_phi, n=n, k=k)
        np.testing.assert_allclose(J, np.array(expected.tolist(), dtype=complex), atol=AMPLITUDE)


def literal(wi: Any, wr: Any, n: float, k: float) -> Complexes:
    """M of eqs 61-64 over |k_r x k_i|^2, with the vectors of eqs 14 and 35, and with the sign that eq. 64 lacks."""
    k_i, k_r, z = -wi, wr, np.array([0.0, 0.0, 1.0])
    s_i, s_r = (np.cross(w, z) / np.linalg.norm(np.cross(w, z)) for w in (k_i, k_r))
    p_i, p_r = np.cross(s_i, k_i), np.cross(s_r, k_r)
    cos_b = np.linalg.norm(k_r - k_i) / 2.0
    index = complex(n, k)
    refracted = np.sqrt(index**2 - 1.0 + cos_b**2)
    F_s = (cos_b - refracted) / (cos_b + refracted)
    F_p = (index**2 * cos_b - refracted) / (index**2 * cos_b + refracted)
    M_ss = F_s * (p_i @ k_r) * (p_r @ k_i) + F_p * (s_i @ k_r) * (s_r @ k_i)
    M_sp = -(F_s * (s_i @ k_r) * (p_r @ k_i) - F_p * (p_i @ k_r) * (s_r @ k_i))
    M_pp = F_s * (s_i @ k_r) * (s_r @ k_i) + F_p * (p_i @ k_r) * (p_r @ k_i)
    M_ps = F_s * (p_i @ k_r) * (s_r @ k_i) - F_p * (s_i @ k_r) * (p_r @ k_i)
    M: Complexes = np.array([[M_ss, M_sp], [-M_ps, M_pp]])
    return M / np.linalg.norm(np.cross(k_r, k_i)) ** 2


R2 = np.sqrt(0.5)
STATES = {  # c_s and c_p of eq. 34, and the Stokes vector
    "s": ([1.0, 0.0], [1.0, 1.0, 0.0, 0.0]),
    "p": ([0.0, 1.0], [1.0, -1.0, 0.0, 0.0]),
    "+45": ([R2, R2], [1.0, 0.0, 1.0, 0.0]),
    "-45": ([R2, -R2], [1.0, 0.0, -1.0, 0.0]),
    "circular": ([1j * R2, R2], [1.0, 0.0, 0.0, 1.0]),
    "the other circular": ([-1j * R2, R2], [1.0, 0.0, 0.0, -1.0]),
    "elliptical": ([0.6, 0.8j], [1.0, -0.28, 0.0, -0.96]),
}


def reflected_s_and_p(wi: Any, wr: Any, n: float, k: float, stokes: list[float]) -> NDArray[np.float64]:
    """Intensities of s and p by our Mueller matrix over its directional diffuse part for a mirror."""
    M = models.he_torrance_mueller_vectors(wi, wr, n=n, k=k, **ALUMINUM)
    M = M / M[0, 0] * fresnel.unpolarised(min(0.5 * float(np.linalg.norm(wi + wr)), 1.0), n, k)
    intensity, difference = (M @ stokes)[:2]
    return np.array([intensity + difference, intensity - difference]) / 2.0


@pytest.mark.parametrize("state", STATES)
def test_every_incident_state_is_reflected_as_eqs_59_and_60_say(state: str) -> None:
    rng = np.random.default_rng(59)
    for theta_i, phi_i, theta_r, phi_r in rng.uniform([0.1, 0.0, 0.1, 2.0], [1.4, 1.0, 1.4, 6.0], (40, 4)):
        wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
        n, k = rng.uniform([0.2, 0.0], [3.0, 5.0])
        c, stokes = STATES[state]
        expected = abs(literal(wi, wr, n, k) @ np.array(c)) ** 2
        np.testing.assert_allclose(reflected_s_and_p(wi, wr, n, k, stokes), expected, atol=AMPLITUDE)


def s_and_p(w: Any, k: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    s = np.cross([0.0, 0.0, 1.0], w)
    s /= np.linalg.norm(s)
    return s, np.cross(s, k)


def stokes(field: Complexes, s: Any, p: Any, k: Any) -> NDArray[np.float64]:
    """Of a field in space, for exp(-i omega t): V is its helicity, without s and p."""
    E_s, E_p = field @ s, field @ p
    helicity = np.cross(field.conj(), field) @ k
    return np.array(
        [abs(E_s) ** 2 + abs(E_p) ** 2, abs(E_s) ** 2 - abs(E_p) ** 2, 2 * (E_s * E_p.conj()).real, helicity.imag]
    )


def test_positive_v_turns_counter_clockwise_for_whoever_looks_towards_the_light() -> None:
    w = unit_vector(0.7, 0.4)
    s, p = s_and_p(w, w)
    assert np.cross(p, s) @ w == pytest.approx(1.0)  # (p, s, k) is right-handed
    field = 1j * s + p
    assert stokes(field, s, p, w)[3] == pytest.approx(2.0)
    now, later = (np.real(field * np.exp(-1j * omega_t)) for omega_t in (0.0, 0.1))
    assert np.cross(now, later) @ w > 0.0


def test_mueller_reflects_fields_in_space() -> None:
    """The facet's own s and p, eqs 41 and 42, in three dimensions, against the matrix between the surface's s and p."""
    rng = np.random.default_rng(41)
    for theta_i, phi_i, theta_r, phi_r in rng.uniform([0.1, -3.0, 0.1, -3.0], [1.5, 3.0, 1.5, 3.0], (50, 4)):
        wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
        n, k = rng.uniform([0.2, 0.0], [3.0, 5.0])
        facet = (wi + wr) / np.linalg.norm(wi + wr)
        s = np.cross(-wi, facet)
        s /= np.linalg.norm(s)
        (s_i, p_i), (s_r, p_r) = s_and_p(wi, -wi), s_and_p(wr, wr)
        c = rng.normal(size=2) + 1j * rng.normal(size=2)
        field = c[0] * s_i + c[1] * p_i
        F_s, F_p = fresnel.amplitudes(wi @ facet, n, k)
        reflected = F_s * (field @ s) * s + F_p * (field @ np.cross(s, -wi)) * np.cross(s, wr)
        M = he_torrance_mueller(theta_i, phi_i, theta_r, phi_r, n=n, k=k, **ALUMINUM)
        M = M / M[0, 0] * fresnel.unpolarised(wi @ facet, n, k)
        np.testing.assert_allclose(M @ stokes(field, s_i, p_i, -wi), stokes(reflected, s_r, p_r, wr), atol=CONTRACTED)


def test_jones_turns_with_the_surface_and_has_a_mirror_image() -> None:
    rng = np.random.default_rng(4)
    theta_i, phi_i, theta_r, phi_r = rng.uniform(0.05, 1.5, (4, 500))
    index = {"n": 0.769, "k": 6.08}
    J = he_torrance_jones(theta_i, phi_i, theta_r, phi_r, **index)
    turned = he_torrance_jones(theta_i, phi_i + 2.0, theta_r, phi_r + 2.0, **index)
    np.testing.assert_allclose(turned, J, atol=AMPLITUDE)
    mirrored = he_torrance_jones(theta_i, -phi_i, theta_r, -phi_r, **index)
    np.testing.assert_allclose(mirrored, Z @ J @ Z, atol=AMPLITUDE)
    in_plane = he_torrance_jones(theta_i, 0.0, theta_r, [[0.0], [np.pi]], **index)
    assert abs(in_plane[..., [0, 1], [1, 0]]).max() < 1e-15


@pytest.mark.parametrize("step", [1e-3, 1e-6, 1e-9])
def test_jones_is_continuous_where_the_plane_of_reflection_is_not(step: float) -> None:
    index = {"n": 1.5, "k": 1.0}
    around = np.linspace(0.0, 2.0 * np.pi, 17)
    at = he_torrance_jones(0.7, 0.2, 0.7, 0.2, **index)
    nearby = he_torrance_jones(0.7, 0.2, 0.7 + step * np.cos(around), 0.2 + step * np.sin(around), **index)
    assert abs(nearby - at).max() < 3.0 * step
    grazing = he_torrance_jones(HALF_PI, 0.2, HALF_PI, 0.2 + np.pi, **index)
    np.testing.assert_allclose(grazing, np.eye(2), atol=1e-15)
    below = step * abs(np.cos(around))
    nearby = he_torrance_jones(HALF_PI - below, 0.2, HALF_PI, 0.2 + np.pi + step * np.sin(around), **index)
    assert abs(nearby - grazing).max() < 3.0 * step


def test_first_element_is_the_unpolarised_model() -> None:
    rng = np.random.default_rng(71)
    angles, index = directions(rng, 4000), indices(rng, 4000, lowest=1e-3)
    M = he_torrance_mueller(*angles, a=0.1, **index, **ALUMINUM)
    np.testing.assert_allclose(M[..., 0, 0], models.he_torrance(*angles, a=0.1, **index, **ALUMINUM), rtol=ELEMENT_00)
    specular = he_torrance_specular_mueller(angles[0], **index, **ALUMINUM)
    expected = models.he_torrance_specular(angles[0], **index, **ALUMINUM)
    np.testing.assert_allclose(specular[..., 0, 0], expected, rtol=1e-15)


def test_the_uniform_diffuse_part_depolarises() -> None:
    arguments = ALUMINUM | {"n": 1.5, "k": 0.0}
    with_it, without = (he_torrance_mueller(0.3, 0.0, 0.5, 1.0, a=a, **arguments) for a in (0.6, 0.0))
    np.testing.assert_allclose(with_it - without, np.diag([0.6 / np.pi, 0.0, 0.0, 0.0]), atol=1e-15)


def test_the_specular_part_is_that_of_a_facet_that_lies_flat() -> None:
    theta_i, index = np.linspace(0.0, HALF_PI, 31), {"n": 0.769, "k": 6.08}
    specular = he_torrance_specular_mueller(theta_i, **index, **ALUMINUM)
    mirror = he_torrance_mueller(theta_i, 0.3, theta_i, 0.3 + np.pi, **index, **ALUMINUM)
    ratio = specular[:, :1, :1] / mirror[:, :1, :1]
    np.testing.assert_allclose(specular, mirror * ratio, atol=1e-13)
    # no interface
    assert (he_torrance_specular_mueller(theta_i, n=1.0, k=0.0, **ALUMINUM) == 0.0).all()


PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, 1j], [-1j, 0]]])


def smallest_eigenvalue(M: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of Cloude's coherency matrix, over the first element: not negative where M is a sum of Jones matrices."""
    products = np.einsum("iab,jcd->ijacbd", PAULI, PAULI.conj()).reshape(4, 4, 4, 4)
    coherency = np.einsum("...ij,ijxy->...xy", M, products) / 4.0
    smallest: NDArray[np.float64] = np.linalg.eigvalsh(coherency)[..., 0] / M[..., 0, 0]
    return smallest


def test_mueller_matrices_are_physical() -> None:
    rng = np.random.default_rng(6)
    angles, index = directions(rng, 4000), indices(rng, 4000)
    for a in (0.0, 0.3):
        M = he_torrance_mueller(*angles, a=a, **index, **ALUMINUM)
        assert smallest_eigenvalue(M[M[:, 0, 0] > 1e-280]).min() > -EIGENVALUE
    M = he_torrance_specular_mueller(angles[0], **index, **ALUMINUM)
    assert smallest_eigenvalue(M[M[:, 0, 0] > 1e-280]).min() > -EIGENVALUE
    # the test can fail: what no surface does
    assert smallest_eigenvalue(np.diag([1.0, 1.0, 1.0, -1.0])) < -0.1


@pytest.mark.filterwarnings("ignore::brdfdb.errors.DegreesWarning")  # azimuths of many turns are meant
@pytest.mark.parametrize("n", [1e-3, 1.0, 1.5, 100.0])
@pytest.mark.parametrize("k", [0.0, 1e-3, 1e4])
def test_is_finite_in_every_corner(n: float, k: float) -> None:
    theta = np.array([0.0, 5e-324, 1e-8, 0.7, np.nextafter(HALF_PI, 0.0), HALF_PI])
    phi = np.array([0.0, np.pi, -HALF_PI, 2.0 * np.pi, 1e15])
    angles = theta[:, None, None, None], phi[:, None, None], theta[:, None], phi
    w = np.concatenate([unit_vector(theta[:, None], phi).reshape(-1, 3), np.eye(3), -np.eye(3)[:2]])
    for J in (he_torrance_jones(*angles, n=n, k=k), models.he_torrance_jones_vectors(w[:, None], w, n=n, k=k)):
        assert np.isfinite(J).all()
        assert abs(J).max() <= 1.0 + 1e-12
    assert np.isfinite(he_torrance_mueller(*angles, n=n, k=k, **ALUMINUM)).all()
    assert np.isfinite(he_torrance_specular_mueller(theta, n=n, k=k, **ALUMINUM)).all()
