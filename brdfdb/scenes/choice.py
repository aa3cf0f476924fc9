"""The choice for a scene: the cheapest form of each material within the tolerance of the picture."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from brdfdb.errors import ParameterError
from brdfdb.forms.timing import ALIKE, clearly_cheaper
from brdfdb.geometry import radians
from brdfdb.parameters import Floats
from brdfdb.scenes.gbuffer import Points, View
from brdfdb.scenes.image import difference
from brdfdb.scenes.offered_forms import OfferedForm
from brdfdb.scenes.renderer import Reflector, composed, radiance
from brdfdb.scenes.scene import Scene, Tolerance
from brdfdb.scenes.shapes import Array

# Largest angle from the normal at which errors count. Nearer to the horizon models have poles, and a sphere shows only
# 3e-8 of its area there
GRAZING_DEG = 89.99
# Confidence of a statement from samples, over all rounds of checks. A round has fresh places, to which its choices were
# not fitted. Round j takes 1 / (j (j + 1)) of the probability of error
CONFIDENCE = 0.95
DARK = 1e-3  # exposed radiance below which errors are relative to this value
FINEST = {"relative": 1e-6, "CIEDE2000": 1e-4}  # least tolerances, because integrals over facets are known to 1e-6


class InfeasibleError(ParameterError):
    """A tolerance smaller than the error of the truth."""


class Left(NamedTuple):
    """The error over the places of a material: at the percentile of the tolerance, and the largest."""

    counted: float
    most: float


class Pick(NamedTuple):
    """The chosen form of a material and the best of the clearly cheaper forms, if any, as indices."""

    chosen: int
    cheaper: int | None


class Sample(NamedTuple):
    """A sample of the places of a material: their number, and the errors of the choices there.

    `share` is the upper bound, at `CONFIDENCE`, of the share of all such places that exceed the tolerance.
    """

    places: int
    most: float
    share: float


class Decision(NamedTuple):
    """The choice for a material, with its error by itself and together with all other choices.

    Attributes
    ----------
    pick : Pick
        The chosen form.
    left : Left
        Error of the choice by itself, at the places where forms are compared.
    cheaper_left : Left or None
        Error of the next cheaper form, which exceeds the tolerance.
    refused : bool
        True if the next cheaper form exceeds the tolerance only at the places where choices are checked.
    whole : Left
        Error together with all other choices, at every pixel of the picture and at fresh places.
    even, edges : Sample or None
        Fresh places, evenly spread over the picture and at edges. None for a recorded scene.
    """

    pick: Pick
    left: Left
    cheaper_left: Left | None
    refused: bool
    whole: Left
    even: Sample | None = None
    edges: Sample | None = None


class Seen:
    """A scene at the points of one view: its true picture, and pictures with forms for some materials.

    Parameters
    ----------
    scene : Scene
        The scene.
    view : View
        The points of the view.
    truths : mapping
        By the name of each material, the form with which the others are compared.
    materials : mapping
        The result of `brdfdb.scenes.renderer.reflectors`: mirror and albedo, which are the same for all forms.

    Attributes
    ----------
    truth : array (height, width, L)
        The true picture.
    """

    def __init__(
        self, scene: Scene, view: View, truths: Mapping[str, OfferedForm], materials: Mapping[str, Reflector]
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

    def _at(self, points: Points) -> NDArray[np.int64]:
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

    Parameters
    ----------
    costs : array of shape (rounds, forms)
        Cost of each form in each round of timing, in one unit. Costs without scatter have one round.
    error : callable
        ``error(index)`` gives the error of a form, which is 0 for the truth. It is called in the order of median costs,
        and not for forms that are clearly costlier than necessary.
    tolerance : float
        Largest error.

    Returns
    -------
    Pick
        Two costs are about the same if neither is clearly cheaper (`brdfdb.forms.timing.clearly_cheaper`), as in a
        chart. Two errors are about the same if their ratio is less than `brdfdb.forms.timing.ALIKE`. Of forms alike in
        both, the first one given is picked. The next cheaper form is the most accurate of the forms that are clearly
        cheaper than the choice, all of which exceed the tolerance.
    """
    errors: dict[int, float] = {}
    least: int | None = None
    for index in np.argsort(np.median(costs, axis=0), kind="stable").tolist():
        if least is not None and clearly_cheaper(costs, least, index):
            continue
        errors[index] = error(index)
        if errors[index] <= tolerance and least is None:
            least = index
    kept = {index: errors[index] for index in sorted(errors) if errors[index] <= tolerance}
    chosen = next(index for index in kept if kept[index] <= ALIKE * min(kept.values()))
    cheaper = [index for index in sorted(errors) if index not in kept and clearly_cheaper(costs, index, chosen)]
    return Pick(chosen, min(cheaper, key=lambda index: errors[index], default=None))


def check_feasible(tolerance: Tolerance) -> None:
    """Raise an InfeasibleError if a tolerance is smaller than the error of the truth."""
    value, unit = tolerance.value, tolerance.unit
    if value < FINEST[unit]:
        raise InfeasibleError(
            "tolerance", f"{value:g} ({unit}) is finer than the truth is known, {FINEST[unit]:g}", value
        )


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


def _left(errors: Sequence[Array], percentile: float) -> Left:
    """Return the error at even places and at edges. Edges count if the tolerance is for all places."""
    most = max(float(values.max(initial=0.0)) for values in errors)
    if percentile == 100.0 or not errors[0].size:
        return Left(most, most)
    return Left(float(np.percentile(errors[0], percentile)), most)


def _sample(errors: Array, tolerance: float, confidence: float) -> Sample:
    """Return a sample with the upper bound of Clopper and Pearson. The bound of an empty sample is 1."""
    beyond, places = int(np.count_nonzero(errors > tolerance)), errors.size
    share = 1.0 if beyond == places else float(stats.beta.ppf(confidence, beyond + 1, places - beyond))
    return Sample(places, float(errors.max(initial=0.0)), share)


def choose(
    planned: Look,
    check: Callable[[int], Look | None],
    offered: Mapping[str, Sequence[OfferedForm]],
    costs: Mapping[str, Floats],
    tick: Callable[[], None] = lambda: None,
) -> dict[str, Decision]:
    """Choose a form for each material of a scene, and check all of them together.

    Parameters
    ----------
    planned : Look
        Picture, and places near edges, where each form is compared with the truth, all other materials at their truth.
    check : callable
        ``check(round)`` gives the scene at fresh places for a round from 1 on, or None if it has no other places.
    offered : mapping
        Forms of each material by its name, the truth first.
    costs : mapping
        Costs of the forms of each material, of shape (rounds, forms).
    tick : callable
        A function that is called for each material, and for each round of checks.

    Returns
    -------
    dict
        A decision for each material. If all choices together exceed the tolerance, the choices that exceed it by
        themselves are refused. If none does, the choice with the largest error is refused. The truth is never refused.
        Then the next round checks other places.

    Raises
    ------
    InfeasibleError
        If the tolerance is smaller than the error of the truth.
    """
    check_feasible(planned.even.scene.tolerance)
    tolerance, percentile = planned.even.scene.tolerance.value, planned.even.scene.tolerance.percentile
    refused: dict[tuple[str, int], Left] = {}

    def left(look: Look, name: str, index: int) -> Left:
        return _left(look.errors([name], {name: offered[name][index]})[name], percentile)

    alone = functools.cache(functools.partial(left, planned))

    def known(name: str, index: int) -> Left:
        return refused[name, index] if (name, index) in refused else alone(name, index)

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
        whole = {
            name: Left(*np.max([_left(of_look[name], percentile) for of_look in errors], axis=0)) for name in forms
        }
        tick()
        if max(whole.values()).counted <= tolerance:
            break
        own = {name: max(left(look, name, one.chosen) for look in looks) for name, one in picks.items() if one.chosen}
        for name, broken in _broken(own, max(whole.values()), tolerance).items():
            refused[name, picks[name].chosen] = broken
            picks[name] = picked(name)
    confidence = 1.0 - (1.0 - CONFIDENCE) / (number * (number + 1))
    return {
        name: Decision(
            one,
            alone(name, one.chosen),
            None if one.cheaper is None else known(name, one.cheaper),
            (name, one.cheaper) in refused,
            whole[name],
            *(_sample(values, tolerance, confidence) for fresh in errors[1:] for values in fresh[name]),
        )
        for name, one in picks.items()
    }


def _broken(own: Mapping[str, Left], whole: Left, tolerance: float) -> dict[str, Left]:
    """Return the errors of choices that exceed the tolerance by themselves, else of the one with the largest error."""
    broke = {name: left for name, left in own.items() if left.counted > tolerance}
    return broke or {max(own, key=lambda name: own[name]): whole}
