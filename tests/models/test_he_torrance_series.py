"""The sum of He et al. 1991, eq. 78: against the whole sum at 40 digits, its limits, and both sides of every branch."""

from collections.abc import Iterator

import numpy as np
import pytest

from brdfdb import models
from brdfdb.models import _diffraction_series as series
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.reference import he_torrance_1991, mp
from tests.compiled import compiled

log_series_of_row = compiled(series.log_series_of_row)
TINY = 1e-280
# Relative errors, each just above the worst measured, which stands behind it
WHOLE_SUM = 1e-12  # 3.6e-13; 9.3e-13 in 1200 other draws, of the terms left out of a short sum
CLOSED_FORM = 4e-13  # 1.6e-13
BRANCH = 6e-13  # 4.6e-13, from a peak just below _SUM_BELOW to one just above
TOGETHER = 2e-12  # 1e-12: values of a block take as many terms as the neediest of them


def peak(g: float, V: float) -> float:
    """The m of the largest summand: the root of ln(g / m) + V / m^2, by bisection."""
    low, high = g, g + np.sqrt(V) + V / g
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if np.log(g / middle) + V / middle**2 > 0.0 else (low, middle)
    return low


def m_star(g: float, V: float) -> float:
    """The same as the code finds it."""
    return g * float(np.exp(0.5 * series._peak(g, float(np.log(g)), V)))


def V_of_peak(g: float, m: float) -> float:
    """The V that puts the largest summand at m > g."""
    return m * m * np.log(m / g)


def draws() -> Iterator[tuple[float, float]]:
    """(g, V): every branch, its edges, and values from the largest float64 to 1e-280."""
    yield from ((g, V) for g in (1e-250, 1e-9, 1.0, 9.0, 39.0, 41.0, 745.0, 1e4) for V in (0.0, 1e-9, 1.0, 300.0))
    yield from ((g, 1e6) for g in (1e-3, 1.0, 2e3, 1e4))
    yield from ((1e6, V) for V in (0.0, 1e5, 1e6))
    yield from ((1e-12, 0.0), (1e-12, 1e3), (40.0, 1e3), (1e7, 1e6))
    yield from ((0.3, 1.0), (1e-289, 600.0), (1e-291, 600.0), (1e-308, 5.0))
    rng = np.random.default_rng(78)
    for _ in range(60):
        g = 10.0 ** rng.uniform(-6.0, 4.5)
        yield g, float(rng.choice([10.0 ** rng.uniform(-6.0, 6.0), g * 10.0 ** rng.uniform(-2.0, 2.5)]))
    for _ in range(60):  # the peak on either side of _SUM_BELOW
        g = 10.0 ** rng.uniform(-2.0, 1.6)
        yield g, V_of_peak(g, series._SUM_BELOW * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12.0, -1.0)))


def test_against_the_whole_sum() -> None:
    compared = 0
    for g, V in draws():
        expected = he_torrance_1991.series(g, V) / mp.mpf(g)
        value = float(diffraction_series(np.float64(g), np.float64(V)))
        if expected < TINY:
            assert 0.0 <= value <= TINY
            continue
        compared += 1
        assert abs(value / expected - 1) <= WHOLE_SUM, (g, V)
    assert compared > 130


@pytest.mark.parametrize("exponent", [-200, -20, -6, -3, -1, 0, 1, 1.5, 2, 3, 4, 5, 6, 8, 10, 11.9, 12.1, 15, 25])
def test_without_lateral_phase_it_is_an_exponential_integral(exponent: float) -> None:
    g = 10.0**exponent
    with mp.workdps(300):  # at small g the three terms cancel
        x = mp.mpf(g)
        closed_form = mp.exp(-x) * (mp.ei(x) - mp.log(x) - mp.euler) / x
    value = diffraction_series(np.float64(g), np.float64(0.0))
    assert abs(float(value) / closed_form - 1) <= CLOSED_FORM


@pytest.mark.parametrize("V", [0.0, 1e-300, 2.5, 600.0])
def test_of_a_smooth_surface_it_is_its_first_term(V: float) -> None:
    for g in (0.0, 5e-324, 1e-300, 1e-291, 1e-289, 1e-30):
        assert diffraction_series(np.float64(g), np.float64(V)) == pytest.approx(np.exp(-V), rel=3e-13)


@pytest.mark.parametrize("b", [0.0, 0.5, 2.0, 4.0])
def test_at_large_g_it_is_the_corrected_limit_of_beckmann(b: float) -> None:
    for g in 10.0 ** np.arange(4.0, 25.0, 0.7):
        limit = np.exp(-b) / g**2 * (1.0 + (b**2 / 2.0 - 2.0 * b + 1.0) / g)
        error = abs(diffraction_series(g, b * g) / limit - 1.0)
        assert error <= 10.0 / g**2 + 1e-12, g  # the next order of the expansion, and the sum's own error


@pytest.mark.parametrize("g", [0.05, 0.5, 3.0, 9.0, 17.0, 25.0, 31.0, 36.0, 39.0, 39.9])
def test_is_continuous_where_the_sum_becomes_an_integral(g: float) -> None:
    low, high = 0.0, 2.0 * V_of_peak(g, series._SUM_BELOW)
    while np.nextafter(low, high) < high:
        middle = (low + high) / 2.0
        low, high = (middle, high) if m_star(g, middle) < series._SUM_BELOW else (low, middle)
    assert m_star(g, low) < series._SUM_BELOW <= m_star(g, high)
    summed, integrated = diffraction_series(np.full(2, g), np.array([low, high]))
    assert summed > TINY
    assert integrated == pytest.approx(summed, rel=BRANCH)


def test_is_continuous_in_g_at_every_edge() -> None:
    for edge in (1e-290, series._SUM_BELOW, series._TAYLOR_ABOVE):
        for V in (0.0, 0.3 * edge, 3.0 * edge):
            below, at, above = diffraction_series(edge * (1.0 + np.array([-1e-13, 0.0, 1e-13])), np.full(3, V))
            assert below == pytest.approx(at, rel=BRANCH)
            assert above == pytest.approx(at, rel=BRANCH)


def test_peak_is_found() -> None:
    for g in 10.0 ** np.arange(-6.0, 7.0):
        for V in 10.0 ** np.arange(-3.0, 7.0):
            assert m_star(g, V) == pytest.approx(peak(g, V), rel=1e-6), (g, V)


@pytest.mark.parametrize("count", [1, 2, 15, 255, 256, 257, 600])
def test_values_do_not_depend_on_their_neighbours(count: int) -> None:
    rng = np.random.default_rng(count)
    g = 10.0 ** rng.uniform(-8.0, 8.0, count)
    V = g * 10.0 ** rng.uniform(-3.0, 2.0, count)
    together = diffraction_series(g, V)
    alone = np.array([float(diffraction_series(*pair)) for pair in zip(g, V, strict=True)])
    np.testing.assert_allclose(together, alone, rtol=TOGETHER, atol=TINY)


def test_nan_and_infinity_stay_where_they_are() -> None:
    V = np.linspace(0.0, 5.0, 50)
    clean = diffraction_series(np.full(1, 3.0), V)
    V[[3, 40]] = np.nan
    V[20] = np.inf
    V[21] = 1e300
    row = diffraction_series(np.full(1, 3.0), V)
    assert np.isnan(row[[3, 40]]).all()
    assert (row[20:22] == 0.0).all()
    others = np.isfinite(V) & (V < 10.0)
    np.testing.assert_allclose(row[others], clean[others], rtol=TOGETHER)


@pytest.mark.parametrize("g", [1e-280, 1e-9, 1.0, 1e3, 1e12, 2e18, 1e22, 1e200])
@pytest.mark.parametrize("V", [0.0, 1.0, 1e10, 1e19, 1e25, 1e100, 1e199, 1e300])
def test_ends_and_stays_finite_far_outside_the_models(g: float, V: float) -> None:
    for value in (
        diffraction_series(np.full(1, g), np.array([0.0, V])),
        diffraction_series(np.float64(g), np.float64(V)),
    ):
        assert np.isfinite(value).all()
        assert (value >= 0.0).all()


SHAPES: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = (
    *(((), ()), ((), (7,)), ((1,), (0,)), ((), (0,)), ((3, 1), (1, 0)), ((0, 1), (5,)), ((3, 1), (5,))),
    *(((3, 1), (3, 5)), ((2, 1, 1), (3, 5)), ((5,), (3, 1)), ((5,), ())),
)


def test_broadcasts() -> None:
    for shapes in SHAPES:
        rng = np.random.default_rng(5)
        g, V = np.asarray(rng.uniform(0.1, 50.0, shapes[0])), np.asarray(rng.uniform(0.0, 90.0, shapes[1]))
        values = diffraction_series(g, V)
        assert values.shape == np.broadcast_shapes(*shapes)
        pairs = zip(*(array.ravel() for array in np.broadcast_arrays(g, V)), strict=True)
        each = [diffraction_series(*pair) for pair in pairs]
        np.testing.assert_allclose(np.ravel(values), each, rtol=TOGETHER, err_msg=str(shapes))


@pytest.mark.parametrize(
    ("terms", "promise"),
    [(series.TERMS, 1e-11), (series.TERMS_OF_FLOAT32, 2e-6)],  # 7.3e-12, at ln(sum) near -600; 3.2e-7
)
def test_the_table_keeps_its_promise_all_over_its_domain(terms: int, promise: float) -> None:
    rng = np.random.default_rng(terms)
    table, row = series.series_table(terms), np.empty((series.Q_PATCHES, terms))
    ends = [series.G_LOW, np.nextafter(series.G_HIGH, 0.0)]
    for g in (*ends, *np.exp(rng.uniform(*np.log(ends), 1500))):
        V = (5.0 + g) * np.expm1(np.append(rng.uniform(0.0, 8.7, 60), [0.0, 8.8]))
        exact, tabulated = np.empty(V.size), np.empty(V.size)
        series._series(np.full(V.size, g), V, exact)
        log_series_of_row(table, g, V, V.min(), V.max(), tabulated, row)
        above = exact > -708.0
        np.testing.assert_allclose(tabulated[above], exact[above], rtol=0.0, atol=promise)
        assert (tabulated[~above] < -707.9).all()


def test_rows_by_the_table_meet_rows_without_it_where_its_domain_ends() -> None:
    # a row of 15 values is computed without the table
    phi = np.linspace(0.0, np.pi, 15)
    surface = {"tau_um": 2.0, "wavelength_nm": 500.0, "n": 1.5, "k": 0.2}
    for g in (series.G_LOW * 0.999, series.G_LOW * 1.001, 1.0, series.G_HIGH * 0.999, series.G_HIGH * 1.001):
        sigma_0_um = np.sqrt(g) * 0.5 / (2.0 * np.pi * 2.0 * np.cos(0.3))
        light = {"sigma_0_um": sigma_0_um, **surface, "tau_um": max(2.0, 20.0 * sigma_0_um)}
        few = models.he_torrance(0.3, 0.0, 0.3, phi, **light)
        many = models.he_torrance(0.3, 0.0, 0.3, np.append(phi, phi), **light)
        np.testing.assert_allclose(many[:15], few, rtol=2e-11, atol=TINY)
