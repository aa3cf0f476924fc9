"""All forms of a source as one type: models, approximations, printed forms and tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from brdfdb.errors import ParameterError
from brdfdb.figure import DocumentPart
from brdfdb.materials import Material, Source, exact_material
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats, FormKind, ModelForm, bytes_of
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
from brdfdb.tables.measured_layout import tabulated
from brdfdb.tables.planner import check_tolerance, plan
from brdfdb.tables.table import Table, TableSource
from brdfdb.tables.tabulation import POLE_END_DEG

Kind = Literal[FormKind, "table"]
Evaluate = Callable[[Floats, Floats], Floats]

TOLERANCES = (0.1, 0.01, 0.001)
SPECTRAL_TOLERANCES = (0.1, 0.01)  # tolerances of spectral tables; a finer one takes ten seconds to plan
_UNFACTORED = 0.01  # tolerance of the table that is offered with and without a factored spectrum


@dataclass(frozen=True, eq=False)
class Form:
    """One way to evaluate f_r of a source at some wavelengths.

    ``evaluate(wi, wr)`` gives f_r [1/sr] of shape (N, L) for unit vectors (N, 3) of the dtype. The specular part is
    left out, because it is the same for all forms. `bytes` is the size of the numbers that an evaluation reads:
    parameters, spectra and constants of kernels, or the values of a table; 0 for a function, whose numbers are not
    known.
    """

    key: str  # lower-case words joined by hyphens, unique among the forms of a source
    title: str  # a name for people, with the equation
    kind: Kind
    python: str  # the function in Python
    evaluate: Evaluate
    bytes: int
    dtype: type[np.floating[Any]] = np.float64  # of vectors and values
    rounded: bool = False  # True for a form that repeats another one with float32 vectors and values
    layout: Layout | None = None  # of a table that was tabulated here
    values: NDArray[np.float32] | None = None  # all values of such a table, which need not be tabulated again
    copied: Callable[[], Evaluate] | None = None  # returns an evaluation that reads a copy of the values of a table


class LeftOut(DocumentPart):
    """A form that cannot be made."""

    key: str
    title: str
    reason: str = Field(description="why it cannot be made, in a sentence")


F = TypeVar("F")


class Forms(list[F]):
    """Forms of a source, the exact form first. `left_out` names the forms that cannot be made."""

    def __init__(self, forms: Iterable[F], left_out: Iterable[LeftOut]) -> None:
        super().__init__(forms)
        self.left_out = list(left_out)


def forms(source: Source, wavelength_nm: ArrayLike | None, tolerances: Sequence[float] | None = None) -> Forms[Form]:
    """Return all forms of a source, the exact form first.

    Parameters
    ----------
    source : Source
        A material of any model, or a function.
    wavelength_nm : array_like of shape (L,) [nm], or None
        Wavelengths of a spectral source, and only of such a source.
    tolerances : sequence of float, optional
        Relative errors of planned tables, each in [1e-4, 0.5]. The default is 0.1, 0.01 and, for a grey source, 0.001.
        An empty sequence gives no tables.

    Returns
    -------
    Forms of Form
        The forms that the model of a material names (`ModelSpec.forms`), or the source itself, then tables. Coarser
        rungs follow the exact form: approximations are compared with this ladder. Tables hold the exact form if it is a
        model of the registry (`ModelSpec.exact_model`). They are planned for the model of the material, which is as
        smooth. A table that cannot be made, such as one that takes too many values, is among `left_out`.

    Raises
    ------
    ParameterError
        If a tolerance is outside its range, or the wavelengths do not suit the source.
    """
    for tolerance in tolerances or ():
        check_tolerance(tolerance)
    if tolerances is None:
        tolerances = SPECTRAL_TOLERANCES if source.spectral else TOLERANCES
    at = None if wavelength_nm is None else np.atleast_1d(np.asarray(wavelength_nm, dtype=np.float64))
    if not isinstance(source, Material):
        itself = Form("function", source.title, "exact", f"source {source.name}", source.brdf_at(at), 0)
        if isinstance(source, TableSource):  # its source cannot be evaluated
            itself = replace(itself, key="table-itself", title=f"{source.title}: the stored table itself")
        elif isinstance(source, MeasuredSource):
            itself = replace(itself, key="data", title=f"{source.title}: the data, interpolated")
        return _offered([itself], _tables(source, source, at, tolerances, "table"))
    listed = list(_of_model(source, at))
    evaluated = exact_material(source)
    title = "table" if listed[0].python == f"models.{evaluated.model}" else "table of the fit"
    return _offered(listed, _tables(source, evaluated, at, tolerances, title))


def _offered(listed: Sequence[Form], tables: Iterator[Form | LeftOut]) -> Forms[Form]:
    made = list(tables)
    return Forms(
        [*listed, *(form for form in made if isinstance(form, Form))],
        [form for form in made if isinstance(form, LeftOut)],
    )


def _of_model(material: Material, wavelength_nm: NDArray[np.float64] | None) -> Iterator[Form]:
    """Yield the forms that the model of a material names, or the model itself.

    Some are yielded a second time with float32 vectors and values. Their arithmetic is float64, too.
    """
    spec = material.spec
    arguments = material.arguments(wavelength_nm)
    itself = ModelForm(
        "model",
        f"{spec.title}, {spec.equation}",
        "exact",
        f"models.{spec.name}",
        spec.vectors,
        bytes_of(arguments),
        single=True,
        degree=spec.degree,
    )
    for form in (itself,) if spec.forms is None else spec.forms(arguments):
        evaluate = material.brdf_at(wavelength_nm, form.vectors, form.degree)
        double = Form(form.key, form.title, form.kind, form.python, evaluate, form.bytes)
        yield double
        if form.single:
            yield replace(
                double,
                key=f"{form.key}-float32",
                title=f"{form.title}, float32 in and out",
                python=f"{form.python}, float32 vectors",
                dtype=np.float32,
                rounded=True,
            )


# Tables


def _tables(
    planned: Source,
    evaluated: Source,
    wavelength_nm: NDArray[np.float64] | None,
    tolerances: Sequence[float],
    table: str,
) -> Iterator[Form | LeftOut]:
    """Yield planned tables, one of them also without a factored spectrum, and tables on two plain grids.

    They are planned for one source and hold the values of another, which is as smooth. Without tolerances there are no
    tables.
    """
    if not tolerances:
        return
    for tolerance in dict.fromkeys(tolerances):
        percent = f"{100.0 * tolerance:g}"
        key = f"table-{percent.replace('.', '-')}"
        title = f"{table}, planned for {percent} %"
        try:
            if isinstance(planned, MeasuredSource) or (
                isinstance(planned, TableSource) and planned.measured is not None
            ):
                layout, _ = tabulated(planned, wavelength_nm, tolerance)
            else:
                layout = replace(plan(planned, wavelength_nm, tolerance), source=evaluated)
        except ParameterError as error:
            yield LeftOut(key=key, title=title, reason=str(error))
            continue
        yield _table(layout, key, title)
        if layout.spectra is not None and tolerance == _UNFACTORED:
            unfactored = replace(layout, spectra=None, part_nm=None)
            yield _table(unfactored, f"{key}-unfactored", f"the {percent} % table, spectra whole")
    for halves, key, title in ((False, "table-even", "even angles"), (True, "table-halves", "half vectors")):
        layout = Layout(evaluated, _plain_grid(evaluated, halves=halves), wavelength_nm)
        yield _table(layout, key, f"{table}, {title}, linear")


def _table(layout: Layout, key: str, title: str) -> Form | LeftOut:
    try:
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
    except ParameterError as error:
        return LeftOut(key=key, title=title, reason=str(error))
    return replace(of_table(Table.of(layout, values), key, title), layout=layout, values=values)


def of_family(family: Family) -> Form:
    """Return the form that looks up a family between the two middle values of each parameter."""
    at: dict[str, Any] = {}
    for name, nodes in family.axes.items():
        cell = (nodes.size - 2) // 2
        at[name] = float(nodes[cell : cell + 2].mean())
    tables = family.around(**at)
    count = 1 if family.wavelength_nm is None else family.wavelength_nm.size

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values: Floats = family.lookup_vectors(wi, wr, **at)
        return values.reshape(len(wi), count)

    size = sum(of_table(table, "", "").bytes for table in tables)
    return Form("between", "between members", "table", "Family.lookup_vectors", evaluate, size)


def of_table(table: Table, key: str, title: str) -> Form:
    """Return the form of a table in memory, at its own wavelengths."""
    count = 1 if table.wavelength_nm is None else table.wavelength_nm.size

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        return table.lookup_vectors(wi, wr).reshape(len(wi), count)

    def copied() -> Evaluate:
        return of_table(replace(table, values=table.values.copy()), key, title).evaluate

    arrays = (table.values, *table.axes_deg.values(), table.spectra, table.uniform)
    size = sum(array.nbytes for array in arrays if array is not None)
    return Form(key, title, "table", "Table.lookup_vectors", evaluate, size, copied=copied)


def _plain_grid(source: Source, *, halves: bool) -> Grid:
    """Return a plain grid of even angles, or of half vectors crowded at the peak.

    Angles have a node every 5 degrees, or every 10 for an anisotropic source. Half vectors are those of the MERL
    database, with theta_h as the square of an even axis.
    """
    anisotropic = source.anisotropic
    turn = 90.0 if source.elliptical else 360.0
    if halves:
        theta_h = 90.0 * np.linspace(0.0, 1.0, 31) ** 2
        sides = 2 - source.reciprocal
        if anisotropic:
            nodes = (
                theta_h,
                np.linspace(0.0, turn, 7),
                np.linspace(0.0, 90.0, 10),
                np.linspace(0.0, sides * 180.0, sides * 18 + 1),
            )
            return Grid(dict(zip(ANISOTROPIC_HALF_DIFFERENCE_AXES, nodes, strict=True)))
        isotropic = theta_h, np.linspace(0.0, 90.0, 19), np.linspace(0.0, sides * 90.0, sides * 18 + 1)
        return Grid(dict(zip(HALF_DIFFERENCE_AXES, isotropic, strict=True)))
    end = POLE_END_DEG if source.grazing_pole else 90.0
    if anisotropic:
        theta = np.linspace(0.0, end, 10)
        nodes = theta, np.linspace(0.0, turn, round(turn / 10.0) + 1), theta, np.linspace(0.0, 360.0, 37)
        return Grid(dict(zip(ANISOTROPIC_AXES, nodes, strict=True)))
    theta = np.linspace(0.0, end, 19)
    return Grid(dict(zip(ISOTROPIC_AXES, (theta, theta, np.linspace(0.0, 180.0, 37)), strict=True)))
