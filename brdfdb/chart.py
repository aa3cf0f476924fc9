"""Speed against accuracy: every representation of a material, or along a family, its error, its cost, the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb import accuracy, cost
from brdfdb.family import Family, Sweep
from brdfdb.materials import Material, Number
from brdfdb.parameters import Floats
from brdfdb.representations import SPECTRAL_TOLERANCES, Kind, Representation, of_family, representations

DIRECTIONS = 1000  # of each band of theta_i
SEED = 1992
SINGLES = 101  # rounds of single evaluations, which take microseconds
TIMED = cost.ROUNDS + SINGLES  # steps of timing, as `tick` counts them
STEPS = 2 + TIMED  # of a chart

_STRICT = ConfigDict(frozen=True, extra="forbid")


class Cost(BaseModel):
    """Time of an evaluation on the machine of the chart, on one thread."""

    model_config = _STRICT

    ns: float = Field(description="median over all rounds, of a value of f_r: one direction, one wavelength")
    low: float = Field(description="lower quartile")
    high: float = Field(description="upper quartile")
    directions: int = Field(description="evaluated at once")


class Form(BaseModel):
    """A representation, and what it costs."""

    model_config = _STRICT

    key: str
    title: str
    kind: Kind
    python: str = Field(description="what it is called in Python")
    dtype: Literal["float64", "float32"]
    bytes: int = Field(description="of the numbers that an evaluation reads")
    batch: Cost
    single: Cost


class Point(Form):
    """A representation: errors are relative to the truth, at the worst wavelength."""

    l1: float = Field(description="mean of abs(f_r - truth) over that of the truth, weighted with the cosine")
    p99: float = Field(description="99th percentile of abs(f_r - truth) / max(truth, floor)")
    forward: float = Field(description="l1 of viewers within 45 degrees of the azimuth of the mirror direction")
    back: float = Field(description="l1 of viewers within 45 degrees of the azimuth of the light")
    grazing: float = Field(description="l1 where light or viewer is beyond 75 degrees")


class Fronts(BaseModel):
    """Keys of the points worth having, the most accurate (l1) first, each clearly cheaper than the one before.

    Models that are meant to differ are not among them, nor what is further off than black would be.
    """

    model_config = _STRICT

    batch: list[str]
    single: list[str]
    bytes: list[str]


class Chart(BaseModel):
    """One material."""

    model_config = _STRICT

    material: str
    title: str
    model: str
    parameters: dict[str, Number] = Field(description="angles in degrees, under names that end in _deg")
    wavelength_nm: list[float] | None
    directions: int = Field(description="that errors are measured at")
    truth: str = Field(description="key of the point that the others are compared with")
    points: list[Point]
    fronts: Fronts


class Curve(Form):
    """A representation along a family: errors as those of a point, bytes and cost those of one member."""

    timed: str = Field(description="the member: of those that have this form, the one next to the middle of the family")
    l1: list[float | None] = Field(description="of each member; null where there is no such form")
    p99: list[float | None]


class Between(Form):
    """Lookups between the members of a family in a store, timed in its middle."""

    l1: float = Field(description="as the family states it, over all its parameters")
    p99: float


class FamilyChart(BaseModel):
    """A family: which form is right where in it."""

    model_config = _STRICT

    family: str
    title: str
    model: str
    axes: dict[str, list[float]] = Field(description="values of each swept parameter, as in the record of a family")
    members: list[str] = Field(description="names of the materials; the last axis runs fastest")
    g: list[float] | None = Field(
        description="of He-Torrance, for each member: eq. 79 along the normal, at the middle wavelength"
    )
    wavelength_nm: list[float] | None
    truth: str = Field(description="key of the curve that the others are compared with")
    curves: list[Curve]
    between: Between | None = Field(description="null unless the family is in the store")
    fronts: list[list[str]] = Field(
        description="of each member, keys of the curves worth having in bulk: as of a chart, with the costs above"
    )


class Charts(BaseModel):
    """Charts of materials and families, made in one go; a file holds one of them."""

    model_config = _STRICT

    brdfdb: str
    when: datetime
    machine: str
    charts: list[Chart]
    families: list[FamilyChart]


def chart(
    material: Material,
    wavelength_nm: NDArray[np.float64] | None,
    tolerances: Sequence[float] | None = None,
    *,
    also: Sequence[Representation] = (),
    tick: Callable[[], None] = lambda: None,
) -> Chart:
    """Measure error and cost of every representation of a material.

    Parameters
    ----------
    material : Material
        Of any model.
    wavelength_nm : array of shape (L,) [nm], or None
        For spectral materials, and only for them.
    tolerances : sequence of float, optional
        Of planned tables, as `representations` takes them.
    also : sequence of Representation
        More of them, at the same wavelengths: a table of a store.
    tick : callable
        Called `STEPS` times.

    Returns
    -------
    Chart
        Errors are those that tables state, at directions of their own: see `brdfdb.accuracy`.

    Raises
    ------
    ValueError
        If a tolerance is outside its range or takes too many values, or the wavelengths do not suit the material.
    """
    forms = [*representations(material, wavelength_nm, tolerances), *also]
    tick()
    drawn = accuracy.draw(material, wavelength_nm, DIRECTIONS, SEED)
    errors = _errors(forms, drawn)
    tick()
    batch, single = _timed(forms, drawn, tick)

    def front(costs: Floats) -> list[str]:
        return _front(forms, [error["l1"] for error in errors], costs)

    return Chart(
        material=material.name,
        title=material.title,
        model=material.model,
        parameters=material.file_parameters(),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        directions=int(np.count_nonzero(drawn.above)),
        truth=forms[0].key,
        points=[
            Point(**_described(form, together, alone), **error)
            for form, error, together, alone in zip(forms, errors, batch, single, strict=True)
        ],
        fronts=Fronts(
            batch=front(np.stack([each.seconds for each in batch], axis=1)),
            single=front(np.stack([each.seconds for each in single], axis=1)),
            bytes=front(np.array([[form.bytes for form in forms]], dtype=np.float64)),
        ),
    )


def chart_family(
    sweep: Sweep,
    materials: Sequence[Material],
    wavelength_nm: NDArray[np.float64] | None,
    tolerances: Sequence[float] | None = None,
    *,
    family: Family | None = None,
    tick: Callable[[], None] = lambda: None,
) -> FamilyChart:
    """Measure the error of every representation at every member of a family, and the cost of each at one of them.

    Parameters
    ----------
    sweep : Sweep
        The family.
    materials : sequence of Material
        Its members, in order.
    wavelength_nm : array of shape (L,) [nm], or None
        For spectral materials, and only for them.
    tolerances : sequence of float, optional
        Of planned tables, as `representations` takes them; by default 0.1 and 0.01.
    family : Family, optional
        As the store has it: its lookups between members are measured, too.
    tick : callable
        Called once for each member, and `TIMED` times.

    Returns
    -------
    FamilyChart
        Errors of members as `chart` measures them.

    Raises
    ------
    ValueError
        If a tolerance is outside its range or takes too many values, or the wavelengths do not suit the materials.
    StoreError
        If a member of `family` was built anew since it was recorded.
    """
    tolerances = SPECTRAL_TOLERANCES if tolerances is None else tolerances
    middle = len(materials) // 2
    kept: dict[str, tuple[int, Representation]] = {}  # of each key the one next to the middle, which is timed
    errors: list[dict[str, dict[str, Any]]] = []
    for number, material in enumerate(materials):
        forms = representations(material, wavelength_nm, tolerances)
        drawn = accuracy.draw(material, wavelength_nm, DIRECTIONS, SEED)
        errors.append(dict(zip((form.key for form in forms), _errors(forms, drawn), strict=True)))
        for form in forms:
            if form.key not in kept or abs(number - middle) <= abs(kept[form.key][0] - middle):
                kept[form.key] = number, form
        tick()
    timed = [form for _, form in kept.values()]
    between = None if family is None else of_family(family)
    drawn = accuracy.draw(materials[middle], wavelength_nm, DIRECTIONS, SEED)
    batch, single = _timed([*timed, *([between] if between else [])], drawn, tick)
    seconds = np.stack([each.seconds for each in batch], axis=1)
    fronts = []
    for found in errors:
        here = [index for index, form in enumerate(timed) if form.key in found]
        some = [timed[index] for index in here]
        fronts.append(_front(some, [found[form.key]["l1"] for form in some], seconds[:, here]))
    return FamilyChart(
        family=sweep.name,
        title=sweep.title,
        model=sweep.model,
        axes=sweep.axes,
        members=sweep.members,
        g=_g(materials, wavelength_nm),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        truth=timed[0].key,
        curves=[
            Curve(
                **_described(form, together, alone),
                timed=sweep.members[number],
                l1=[found[form.key]["l1"] if form.key in found else None for found in errors],
                p99=[found[form.key]["p99"] if form.key in found else None for found in errors],
            )
            for (number, form), together, alone in zip(kept.values(), batch, single, strict=False)
        ],
        between=None
        if family is None or between is None
        else Between(
            **_described(between, batch[-1], single[-1]), l1=family.error.overall.l1, p99=family.error.overall.p99
        ),
        fronts=fronts,
    )


def _g(materials: Sequence[Material], wavelength_nm: NDArray[np.float64] | None) -> list[float] | None:
    """Eq. 79 of He et al. along the normal, where nothing is hidden and sigma is sigma_0; None of other models."""
    if materials[0].model != "he_torrance" or wavelength_nm is None:
        return None
    middle_um = 1e-3 * float(wavelength_nm[wavelength_nm.size // 2])
    return [float(f"{(4.0 * np.pi * m.parameters['sigma_0_um'] / middle_um) ** 2:.3g}") for m in materials]


def _timed(
    forms: Sequence[Representation], drawn: accuracy.Draw, tick: Callable[[], None]
) -> tuple[list[cost.Times], list[cost.Times]]:
    """Of many directions at once, and of one."""
    mixed = np.random.default_rng(SEED).permutation(np.flatnonzero(drawn.above))  # few of them are as mixed as all
    wi, wr = drawn.wi[mixed], drawn.wr[mixed]
    batch = cost.times(forms, wi, wr, rounds=cost.ROUNDS, tick=tick)
    return batch, cost.times(forms, wi, wr, most=1, rounds=SINGLES, tick=tick)


def _front(forms: Sequence[Representation], l1: Sequence[float], costs: Floats) -> list[str]:
    """Keys of the forms worth having, of which costs has a column each."""
    # black is free, and has an l1 of 1
    rivals = [
        index
        for index, (form, error) in enumerate(zip(forms, l1, strict=True))
        if form.kind != "other model" and error < 1.0
    ]
    return [forms[rivals[index]].key for index in cost.front([l1[index] for index in rivals], costs[:, rivals])]


def _described(form: Representation, batch: cost.Times, single: cost.Times) -> dict[str, Any]:
    """The fields of a `Form`."""
    return {
        "key": form.key,
        "title": form.title,
        "kind": form.kind,
        "python": form.python,
        "dtype": "float32" if form.dtype is np.float32 else "float64",
        "bytes": form.bytes,
        "batch": _cost(batch),
        "single": _cost(single),
    }


def _errors(forms: Sequence[Representation], drawn: accuracy.Draw) -> list[dict[str, Any]]:
    """Of each form against the first one: the errors of a `Point`, to three digits."""
    truth = forms[0].evaluate(drawn.wi, drawn.wr)
    classes = accuracy.classes(drawn)
    rows = []
    for form in forms:
        given = drawn.wi.astype(form.dtype), drawn.wr.astype(form.dtype)
        found = truth if form is forms[0] else form.evaluate(*given).astype(np.float64)
        overall = accuracy.compare(found, truth, drawn, SEED).overall
        parts = {
            name: float(f"{accuracy.mean_error(found, truth, np.where(some, drawn.weight, 0.0)).max():.3g}")
            for name, some in classes.items()
        }
        rows.append({"l1": overall.l1, "p99": overall.p99, **parts})
    return rows


def _cost(times: cost.Times) -> Cost:
    low, middle, high = (float(f"{ns:.3g}") for ns in times.quartiles_ns)
    return Cost(ns=middle, low=low, high=high, directions=times.directions)
