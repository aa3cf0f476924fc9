"""The best point of a surface, with its covariance and its residuals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.problem import Point, Problem
from brdfdb.fitting.residuals import logarithms
from brdfdb.fitting.surface import SearchedSurface
from brdfdb.fitting.uncertainty import Covariance, covariance
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.parameters import Floats

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class FittedSurface:
    """The best point of a surface, with the samples that it was fitted to."""

    samples: Samples
    problem: Problem
    point: Point
    sigma: float  # robust standard deviation of the residuals
    rows: NDArray[np.int64]  # samples that count: those of the problem
    hidden: Mask  # samples (N,) that are left out, because they may contain a specular part in an unknown aperture

    @property
    def surface(self) -> SearchedSurface:
        """The surface that was fitted."""
        return self.problem.surface

    @cached_property
    def covariance(self) -> Covariance:
        """The covariance of the numbers of the fit."""
        return covariance(self.problem, self.point)

    @cached_property
    def view(self) -> InstrumentView:
        """The directions of all samples, as their instrument sees them."""
        return InstrumentView(self.samples.w_i, self.samples.w_r, self.samples.instrument)

    def f_r(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r (N, C) [1/sr] of the fit at unit vectors (N, 3) of light and viewer, without its specular part."""
        return self.surface.f_r(self.point.x, self.point.values, InstrumentView(wi, wr))

    def seen(self, view: InstrumentView) -> Floats:
        """Return f_r (N, C) [1/sr] of the fit as an instrument sees it."""
        return self.surface.f_r(self.point.x, self.point.values, view)

    @cached_property
    def logarithms(self) -> Floats:
        """Return ln(model / sample) (N, C); nan where the sample is not positive, or is left out."""
        difference = logarithms(self.samples, self.seen(self.view))
        return np.where(self.hidden[:, np.newaxis], np.nan, difference)
