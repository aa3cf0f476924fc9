"""The choice for a scene: the cheapest form of each material within the tolerance of the picture."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import stats

from brdfdb.errors import ParameterError
from brdfdb.figure import DocumentPart
from brdfdb.forms.catalogue import Forms, Kind, LeftOut
from brdfdb.forms.timing import ALIKE, clearly_cheaper
from brdfdb.geometry import radians
from brdfdb.parameters import Floats
from brdfdb.scenes.gbuffer import CameraView, VisiblePoints
from brdfdb.scenes.image import difference
from brdfdb.scenes.offered_forms import OfferedForm
from brdfdb.scenes.renderer import Reflector, composed, radiance
from brdfdb.scenes.scene import Scene, Tolerance
from brdfdb.scenes.shapes import Array

# Largest angle from the normal at which errors count. Closer to the horizon models have poles, and a sphere shows only
# 3e-8 of its area there
GRAZING_DEG = 89.99
# Confidence of statements on samples, over all rounds of checks. Each round has new places, to which its choices were
# not fitted. Round j takes 1 / (j (j + 1)) of the probability of error
CONFIDENCE = 0.95
DARK = 1e-3  # exposed radiance below which errors are relative to this value
FINEST = {"relative": 1e-6, "CIEDE2000": 1e-4}  # least tolerances, because integrals over facets are known to 1e-6

THIRD = 1.0 / 3.0  # largest expected cost of a choice, as a share of the truth's cost

Weigh = Literal["time", "bytes", "both"]


class InfeasibleError(ParameterError):
    """A tolerance smaller than the error of the truth."""


class PictureError(NamedTuple):
    """The error at the places that show a material: at the percentile of the tolerance, and the largest."""

    counted: float
    most: float


class Pick(NamedTuple):
    """The chosen form of a material and the best of the clearly cheaper forms, if any, as indices."""

    chosen: int
    cheaper: int | None


class PlaceSample(NamedTuple):
    """A sample of the places of a material: their number, and the errors of the choices there.

    `share` is the upper bound, at `CONFIDENCE`, of the share of all such places that exceed the tolerance.
    """

    places: int
    most: float
    share: float

    @classmethod
    def of(cls, errors: Array, tolerance: float, confidence: float) -> PlaceSample:
        """Return a sample with the upper bound of Clopper and Pearson. The bound of an empty sample is 1."""
        beyond = int(np.count_nonzero(errors > tolerance))
        places = errors.size
        share = 1.0 if beyond == places else float(stats.beta.ppf(confidence, beyond + 1, places - beyond))
        return cls(places, float(errors.max(initial=0.0)), share)


class Decision(NamedTuple):
    """The choice for a material, with its error by itself and together with all other choices."""

    pick: Pick
    error: PictureError  # of the choice by itself, at the places where forms are compared
    cheaper_error: PictureError | None  # of the next cheaper form, which exceeds the tolerance
    refused: bool  # True if the next cheaper form exceeds the tolerance only at the places where choices are checked
    joint_error: PictureError  # together with all other choices, at every pixel of the picture and at fresh places
    even: PlaceSample | None = None  # fresh places, evenly spread over the picture; None for a recorded scene
    edges: PlaceSample | None = None  # fresh places at edges; None for a recorded scene


class Seen:
    """A scene at the points of one view: its true picture, and pictures with forms for some materials.

    `truths` has the form of each material with which the others are compared, by name. `materials`, the result of
    `brdfdb.scenes.renderer.reflectors`, has mirror and albedo, which are the same for all forms. `truth` (height,
    width, L) is the true picture.
    """

    def __init__(
        self, scene: Scene, view: CameraView, truths: Mapping[str, OfferedForm], materials: Mapping[str, Reflector]
    ) -> None:
        self.scene, self.view = scene, view
        self._materials = materials
        self._lists = self._radiances(truths)
        self.truth = composed(scene, view, self._lists, materials)

    def _radiances(self, forms: Mapping[str, OfferedForm]) -> list[Floats]:
        """Return the radiance of each list of points, by its form if it has one, else by the truth."""
        return [
            radiance(self.scene, points, self._materials[points.material], forms[points.material].brdf)
            if points.material in forms
            else self._lists[number]
            for number, points in enumerate(self.view.points)
        ]

    def picture(self, forms: Mapping[str, OfferedForm]) -> Array:
        """Return the picture (height, width, L) with forms for some materials, the truth for all others."""
        return composed(self.scene, self.view, self._radiances(forms), self._materials)

    def pixels(self, material: str) -> NDArray[np.int64]:
        """Return the pixels that show a material, directly or in a mirror, up to `GRAZING_DEG` from the normal."""
        shown = [self._at(points) for points in self.view.points if points.material == material]
        return np.setdiff1d(np.concatenate(shown), self._grazing) if shown else np.empty(0, dtype=np.int64)

    def _at(self, points: VisiblePoints) -> NDArray[np.int64]:
        """Return the pixel of each point of a list."""
        return points.at if points.via is None else self.view.points[points.via].at[points.at]

    @functools.cached_property
    def _grazing(self) -> NDArray[np.int64]:
        """Return the pixels that show something between `GRAZING_DEG` and the horizon."""
        least = np.cos(radians(GRAZING_DEG))
        pixels = [self._at(points)[(points.wr[:, 2] > 0.0) & (points.wr[:, 2] < least)] for points in self.view.points]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *pixels]))

    def differences(self, picture: Array) -> Array:
        """Return the difference of each pixel (height, width) from the truth, in the unit of the tolerance.

        Relative differences are those of spectral radiance at the worst wavelength.
        """
        return _differences(self.scene, self.truth, picture)

    def errors(self, material: str, picture: Array) -> Array:
        """Return the errors (N,) of a picture at the pixels of a material, in the unit of the tolerance."""
        at = np.unravel_index(self.pixels(material), self.truth.shape[:2])
        return _differences(self.scene, self.truth[at], picture[at])


def _differences(scene: Scene, truth: Array, picture: Array) -> Array:
    if scene.tolerance.unit == "CIEDE2000":
        return difference(scene, truth, picture)
    return np.asarray((np.abs(picture - truth) / np.maximum(truth, DARK / scene.exposure)).max(axis=-1))


def pick(costs: Floats, error: Callable[[int], float], tolerance: float) -> Pick:
    """Pick the cheapest form within a tolerance. Of forms with about the same cost, pick the most accurate one.

    `costs` (rounds, forms) are those of each round of timing. `error(index)` gives the error of a form, 0 for the
    truth. It is called in the order of median costs, and not for forms that are clearly costlier than necessary. Two
    costs are about the same if neither is clearly cheaper (`brdfdb.forms.timing.clearly_cheaper`), two errors if their
    ratio is below `brdfdb.forms.timing.ALIKE`. Of forms alike in both, the first one is picked. The next cheaper form
    is the most accurate of those that are clearly cheaper than the choice, all of which exceed the tolerance.
    """
    errors: dict[int, float] = {}
    least: int | None = None
    for index in np.argsort(np.median(costs, axis=0), kind="stable").tolist():
        if least is not None and clearly_cheaper(costs, least, index):
            continue
        errors[index] = error(index)
        if errors[index] <= tolerance and least is None:
            least = index
    precise = {index: errors[index] for index in sorted(errors) if errors[index] <= tolerance}
    chosen = next(index for index in precise if precise[index] <= ALIKE * min(precise.values()))
    cheaper = [index for index in sorted(errors) if index not in precise and clearly_cheaper(costs, index, chosen)]
    return Pick(chosen, min(cheaper, key=lambda index: errors[index], default=None))


def check_feasible(tolerance: Tolerance) -> None:
    """Raise an InfeasibleError if a tolerance is smaller than the error of the truth."""
    value = tolerance.value
    unit = tolerance.unit
    if value < FINEST[unit]:
        text = f"{value:g} ({unit}) is smaller than the error of the truth, {FINEST[unit]:g}"
        raise InfeasibleError("tolerance", text, value)


class Look(NamedTuple):
    """A scene at evenly spread places, such as the pixels of a picture, and at places near edges, if any."""

    even: Seen
    edges: Seen | None

    def errors(self, names: Iterable[str], forms: Mapping[str, OfferedForm]) -> dict[str, list[Array]]:
        """Return the errors of materials at even places and at edges, with forms for some of them at once."""
        seen = [self.even] if self.edges is None else [self.even, self.edges]
        pictures = [view.picture(forms) for view in seen]
        return {
            name: [view.errors(name, picture) for view, picture in zip(seen, pictures, strict=True)] for name in names
        }


def _error(errors: Sequence[Array], percentile: float) -> PictureError:
    """Return the error at even places and at edges. Edges count if the tolerance is for all places."""
    most = max(float(values.max(initial=0.0)) for values in errors)
    if percentile == 100.0 or not errors[0].size:
        return PictureError(most, most)
    return PictureError(float(np.percentile(errors[0], percentile)), most)


def choose(
    planned: Look,
    check: Callable[[int], Look | None],
    offered: Mapping[str, Sequence[OfferedForm]],
    costs: Mapping[str, Floats],
    tick: Callable[[], None] = lambda: None,
) -> dict[str, Decision]:
    """Choose a form for each material of a scene, and check all of them together.

    `planned` is where each form is compared with the truth, all other materials at their truth. ``check(round)`` gives
    the scene at fresh places for a round from 1 on, or None if it has no other places. `offered` has the forms of each
    material, the truth first, and `costs` theirs, of shape (rounds, forms). `tick` is called for each material, and for
    each round of checks. InfeasibleError if the tolerance is smaller than the error of the truth.

    If all choices together exceed the tolerance, the choices that exceed it by themselves are refused. If none does,
    the choice with the largest error is refused. The truth is never refused. Then the next round checks other places.
    """
    check_feasible(planned.even.scene.tolerance)
    tolerance, percentile = planned.even.scene.tolerance.value, planned.even.scene.tolerance.percentile
    refused: dict[tuple[str, int], PictureError] = {}

    def alone(look: Look, name: str, index: int) -> PictureError:
        return _error(look.errors([name], {name: offered[name][index]})[name], percentile)

    planned_error = functools.cache(functools.partial(alone, planned))

    def known(name: str, index: int) -> PictureError:
        return refused[name, index] if (name, index) in refused else planned_error(name, index)

    def picked(name: str) -> Pick:
        return pick(costs[name], lambda index: known(name, index).counted, tolerance)

    picks = {}
    for name in offered:
        picks[name] = picked(name)
        tick()
    for number in itertools.count(1):
        forms = {name: offered[name][one.chosen] for name, one in picks.items()}
        checked = check(number)
        looks = [planned] if checked is None else [planned, checked]
        errors = [look.errors(forms, forms) for look in looks]
        joint = {name: PictureError(*np.max([_error(by[name], percentile) for by in errors], axis=0)) for name in forms}
        tick()
        if max(joint.values()).counted <= tolerance:
            break
        own = {name: max(alone(look, name, one.chosen) for look in looks) for name, one in picks.items() if one.chosen}
        # Choices that exceed the tolerance by themselves are refused, else the choice with the largest error
        broken = {name: error for name, error in own.items() if error.counted > tolerance}
        for name, error in (broken or {max(own, key=lambda name: own[name]): max(joint.values())}).items():
            refused[name, picks[name].chosen] = error
            picks[name] = picked(name)
    confidence = 1.0 - (1.0 - CONFIDENCE) / (number * (number + 1))
    return {
        name: Decision(
            one,
            planned_error(name, one.chosen),
            None if one.cheaper is None else known(name, one.cheaper),
            (name, one.cheaper) in refused,
            joint[name],
            *(PlaceSample.of(values, tolerance, confidence) for fresh in errors[1:] for values in fresh[name]),
        )
        for name, one in picks.items()
    }


class Price(NamedTuple):
    """The price of a form: time [ns] of a pair of directions, and the weighed cost in each round of timing."""

    ns: float
    costs: Floats

    @property
    def cost(self) -> float:
        """The median cost."""
        return float(np.median(self.costs))


class Residue(DocumentPart):
    """Error over the places that show a material, in the unit of the tolerance."""

    counted: float = Field(description="error at the percentile of the tolerance, which must keep to it")
    most: float = Field(description="largest")


class Sampled(DocumentPart):
    """A sample of the places that show a material. They were not used to choose."""

    places: int = Field(description="number of places")
    most: float = Field(description="largest error at these places")
    one_in: int = Field(
        description="fewer than 1 in this number of all such places exceeds the tolerance, with the stated confidence"
    )


class Option(DocumentPart):
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


class MaterialChoice(DocumentPart):
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
        description="places near limbs, terminators and edges of shadows: each power of ten of the distance, from a "
        "pixel's width down to a hundred millionth of it, is equally likely; null if recorded"
    )
    reason: str
    revision: str | None = Field(description="revision of the table, if a store was named and a table chosen")
    left_out: list[LeftOut] = Field(
        default=[], description="forms that cannot be made, for example because a table would be too large"
    )


class SceneChoice(DocumentPart):
    """The cheapest form of each material within the tolerance of the picture of a scene."""

    brdfdb: str
    when: datetime
    machine: str
    scene: str
    tolerance: Tolerance
    weigh: Weigh
    picture: tuple[int, int] = Field(
        description="pixels across and down; at the centre of each of them, the error is within the tolerance"
    )
    confidence: float = Field(description="confidence of statements on samples, for each material and kind of sample")
    grazing_deg: float = Field(description="largest angle from the normal at which errors count")
    statement: str = Field(description="proven and sampled results in a few sentences")
    materials: list[MaterialChoice]


def within(tolerance: Tolerance) -> str:
    """Return a tolerance of a picture in words."""
    share = tolerance.percentile
    where = "" if share == 100.0 else f" at {share:g} % of the places of each material"
    return f"within {tolerance.value:g} ({tolerance.unit}){where}"


def statement(tolerance: Tolerance, picture: tuple[int, int], materials: Sequence[MaterialChoice]) -> str:
    """Return the proven results for the choices and the results of samples, with their confidence, in words."""
    value = f"{tolerance.value:g}"
    size = f"{picture[0]} x {picture[1]}"
    share = tolerance.percentile
    proven = f"Proven: at the centre of each of the {size} pixels, the error is at most {value}."
    if share != 100.0:
        proven = f"Proven: for {share:g} % of each material's pixels, of {size}, the error is at most {value}."
    even = [one.even for one in materials if one.even is not None]
    edges = [one.edges for one in materials if one.edges is not None]
    if not even:
        return f"{proven} The file has no other places."
    places = sum(one.places for one in (*even, *edges))
    most = max(one.most for one in (*even, *edges))
    return (
        f"{proven} Sampled: {places} other places, which pixels of other widths and offsets show, were not used to "
        f"choose; their largest error is {most:.2g}. With {100 * CONFIDENCE:g} % confidence for each material, fewer "
        f"than 1 in {min(one.one_in for one in even)} of its places exceeds {value}, and fewer than 1 in "
        f"{min(one.one_in for one in edges)} of those near its edges. "
        f"Directions within {90.0 - GRAZING_DEG:.2g} degrees of grazing are left out."
    )


def describe(
    scene: Scene,
    chosen: Mapping[str, Decision],
    offered: Mapping[str, Forms[OfferedForm]],
    prices: Mapping[str, Sequence[Price]],
    pixels: Mapping[str, int],
    revisions: Mapping[str, str],
) -> list[MaterialChoice]:
    """Return the choice for each material of a scene, with costs to three digits and reasons."""

    def option(name: str, index: int, error: PictureError) -> Option:
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
            error=Residue(**error._asdict()),
        )

    materials = []
    for name, decision in chosen.items():
        truth = option(name, 0, PictureError(0.0, 0.0))
        choice = option(name, decision.pick.chosen, decision.error)
        cheaper = None
        if decision.pick.cheaper is not None and decision.cheaper_error is not None:
            cheaper = option(name, decision.pick.cheaper, decision.cheaper_error)
        materials.append(
            MaterialChoice(
                material=name,
                title=scene.materials[name].title,
                pixels=pixels[name],
                truth=truth,
                choice=choice,
                next_cheaper=cheaper,
                refused=decision.refused,
                whole=Residue(**decision.joint_error._asdict()),
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
    # At least two digits, and enough to show that the error is above the tolerance
    error = cheaper.error.counted
    text = next(text for digits in range(2, 18) if float(text := f"{error:.{digits}g}") > tolerance)
    return f"{clause}; the most accurate cheaper form, {cheaper.title}, would leave {text}{where}"


def _sampled(sample: PlaceSample | None) -> Sampled | None:
    """Return the record of a sample, with bounds rounded so that they remain true."""
    if sample is None:
        return None
    return Sampled(places=sample.places, most=sample.most, one_in=int(1.0 / sample.share))


def _short(value: float) -> float:
    return float(f"{value:.3g}")
