"""Residuals of a fit: the difference of model and samples in logarithms, relative, weighted or by uncertainty."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.measurements import Samples
from brdfdb.parameters import Floats

Kind = Literal["log", "relative", "cosine", "uncertainty"]
KINDS: tuple[Kind, ...] = ("log", "relative", "cosine", "uncertainty")

_LEAST = 1e-6  # share of the smallest sample that is added to both sides before logarithms: the model may be 0
_NOTHING = 1e-12  # the same share of the largest sample, for samples below the resolution of any instrument
CREDIBLE = 0.01  # share of the median uncertainty, absolute and relative, below which an uncertainty is a mistake
_LEAST_F_R = 1e-100  # squares of derivatives of logarithms of less than that are too large for numbers
_HORIZON_COSINE = 1e-4  # smaller cosines are at the horizon, where models are 0, and are left out


class Residual:
    """The residual of each sample as a function of the f_r of a model.

    Parameters
    ----------
    samples : Samples
        The samples.
    kind : {"log", "relative", "cosine", "uncertainty"}
        "log": ln f - ln y. "relative": (f - y) / y. "cosine": (f - y) cos theta_i cos theta_r over the root mean square
        of y cos theta_i cos theta_r. "uncertainty": (f - y) / u, u the standard uncertainty of each sample.

    Attributes
    ----------
    used : array (N, C) of bool
        Samples that count. Holes do not, nor directions at the horizon, nor, of "log" and "relative", samples that are
        not positive, nor, of "uncertainty", samples without a positive finite one.
    holes, at_horizon, left_out : int
        Numbers of values that do not count, in this order of reasons.
    raised : int
        Number of uncertainties that are below a hundredth of the usual one, which they are raised to, so that no sample
        outweighs all others. The usual one is the median, or the median relative to y where that is less.

    Raises
    ------
    ParameterError
        If the kind is unknown, the samples have no uncertainty, none is left, or f_r is below 1e-100 /sr.
    """

    def __init__(self, samples: Samples, kind: Kind) -> None:
        if kind not in KINDS:
            raise ParameterError("residual", f"{kind!r} is not one of {', '.join(KINDS)}", kind, KINDS)
        if kind == "uncertainty" and samples.uncertainty is None:
            raise ParameterError(
                "residual", f"{samples.name} has no uncertainties; choose log, relative or cosine", kind, KINDS
            )
        self.kind = kind
        self.truth = samples.values
        cosines = np.cos(samples.theta_i) * np.cos(samples.theta_r)
        above = np.minimum(np.cos(samples.theta_i), np.cos(samples.theta_r)) > _HORIZON_COSINE
        known = samples.known
        horizon = known & ~above[:, np.newaxis]
        self.used = known & above[:, np.newaxis]
        self.holes = int(np.sum(~known))
        self.at_horizon = int(np.sum(horizon))
        with np.errstate(invalid="ignore"):
            positive = self.truth > 0.0
            if kind in ("log", "relative"):
                usable = positive
            elif kind == "uncertainty":
                assert samples.uncertainty is not None
                usable = samples.uncertainty > 0.0
            else:
                usable = known
        self.left_out = int(np.sum(self.used & ~usable))
        self.used &= usable
        if not self.used.any():
            raise ParameterError(
                "samples", f"{samples.name} has no value that the residual {kind} can use", samples.name
            )
        y = np.where(self.used, self.truth, 1.0)
        usable_y = y[self.used]
        size = float(usable_y.min() if kind == "relative" else np.abs(usable_y).max())
        if 0.0 < size < _LEAST_F_R:
            text = (
                f"{samples.name} has f_r of {size:.3g} /sr; {_LEAST_F_R:g} /sr and more are allowed; check their unit"
            )
            raise ParameterError("samples", text, size, (_LEAST_F_R, np.inf))
        least = max(_LEAST * float(usable_y.min()), _NOTHING * float(usable_y.max()))
        self.raised = 0
        self.floor = least if kind == "log" else 0.0
        if kind == "log":
            self.weight = np.where(self.used, 1.0, 0.0)
            self.goal = np.log(y + self.floor)
            return
        if kind == "relative":
            weight = 1.0 / y
        elif kind == "cosine":
            size = np.sqrt(np.mean((y * cosines[:, np.newaxis])[self.used] ** 2))
            weight = np.broadcast_to(cosines[:, np.newaxis], y.shape) / (size if size > 0.0 else 1.0)
        else:
            assert samples.uncertainty is not None
            stated = np.where(self.used, samples.uncertainty, 1.0)
            usual = _usual_uncertainty(y, stated, self.used)
            low = self.used & (stated < CREDIBLE * usual)
            self.raised = int(low.sum())
            weight = 1.0 / np.where(low, usual, stated)
        self.weight = np.where(self.used, weight, 0.0)
        self.goal = y

    @property
    def count(self) -> int:
        """Return the number of samples that count."""
        return int(self.used.sum())

    def selected(self, rows: NDArray[np.int64]) -> Residual:
        """Return the residual of some of the samples, with the same weights."""
        part = object.__new__(Residual)
        part.kind, part.floor = self.kind, self.floor
        part.holes = part.at_horizon = part.left_out = part.raised = 0
        for name in ("truth", "used", "weight", "goal"):
            setattr(part, name, getattr(self, name)[rows])
        return part

    def of(self, f_r: Floats) -> Floats:
        """Return the residuals (N, C) of f_r (N, C) [1/sr]; 0 where a sample does not count."""
        values = np.log(np.maximum(f_r, 0.0) + self.floor) if self.kind == "log" else f_r
        return np.asarray(self.weight * (values - self.goal))

    def slope(self, f_r: Floats) -> Floats:
        """Return the derivatives (N, C) [sr] of the residuals by f_r."""
        if self.kind != "log":
            return self.weight
        return np.asarray(self.weight / (np.maximum(f_r, 0.0) + self.floor))


def _usual_uncertainty(y: Floats, stated: Floats, used: NDArray[np.bool_]) -> Floats:
    """Return the uncertainty (N, C) that each sample would have, were it as uncertain as others.

    Constant noise is far below the median relative to y in highlights, and noise in proportion to y is far below the
    median in the dark. Hence it is the lower of the two. A sample of 0 counts as the dimmest of the others.
    """
    median = float(np.median(stated[used]))
    sizes = np.abs(y)
    others = used & (sizes > 0.0)
    if not others.any():
        return np.full_like(stated, median)
    relative = float(np.median(stated[others] / sizes[others]))
    return np.asarray(np.minimum(median, relative * np.maximum(sizes, sizes[others].min())))


def logarithms(samples: Samples, f_r: Floats) -> Floats:
    """Return ln f - ln y (N, C), nan where a sample is no positive number or lies at the horizon."""
    above = np.minimum(np.cos(samples.theta_i), np.cos(samples.theta_r)) > _HORIZON_COSINE
    with np.errstate(all="ignore"):
        difference = np.log(np.maximum(f_r, np.finfo(np.float64).tiny)) - np.log(samples.values)
    return np.where(np.isfinite(difference) & above[:, np.newaxis], difference, np.nan)
