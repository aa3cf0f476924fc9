"""Each plugin in each variant of Mitsuba against the library: ``python -m tests.mitsuba.every_variant [VARIANT ...]``.

Values and densities are compared in float64 at 500 pairs or more (100 in scalar variants): all nodes of a table as
float32 with the numbers next to them, the horizon, the mirror direction, and directions at random. The weights of
samples are f_r cos / density, and their directions have a chi-square test with the density of the library. Prints a row
for each plugin in each variant.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from brdfdb.formats._channels import channels_of
from brdfdb.geometry import unit_vector
from brdfdb.integrals.sampling import lobe_of, mixture_density, pdf
from brdfdb.lobes import Lobe
from brdfdb.materials import presets
from brdfdb.models import MODELS
from brdfdb.refractive_indices import refractive_index
from brdfdb.spectra import PICTURE_NM, linear_srgb
from brdfdb.tables.grids import directions as directions_of_nodes
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table, table_from
from brdfdb.tables.tabulation import tabulate
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, SPECTRAL, small_table
from tests.formats.test_kaist import plastic
from tests.mitsuba.surfaces import SUBJECTS, Subject, directions, interaction, smooth, vectors
from tests.mitsuba.test_table import painted
from tests.tables.made_up import made_up

Array = NDArray[Any]

PAIRS, PAIRS_ONE_BY_ONE = 500, 100  # together, and in scalar variants, which take a pair at a time
MONO_NM, RGB_NM = 549.1, (611.4, 549.1, 464.2)
THETA_BINS, PHI_BINS, FINE = 8, 16, 48  # bins of a chi-square test, and pieces of each along both sides
LIGHT = unit_vector(np.deg2rad(50.0), 0.5).astype(np.float32)
DRAWN, DRAWN_ONE_BY_ONE = 1 << 15, 100
JOINED = 4  # bins that are one along both sides where few directions are drawn
LEAST_DENSITY = 1e-9  # [1/sr] differences of smaller densities are relative to it
FEWEST = 5.0  # expected directions of a bin; bins with fewer are one
ROUNDED = 2e-6  # by which float32 moves a direction, which may then lie in the next cell of a sampler


@dataclass(frozen=True)
class Case:
    """A plugin, f_r [1/sr] of the library at wavelengths or in linear sRGB, and the density of its samples."""

    name: str
    document: dict[str, Any]
    f_r: Callable[[Array, Array, Array], Array]  # (N, L) of wi, wr and wavelengths (L,) [nm]
    srgb: Callable[[Array, Array], Array]  # (N, 3)
    density: Callable[[Array, Array, Any], Array]  # (N,), in a variant
    table: Table | None = None

    def pairs(self, mitsuba: Any) -> tuple[Array, Array]:
        """Return vectors of float32 of lights and viewers: 500 or more, and fewer of them in scalar variants."""
        chosen = [_special(), *([] if self.table is None else [_at_nodes(self.table)])]
        count = sum(len(wi) for wi, _ in chosen)
        chosen.append(directions(max(PAIRS - count, 100)))
        wi, wr = (np.concatenate(part) for part in zip(*chosen, strict=True))
        if mitsuba.variant().startswith("scalar"):
            rows = np.linspace(0, len(wi) - 1, PAIRS_ONE_BY_ONE).astype(int)
            return wi[rows], wr[rows]
        return wi, wr

    def wavelengths_nm(self, mitsuba: Any) -> Array:
        """Return the wavelengths of the channels; those of spectral variants are the ends as float32, and near them."""
        if not mitsuba.is_spectral:
            return np.array([MONO_NM] if mitsuba.is_monochromatic else RGB_NM)
        stored = None if self.table is None else self.table.wavelength_nm
        low, high = np.float32((420.0, 680.0) if stored is None else stored[[0, -1]])
        return np.array([low, np.nextafter(high, low), 0.3 * low + 0.7 * high, high], dtype=np.float32)

    @functools.cached_property
    def _bins(self) -> dict[tuple[float, ...], Array]:
        return {}

    def in_bins(self, mitsuba: Any) -> Array:
        """Return the share [1] of samples for `LIGHT` in bins of the height and the azimuth of the viewer."""
        key = tuple(self.wavelengths_nm(mitsuba).tolist())
        if key not in self._bins:
            z = (np.arange(THETA_BINS * FINE) + 0.5) / (THETA_BINS * FINE)
            phi = (np.arange(PHI_BINS * FINE) + 0.5) * (2.0 * np.pi / (PHI_BINS * FINE))
            viewers = unit_vector(np.arccos(z)[:, np.newaxis], phi).reshape(-1, 3)
            density = self.density(np.broadcast_to(LIGHT.astype(np.float64), viewers.shape), viewers, mitsuba)
            means = density.reshape(THETA_BINS, FINE, PHI_BINS, FINE).mean(axis=(1, 3))
            self._bins[key] = means.ravel() * (2.0 * np.pi / (THETA_BINS * PHI_BINS))
        return self._bins[key]

    def expected(self, mitsuba: Any, wi: Array, wr: Array) -> Array:
        """Return f_r [1/sr] in the channels of a variant, shape (N, channels)."""
        wi, wr = wi.astype(np.float64), wr.astype(np.float64)
        if mitsuba.is_rgb:
            return np.maximum(self.srgb(wi, wr), 0.0)
        return self.f_r(wi, wr, self.wavelengths_nm(mitsuba).astype(np.float64))


class Measured(NamedTuple):
    """Relative errors of a plugin in a variant, and the probability of its samples in a chi-square test."""

    pairs: int
    value: float
    density: float
    weight: float
    p_value: float


def of_model(subject: Subject) -> Case:
    """Return the case of a model that has the same f_r at all wavelengths, or whose plugin has a single one."""

    def f_r(wi: Array, wr: Array, nm: Array) -> Array:
        return np.repeat(subject.f_r(wi, wr)[:, np.newaxis], nm.size, axis=1)

    def density(wi: Array, wr: Array, _: Any) -> Array:
        return np.asarray(pdf(subject.model, wi, wr, **subject.arguments))

    return Case(str(subject), subject.document, f_r, lambda wi, wr: f_r(wi, wr, np.zeros(3)), density)


def of_gold() -> Case:
    """Return the case of He-Torrance with n and k of gold as spectra."""
    stored = np.arange(380.0, 781.0, 10.0)
    indices = dict(zip(("n", "k"), refractive_index("main/Au/Johnson", stored), strict=True))
    surface = {name: float(np.float32(value)) for name, value in (("sigma_0_um", 0.3), ("tau_um", 1.5), ("a", 0.05))}
    spectra = {
        name: {"type": "spectrum", "value": [(float(nm), float(x)) for nm, x in zip(stored, values, strict=True)]}
        for name, values in indices.items()
    }

    def at(nm: float) -> dict[str, float]:
        return {"wavelength_nm": nm, **{name: float(np.interp(nm, stored, x)) for name, x in indices.items()}}

    def f_r(wi: Array, wr: Array, nm: Array) -> Array:
        vectors = MODELS["he_torrance"].vectors
        return np.stack([vectors(wi, wr, **surface, **at(float(each))) for each in nm], axis=-1)

    def density(wi: Array, wr: Array, mitsuba: Any) -> Array:
        # Of all channels: the widest lobe, with the mean of the light that is scattered
        nm = case.wavelengths_nm(mitsuba)
        lobes = [lobe_of(MODELS["he_torrance"], wi, {**surface, **at(float(each))}) for each in nm]
        a = surface["a"]
        scattered = np.mean([lobe.share * a / (0.9 - lobe.share) for lobe in lobes], axis=0)
        alpha = np.max([lobe.alpha_x for lobe in lobes], axis=0)
        return np.asarray(mixture_density(Lobe(0.9 * scattered / (scattered + a), alpha, alpha), wi, wr))

    def srgb(wi: Array, wr: Array) -> Array:
        return np.asarray(linear_srgb(PICTURE_NM, f_r(wi, wr, PICTURE_NM)))

    case = Case("he_torrance-gold", {"type": "brdfdb_he_torrance", **surface, **spectra}, f_r, srgb, density)
    return case


def of_table(name: str, table: Table, **options: float) -> Case:
    """Return the case of a table; `options` are properties of the plugin."""
    single, stored = options.get("wavelength_nm"), table.wavelength_nm

    def f_r(wi: Array, wr: Array, nm: Array) -> Array:
        if stored is None:
            return np.repeat(table.lookup_vectors(wi, wr)[:, np.newaxis], nm.size, axis=1)
        at = np.full(nm.size, single) if single else np.clip(nm, stored[0], stored[-1])
        return np.asarray(table.lookup_vectors(wi, wr, at))

    def srgb(wi: Array, wr: Array) -> Array:
        if single:
            return f_r(wi, wr, np.zeros(3))
        return channels_of(table, "rgb").values(table, wi, wr)

    document = {"type": "brdfdb_table", "material": name, **options}
    return Case(f"table-{name}", document, f_r, srgb, lambda wi, wr, _: np.asarray(table.pdf(wi, wr)), table)


@functools.cache
def factored() -> Table:
    """Copper whose wavelengths share a few spectra; the first and the last wavelength are no numbers of float32."""
    layout = plan(presets()["scene-copper-sphere"], np.linspace(400.1, 700.3, 16), 0.1)
    dataset = tabulate(layout)
    arrays = {str(name): np.asarray(variable.values) for name, variable in dataset.variables.items()}
    assert "spectra" in arrays
    return table_from("factored", "r000001", arrays, dataset.attrs)


def black() -> Table:
    """Return a table whose f_r is 0, as that of a mirror: its samples are even over half vectors."""
    grid = made_up("isotropic").grid
    return Table("black", "r000001", {}, grid, None, np.zeros(grid.shape, np.float32), None)


# A surface of each model, rough if there are two; a table of each kind
MODELS_JUDGED = {subject.model: subject for subject in SUBJECTS}
CASES: dict[str, Callable[[], Case]] = {
    **{model: functools.partial(of_model, subject) for model, subject in MODELS_JUDGED.items()},
    "he_torrance-gold": of_gold,
    "table-grey": lambda: of_table("grey", small_table(GREY)),
    "table-anisotropic": lambda: of_table("anisotropic", small_table(ANISOTROPIC)),
    "table-diffuse": lambda: of_table("diffuse", small_table(DIFFUSE)),
    "table-spectral": lambda: of_table("spectral", small_table(SPECTRAL)),
    "table-black": lambda: of_table("black", black()),
    "table-factored": lambda: of_table("factored", factored()),
    "table-mixture": lambda: of_table("mixture", painted()),
    "table-four-axes": lambda: of_table("four-axes", made_up("anisotropic")),
    "table-polarised": lambda: of_table("polarised", plastic(), wavelength_nm=550.0),
}


@functools.cache
def case_of(name: str) -> Case:
    """Return one of `CASES`. Its table is made once."""
    return CASES[name]()


def tabulated(name: str, _: str | None = None) -> Table:
    """Return the table of a case, in place of one in a store."""
    table = case_of(f"table-{name}").table
    assert table is not None
    return table


def measure(mitsuba: Any, case: Case) -> Measured:
    """Return what a plugin is off by in the variant of Mitsuba that is set."""
    surface = mitsuba.load_dict(case.document)
    wi, wr = case.pairs(mitsuba)
    nm = case.wavelengths_nm(mitsuba)
    value, density = results_of(mitsuba, nm, surface.eval_pdf, wi, wr)
    expected = case.expected(mitsuba, wi, wr)
    above = (wi[:, 2] > 0.0) & (wr[:, 2] > 0.0)
    assert np.all(value[~above] == 0.0)
    assert np.all(density[~above] == 0.0)
    value, expected = value[above] / wr[above, 2:], expected[above]
    by = np.max(np.abs(value - expected) / np.maximum(expected, _floor(case, wi[above], wr[above])[:, np.newaxis]))
    wi, wr, density = wi[above], wr[above], density[above, 0]
    low, high = _densities(case, mitsuba, wi, wr)
    off = np.maximum(np.maximum(low - density, density - high), 0.0) / np.maximum(high, LEAST_DENSITY)

    rng = np.random.default_rng(41)
    count = DRAWN_ONE_BY_ONE if mitsuba.variant().startswith("scalar") else DRAWN
    u = rng.random((count, 3)).astype(np.float32)
    lights = np.tile(LIGHT, (count, 1))

    def drawn(ctx: Any, si: Any, choice: Any) -> tuple[Any, ...]:
        record, weight = surface.sample(ctx, si, choice.x, mitsuba.Point2f(choice.y, choice.z))
        again, at = surface.eval_pdf(ctx, si, record.wo)
        return weight, record.pdf, record.wo, again, at

    weight, of_sample, wo, again, at = results_of(mitsuba, nm, drawn, lights, u)
    accepted = of_sample[:, 0] > 0.0
    assert np.all(np.isfinite(weight))
    assert np.all(weight[~accepted] == 0.0)
    known = np.maximum(again[accepted], 1e-6)
    wrong = np.abs(weight * of_sample - again)[accepted] / known
    assert np.max(np.abs(at - of_sample)[accepted] / of_sample[accepted]) <= 1e-3
    return Measured(
        len(above), float(by), float(off.max()), float(wrong.max()), _p_value(case, mitsuba, wo[accepted], count)
    )


def _floor(case: Case, wi: Array, wr: Array) -> Array:
    """Return the values [1/sr] below which differences are relative to them: sums of numbers cancel there.

    A table may hold f_r times a power of both cosines.
    """
    if case.table is not None:
        power = case.table.interpolation.power
        return np.asarray(5e-3 * (wi[:, 2].astype(np.float64) * wr[:, 2]) ** -power)
    return np.full(len(wi), 5e-3 if case.name.startswith(("oren_nayar-", "ross_li")) else 1e-9)


def _special() -> tuple[Array, Array]:
    """Return pairs at the normal, back to the light, in the mirror direction, and at the horizon."""
    theta = np.deg2rad([0.0, 1e-5, 0.01, 1.0, 20.0, 45.0, 60.0, 80.0, 89.0, 89.99])
    light = unit_vector(theta, 0.7)
    mirrored, other = light * (-1.0, -1.0, 1.0), np.tile(unit_vector(0.6, 2.0), (theta.size, 1))
    wi, wr = np.concatenate([light, light, light]), np.concatenate([light, mirrored, other])
    # cos(pi / 2) of float64 with its neighbours of float32, the horizon itself, and below
    z = np.float32(np.cos(np.pi / 2.0))
    heights = np.array([np.nextafter(z, 0.0), z, np.nextafter(z, 1.0), 1e-7, 1e-3, 0.0, -1e-7, -0.5], np.float32)
    low = np.stack([np.cos(0.7) * np.sqrt(1.0 - heights**2), np.sin(0.7) * np.sqrt(1.0 - heights**2), heights], axis=1)
    upper = np.tile(unit_vector(0.6, 2.0), (heights.size, 1))
    wi, wr = (np.concatenate(part) for part in ((wi, low, upper, low), (wr, upper, low, low * (-1.0, 1.0, 1.0))))
    return wi.astype(np.float32), wr.astype(np.float32)


def _at_nodes(table: Table) -> tuple[Array, Array]:
    """Return pairs at all nodes of each axis as float32, with the numbers next to them, and at those of the sampler."""
    names, axes = table.grid.names, list(table.axes_deg.values())
    angles = []
    for number, nodes in enumerate(axes):
        # The others lie between nodes
        at = [np.array([0.4 * other[1] + 0.6 * other[0]]) for other in axes]
        at[number] = np.rad2deg(_with_neighbours(np.deg2rad(nodes)))
        angles.append(
            [np.broadcast_to(x, [len(at[k]) for k in range(len(at))]).ravel() for x in directions_of_nodes(names, at)]
        )
    theta_i, phi_i, theta_r, phi_r = np.concatenate(angles, axis=1)
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    cells = table.sampler.cells
    lights = unit_vector(_with_neighbours(cells.theta_i), 0.3)
    versine = _with_neighbours(cells.edges[1:-1:4])
    sin = np.sqrt(versine * (2.0 - versine))
    h = np.stack([sin * np.cos(1.0), sin * np.sin(1.0), 1.0 - versine], axis=1)
    light = LIGHT.astype(np.float64)
    mirrored = 2.0 * (h @ light)[:, np.newaxis] * h - light
    wi = np.concatenate([wi, lights, np.tile(light, (len(h), 1))])
    wr = np.concatenate([wr, np.tile(unit_vector(0.5, 2.5), (len(lights), 1)), mirrored])
    above = (wi[:, 2] > 0.0) & (wr[:, 2] > 0.0)
    return wi[above].astype(np.float32), wr[above].astype(np.float32)


def _with_neighbours(nodes: Array) -> Array:
    """Return numbers as float32, and the numbers of float32 on both sides."""
    rounded = nodes.astype(np.float32)
    beside = (np.nextafter(rounded, np.float32(end)) for end in (-1.0, 9.0))
    numbers = np.concatenate([rounded, *beside])
    # Processors take numbers below the normal ones for 0
    return np.where(np.abs(numbers) < np.finfo(np.float32).tiny, 0.0, numbers.astype(np.float64))


def _densities(case: Case, mitsuba: Any, wi: Array, wr: Array) -> tuple[Array, Array]:
    """Return the least and the largest density of the library around directions that float32 has rounded."""
    wi, wr = wi.astype(np.float64), wr.astype(np.float64)
    moves = np.concatenate([np.zeros((1, 6)), ROUNDED * np.eye(6), -ROUNDED * np.eye(6)])
    around = []
    for move in moves if case.table is not None else moves[:1]:
        i, r = ((w + x) / np.linalg.norm(w + x, axis=1, keepdims=True) for w, x in ((wi, move[:3]), (wr, move[3:])))
        around.append(case.density(i, r, mitsuba))
    return np.min(around, axis=0), np.max(around, axis=0)


def _p_value(case: Case, mitsuba: Any, wo: Array, count: int) -> float:
    """Return the probability of numbers of directions in bins that are as far from those expected as these, or more."""
    expected = case.in_bins(mitsuba) * count
    row = np.clip((wo[:, 2] * THETA_BINS).astype(int), 0, THETA_BINS - 1)
    column = ((np.arctan2(wo[:, 1], wo[:, 0]) / (2.0 * np.pi)) % 1.0 * PHI_BINS).astype(int) % PHI_BINS
    found = np.bincount(row * PHI_BINS + column, minlength=expected.size).astype(float)
    if count < DRAWN:
        blocks = (THETA_BINS // JOINED, JOINED, PHI_BINS // JOINED, JOINED)
        expected, found = (x.reshape(blocks).sum(axis=(1, 3)).ravel() for x in (expected, found))
    rare = expected < FEWEST
    # Directions below the horizon have no bin; their number is left over
    expected, found = (np.append(x[~rare], [x[rare].sum(), count - x.sum()]) for x in (expected, found))
    enough = expected >= FEWEST
    statistic = np.sum((found - expected)[enough] ** 2 / expected[enough])
    return float(stats.chi2.sf(statistic, np.count_nonzero(enough) - 1))


def results_of(mitsuba: Any, nm: Array, function: Callable[..., Any], wi: Array, other: Array) -> list[Array]:
    """Return numbers (N, channels) of the results of a function of a context, a place with a light, and a vector."""
    return (_one_by_one if mitsuba.variant().startswith("scalar") else _at_once)(mitsuba, nm, function, wi, other)


def _at_once(mitsuba: Any, nm: Array, function: Callable[..., Any], wi: Array, other: Array) -> list[Array]:
    import drjit

    place = interaction(mitsuba, wi)
    if mitsuba.is_spectral:
        place.wavelengths = nm.tolist()
    results = function(smooth(mitsuba), place, vectors(mitsuba, other))
    drjit.eval(results)
    return [np.stack([np.broadcast_to(x, len(wi)) for x in _channels(mitsuba, result)], axis=-1) for result in results]


def _one_by_one(mitsuba: Any, nm: Array, function: Callable[..., Any], wi: Array, other: Array) -> list[Array]:
    place, context, rows = mitsuba.SurfaceInteraction3f(), smooth(mitsuba), []
    if mitsuba.is_spectral:
        place.wavelengths = nm.tolist()
    for light, vector in zip(wi.tolist(), other.tolist(), strict=True):
        place.wi = mitsuba.Vector3f(light)
        rows.append(
            [np.ravel(_channels(mitsuba, result)) for result in function(context, place, mitsuba.Vector3f(vector))]
        )
    return [np.stack(column) for column in zip(*rows, strict=True)]


def _channels(mitsuba: Any, result: Any) -> list[Any]:
    """Return numbers of a density, of a vector, or of the channels of a spectrum: the intensity if it is a matrix."""
    if isinstance(result, float):
        return [result]
    if mitsuba.is_polarized and isinstance(result, mitsuba.Spectrum):
        result = result[0, 0]
    return [result] if type(result) is mitsuba.Float else [np.array(x) for x in result]


def main(variants: list[str]) -> None:
    import mitsuba

    import brdfdb.mitsuba.table

    brdfdb.mitsuba.table.loaded = tabulated
    print("variant                       plugin                          pairs   value  density   weight  p of chi2")
    for variant in variants or mitsuba.variants():
        mitsuba.set_variant(variant)
        for name in CASES:
            m = measure(mitsuba, case_of(name))
            print(
                f"{variant:29} {name:30} {m.pairs:6} {m.value:8.1e} {m.density:8.1e} {m.weight:8.1e} {m.p_value:8.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
