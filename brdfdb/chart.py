"""Speed against accuracy: every representation of a material with its error, its cost, and the front of the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb import accuracy, cost
from brdfdb.materials import Material, Number
from brdfdb.parameters import Floats
from brdfdb.representations import Kind, Representation, representations

DIRECTIONS = 1000  # of each band of theta_i
SEED = 1992
SINGLES = 101  # rounds of single evaluations, which take microseconds
STEPS = 2 + cost.ROUNDS + SINGLES  # of a chart, as `tick` counts them

_STRICT = ConfigDict(frozen=True, extra="forbid")


class Cost(BaseModel):
    """Time of an evaluation on the machine of the chart, on one thread."""

    model_config = _STRICT

    ns: float = Field(description="median over all rounds, of a value of f_r: one direction, one wavelength")
    low: float = Field(description="lower quartile")
    high: float = Field(description="upper quartile")
    directions: int = Field(description="evaluated at once")


class Point(BaseModel):
    """A representation: errors are relative to the truth, at the worst wavelength."""

    model_config = _STRICT

    key: str
    title: str
    kind: Kind
    python: str = Field(description="what it is called in Python")
    dtype: Literal["float64", "float32"]
    bytes: int = Field(description="of the numbers that an evaluation reads")
    l1: float = Field(description="mean of abs(f_r - truth) over that of the truth, weighted with the cosine")
    p99: float = Field(description="99th percentile of abs(f_r - truth) / max(truth, floor)")
    forward: float = Field(description="l1 of viewers within 45 degrees of the azimuth of the mirror direction")
    back: float = Field(description="l1 of viewers within 45 degrees of the azimuth of the light")
    grazing: float = Field(description="l1 where light or viewer is beyond 75 degrees")
    batch: Cost
    single: Cost


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


class Charts(BaseModel):
    """Charts of several materials, made in one go."""

    model_config = _STRICT

    brdfdb: str
    when: datetime
    machine: str
    charts: list[Chart]


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
    truth = forms[0].evaluate(drawn.wi, drawn.wr)
    errors = [_errors(_found(form, drawn), truth, drawn) for form in forms]
    tick()
    above = np.flatnonzero(drawn.above)
    mixed = np.random.default_rng(SEED).permutation(above)  # few of them are as mixed as all
    wi, wr = drawn.wi[mixed], drawn.wr[mixed]
    batch = cost.times(forms, wi, wr, rounds=cost.ROUNDS, tick=tick)
    single = cost.times(forms, wi, wr, most=1, rounds=SINGLES, tick=tick)
    # black is free, and has an l1 of 1
    rivals = [
        index
        for index, (form, error) in enumerate(zip(forms, errors, strict=True))
        if form.kind != "other model" and error["l1"] < 1.0
    ]

    def front(costs: Floats) -> list[str]:
        chosen = cost.front([errors[index]["l1"] for index in rivals], costs[:, rivals])
        return [forms[rivals[index]].key for index in chosen]

    return Chart(
        material=material.name,
        title=material.title,
        model=material.model,
        parameters=material.file_parameters(),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        directions=above.size,
        truth=forms[0].key,
        points=[
            Point(
                key=form.key,
                title=form.title,
                kind=form.kind,
                python=form.python,
                dtype="float32" if form.dtype is np.float32 else "float64",
                bytes=form.bytes,
                **error,
                batch=_cost(together),
                single=_cost(alone),
            )
            for form, error, together, alone in zip(forms, errors, batch, single, strict=True)
        ],
        fronts=Fronts(
            batch=front(np.stack([each.seconds for each in batch], axis=1)),
            single=front(np.stack([each.seconds for each in single], axis=1)),
            bytes=front(np.array([[form.bytes for form in forms]], dtype=np.float64)),
        ),
    )


def _found(form: Representation, drawn: accuracy.Draw) -> Floats:
    return form.evaluate(drawn.wi.astype(form.dtype), drawn.wr.astype(form.dtype)).astype(np.float64)


def _errors(found: Floats, truth: Floats, drawn: accuracy.Draw) -> dict[str, float]:
    """To three digits, at the worst wavelength."""
    overall = accuracy.compare(found, truth, drawn, SEED).overall
    parts = {
        name: float(f"{accuracy.mean_error(found, truth, np.where(rows, drawn.weight, 0.0)).max():.3g}")
        for name, rows in accuracy.classes(drawn).items()
    }
    return {"l1": overall.l1, "p99": overall.p99, **parts}


def _cost(times: cost.Times) -> Cost:
    low, middle, high = (float(f"{ns:.3g}") for ns in times.quartiles_ns)
    return Cost(ns=middle, low=low, high=high, directions=times.directions)
