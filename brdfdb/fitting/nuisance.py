"""Nuisance numbers of a measurement: the tilt of the sample, the drift of the lamp, and the dark level."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.measurements.conventions import NODES
from brdfdb.parameters import Floats

NuisanceKind = Literal["tilt", "drift", "dark"]
NUISANCE: tuple[NuisanceKind, ...] = get_args(NuisanceKind)

_LEAST_COSINE = 1e-3  # of directions of a tilted sample; others are taken as they are

#: powers of cos theta_i and cos theta_r that a reading is divided by. An instrument with a small spot divides by the
#: cosine of the viewer, one with a small field of view by that of the light
COSINES = {"dark": ((0, 1), (0, 0), (1, 0), (1, 1)), "tilt": ((0, 0), (0, 1), (1, 0)), "drift": ((0, 0),)}


class NuisanceNumber(NamedTuple):
    """One number, its unit, and the size of the range [-size, size] in which it is searched."""

    kind: NuisanceKind
    name: str
    unit: str
    size: float


def kinds_of(names: Any) -> tuple[NuisanceKind, ...]:
    """Return the kinds that a user names, each once; ParameterError if one is unknown."""
    for name in names:
        if name not in NUISANCE:
            raise ParameterError("nuisance", f"{name!r} is not one of {', '.join(NUISANCE)}", name, NUISANCE)
    return tuple(kind for kind in NUISANCE if kind in names)


def keeps_order(samples: Samples) -> bool:
    """Return True if the rows may stand in the order of measurement: not those of a grid, and several of them."""
    return not samples.record.get(NODES) and len(samples) > 1


@dataclass(frozen=True, eq=False)
class Nuisance:
    """Disturbances of the readings of samples: reading = gain f_r + dark, at the directions of a tilted sample.

    The tilt [degree] turns the sample about its x and y axis. The gain is 1 + drift t + curvature t (t - 1), t from 0
    at the first sample to 1 at the last, over its value at `reference`. The dark level [1/sr] is divided by powers of
    the cosines of light and viewer.
    """

    kinds: tuple[NuisanceKind, ...]
    order: Floats  # (N,), from 0 to 1
    cosines: Floats  # (N, 2), of light and viewer
    level: float  # largest dark level [1/sr]
    forms: Mapping[str, tuple[int, int]]  # powers of the cosines, by kind
    reference: float = 0.0  # time at which the gain is 1

    @classmethod
    def of(
        cls, samples: Samples, kinds: tuple[NuisanceKind, ...], forms: Mapping[str, tuple[int, int]] | None = None
    ) -> Nuisance:
        """Return the nuisance numbers of samples; ParameterError if a drift needs an order that is not known."""
        if "drift" in kinds and not keeps_order(samples):
            raise ParameterError(
                "nuisance", f"{samples.name} is a grid, whose rows are in no order of measurement; leave drift out"
            )
        return cls(
            kinds,
            np.arange(len(samples)) / max(len(samples) - 1, 1),
            np.stack([np.cos(samples.theta_i), np.cos(samples.theta_r)], axis=1),
            float(np.nanmedian(np.abs(samples.values))) or 1.0,
            {kind: options[0] for kind, options in COSINES.items()} | dict(forms or {}),
        )

    def with_kind(self, samples: Samples, kind: NuisanceKind, form: tuple[int, int]) -> Nuisance:
        """Return these numbers of all samples with those of another kind, whose form is given."""
        kinds = tuple(known for known in NUISANCE if known in (*self.kinds, kind))
        return Nuisance.of(samples, kinds, {**self.forms, kind: form})

    def of_kinds(self, kinds: Collection[NuisanceKind]) -> Nuisance:
        """Return these numbers with those of some kinds alone, in the same forms."""
        return replace(self, kinds=tuple(kind for kind in NUISANCE if kind in kinds))

    @property
    def numbers(self) -> list[NuisanceNumber]:
        """The numbers, in the order of the arrays of the other methods."""
        every = (
            NuisanceNumber("tilt", "tilt about x", "degree", 5.0),
            NuisanceNumber("tilt", "tilt about y", "degree", 5.0),
            NuisanceNumber("drift", "drift", "1", 0.8),
            NuisanceNumber("drift", "curvature of the drift", "1", 0.8),
            NuisanceNumber("dark", "dark level", "1/sr", self.level),
        )
        return [one for one in every if one.kind in self.kinds]

    def __len__(self) -> int:
        return len(self.numbers)

    def selected(self, rows: NDArray[Any]) -> Nuisance:
        """Return the numbers for some of the samples."""
        return replace(self, order=self.order[rows], cosines=self.cosines[rows]) if self.kinds else self

    def values(self, u: Floats) -> dict[str, float]:
        """Return the numbers by name at u in the unit cube; 0.5 is none."""
        return {one.name: one.size * (2.0 * float(at) - 1.0) for one, at in zip(self.numbers, u, strict=True)}

    def view(self, view: InstrumentView, u: Floats) -> InstrumentView:
        """Return the directions in the frame of the tilted sample."""
        if "tilt" not in self.kinds:
            return view
        values = self.values(u)
        x, y = radians(np.array([values["tilt about x"], values["tilt about y"]])).tolist()
        turned = [_turned(w, x, y) for w in (view.w_i, view.w_r)]
        return InstrumentView(turned[0], turned[1], view.instrument)

    def gain(self, u: Floats, view: InstrumentView) -> Floats:
        """Return the factor (N, 1) of f_r; `view` has the directions of the tilted sample."""
        gain = np.ones(len(view))
        values = self.values(u)
        if "drift" in self.kinds:
            at = np.append(self.order, self.reference)
            course = 1.0 + values["drift"] * at + values["curvature of the drift"] * at * (at - 1.0)
            gain = np.maximum(course[:-1], 0.05) / max(float(course[-1]), 0.05)
        if "tilt" in self.kinds and any(self.forms["tilt"]):
            tilted = np.stack([view.w_i[:, 2], view.w_r[:, 2]], axis=1)
            gain = gain * np.prod((tilted / self.cosines) ** self.forms["tilt"], axis=1)
        return np.asarray(gain[:, np.newaxis])

    def offset(self, u: Floats) -> Floats:
        """Return what is added to f_r (N, 1) [1/sr]; (1, 1) without a dark level."""
        if "dark" not in self.kinds:
            return np.zeros((1, 1))
        return np.asarray(self.values(u)["dark level"] / np.prod(self.cosines ** self.forms["dark"], axis=1)[:, None])


def _turned(w: Floats, x: float, y: float) -> Floats:
    """Return unit vectors (N, 3) turned about the x axis and then the y axis by small angles [rad]."""
    cx, sx, cy, sy = np.cos(x), np.sin(x), np.cos(y), np.sin(y)
    matrix = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]]) @ [[1, 0, 0], [0, cx, -sx], [0, sx, cx]]
    turned = w @ matrix.T
    return np.where(turned[:, 2:] > _LEAST_COSINE, turned, w)


UNDISTURBED = Nuisance((), np.zeros(0), np.zeros((0, 2)), 1.0, {})
