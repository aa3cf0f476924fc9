"""Pairs of directions at which a source is compared with models, and the distance between the two."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import degrees
from brdfdb.integrals.pairs import Counts, Symmetry, View, views
from brdfdb.lobes import Lobe
from brdfdb.materials import Source
from brdfdb.parameters import Floats

Array = NDArray[np.float64]
Evaluate = Callable[[Floats, Floats], Floats]  # f_r (N, L) for unit vectors (N, 3)
Specular = Callable[[Array], Floats]  # reflectance (V, L) of the specular part at theta (V,)
Weigh = Literal["light", "lightness"]  # what is compared: f_r, or its cube root
WEIGHS: tuple[Weigh, ...] = ("light", "lightness")

COARSE, FITTED = Counts(8, 3, 12, 4), Counts(14, 5, 18, 7)
FINER = 1.75  # nodes along each axis of the rule that measures what is left, relative to the rule that was fitted


def specular_of(source: Source, wavelength_nm: Array | None) -> Specular | None:
    """Return the specular part of a source as a function of theta; None without one."""
    if not source.has_specular:
        return None
    return lambda theta: np.reshape(source.specular_reflectance(theta, wavelength_nm), (theta.size, -1))


class Nodes:
    """The truth at the nodes of one rule, of L columns.

    Attributes
    ----------
    wi, wr : array (N, 3)
        Unit vectors of light and viewer.
    weight : array (N,) [sr^2]
        Weights of the integral over both hemispheres, with both cosines.
    truth : array (N, L) [1/sr]
        f_r of the source.
    theta, theta_weight : array (V,) [rad], [sr]
        Angles of the viewers, with the weights of an integral over them, for the specular part.
    specular : array (V, L) [1]
        Reflectance of the specular part of the source.
    total : array (L,)
        Integral of all that the source reflects.
    weigh : {"light", "lightness"}
        What `distance` compares.
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
    """Return a weighted sum. A BLAS would wait for its threads, and sum in an order of its own."""
    return float(np.einsum("i,i->", weight, values))


class Left:
    """The error that a model leaves, summed viewer by viewer.

    Attributes
    ----------
    l1 : array (L,) [1]
        Distance over all pairs of directions.
    reflected, specular : array (L,) [1]
        Mean albedo of the model over that of the source, and the share of the specular part in the source.
    """

    def __init__(
        self, rule: Iterator[View], truth: Evaluate, model: Evaluate, mirrors: tuple[Specular | None, Specular | None]
    ) -> None:
        wrong, ours, theirs, of_mirror = (np.zeros(1) for _ in range(4))
        for view in rule:
            one = ViewError(view, truth, model, mirrors)
            wrong, ours = wrong + view.weight * one.wrong, ours + view.weight * one.whole
            theirs, of_mirror = theirs + view.weight * one.model, of_mirror + view.weight * one.specular
        self.l1, self.reflected, self.specular = wrong / ours, theirs / ours, of_mirror / ours


class ViewError:
    """The error of a model for one viewer, over all lights, in L columns.

    Attributes
    ----------
    wrong, whole, model, specular : array (L,) [1]
        Light in the wrong place, all light that the source reflects to the viewer, all of the model, and the specular
        part of the source, under uniform light.
    """

    def __init__(
        self, view: View, truth: Evaluate, model: Evaluate, mirrors: tuple[Specular | None, Specular | None]
    ) -> None:
        wr = np.broadcast_to(view.wr, view.wi.shape)
        self.view, self.f, self.g = view, truth(view.wi, wr), model(view.wi, wr)
        theta = np.array([view.theta])
        first, second = (0.0 if mirror is None else mirror(theta)[0] for mirror in mirrors)
        columns = self.f.shape[1]
        self.specular = np.broadcast_to(np.asarray(first, dtype=np.float64), (columns,))
        self.wrong = view.weights @ np.abs(self.g - self.f) + np.abs(np.asarray(second) - first)
        self.whole = view.weights @ self.f + self.specular
        self.model = view.weights @ self.g + second

    @property
    def l1(self) -> Floats:
        """Return the share (L,) of light in the wrong place."""
        return np.divide(self.wrong, self.whole, out=np.zeros(self.whole.shape), where=self.whole > 0.0)

    def largest(self, column: int) -> tuple[tuple[float, float], float, float]:
        """Return theta_i and phi_i [degree] where abs(g - f) cos theta_i is largest, and f and g [1/sr] there."""
        index = int(np.argmax(np.abs(self.g - self.f)[:, column] * np.maximum(self.view.wi[:, 2], 0.0)))
        x, y, z = self.view.wi[index]
        at = float(degrees(np.arccos(np.clip(z, -1.0, 1.0)))), float(degrees(np.arctan2(y, x))) % 360.0
        return at, float(self.f[index, column]), float(self.g[index, column])
