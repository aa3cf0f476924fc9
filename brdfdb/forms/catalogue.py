"""Every form in which the project has a material: models, approximations, printed forms and tables, as one type."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import models
from brdfdb.materials import Material
from brdfdb.materials.provenance import Number
from brdfdb.models._he_torrance_kernels import CORRECTED_LIMIT, LIMIT
from brdfdb.models._he_torrance_series import CONSTANTS_BYTES
from brdfdb.models._oren_nayar_facets import NODES
from brdfdb.models.he_torrance_1991 import with_sum
from brdfdb.models.oren_nayar_1994_surfaces import PartName, gaussian_part, gaussian_rung, single_slope_mean
from brdfdb.parameters import Floats
from brdfdb.store.family import Family
from brdfdb.tables import tabulation
from brdfdb.tables.grids import (
    ANISOTROPIC_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
    HALF_DIFFERENCE_AXES,
    ISOTROPIC_AXES,
    Grid,
)
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import POLE_END_DEG

Kind = Literal["exact", "quadrature", "closed form", "approximation", "customary", "printed", "other model", "table"]
Evaluate = Callable[[Floats, Floats], Floats]

TOLERANCES = (0.1, 0.01, 0.001)
SPECTRAL_TOLERANCES = (0.1, 0.01)  # a finer one takes ten seconds to plan
# Rungs of the ladder below the truth: nodes of the quadrature of facets, of 16; and shares of the distance from its
# peak up to which the sum of eq. 78 is taken, of which the number of its terms is the square
_NODES = (8, 6, 4, 3, 2)
_REACHES = (0.7, 0.5, 0.4, 0.3)
_TERMS = 10  # that are customary in the sum of eq. 78
_SLOPES = 24  # of eq. 25 over the closed forms: 2000 change the mean of f_r by 3e-5 and no value by more than 1e-3
_WIDEST = 6.0  # standard deviations of the slope that are integrated over
_UNFACTORED = 0.01  # the tolerance of the table that is shown with and without parts


@dataclass(frozen=True, eq=False)
class Representation:
    """One way to get f_r of a material at some wavelengths.

    Attributes
    ----------
    key : str
        Unique among those of a material: lower-case words joined by hyphens.
    title : str
        What it is, with the equation.
    kind : str
        "exact"; "quadrature", the truth by a coarser integral or sum; "closed form"; "approximation"; "customary",
        usual in programs and printed by no paper; "printed" by a paper, where the models of this library hold another
        form; "other model", of the same parameters and meant to differ; or "table".
    python : str
        What it is called in Python.
    evaluate : callable
        ``evaluate(wi, wr)``: f_r [1/sr], shape (N, L), of unit vectors of shape (N, 3) and of the dtype below. The
        Dirac part of He-Torrance is no part of it: it is the same for all.
    bytes : int
        Of the numbers that an evaluation reads: parameters, spectra, and constants that kernels look up, or the nodes
        of a table. Memory that it writes first is not counted.
    dtype : float32 or float64
        Of the vectors to give it, and of the values.
    rounded : bool
        Whether it is another form but for float32 in and out: as much work, and rounding for an error.
    layout : Layout or None
        Of a table that was tabulated here: what it takes to do so again.
    copied : callable or None
        Of a table: gives an evaluation that reads a copy of its numbers, as another table of this size would.
    """

    key: str
    title: str
    kind: Kind
    python: str
    evaluate: Evaluate
    bytes: int
    dtype: type[np.floating[Any]] = np.float64
    rounded: bool = False
    layout: Layout | None = None
    copied: Callable[[], Evaluate] | None = None


def representations(
    material: Material, wavelength_nm: ArrayLike | None, tolerances: Sequence[float] | None = None
) -> list[Representation]:
    """Every representation of a material that the project has; the first one is the truth.

    Parameters
    ----------
    material : Material
        Of any model.
    wavelength_nm : array_like of shape (L,) [nm], or None
        For spectral materials, and only for them.
    tolerances : sequence of float, optional
        Of planned tables, each in [1e-4, 0.5]; by default 0.1, 0.01 and, of a grey material, 0.001.
        None at all: no tables.

    Returns
    -------
    list of Representation
        The truth is the highest rung that there is: for Oren-Nayar the facets, integrated (`oren_nayar_gaussian`), for
        Ward eq. 5a, for He-Torrance the sum of eq. 78, and for all others the model itself. Its rungs follow it, by
        fewer nodes or terms: the ladder that an approximation is compared with. Tables hold the truth
        where a model of this library is the truth; they are planned for the material's own model, which is as smooth.

    Raises
    ------
    ValueError
        If a tolerance is outside its range or takes too many values, or the wavelengths do not suit the material.
    """
    if tolerances is None:
        tolerances = SPECTRAL_TOLERANCES if material.spectral else TOLERANCES
    at = None if wavelength_nm is None else np.atleast_1d(np.asarray(wavelength_nm, dtype=np.float64))
    forms = _FORMS.get(material.model, _of_itself)(material, at)
    tables = _tables(material, _tabulated(material), at, tolerances) if tolerances else ()
    return [*forms, *tables]


def _of_itself(
    material: Material,
    wavelength_nm: NDArray[np.float64] | None,
    key: str = "model",
    title: str = "",
    kind: Kind = "exact",
) -> Iterator[Representation]:
    """The model of a material, and the same with float32 in and out: its arithmetic is float64 all the same."""
    title = title or f"{material.spec.title}, {material.spec.equation}"
    size = _bytes(material.arguments(wavelength_nm))
    double = Representation(key, title, kind, f"models.{material.model}", material.brdf_at(wavelength_nm), size)
    yield from (double, _single(double))


def _single(form: Representation) -> Representation:
    """A form with float32 in and out."""
    return replace(
        form,
        key=f"{form.key}-float32",
        title=f"{form.title}, float32 in and out",
        python=f"{form.python}, float32 vectors",
        dtype=np.float32,
        rounded=True,
    )


def _bytes(arguments: dict[str, Any]) -> int:
    return 8 * sum(np.size(each) for each in arguments.values())


def _as(material: Material, model: str, **parameters: Number) -> Material:
    """A material of another model, from the same sources; what is said of parameters that it lacks is left out."""
    stated = {
        "sources": {name: source for name, source in material.sources.items() if name in parameters},
        "assumed": {name: each for name, each in material.assumed.items() if name in parameters},
        "known_excess": None,  # of the other model
    }
    return material.model_copy(update={"model": model, "parameters": parameters, **stated})


# Oren and Nayar 1994


def _oren_nayar(material: Material, _: NDArray[np.float64] | None) -> Iterator[Representation]:
    values = material.parameters
    own = {"rho": float(values["rho"]), "sigma": float(values["sigma"])}
    bounces = bool(values.get("interreflection", True))

    def form(
        key: str, title: str, kind: Kind, python: str, body: Callable[..., Floats], constants: int = 0, **more: Any
    ) -> Representation:
        def evaluate(wi: Floats, wr: Floats) -> Floats:
            f_r = body(wi, wr, **own, **more)
            if "k_s" in values:  # Eq. (32)
                surface = models.torrance_sparrow_vectors(wi, wr, sigma=own["sigma"])
                f_r = values["k_b"] * f_r + values["k_s"] / values["e_0"] * surface
            return f_r[:, np.newaxis]

        return Representation(key, title, kind, f"models.{python}", evaluate, 8 * (2 + len(more) + constants))

    for nodes in (NODES, *_NODES):
        finest = nodes == NODES
        facets = form(
            "facets" if finest else f"facets-{nodes}",
            "facets integrated, eqs 8-20 and 47" if finest else f"facets, {nodes} nodes of {NODES}",
            "exact" if finest else "quadrature",
            "oren_nayar_gaussian" if finest else "oren_nayar_1994_surfaces.gaussian_rung",
            functools.partial(gaussian_rung, nodes=nodes, bounce=bounces),
            2 * (NODES if finest else NODES + nodes),
        )
        yield facets
        if finest:
            yield _single(facets)
    averaged = "oren_nayar_1994_surfaces.single_slope_mean"
    closed = functools.partial(_over_slopes, bounce=bounces)
    equations = "eqs 45 and 49" if bounces else "eq. 45"
    yield form("closed-forms", f"closed forms of B.2, {equations}", "closed form", averaged, closed, 3 * _SLOPES)
    if bounces:
        both = 3 * _SLOPES + 2 * NODES
        own_bounce = _mixed("direct", functools.partial(_over_slopes, lit=False))
        yield form("bounce-49", "facets, but eq. 49 for the bounce", "printed", averaged, own_bounce, both)
        own_direct = _mixed("interreflected", functools.partial(_over_slopes, bounce=False))
        yield form("direct-45", "facets, but eq. 45 for direct light", "closed form", averaged, own_direct, both)
    fit = models.oren_nayar_vectors
    whole = form("fit", "functional fit, eqs 27-29", "approximation", "oren_nayar", fit, interreflection=bounces)
    yield from (whole, _single(whole))
    if bounces:
        yield form(
            "fit-direct", "fit without bounce, eq. 27", "approximation", "oren_nayar", fit, interreflection=False
        )
    rough = models.oren_nayar_qualitative_vectors
    yield form("qualitative", "qualitative, eq. 30", "approximation", "oren_nayar_qualitative", rough, offset=0.33)
    yield form(
        "qualitative-057", "qualitative, 0.57 (note 7)", "approximation", "oren_nayar_qualitative", rough, offset=0.57
    )
    if own["sigma"] <= 1.0:
        yield form("fujii", "Fujii's form", "approximation", "oren_nayar_fujii", models.oren_nayar_fujii_vectors)

        def eon(wi: Floats, wr: Floats, *, rho: float, sigma: float) -> Floats:
            return models.oren_nayar_energy_preserving_vectors(wi, wr, rho=rho, roughness=sigma)

        yield form("eon", "energy preserving (EON)", "other model", "oren_nayar_energy_preserving", eon)

    yield form("lambert", "Lambert, no roughness", "approximation", "lambert", _smooth)


def _smooth(wi: Floats, wr: Floats, *, rho: float, **_: float) -> Floats:
    return models.lambert_vectors(wi, wr, rho=rho)


def _mixed(facets: PartName, other: Callable[..., Floats]) -> Callable[..., Floats]:
    """One part of the facets, and the other one by a form of its own."""

    def evaluate(wi: Floats, wr: Floats, **own: float) -> Floats:
        return gaussian_part(wi, wr, **own, part=facets) + other(wi, wr, **own)

    return evaluate


def _over_slopes(wi: Floats, wr: Floats, *, rho: float, sigma: float, lit: bool = True, bounce: bool = True) -> Floats:
    """The closed forms of appendix B.2, eqs 45 and 49, averaged over slopes with the weights of eqs 25 and 26."""
    theta_a, weight = _slopes(sigma)
    return single_slope_mean(wi, wr, rho=rho, theta_a=theta_a, weight=weight, lit=lit, bounce=bounce)


@functools.cache
def _slopes(sigma: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return slopes [rad] and their weights [1], which add up to 1."""
    x, w = np.polynomial.legendre.leggauss(_SLOPES)
    deviation = max(sigma, 1e-9)  # a flat surface: all slopes are 0
    theta_a = (x + 1.0) * min(np.pi / 2, _WIDEST * deviation) / 2.0
    weight = w * np.exp(-(theta_a**2) / (2.0 * deviation**2)) * np.sin(theta_a)
    return theta_a, weight / weight.sum()


# Ward 1992


def _ward(material: Material, _: NDArray[np.float64] | None) -> Iterator[Representation]:
    own = {name: float(value) for name, value in material.parameters.items()}
    yield from _of_itself(_as(material, "ward", **own), None, "elliptical", "elliptical Gaussian, eq. 5a")
    half = _as(material, "ward_half_vector", **own)
    yield from _of_itself(half, None, "half-vector", "half vectors, eq. 5b", "approximation")
    if own["alpha_x"] != own["alpha_y"]:
        alpha = float(np.sqrt(own["alpha_x"] * own["alpha_y"]))
        round_lobe = _as(material, "ward", **own | {"alpha_x": alpha, "alpha_y": alpha})
        yield next(_of_itself(round_lobe, None, "isotropic", "round lobe as large, eq. 4", "approximation"))
    for key, title in (("ward_duer", "normalised by Duer"), ("ward_bounded", "bounded albedo, 2010")):
        other = _as(material, key, **own)
        yield next(_of_itself(other, None, key.replace("_", "-"), title, "other model"))
    albedo = own["rho_d"] + own["rho_s"]
    flat = _as(material, "lambert", rho=min(albedo, 1.0))
    yield next(_of_itself(flat, None, "lambert", "Lambert, rho_d + rho_s", "approximation"))


# He, Torrance, Sillion and Greenberg 1991


def _he_torrance(material: Material, wavelength_nm: NDArray[np.float64] | None) -> Iterator[Representation]:
    double, single = _of_itself(material, wavelength_nm, "sum", "the sum of eq. 78, whole")
    size = double.bytes
    if material.parameters["sigma_0_um"] == 0.0:  # a mirror has no sum to shorten
        yield from (double, single)
        return
    yield from (replace(each, bytes=size + CONSTANTS_BYTES) for each in (double, single))

    def form(
        key: str, title: str, kind: Kind, python: str, vectors: Callable[..., Floats], more: int
    ) -> Representation:
        return Representation(key, title, kind, python, material.brdf_at(wavelength_nm, vectors), size + more)

    python = "models.he_torrance_1991.with_sum"
    for reach in _REACHES:
        vectors = functools.partial(with_sum, reach=reach)
        title = f"the sum of eq. 78, {round(100.0 * reach**2)} % of its terms"
        yield form(f"sum-{round(100.0 * reach**2)}", title, "quadrature", python, vectors, CONSTANTS_BYTES)
    ten = functools.partial(with_sum, series=_TERMS)
    yield form("ten-terms", "ten terms of eq. 78", "customary", python, ten, 0)
    corrected = functools.partial(with_sum, series=CORRECTED_LIMIT)
    yield form("beckmann-corrected", "Beckmann, first order in 1/g", "approximation", python, corrected, 0)
    limit = functools.partial(with_sum, series=LIMIT)
    yield form("beckmann", "Beckmann's limit, g to infinity", "customary", python, limit, 0)


_FORMS: dict[str, Callable[[Material, NDArray[np.float64] | None], Iterator[Representation]]] = {
    "oren_nayar": _oren_nayar,
    "oren_nayar_qualitative": _oren_nayar,
    "oren_nayar_gaussian": _oren_nayar,
    "oren_nayar_body_surface": _oren_nayar,
    "ward": _ward,
    "ward_half_vector": _ward,
    "he_torrance": _he_torrance,
}


# Tables

_FITTED = ("oren_nayar", "oren_nayar_body_surface")  # models of which a table does not hold the truth


def _tabulated(material: Material) -> Material:
    """What tables of a material are to hold: the truth, if one model of the library is."""
    values = material.parameters
    if material.model in ("oren_nayar", "oren_nayar_qualitative") and values.get("interreflection", True):
        return _as(material, "oren_nayar_gaussian", rho=values["rho"], sigma=values["sigma"])
    if material.model == "ward_half_vector":
        return _as(material, "ward", **values)
    return material


def _tables(
    planned: Material, material: Material, wavelength_nm: NDArray[np.float64] | None, tolerances: Sequence[float]
) -> Iterator[Representation]:
    """Planned tables, one of them without its parts, too, and the two grids that anybody would begin with."""
    table = "table of the fit" if material.model in _FITTED else "table"
    for tolerance in dict.fromkeys(tolerances):
        percent = f"{100.0 * tolerance:g}"
        key = f"table-{percent.replace('.', '-')}"
        layout = replace(plan(planned, wavelength_nm, tolerance), source=material)
        yield _table(layout, key, f"{table}, planned for {percent} %")
        if layout.spectra is not None and tolerance == _UNFACTORED:
            yield _table(replace(layout, spectra=None), f"{key}-unfactored", f"the {percent} % table, spectra whole")
    for halves, key, title in (
        (False, "table-even", "even angles"),
        (True, "table-halves", "half vectors"),
    ):
        layout = Layout(material, _plain_grid(material, halves=halves), wavelength_nm)
        yield _table(layout, key, f"{table}, {title}, linear")


def _table(layout: Layout, key: str, title: str) -> Representation:
    values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
    return replace(of_table(Table.of(layout, values), key, title), layout=layout)


def of_family(family: Family) -> Representation:
    """Lookups in the middle of a family: between the two middle values of each parameter."""
    at: dict[str, Any] = {}
    for name, nodes in family.axes.items():
        cell = (nodes.size - 2) // 2
        at[name] = float(nodes[cell : cell + 2].mean())
    tables = family.around(**at)
    count = 1 if family.wavelength_nm is None else family.wavelength_nm.size

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        found: Floats = family.lookup_vectors(wi, wr, **at)
        return found.reshape(len(wi), count)

    size = sum(of_table(table, "", "").bytes for table in tables)
    return Representation("between", "between members", "table", "Family.lookup_vectors", evaluate, size)


def of_table(table: Table, key: str, title: str) -> Representation:
    """A table that is in memory, at its own wavelengths."""
    count = 1 if table.wavelength_nm is None else table.wavelength_nm.size

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        return table.lookup_vectors(wi, wr).reshape(len(wi), count)

    def copied() -> Evaluate:
        return of_table(replace(table, values=table.values.copy()), key, title).evaluate

    arrays = (table.values, *table.axes_deg.values(), table.spectra, table.uniform)
    size = sum(each.nbytes for each in arrays if each is not None)
    return Representation(key, title, "table", "Table.lookup_vectors", evaluate, size, copied=copied)


def _plain_grid(material: Material, *, halves: bool) -> Grid:
    """A grid that nobody planned: every 5 degrees (10 of an anisotropic surface), or half vectors crowded at the peak.

    The half vectors are those of the MERL database: theta_h as the square of an even axis.
    """
    spec, anisotropic = material.spec, material.anisotropic
    turn = 90.0 if spec.lobe_axes is not None else 360.0
    if halves:
        theta_h = 90.0 * np.linspace(0.0, 1.0, 31) ** 2
        if anisotropic:
            nodes = theta_h, np.linspace(0.0, turn, 7), np.linspace(0.0, 90.0, 10), np.linspace(0.0, 180.0, 19)
            return Grid(dict(zip(ANISOTROPIC_HALF_DIFFERENCE_AXES, nodes, strict=True)))
        quarter = np.linspace(0.0, 90.0, 19)
        return Grid(dict(zip(HALF_DIFFERENCE_AXES, (theta_h, quarter, quarter), strict=True)))
    end = POLE_END_DEG if spec.grazing_pole else 90.0
    if anisotropic:
        theta = np.linspace(0.0, end, 10)
        nodes = theta, np.linspace(0.0, turn, round(turn / 10.0) + 1), theta, np.linspace(0.0, 360.0, 37)
        return Grid(dict(zip(ANISOTROPIC_AXES, nodes, strict=True)))
    theta = np.linspace(0.0, end, 19)
    return Grid(dict(zip(ISOTROPIC_AXES, (theta, theta, np.linspace(0.0, 180.0, 37)), strict=True)))
