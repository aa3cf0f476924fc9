"""What a choice for a scene says: the types of choice.json, and reasons in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.choose import Candidate, Decision, Left
from brdfdb.representations import Kind
from brdfdb.scene import Scene, Tolerance

THIRD = 1.0 / 3.0  # of the truth: what a choice is expected to cost at most

Weigh = Literal["time", "bytes", "both"]

_STRICT = ConfigDict(frozen=True, extra="forbid")


class Price(NamedTuple):
    """Of a candidate: nanoseconds a pair of directions, all wavelengths of the scene; and what is weighed of it."""

    ns: float
    cost: float


class Residue(BaseModel):
    """Error over the pixels that show a material, in the unit of the tolerance."""

    model_config = _STRICT

    counted: float = Field(description="at the percentile of the tolerance: what keeps to it")
    most: float = Field(description="largest")


class Option(BaseModel):
    """A form of a material, with all others of the scene at their truth."""

    model_config = _STRICT

    key: str
    title: str
    kind: Kind
    python: str = Field(description="what it is called in Python")
    dtype: Literal["float64", "float32"]
    wavelengths_nm: list[float] | None = Field(description="that it is evaluated at; null of a grey form")
    bytes: int = Field(description="of the numbers that an evaluation reads")
    ns: float = Field(description="of a pair of directions at all wavelengths of the scene, on one thread")
    share: float = Field(description="of what the truth costs, as it is weighed")
    error: Residue


class Material(BaseModel):
    """What is chosen for a material, and why."""

    model_config = _STRICT

    material: str
    title: str
    pixels: int = Field(description="that show it, directly or in a mirror")
    truth: Option
    choice: Option
    next_cheaper: Option | None = Field(description="the most accurate of what is cheaper; null without any")
    refused: bool = Field(description="whether the next cheaper breaks it only where it is checked")
    whole: Residue = Field(description="of the choices all at once, where they are checked")
    reason: str
    revision: str | None = Field(description="of the table in the store, if a store was named and a table chosen")


class Choice(BaseModel):
    """The cheapest form of each material that a scene cannot tell from the truth."""

    model_config = _STRICT

    brdfdb: str
    when: datetime
    machine: str
    scene: str
    tolerance: Tolerance
    weigh: Weigh
    planned: tuple[int, int] = Field(description="pixels across and down where candidates are compared")
    checked: tuple[int, int] = Field(
        description="where the whole is held to the tolerance: half as many more across; if recorded, those of the file"
    )
    materials: list[Material]


def within(tolerance: Tolerance) -> str:
    """How far a picture may be off, and where, in words."""
    share = tolerance.percentile
    where = "every pixel" if share == 100.0 else f"{share:g} % of the pixels of each material"
    return f"within {tolerance.value:g} ({tolerance.unit}) at {where}"


def describe(
    scene: Scene,
    chosen: Mapping[str, Decision],
    offered: Mapping[str, Sequence[Candidate]],
    prices: Mapping[str, Sequence[Price]],
    pixels: Mapping[str, int],
    revisions: Mapping[str, str],
) -> list[Material]:
    """What is chosen for each material of a scene: costs to three digits, and reasons."""

    def option(name: str, index: int, left: Left) -> Option:
        candidate, price = offered[name][index], prices[name][index]
        form, at = candidate.form, candidate.wavelength_nm
        return Option(
            key=form.key,
            title=form.title,
            kind=form.kind,
            python=form.python,
            dtype="float32" if form.dtype is np.float32 else "float64",
            wavelengths_nm=None if at is None else at.tolist(),
            bytes=form.bytes,
            ns=_short(price.ns),
            share=_short(price.cost / prices[name][0].cost),
            error=_residue(left),
        )

    found = []
    for name, decision in chosen.items():
        truth = option(name, 0, Left(0.0, 0.0))
        choice = option(name, decision.pick.chosen, decision.left)
        cheaper = None
        if decision.pick.cheaper is not None and decision.cheaper_left is not None:
            cheaper = option(name, decision.pick.cheaper, decision.cheaper_left)
        found.append(
            Material(
                material=name,
                title=scene.materials[name].title,
                pixels=pixels[name],
                truth=truth,
                choice=choice,
                next_cheaper=cheaper,
                refused=decision.refused,
                whole=_residue(decision.whole),
                reason=_reason(choice, cheaper, decision, scene.tolerance.value),
                revision=revisions.get(name),
            )
        )
    return found


def _reason(choice: Option, cheaper: Option | None, decision: Decision, tolerance: float) -> str:
    """Why this one, and that it costs more than a third of the truth where it does."""
    said = "is the truth itself" if decision.pick.chosen == 0 else f"leaves {choice.error.counted:.2g}"
    if decision.pick.chosen != 0 and choice.share > THIRD:
        said += f" at {choice.share:.2g} of the truth's cost, more than a third"
    if cheaper is None:
        return f"{said}, and nothing is cheaper"
    where = " on the denser sampling" if decision.refused else ""
    left = _above(tolerance, cheaper.error.counted)
    return f"{said}; the best of what is cheaper, {cheaper.title}, would leave {left}{where}"


def _above(tolerance: float, error: float) -> str:
    """An error with as many digits as show that it is above the tolerance, two at least."""
    return next(text for digits in range(2, 18) if float(text := f"{error:.{digits}g}") > tolerance)


def _residue(left: Left) -> Residue:
    return Residue(counted=left.counted, most=left.most)


def _short(value: float) -> float:
    return float(f"{value:.3g}")
