"""Residuals of a fit: the difference of model and samples by their noise, in logarithms, relative, or weighted."""

from __future__ import annotations

from copy import copy
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.measurements import Samples
from brdfdb.parameters import Floats

Kind = Literal["noise", "log", "relative", "cosine", "uncertainty"]
KINDS: tuple[Kind, ...] = get_args(Kind)

_LEAST = 1e-6  # share of the smallest sample that is added to both sides before logarithms: the model may be 0
_NOTHING = 1e-12  # the same share of the largest sample, for samples below the resolution of any instrument
CREDIBLE = 0.01  # share of the median uncertainty, absolute and relative, below which an uncertainty is a mistake
_LEAST_F_R = 1e-100  # squares of derivatives of logarithms of less than that are too large for numbers
MAD = 1.4826  # standard deviation of normal noise over the median of its size
_FEWEST = 12  # samples from which a floor is estimated
_LEVELS = 61  # floors that are tried
_ENOUGH = 5000  # samples by which it is estimated
_FREE = 5.0  # degrees of freedom of Student's distribution of residuals
_SCALINGS = 12  # steps of the search for its scale
_LEAST_SIZE = 1e-12  # scale of samples without noise
_LARGEST = 1e300  # floor [1/sr]
_SEEN = 10.8  # fall of -2 ln of the likelihood by a floor that chance reaches once in a thousand
_EXPLAINED = 6.0  # standard deviations within which a value that is not positive is noise
_HORIZON_COSINE = 1e-4  # smaller cosines are at the horizon, where models are 0, and are left out


class NoiseFloor(NamedTuple):
    """The floor of the noise: at f_r of `level` [1/sr] it is as large as the part of the noise in proportion to f_r.

    `explained` (N, C) are samples that are not positive, and within the noise of a fit.
    """

    level: float
    explained: NDArray[np.bool_]


class Residual:
    """The residual of each sample as a function of the f_r of a model.

    Parameters
    ----------
    samples : Samples
        The samples.
    kind : {"noise", "log", "relative", "cosine", "uncertainty"}
        "noise": asinh(f / c) - asinh(y / c), whose noise is the same everywhere if that of y is the root of the squares
        of a part a y in proportion and of a floor a c; for c = 0 it is "log". "log": ln f - ln y. "relative":
        (f - y) / y. "cosine": (f - y) cos theta_i cos theta_r over the root mean square of y cos theta_i cos theta_r.
        "uncertainty": (f - y) / u, u the standard uncertainty of each sample.
    noise : NoiseFloor, optional
        c of "noise", and which samples count besides the positive ones.

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

    gain: Floats | float = 1.0
    offset: Floats | float = 0.0
    variance = 0.0  # of the noise, by which the goal is moved
    raised = 0

    def __init__(self, samples: Samples, kind: Kind, noise: NoiseFloor | None = None) -> None:
        if kind not in KINDS:
            raise ParameterError("residual", f"{kind!r} is not one of {', '.join(KINDS)}", kind, KINDS)
        if kind == "uncertainty" and samples.uncertainty is None:
            raise ParameterError(
                "residual", f"{samples.name} has no uncertainties; choose log, relative or cosine", kind, KINDS
            )
        self.kind = kind
        self.noise = noise
        self.truth = samples.values
        known, above = samples.known, _above_horizon(samples)
        with np.errstate(invalid="ignore"):
            usable = known if kind == "cosine" else self.truth > 0.0
            if kind == "uncertainty":
                assert samples.uncertainty is not None
                usable = samples.uncertainty > 0.0
            elif noise is not None:
                usable = usable | noise.explained
        self.used = known & above & usable
        self.holes = int(np.sum(~known))
        self.at_horizon = int(np.sum(known & ~above))
        self.left_out = int(np.sum(known & above & ~usable))
        if not self.used.any():
            raise ParameterError(
                "samples", f"{samples.name} has no value that the residual {kind} can use", samples.name
            )
        y = np.where(self.used, self.truth, 1.0)
        lowest, highest = float(y[self.used].min()), float(y[self.used].max())
        size = lowest if kind == "relative" else max(highest, -lowest)
        if 0.0 < size < _LEAST_F_R:
            text = (
                f"{samples.name} has f_r of {size:.3g} /sr; {_LEAST_F_R:g} /sr and more are allowed; check their unit"
            )
            raise ParameterError("samples", text, size, (_LEAST_F_R, np.inf))
        self.logarithmic = kind in ("noise", "log")
        self.floor = max(_LEAST * lowest, _NOTHING * highest) if noise is None else noise.level
        self.goal = self._scaled(y)
        self.weight = np.where(self.used, 1.0 if self.logarithmic else self._weights(samples, y), 0.0)

    def _weights(self, samples: Samples, y: Floats) -> Floats:
        """Return what differences of f_r are multiplied by (N, C) [sr]; counts uncertainties that are raised."""
        if self.kind == "relative":
            return np.asarray(1.0 / y)
        if self.kind == "cosine":
            cosines = (np.cos(samples.theta_i) * np.cos(samples.theta_r))[:, np.newaxis]
            size = np.sqrt(np.mean((y * cosines)[self.used] ** 2))
            return np.asarray(cosines / (size if size > 0.0 else 1.0))
        assert samples.uncertainty is not None
        stated = np.where(self.used, samples.uncertainty, 1.0)
        usual = _usual_uncertainty(y, stated, self.used)
        low = self.used & (stated < CREDIBLE * usual)
        self.raised = int(low.sum())
        return np.asarray(1.0 / np.where(low, usual, stated))

    @property
    def count(self) -> int:
        """Return the number of samples that count."""
        return int(self.used.sum())

    def _changed(self, **attributes: Any) -> Residual:
        part = copy(self)
        part.__dict__ |= attributes
        return part

    def selected(self, rows: NDArray[np.int64]) -> Residual:
        """Return the residual of some of the samples, with the same weights."""
        arrays = {name: getattr(self, name)[rows] for name in ("truth", "used", "weight", "goal")}
        return self._changed(**arrays, holes=0, at_horizon=0, left_out=0, raised=0)

    def disturbed(self, gain: Floats, offset: Floats) -> Residual:
        """Return the residuals of readings that are gain (N, 1) times f_r plus an offset (N, 1) [1/sr]."""
        return self._changed(gain=gain, offset=offset)

    def unbiased(self, variance: float) -> Residual:
        """Return "noise" residuals whose mean is 0 for readings with a mean of f_r and noise of a variance [1].

        The mean of a concave function is less than the function of the mean, by half of the variance for logarithms.
        """
        bent = 1.0 if self.noise is None else np.tanh(self.goal)  # y / sqrt(y^2 + c^2), with asinh(y / c) as the goal
        return self._changed(goal=self.goal + 0.5 * (variance - self.variance) * bent, variance=variance)

    def _scaled(self, f_r: Floats) -> Floats:
        """Return the function of f_r [1/sr] whose differences are residuals, before weights."""
        if self.noise is not None:
            return np.asarray(np.arcsinh(f_r / self.floor))
        return np.asarray(np.log(np.maximum(f_r, 0.0) + self.floor)) if self.logarithmic else f_r

    def of(self, f_r: Floats) -> Floats:
        """Return the residuals (N, C) of f_r (N, C) [1/sr]; 0 where a sample does not count."""
        return np.asarray(self.weight * (self._scaled(self.gain * f_r + self.offset) - self.goal))

    def slope(self, f_r: Floats) -> Floats:
        """Return the derivatives (N, C) [sr] of the residuals by f_r."""
        slope, reading = self.gain * self.weight, self.gain * f_r + self.offset
        if self.noise is not None:
            return np.asarray(slope / np.hypot(reading, self.floor))
        return np.asarray(slope / (np.maximum(reading, 0.0) + self.floor) if self.logarithmic else slope)


def noise_floor(samples: Samples, f_r: Floats, used: NDArray[np.bool_]) -> NoiseFloor | None:
    """Return the floor of the noise of samples about f_r (N, C) [1/sr] of a fit; None where none is seen.

    `used` (N, C) are the samples that count. The floor has the largest likelihood of residuals asinh(f / c) - asinh(y /
    c) that have Student's distribution of five degrees of freedom, whose tails make outliers cheap, and a scale that is
    fitted.
    """
    some = np.random.default_rng(0).permutation(int(used.sum()))[:_ENOUGH] if used.sum() > _ENOUGH else slice(None)
    y, f = samples.values[used][some], f_r[used][some]
    sizes = np.abs(y[y != 0.0])
    if sizes.size < _FEWEST:
        return None
    lowest, highest = np.percentile(sizes, [1.0, 100.0])
    levels = np.geomspace(1e-2 * max(lowest, _NOTHING * highest), min(10.0 * highest, _LARGEST), _LEVELS)
    deviances, scales = np.array([_scaled(level, y, f) for level in levels]).T
    best = int(np.argmin(deviances))
    if deviances[0] - deviances[best] < _SEEN:
        return None
    level = float(levels[best])
    with np.errstate(invalid="ignore"):
        residuals = np.arcsinh(f_r / level) - np.arcsinh(samples.values / level)
        return NoiseFloor(level, (samples.values <= 0.0) & (np.abs(residuals) < _EXPLAINED * scales[best]))


def _scaled(level: float, y: Floats, f: Floats) -> tuple[float, float]:
    """Return -2 ln of the largest likelihood of samples y (M,) about f (M,) [1/sr] with a floor, and its scale."""
    r = np.arcsinh(f / level) - np.arcsinh(y / level)
    size = max(MAD * float(np.median(np.abs(r))), _LEAST_SIZE)
    for _ in range(_SCALINGS):
        size = max(float(np.sqrt(np.mean(r * r * (_FREE + 1.0) / (_FREE + (r / size) ** 2)))), _LEAST_SIZE)
    tails = (_FREE + 1.0) * float(np.sum(np.log1p((r / size) ** 2 / _FREE)))
    slopes = 2.0 * float(np.sum(np.log(np.hypot(y, level))))
    return 2.0 * r.size * float(np.log(size)) + tails + slopes, size


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


def _above_horizon(samples: Samples) -> NDArray[np.bool_]:
    """Return which samples (N, 1) have neither direction at the horizon."""
    return np.minimum(np.cos(samples.theta_i), np.cos(samples.theta_r))[:, np.newaxis] > _HORIZON_COSINE


def logarithms(samples: Samples, f_r: Floats) -> Floats:
    """Return ln f - ln y (N, C), nan where a sample is no positive number or lies at the horizon."""
    with np.errstate(all="ignore"):
        difference = np.log(np.maximum(f_r, np.finfo(np.float64).tiny)) - np.log(samples.values)
    return np.where(np.isfinite(difference) & _above_horizon(samples), difference, np.nan)
