"""The document of a choice for a scene: the types of choice.json, and reasons in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.forms.catalogue import Forms, Kind, LeftOut
from brdfdb.parameters import Floats
from brdfdb.scenes.choice import CONFIDENCE, GRAZING_DEG, Decision, Left, Sample
from brdfdb.scenes.offered_forms import OfferedForm
from brdfdb.scenes.scene import Scene, Tolerance

THIRD = 1.0 / 3.0  # largest expected cost of a choice, as a share of the truth's cost

Weigh = Literal["time", "bytes", "both"]


class _Record(BaseModel):
    """A part of the document: immutable, without keys that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Price(NamedTuple):
    """The price of a form: time [ns] of a pair of directions, and the weighed cost in each round of timing."""

    ns: float
    costs: Floats

    @property
    def cost(self) -> float:
        """The median cost."""
        return float(np.median(self.costs))


class Residue(_Record):
    """Error over the places that show a material, in the unit of the tolerance."""

    counted: float = Field(description="error at the percentile of the tolerance, which must keep to it")
    most: float = Field(description="largest")


class Sampled(_Record):
    """A sample of the places that show a material. They were not used to choose."""

    places: int = Field(description="number of places")
    most: float = Field(description="largest error at these places")
    one_in: int = Field(
        description="fewer than 1 in so many of all such places exceeds the tolerance, with the stated confidence"
    )


class Option(_Record):
    """A form of a material, with all others of the scene at their truth."""

    key: str
    title: str
    kind: Kind
    python: str = Field(description="name in Python")
    dtype: Literal["float64", "float32"]
    wavelengths_nm: list[float] | None = Field(description="wavelengths of its evaluation; null for a grey form")
    bytes: int = Field(description="size of the numbers that an evaluation reads")
    ns: float = Field(description="time of a pair of directions at all wavelengths of the scene, on one thread")
    share: float = Field(description="weighed cost as a share of the truth's cost")
    error: Residue


class Material(_Record):
    """The choice for a material, and its reason."""

    material: str
    title: str
    pixels: int = Field(description="number of pixels that show it, directly or in a mirror")
    truth: Option
    choice: Option
    next_cheaper: Option | None = Field(description="the most accurate of the cheaper forms; null if there are none")
    refused: bool = Field(
        description="true if the next cheaper form exceeds the tolerance only where choices are checked"
    )
    whole: Residue = Field(description="error of all choices at once: at all pixels of the picture, and all samples")
    even: Sampled | None = Field(description="places anywhere in the picture, equally likely; null if recorded")
    edges: Sampled | None = Field(
        description="places beside limbs, terminators and edges of shadows: each power of ten of the distance, from a "
        "pixel's width down to a hundred millionth of it, is equally likely; null if recorded"
    )
    reason: str
    revision: str | None = Field(description="revision of the table, if a store was named and a table chosen")
    left_out: list[LeftOut] = Field(default=[], description="forms that cannot be made, such as a table too large")


class Choice(_Record):
    """The cheapest form of each material within the tolerance of the picture of a scene."""

    brdfdb: str
    when: datetime
    machine: str
    scene: str
    tolerance: Tolerance
    weigh: Weigh
    picture: tuple[int, int] = Field(
        description="pixels across and down; the choices keep to the tolerance at each of them, seen through its middle"
    )
    confidence: float = Field(description="confidence of statements on samples, for each material and kind of sample")
    grazing_deg: float = Field(description="angle from the normal up to which errors count; nothing is stated beyond")
    statement: str = Field(description="proven and sampled results in a few sentences")
    materials: list[Material]


def within(tolerance: Tolerance) -> str:
    """Return a tolerance of a picture in words."""
    share = tolerance.percentile
    where = "" if share == 100.0 else f" at {share:g} % of the places of each material"
    return f"within {tolerance.value:g} ({tolerance.unit}){where}"


def statement(tolerance: Tolerance, picture: tuple[int, int], materials: Sequence[Material]) -> str:
    """Return the proven results for the choices and the results of samples, with their confidence, in words."""
    value = f"{tolerance.value:g}"
    size, share = f"{picture[0]} x {picture[1]}", tolerance.percentile
    proven = f"Proven: each of the {size} pixels, seen through its middle, is within {value}."
    if share != 100.0:
        proven = (
            f"Proven: {share:g} % of each material's pixels, of {size} seen through their middles, are within {value}."
        )
    even = [one.even for one in materials if one.even is not None]
    edges = [one.edges for one in materials if one.edges is not None]
    if not even:
        return f"{proven} The file holds no other places."
    places, most = sum(one.places for one in (*even, *edges)), max(one.most for one in (*even, *edges))
    return (
        f"{proven} Sampled: all other places of the picture, for other widths and offsets of its pixels, at {places} "
        f"places that were not used to choose; the largest error at them is {most:.2g}. With {100 * CONFIDENCE:g} % "
        f"confidence for each material, fewer than 1 in {min(one.one_in for one in even)} of its places is beyond "
        f"{value}, and fewer than 1 in {min(one.one_in for one in edges)} of those beside its edges. "
        f"What is seen within {90.0 - GRAZING_DEG:.2g} degrees of grazing is left out."
    )


def describe(
    scene: Scene,
    chosen: Mapping[str, Decision],
    offered: Mapping[str, Forms[OfferedForm]],
    prices: Mapping[str, Sequence[Price]],
    pixels: Mapping[str, int],
    revisions: Mapping[str, str],
) -> list[Material]:
    """Return the choice for each material of a scene, with costs to three digits and reasons."""

    def option(name: str, index: int, left: Left) -> Option:
        one, price = offered[name][index], prices[name][index]
        form, at = one.form, one.wavelength_nm
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

    materials = []
    for name, decision in chosen.items():
        truth = option(name, 0, Left(0.0, 0.0))
        choice = option(name, decision.pick.chosen, decision.left)
        cheaper = None
        if decision.pick.cheaper is not None and decision.cheaper_left is not None:
            cheaper = option(name, decision.pick.cheaper, decision.cheaper_left)
        materials.append(
            Material(
                material=name,
                title=scene.materials[name].title,
                pixels=pixels[name],
                truth=truth,
                choice=choice,
                next_cheaper=cheaper,
                refused=decision.refused,
                whole=_residue(decision.whole),
                even=_sampled(decision.even),
                edges=_sampled(decision.edges),
                reason=_reason(choice, cheaper, decision, scene.tolerance.value),
                revision=revisions.get(name),
                left_out=offered[name].left_out,
            )
        )
    return materials


def _reason(choice: Option, cheaper: Option | None, decision: Decision, tolerance: float) -> str:
    """Return the reason for a choice, with a remark if it costs more than a third of the truth."""
    clause = "is the truth itself" if decision.pick.chosen == 0 else f"leaves {choice.error.counted:.2g}"
    if decision.pick.chosen != 0 and choice.share > THIRD:
        clause += f" at {choice.share:.2g} of the truth's cost, more than a third"
    if cheaper is None:
        return f"{clause}, and nothing is cheaper"
    where = " at fresh places" if decision.refused else ""
    left = _above(tolerance, cheaper.error.counted)
    return f"{clause}; the best of what is cheaper, {cheaper.title}, would leave {left}{where}"


def _above(tolerance: float, error: float) -> str:
    """Return an error as text, with at least two digits and enough to show that it is above the tolerance."""
    return next(text for digits in range(2, 18) if float(text := f"{error:.{digits}g}") > tolerance)


def _residue(left: Left) -> Residue:
    return Residue(counted=left.counted, most=left.most)


def _sampled(sample: Sample | None) -> Sampled | None:
    """Return the record of a sample, with bounds rounded so that they remain true."""
    if sample is None:
        return None
    return Sampled(places=sample.places, most=sample.most, one_in=int(1.0 / sample.share))


def _short(value: float) -> float:
    return float(f"{value:.3g}")
