"""Pairs of directions at which a source is compared with models, and the distance between the two."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.integrals.pairs import Counts, Symmetry, View, views
from brdfdb.lobes import Lobe
from brdfdb.materials import Material, Source
from brdfdb.parameters import Floats

Array = NDArray[np.float64]
Evaluate = Callable[[Floats, Floats], Floats]  # f_r (N, L) for unit vectors (N, 3)
Specular = Callable[[Array], Floats]  # reflectance (V, L) of the specular part at theta (V,)
Weigh = Literal["light", "lightness"]  # what is compared: f_r, or its cube root
WEIGHS: tuple[Weigh, ...] = ("light", "lightness")

COARSE = Counts(8, 3, 12, 4)  # nodes at which many sets of parameters are tried
FITTED = Counts(14, 5, 18, 7)  # nodes of the last descents
FINER = 1.75  # nodes along each axis of the rule that measures the result, relative to the rule of the search


def specular_of(source: Source, wavelength_nm: Array | None) -> Specular | None:
    """Return the specular part of a source as a function of theta; None without one."""
    if not source.has_specular:
        return None
    return lambda theta: np.reshape(source.specular_reflectance(theta, wavelength_nm), (theta.size, -1))


def lobe_of(source: Source, wavelength_nm: Array | None) -> Callable[[Array], Lobe | None]:
    """Return the lobe of a source at wavelengths [nm] as a function of the cosine."""
    return lambda cosine: source.lobe(cosine, wavelength_nm) if source.has_lobe else None


class Sides(NamedTuple):
    """Source and model as functions: f_r (N, L) of both, their specular parts, and the narrower lobe."""

    truth: Evaluate
    model: Evaluate
    truth_specular: Specular | None
    model_specular: Specular | None
    lobe: Callable[[Array], Lobe | None]


def sides_of(source: Source, material: Material, wavelength_nm: Array | None) -> Sides:
    """Return source and model at wavelengths [nm]; None where both are grey."""
    before = wavelength_nm if source.spectral else None
    after = wavelength_nm if material.spectral else None
    lobes = lobe_of(source, before), lobe_of(material, after)

    def narrower(cosine: Array) -> Lobe | None:
        both = [lobe for lobe in (one(cosine) for one in lobes) if lobe is not None]
        if not both:
            return None
        alpha_x = min(np.min(lobe.alpha_x) for lobe in both)
        alpha_y = min(np.min(lobe.alpha_y) for lobe in both)
        return Lobe(np.asarray(1.0), np.asarray(alpha_x), np.asarray(alpha_y))

    return Sides(
        source.brdf_at(before),
        material.brdf_at(after),
        specular_of(source, before),
        specular_of(material, after),
        narrower,
    )


class TruthNodes:
    """The truth at N pairs of directions from V viewers, in L columns.

    `wi` and `wr` (N, 3) are unit vectors, `weight` (N,) [sr^2] has both cosines, and `truth` (N, L) [1/sr] is f_r.
    `theta` (V,) [rad] with `theta_weight` (V,) [sr] and `specular` (V, L) [1] are those of the specular part. `total`
    (L,) is the integral of all light that the source reflects.
    """

    def __init__(
        self,
        lobe: Callable[[Array], Lobe | None],
        counts: Counts,
        symmetry: Symmetry,
        f_r: Evaluate,
        mirror: Specular | None,
        weigh: Weigh = "light",
    ) -> None:
        self.weigh = weigh
        every = list(views(lobe, counts, symmetry))
        self.wi = np.concatenate([view.wi for view in every])
        self.wr = np.repeat(np.stack([view.wr for view in every]), [len(view.wi) for view in every], axis=0)
        self.weight = np.concatenate([view.weight * view.weights for view in every])
        self.truth = f_r(self.wi, self.wr)
        self.theta = np.array([view.theta for view in every])
        self.theta_weight = np.array([view.weight for view in every])
        columns = self.truth.shape[1]
        self.specular = np.zeros((self.theta.size, columns)) if mirror is None else mirror(self.theta)
        self.total = self.weight @ self.truth + self.theta_weight @ self.specular

        # A column at a time is compared: columns that are contiguous take half of the time
        self.columns = list(np.ascontiguousarray(np.cbrt(self.truth.T) if weigh == "lightness" else self.truth.T))
        self.size = [_sum(self.weight, column * column) for column in self.columns]

    def distance(self, column: int, values: Floats, specular: Floats | None) -> float:
        """Return the distance [1] of f_r (N,) and of a specular part (V,) from one column of the truth.

        Of light it is l1. Of lightness it is the root mean square difference of cube roots, relative to the root mean
        square of those of the truth. Specular parts add the share of the light by which they differ.
        """
        left = self.specular[:, column] if specular is None else np.abs(specular - self.specular[:, column])
        mirrored = _sum(self.theta_weight, left) / self.total[column]
        if self.weigh == "lightness":
            difference = np.cbrt(values) - self.columns[column]
            return float(np.sqrt(_sum(self.weight, difference * difference) / self.size[column]) + mirrored)
        difference = values - self.columns[column]
        return float(_sum(self.weight, np.abs(difference, out=difference)) / self.total[column] + mirrored)


def _sum(weight: Floats, values: Floats) -> float:
    """Return a weighted sum. A BLAS would wait for its threads, and sum in another order."""
    return float(np.einsum("i,i->", weight, values))


class RemainingDifference:
    """The difference of a model from a source over all pairs of directions, in L columns, summed viewer by viewer.

    `l1` is the distance, `reflected` the mean albedo of the model over that of the source, and `specular` the share of
    the specular part in the source, all (L,) [1].
    """

    def __init__(self, sides: Sides, counts: Counts, symmetry: Symmetry) -> None:
        wrong, source, model, specular = (np.zeros(1) for _ in range(4))
        for view in views(sides.lobe, counts, symmetry):
            error = ViewError(view, sides)
            wrong = wrong + view.weight * error.wrong
            source = source + view.weight * error.source
            model = model + view.weight * error.model
            specular = specular + view.weight * error.specular
        self.l1 = wrong / source
        self.reflected = model / source
        self.specular = specular / source


class ViewError:
    """The error of a model for one viewer under uniform light, over all lights, in L columns.

    `wrong` is the light in the wrong place, `source` and `model` the light that both reflect to the viewer, and
    `specular` the specular part of the source, all (L,) [1].
    """

    def __init__(self, view: View, sides: Sides) -> None:
        wr = np.broadcast_to(view.wr, view.wi.shape)
        self.view = view
        self.f = sides.truth(view.wi, wr)
        self.g = sides.model(view.wi, wr)
        theta = np.array([view.theta])
        before = 0.0 if sides.truth_specular is None else sides.truth_specular(theta)[0]
        after = 0.0 if sides.model_specular is None else sides.model_specular(theta)[0]
        self.specular = np.broadcast_to(np.asarray(before, dtype=np.float64), (self.f.shape[1],))
        self.wrong = view.weights @ np.abs(self.g - self.f) + np.abs(np.asarray(after) - before)
        self.source = view.weights @ self.f + self.specular
        self.model = view.weights @ self.g + after

    @property
    def l1(self) -> Floats:
        """Return the share (L,) of light in the wrong place."""
        return np.divide(self.wrong, self.source, out=np.zeros(self.source.shape), where=self.source > 0.0)

    def largest(self, column: int) -> int:
        """Return the number of the light for which abs(g - f) cos theta_i is largest."""
        return int(np.argmax(np.abs(self.g - self.f)[:, column] * np.maximum(self.view.wi[:, 2], 0.0)))
