"""The reference transcriptions against `paper_values/` (see PROVENANCE.md there) and against closed forms."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from brdfdb.reference import he_torrance_1991, minnaert, mp, oren_nayar_1994, ward_1992
from brdfdb.reference.lambert import lambert

PAPER_VALUES = Path(__file__).parent / "paper_values"
PRINTED = 5e-17  # half a unit of the 17th digit; worst measured over all columns but the series: 4.43e-17
SERIES_PRINTED = 5e-15  # g and V are themselves rounded to 17 digits, and V/m multiplies that; worst measured: 4.6e-15
ROUNDED_ZERO = 1e-50  # V is 0 in the mirror direction; the file holds up to 2.4e-57 there, the reference 1.4e-80
CLOSED_FORM = 1e-39  # the 40 digits; worst measured: 6.9e-41 (Eq. 81)

# Numbers that the files print to 17 digits but that were not evaluated from them. 89.9 is the float64 of that name.
ROUNDED = {mp.nstr(mp.radians(d), 17): mp.radians(d) for d in (1, 5, 10, 20, 30, 40, 60, 85, 89, 89.9, 180)}

Row = dict[str, str]


def exact(text: str) -> Any:
    """The number that a printed input stands for: a short one is an exact decimal."""
    return ROUNDED.get(text, mp.mpf(text))


def rows(file: str) -> list[Row]:
    with (PAPER_VALUES / file).open(newline="") as stream:
        return list(csv.DictReader(stream))


def inputs(row: Row, names: str) -> list[Any]:
    return [exact(row[name]) for name in names.split()]


def qualitative(row: Row, offset: str) -> Any:
    theta_i, theta_r, delta_phi, rho, sigma = inputs(row, "theta_i theta_r delta_phi rho sigma")
    return oren_nayar_1994.qualitative(theta_i, theta_r, delta_phi, rho, sigma, offset)


def functional(row: Row) -> tuple[Any, Any]:
    return oren_nayar_1994.functional(*inputs(row, "theta_i theta_r delta_phi rho sigma"))


def minnaert_k07(row: Row) -> Any:
    theta_i, theta_r = inputs(row, "theta_i theta_r")
    return minnaert.minnaert(theta_i, theta_r, "0.7")


def elliptical(row: Row) -> Any:
    return ward_1992.elliptical(*inputs(row, "theta_i phi_i theta_r phi_r rho_d rho_s alpha_x alpha_y"))


def directional_diffuse(row: Row) -> Any:
    theta_i, theta_r, delta_phi = inputs(row, "theta_i theta_r delta_phi")
    wavelength, sigma_0, tau, n, k = inputs(row, "wavelength sigma_0 tau n k")
    return he_torrance_1991.directional_diffuse(theta_i, theta_r, delta_phi, 1000 * wavelength, sigma_0, tau, n, k)


def specular_reflectance(row: Row) -> Any:
    theta_i, wavelength, sigma_0, tau, n, k = inputs(row, "theta_i wavelength sigma_0 tau n k")
    return he_torrance_1991.specular_reflectance(theta_i, 1000 * wavelength, sigma_0, tau, n, k)


def shadowing(row: Row) -> Any:
    theta_i, theta_r, sigma_0, tau = inputs(row, "theta_i theta_r sigma_0 tau")
    return he_torrance_1991.shadowing(theta_i, sigma_0, tau) * he_torrance_1991.shadowing(theta_r, sigma_0, tau)


def sigma_over_sigma0(row: Row) -> Any:
    theta_i, theta_r, sigma_0, tau = inputs(row, "theta_i theta_r sigma_0 tau")
    return he_torrance_1991.effective_roughness(theta_i, theta_r, sigma_0, tau) / sigma_0


def surface_roughness(row: Row) -> Any:
    return he_torrance_1991.surface_roughness(*inputs(row, "theta_i theta_r wavelength sigma_0 tau"))


def lateral_phase(row: Row) -> Any:
    V = he_torrance_1991.lateral_phase(*inputs(row, "theta_i theta_r delta_phi wavelength tau"))
    if mp.mpf(row["V"]) < ROUNDED_ZERO:
        assert V < ROUNDED_ZERO
        return mp.mpf(row["V"])
    return V


@pytest.mark.parametrize(
    ("file", "column", "evaluate", "tolerance"),
    [
        ("oren_nayar.csv", "functional_direct", lambda row: functional(row)[0], PRINTED),
        ("oren_nayar.csv", "functional", lambda row: sum(functional(row)), PRINTED),
        ("oren_nayar.csv", "qualitative", lambda row: qualitative(row, "0.33"), PRINTED),
        ("oren_nayar.csv", "qualitative_057", lambda row: qualitative(row, "0.57"), PRINTED),
        ("oren_nayar.csv", "minnaert_k07", minnaert_k07, PRINTED),
        ("ward.csv", "elliptical_5a", elliptical, PRINTED),
        ("he_torrance.csv", "directional_diffuse", directional_diffuse, PRINTED),
        ("he_torrance.csv", "specular_reflectance", specular_reflectance, PRINTED),
        ("he_torrance.csv", "shadowing", shadowing, PRINTED),
        ("he_torrance.csv", "sigma_over_sigma0", sigma_over_sigma0, PRINTED),
        ("he_torrance.csv", "g", surface_roughness, PRINTED),
        ("he_torrance.csv", "V", lateral_phase, PRINTED),
        ("he_torrance_series.csv", "sum", lambda row: he_torrance_1991.series(row["g"], row["V"]), SERIES_PRINTED),
    ],
)
def test_every_row_of_the_paper_values(
    file: str, column: str, evaluate: Callable[[Row], Any], tolerance: float
) -> None:
    table = rows(file)
    assert len(table) == 80
    for line, row in enumerate(table, start=2):
        expected = mp.mpf(row[column])
        error = abs(evaluate(row) - expected)
        assert error <= tolerance * abs(expected), f"{file}:{line}: off by {mp.nstr(error, 3)} from {row[column]}"


@pytest.mark.parametrize("direction", [(0, 0, 0), ("0.3", "1.2", "2.9"), ("1.5", "1.5", "0.1")])
def test_without_roughness_oren_nayar_and_minnaert_are_lambert(direction: tuple[Any, Any, Any]) -> None:
    theta_i, theta_r, delta_phi = direction
    assert oren_nayar_1994.functional(theta_i, theta_r, delta_phi, "0.9", sigma=0) == (lambert("0.9"), 0)
    assert oren_nayar_1994.qualitative(theta_i, theta_r, delta_phi, "0.9", sigma=0) == lambert("0.9")
    assert minnaert.minnaert(theta_i, theta_r, 1, "0.9") == lambert("0.9")
    assert he_torrance_1991.uniform_diffuse("0.9") == lambert("0.9")


def test_oren_nayar_functional_form_stays_negative_where_the_equation_is() -> None:
    direct, interreflected = oren_nayar_1994.functional("1.5", "1.5", mp.pi, rho="0.1", sigma=1)
    assert direct < 0 < interreflected
    assert direct + interreflected < 0


def test_ward_in_the_mirror_direction_is_the_height_of_the_lobe() -> None:
    value = ward_1992.elliptical("0.7", "0.2", "0.7", mp.pi + mp.mpf("0.2"), "0.3", "0.2", "0.1", "0.05")
    height = mp.mpf("0.3") / mp.pi + mp.mpf("0.2") / (4 * mp.pi * mp.mpf("0.005") * mp.cos(mp.mpf("0.7")))
    assert abs(value / height - 1) < CLOSED_FORM


@pytest.mark.parametrize("g", ["1e-6", "0.5", "9", "745", "1e4", "1e6"])
def test_series_without_lateral_phase_is_an_exponential_integral(g: str) -> None:
    with mp.workdps(60):  # at small g the three terms cancel
        x = mp.mpf(g)
        closed_form = mp.exp(-x) * (mp.ei(x) - mp.log(x) - mp.euler)
    assert abs(he_torrance_1991.series(g, 0) / closed_form - 1) < CLOSED_FORM


@pytest.mark.parametrize("b", [0, "0.5", 4])
def test_series_at_a_million_tends_to_the_corrected_beckmann_limit(b: Any) -> None:
    g, b = mp.mpf("1e6"), mp.mpf(b)
    corrected = mp.exp(-b) / g * (1 + (b**2 / 2 - 2 * b + 1) / g)
    assert abs(he_torrance_1991.series(g, b * g) / corrected - 1) < 10 / g**2


def test_series_of_a_smooth_surface_is_zero() -> None:
    assert he_torrance_1991.series(0, 3) == 0
    assert he_torrance_1991.directional_diffuse("0.4", "0.5", 1, 500, 0, 2, "1.5", 0) == 0


@pytest.mark.parametrize("theta", ["0.2", "1", "1.5"])
def test_effective_roughness_solves_equation_81(theta: str) -> None:
    sigma_0, tau = mp.mpf("2.5"), mp.mpf(2)
    sigma = he_torrance_1991.effective_roughness(theta, "0.7", sigma_0, tau)
    z_0 = sigma_0 * mp.sqrt((sigma_0 / sigma) ** 2 - 1)
    shadowed_tangents = [mp.tan(t) * mp.erfc(tau / (2 * sigma_0) * mp.cot(t)) for t in (mp.mpf(theta), mp.mpf("0.7"))]
    right_hand_side = sigma_0 / 4 * sum(shadowed_tangents) * mp.exp(-(z_0**2) / (2 * sigma_0**2))
    assert abs(mp.sqrt(mp.pi / 2) * z_0 / right_hand_side - 1) < CLOSED_FORM


def test_a_smooth_surface_is_a_fresnel_mirror() -> None:
    n, k = mp.mpf("0.2"), mp.mpf("3.9")
    normal = ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)
    assert abs(he_torrance_1991.specular_reflectance(0, 550, 0, 2, n, k) / normal - 1) < CLOSED_FORM
    assert he_torrance_1991.fresnel_unpolarised(0, n, k) == 1
    brewster = mp.atan(mp.mpf("1.5"))
    s_only = mp.sin(2 * brewster - mp.pi / 2) ** 2 / 2
    assert abs(he_torrance_1991.fresnel_unpolarised(mp.cos(brewster), "1.5", 0) / s_only - 1) < CLOSED_FORM


def test_he_torrance_is_reciprocal() -> None:
    one = he_torrance_1991.directional_diffuse("0.3", "1.1", "2.5", 550, "0.28", "1.77", "1.2", "7.3")
    other = he_torrance_1991.directional_diffuse("1.1", "0.3", "-2.5", 550, "0.28", "1.77", "1.2", "7.3")
    assert abs(one / other - 1) < CLOSED_FORM


def test_shadowing_over_cosine_is_finite_at_grazing() -> None:
    theta, sigma_0, tau = mp.pi / 2, mp.mpf("0.28"), mp.mpf("1.77")
    limit = mp.sqrt(mp.pi) * tau / (2 * sigma_0)
    assert abs(he_torrance_1991.shadowing(theta, sigma_0, tau) / mp.cos(theta) / limit - 1) < CLOSED_FORM


def test_he_torrance_falls_slowly_towards_zero_at_grazing() -> None:
    # sigma of Eq. (80) falls as 1 / sqrt(log tan theta): 90 degrees as a float64 is still far from the limit 0
    surface = (500, "0.28", "1.77", "1.5", 0)
    thetas = [mp.pi / 2 - mp.mpf(distance) for distance in ("1e-8", "1e-16", "1e-32")]
    near, nearer, nearest = (he_torrance_1991.directional_diffuse(theta, "1.3", 3, *surface) for theta in thetas)
    assert near > nearer > nearest > near / 10
