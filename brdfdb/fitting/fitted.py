"""The best point of a surface, with its covariance and what it leaves of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from brdfdb.fitting.problem import Point, Problem
from brdfdb.fitting.residuals import logarithms
from brdfdb.fitting.surface import Surface
from brdfdb.fitting.uncertainty import Covariance, covariance
from brdfdb.measurements import Samples
from brdfdb.parameters import Floats


@dataclass(frozen=True)
class Fitted:
    """The best point of a surface.

    Attributes
    ----------
    samples : Samples
        The samples.
    problem : Problem
        Surface, residual and the scale of robustness.
    point : Point
        The best point.
    sigma : float
        Robust standard deviation of the residuals.
    """

    samples: Samples
    problem: Problem
    point: Point
    sigma: float

    @property
    def surface(self) -> Surface:
        """The surface that was fitted."""
        return self.problem.surface

    @cached_property
    def covariance(self) -> Covariance:
        """The covariance of the numbers of the fit."""
        return covariance(self.problem, self.point)

    def f_r(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r (N, C) [1/sr] of the fit at unit vectors (N, 3) of light and viewer."""
        return self.surface.f_r(self.point.x, self.point.values, wi, wr)

    @cached_property
    def logarithms(self) -> Floats:
        """Return ln(model / sample) (N, C); nan where the sample is not positive."""
        return logarithms(self.samples, self.f_r(self.samples.w_i, self.samples.w_r))
