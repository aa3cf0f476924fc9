"""The reference transcriptions against `paper_values/` (see PROVENANCE.md there)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brdfdb.reference import he_torrance_1991 as ht
from brdfdb.reference import minnaert, mp, oren_nayar_1994, torrance_sparrow_1967, ward_1992
from tests.models.agreement import Row, rows

PRINTED = 5e-17  # half a unit of the 17th digit; worst measured over all columns without a name here: 4.58e-17
SERIES_PRINTED = 5e-15  # g and V are themselves rounded to 17 digits, and V/m multiplies that; worst measured: 4.6e-15
ROUNDED_ZERO = 1e-50  # V is 0 in the mirror direction; the file holds up to 2.4e-57 there, the reference 1.4e-80
POLARISED_PRINTED = 6e-15  # angles rounded to 17 digits where one of the four coefficients is small; worst: 5.03e-15
GAUSSIAN_PRINTED = 5e-10  # the file is good to this, its 11 digits go further; worst: 4.3e-10
GAUSSIAN_INTER = 1e-8  # the same for its column `inter`; worst: 9.8e-9
GAUSSIAN_INTER_POOR = 1e-4  # lines 16, 29, 35 and 41 of that column, see PROVENANCE.md; worst: 9.2e-5

# Numbers that the files print to 17 digits but that were not evaluated from them. 89.9 is the float64 of that name.
ROUNDED = {mp.nstr(mp.radians(d), 17): mp.radians(d) for d in (1, 5, 10, 15, 20, 30, 40, 45, 60, 85, 89, 89.9, 180)}


def exact(text: str) -> Any:
    """The number that a printed input stands for: a short one is an exact decimal."""
    return ROUNDED.get(text, mp.mpf(text))


def inputs(row: Row, names: str) -> list[Any]:
    return [exact(row[name]) for name in names.split()]


def of(names: str, function: Callable[..., Any], *more: Any) -> Callable[[Row], Any]:
    """A function of columns of a row, followed by further arguments."""
    return lambda row: function(*inputs(row, names), *more)


def part(number: int, function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: function(*arguments)[number]


def summed(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: sum(function(*arguments))


def nanometres(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of a wavelength [nm] as one of micrometres, which come before the last four arguments."""
    return lambda *given: function(*given[:-5], 1000 * given[-5], *given[-4:])


def polarised(reflected: int, incident: int) -> Callable[[Row], Any]:
    return of("theta_i theta_r delta_phi n k", lambda *given: abs(ht.jones(*given)[reflected, incident]) ** 2)


def lateral_phase(row: Row) -> Any:
    V = ht.lateral_phase(*inputs(row, "theta_i theta_r delta_phi wavelength tau"))
    if mp.mpf(row["V"]) < ROUNDED_ZERO:
        assert V < ROUNDED_ZERO
        return mp.mpf(row["V"])
    return V


MODEL = "theta_i theta_r delta_phi rho sigma"
CAVITY = "theta_i phi_i theta_r phi_r rho theta_a phi_a"
WARD = "theta_i phi_i theta_r phi_r rho_d rho_s alpha_x alpha_y"
SURFACE = "wavelength sigma_0 tau n k"
SLOPES = "theta_i theta_r sigma_0 tau"
FILES: dict[str, dict[str, Callable[[Row], Any]]] = {
    "oren_nayar.csv": {
        "functional_direct": of(MODEL, part(0, oren_nayar_1994.functional)),
        "functional": of(MODEL, summed(oren_nayar_1994.functional)),
        "qualitative": of(MODEL, oren_nayar_1994.qualitative, "0.33"),
        "qualitative_057": of(MODEL, oren_nayar_1994.qualitative, "0.57"),
        "single_slope_direct": of(MODEL, part(0, oren_nayar_1994.single_slope)),
        "single_slope_inter": of(MODEL, part(1, oren_nayar_1994.single_slope)),
        "minnaert_k07": of("theta_i theta_r", minnaert.minnaert, "0.7"),
        "torrance_sparrow_F1": of("theta_i theta_r delta_phi sigma", torrance_sparrow_1967.torrance_sparrow),
    },
    "oren_nayar_unidirectional.csv": {
        "direct": of(CAVITY, part(0, oren_nayar_1994.unidirectional)),
        "inter": of(CAVITY, part(1, oren_nayar_1994.unidirectional)),
    },
    "ward.csv": {"elliptical_5a": of(WARD, ward_1992.elliptical), "elliptical_5b": of(WARD, ward_1992.half_vector)},
    "he_torrance.csv": {
        "directional_diffuse": of(f"theta_i theta_r delta_phi {SURFACE}", nanometres(ht.directional_diffuse)),
        "specular_reflectance": of(f"theta_i {SURFACE}", nanometres(ht.specular_reflectance)),
        "shadowing": of(SLOPES, lambda i, r, *height: ht.shadowing(i, *height) * ht.shadowing(r, *height)),
        "sigma_over_sigma0": of(SLOPES, lambda i, r, height, tau: ht.effective_roughness(i, r, height, tau) / height),
        "g": of("theta_i theta_r wavelength sigma_0 tau", ht.surface_roughness),
        "V": lateral_phase,
    },
    "he_torrance_series.csv": {"sum": lambda row: ht.series(row["g"], row["V"])},
    "he_torrance_polarised.csv": {
        "R_ss": polarised(0, 0),
        "R_sp": polarised(0, 1),
        "R_ps": polarised(1, 0),
        "R_pp": polarised(1, 1),
    },
}
TOLERANCES = {"he_torrance_series.csv": SERIES_PRINTED, "he_torrance_polarised.csv": POLARISED_PRINTED}


@pytest.mark.parametrize(("file", "column"), [(file, column) for file in FILES for column in FILES[file]])
def test_every_row_of_the_paper_values(file: str, column: str) -> None:
    table = rows(file)
    assert len(table) == (40 if file == "he_torrance_polarised.csv" else 80)
    for line, row in enumerate(table, start=2):
        expected = mp.mpf(row[column])
        error = abs(FILES[file][column](row) - expected)
        tolerance = TOLERANCES.get(file, PRINTED) * abs(expected)
        assert error <= tolerance, f"{file}:{line}: off by {mp.nstr(error, 3)} from {row[column]}"


def test_every_row_of_the_gaussian_surface() -> None:
    table = rows("oren_nayar_gaussian.csv")
    assert len(table) == 40
    for line, row in enumerate(table, start=2):
        direct, inter = oren_nayar_1994.gaussian(*inputs(row, "theta_i theta_r delta_phi rho sigma"))
        assert abs(direct / float(row["direct"]) - 1) <= GAUSSIAN_PRINTED, f"line {line}: {direct}"
        tolerance = GAUSSIAN_INTER_POOR if line in (16, 29, 35, 41) else GAUSSIAN_INTER
        assert abs(inter / float(row["inter"]) - 1) <= tolerance, f"line {line}: {inter}"


def test_where_the_gaussian_file_is_off_brute_force_sides_with_the_reference() -> None:
    row = rows("oren_nayar_gaussian.csv")[16 - 2]
    t_i, t_r, delta_phi, rho, sigma = map(float, inputs(row, "theta_i theta_r delta_phi rho sigma"))
    phi_a = (np.arange(6000) + 0.5) * np.pi / 3000
    cos_i, cos_r = np.cos(phi_a), np.cos(phi_a - delta_phi)
    mean = total = 0.0
    for theta_a in (np.arange(3000) + 0.5) * np.pi / 6000:
        height_i, tilt_i = np.cos(t_i) * np.cos(theta_a), np.sin(t_i) * np.sin(theta_a) * cos_i
        height_r, tilt_r = np.cos(t_r) * np.cos(theta_a), np.sin(t_r) * np.sin(theta_a) * cos_r
        received, seen = np.maximum(height_i - tilt_i, 0), np.maximum(height_r + tilt_r, 0)
        m_s = np.clip(-(height_i + tilt_i) / np.where(received > 0, received, 1), 0, 1)
        m_v = np.clip(-(height_r - tilt_r) / np.where(seen > 0, seen, 1), 0, 1)
        d_1v, d_1s, d_sv, d_11 = (
            np.sqrt(x * x + 2 * x * y * np.cos(2 * theta_a) + y * y)
            for x, y in ((1, m_v), (1, m_s), (m_s, m_v), (1, 1))
        )
        radiance = np.mean(received * seen * (d_1v + d_1s - d_sv - d_11)) * np.pi / 2 / np.cos(theta_a)
        weight = np.exp(-((theta_a / sigma) ** 2) / 2) * np.sin(theta_a)
        mean += weight * radiance * (rho / np.pi) ** 2 / (np.cos(t_i) * np.cos(t_r))
        total += weight
    inter = oren_nayar_1994.gaussian(t_i, t_r, delta_phi, rho, sigma)[1]
    assert abs(mean / total / inter - 1) < 1e-6  # measured: 4.9e-7 with this midpoint rule, 2.0e-5 with half the nodes
    assert abs(float(row["inter"]) / inter - 1) > 9e-5
