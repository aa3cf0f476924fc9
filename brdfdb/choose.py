"""The cheapest form of each material that a scene cannot tell from the truth."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.cost import ALIKE, CHEAPER
from brdfdb.gather import View
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.picture import difference
from brdfdb.render import Reflector, composed, radiance
from brdfdb.representations import Representation, representations
from brdfdb.scene import Scene, Tolerance
from brdfdb.shapes import Array

GREY_TOLERANCES = (0.1, 0.01, 0.0005)  # of planned tables; 0.001, as in charts, leaves limbs 1.05 off
SAMPLINGS = (3, 8)  # wavelengths, evenly over those of the scene, that a form may be evaluated at in place of all
DARK = 1e-3  # exposed radiance: relative errors of what is darker are relative to this
FINEST = {"relative": 1e-6, "CIEDE2000": 1e-4}  # integrals over facets are known to 1e-6

_ROWS = 512  # of products at a time: larger ones BLAS gives to threads, which wait for each other on a busy machine


class InfeasibleError(ValueError):
    """The tolerance is finer than the truth is known; str() is one sentence."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A form of a material, whose f_r is that of all wavelengths of the scene, and where it is evaluated itself.

    `wavelength_nm` is None of a grey form; between its wavelengths f_r is interpolated on straight lines.
    """

    form: Representation
    wavelength_nm: NDArray[np.float64] | None

    def brdf(self, wi: Array, wr: Array, _wavelength_nm: Array | None = None) -> Floats:
        """f_r [1/sr], as `render` takes it."""
        dtype = self.form.dtype
        return self.form.evaluate(wi.astype(dtype, copy=False), wr.astype(dtype, copy=False)).astype(np.float64)


class Left(NamedTuple):
    """The error that is left over the pixels of a material: at the percentile of the tolerance, and the largest."""

    counted: float
    most: float


class Pick(NamedTuple):
    """What is chosen of the candidates of a material, as indices; `cheaper`, the best of what costs less, if any."""

    chosen: int
    cheaper: int | None


class Decision(NamedTuple):
    """What is chosen of a material: what it leaves by itself, and in the whole picture, sampled more densely.

    `cheaper_left` is how the next cheaper breaks the tolerance; `refused`, whether only on the denser sampling.
    """

    pick: Pick
    left: Left
    cheaper_left: Left | None
    refused: bool
    whole: Left


def candidates(
    material: Material, wavelength_nm: NDArray[np.float64] | None, tolerances: Sequence[float] | None = None
) -> list[Candidate]:
    """Forms to choose from, the truth first: at all wavelengths, and of spectral materials at fewer.

    Parameters
    ----------
    material : Material
        Of any model.
    wavelength_nm : array of shape (L,) [nm], or None
        Those of the scene, for spectral materials, and only for them.
    tolerances : sequence of float, optional
        Of planned tables: see `brdfdb.representations`. By default `GREY_TOLERANCES` of grey materials.

    Returns
    -------
    list of Candidate
        Without models that are meant to differ, and forms that differ from another in rounding alone.

    Raises
    ------
    ValueError
        As `brdfdb.representations.representations` does.
    """
    if tolerances is None and wavelength_nm is None:
        tolerances = GREY_TOLERANCES
    found = [Candidate(form, wavelength_nm) for form in representations(material, wavelength_nm, tolerances)]
    for count in SAMPLINGS if wavelength_nm is not None else ():
        assert wavelength_nm is not None
        if count < wavelength_nm.size:
            few = wavelength_nm[np.round(np.linspace(0, wavelength_nm.size - 1, count)).astype(np.int64)]
            found += [
                Candidate(_between(form, few, wavelength_nm), few)
                for form in representations(material, few, tolerances)
            ]
    return [each for each in found if each.form.kind != "other model" and not each.form.rounded]


def _between(form: Representation, few: Array, wavelength_nm: Array) -> Representation:
    """A form at a few wavelengths, interpolated to all of them."""
    weights = np.stack([np.interp(wavelength_nm, few, one) for one in np.eye(few.size)]).astype(form.dtype)

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values = form.evaluate(wi, wr)
        whole = np.empty((len(values), wavelength_nm.size), values.dtype)
        for start in range(0, len(values), _ROWS):
            np.matmul(values[start : start + _ROWS], weights, out=whole[start : start + _ROWS])
        return whole

    return replace(
        form,
        key=f"{form.key}-{few.size}-wavelengths",
        title=f"{form.title}, {few.size} wavelengths",
        evaluate=evaluate,
        bytes=form.bytes + weights.nbytes,
    )


class Seen:
    """A scene at the points of one view: its true picture, and what candidates make of it.

    Parameters
    ----------
    scene : Scene
        What is seen.
    view : View
        Its points.
    truths : mapping
        By the name of each material, the candidate that the others are compared with.
    materials : mapping
        The result of `brdfdb.render.reflectors`: mirror and albedo, which are the same for all candidates.

    Attributes
    ----------
    truth : array (height, width, L)
        The true picture.
    """

    def __init__(
        self, scene: Scene, view: View, truths: Mapping[str, Candidate], materials: Mapping[str, Reflector]
    ) -> None:
        self.scene, self.view = scene, view
        self._materials = materials
        self._lists = self._radiances(truths)
        self.truth = composed(scene, view, self._lists, materials)

    def _radiances(self, forms: Mapping[str, Candidate]) -> list[Floats]:
        """Of each list of points: by its candidate, or else the truth."""
        return [
            radiance(self.scene, points, self._materials[points.material], forms[points.material].brdf)
            if points.material in forms
            else self._lists[number]
            for number, points in enumerate(self.view.points)
        ]

    def picture(self, forms: Mapping[str, Candidate]) -> Array:
        """The picture (height, width, L) with candidates for some materials, the truth for all others."""
        return composed(self.scene, self.view, self._radiances(forms), self._materials)

    def pixels(self, material: str) -> NDArray[np.int64]:
        """The pixels that show a material, directly or in a mirror."""
        lists = self.view.points
        at = [
            points.at if points.via is None else lists[points.via].at[points.at]
            for points in lists
            if points.material == material
        ]
        return np.unique(np.concatenate(at))

    def differences(self, picture: Array) -> Array:
        """How far each pixel of a picture is from the truth (height, width), as the tolerance of the scene counts.

        Relative errors are those of spectral radiance at the worst wavelength.
        """
        return _differences(self.scene, self.truth, picture)

    def left(self, material: str, picture: Array) -> Left:
        """The error of a picture over the pixels of a material."""
        at = np.unravel_index(self.pixels(material), self.truth.shape[:2])
        errors = _differences(self.scene, self.truth[at], picture[at])
        return Left(float(np.percentile(errors, self.scene.tolerance.percentile)), float(errors.max()))


def _differences(scene: Scene, truth: Array, picture: Array) -> Array:
    if scene.tolerance.unit == "CIEDE2000":
        return difference(scene, truth, picture)
    return np.asarray((np.abs(picture - truth) / np.maximum(truth, DARK / scene.exposure)).max(axis=-1))


def pick(costs: Sequence[float], error: Callable[[int], float], tolerance: float) -> Pick:
    """The cheapest candidate that keeps to a tolerance; of those that cost about the same, the most accurate.

    Parameters
    ----------
    costs : sequence of float
        Of each candidate, in one unit; one of them keeps to any tolerance, as the truth does.
    error : callable
        Of the candidate with an index; asked in the order of costs, and of nothing clearly costlier than need be.
    tolerance : float
        Of the error.

    Returns
    -------
    Pick
        About the same cost is less than `brdfdb.cost.CHEAPER` times as much, about the same error less than
        `brdfdb.cost.ALIKE` times: of those alike in both it is the one given first, whatever the clock says. Everything
        that costs less than the cheapest one that keeps to the tolerance breaks it; the most accurate of that is the
        next cheaper.
    """
    errors: dict[int, float] = {}
    least = np.inf
    for index in np.argsort(costs, kind="stable").tolist():
        if costs[index] > CHEAPER * least:
            break
        errors[index] = error(index)
        if errors[index] <= tolerance:
            least = min(least, costs[index])
    kept = {index: errors[index] for index in sorted(errors) if errors[index] <= tolerance}
    chosen = next(index for index in kept if kept[index] <= ALIKE * min(kept.values()))
    cheaper = [index for index in sorted(errors) if costs[index] < least]
    return Pick(chosen, min(cheaper, key=lambda index: errors[index], default=None))


def check_feasible(tolerance: Tolerance) -> None:
    """InfeasibleError if a tolerance is finer than the truth is known."""
    value, unit = tolerance.value, tolerance.unit
    if value < FINEST[unit]:
        raise InfeasibleError(f"tolerance: {value:g} ({unit}) is finer than the truth is known, {FINEST[unit]:g}")


def choose(
    planned: Seen,
    checked: Seen,
    offered: Mapping[str, Sequence[Candidate]],
    costs: Mapping[str, Sequence[float]],
    tick: Callable[[], None] = lambda: None,
) -> dict[str, Decision]:
    """Choose a candidate for each material of a scene, and check all of them together.

    Parameters
    ----------
    planned : Seen
        Where candidates are compared, each against a picture that is true otherwise.
    checked : Seen
        The same scene, sampled more densely: where the choices are held to the tolerance, all at once.
    offered : mapping
        By the name of each material, its candidates, the truth first.
    costs : mapping
        The same, what each of them costs.
    tick : callable
        Called for each material, and when the check is over.

    Returns
    -------
    dict
        A decision for each material. Where the whole breaks the tolerance, the choices that do so by themselves are
        refused there, or, if only all of them together do, the one that leaves the most; the truth is never refused.

    Raises
    ------
    InfeasibleError
        If the tolerance is finer than the truth is known.
    """
    check_feasible(planned.scene.tolerance)
    tolerance = planned.scene.tolerance.value
    refused: dict[tuple[str, int], Left] = {}

    @functools.cache
    def alone(name: str, index: int) -> Left:
        return planned.left(name, planned.picture({name: offered[name][index]}))

    def left(name: str, index: int) -> Left:
        return refused[name, index] if (name, index) in refused else alone(name, index)

    def picked(name: str) -> Pick:
        return pick(costs[name], lambda index: left(name, index).counted, tolerance)

    picks = {}
    for name in offered:
        picks[name] = picked(name)
        tick()
    while True:
        forms = {name: offered[name][one.chosen] for name, one in picks.items()}
        picture = checked.picture(forms)
        whole = {name: checked.left(name, picture) for name in forms}
        worst = max(whole.values())
        if worst.counted <= tolerance:
            break
        own = {
            name: checked.left(name, checked.picture({name: forms[name]})) for name, one in picks.items() if one.chosen
        }
        broke = {name: each for name, each in own.items() if each.counted > tolerance}
        for name, each in (broke or {max(own, key=lambda name: own[name]): worst}).items():
            refused[name, picks[name].chosen] = each
            picks[name] = picked(name)
    tick()
    return {
        name: Decision(
            one,
            alone(name, one.chosen),
            None if one.cheaper is None else left(name, one.cheaper),
            (name, one.cheaper) in refused,
            whole[name],
        )
        for name, one in picks.items()
    }
