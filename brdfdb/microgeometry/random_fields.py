"""Estimates of a random field from one finite map, with intervals from the sampling theory of Gaussian fields.

The mean square of a stationary Gaussian field over a map of N nodes is the mean of its periodogram I(k). Values of I at
different k are independent, and each has a standard deviation equal to its mean, the spectrum S (Priestley 1981,
section 6.2). A weighted mean of I, the estimate of a variance of heights or slopes or of a covariance, has the variance
2 mean((w S)^2) / N. It is computed twice, with S of the fitted form of the correlation and with I^2 / 2, whose mean is
S^2, and the larger variance is taken. A mean square T with the variance V has 2 T^2 / V degrees of freedom
(Satterthwaite 1946), the number of independent areas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import import_extra

Array = NDArray[np.float64]

CONFIDENCE = 0.95
_TAIL = 0.5 * (1.0 - CONFIDENCE)
_LAGS = 40  # lags of the correlation along an axis that a fit takes
_CORRELATED = 0.3  # correlation down to which a fit takes lags: that at larger lags is uncertain
_SMOOTH = (0.25, 1.5)  # range of the exponent H of a fit
_ROUNDS = 2  # corrections of the loss by levelling, each of which changes the next one
# Least H of the loss by levelling: a smaller one has a long tail, which the loss would lengthen in each round
_LEAST_OF_LOSS = 0.5
_GRID = 192  # lags along an axis over which the loss by levelling is integrated


class HeightInterval(NamedTuple):
    """An estimate with its interval of 95 %."""

    value: float  #: the estimate
    low: float  #: lower end of the interval, in the same unit
    high: float  #: upper end

    def scaled(self, factor: float) -> HeightInterval:
        """Return the estimate and its interval, multiplied by a number."""
        return HeightInterval(self.value * factor, self.low * factor, self.high * factor)


class MeanSquare(NamedTuple):
    """A mean square and its variance."""

    value: float  #: the mean square
    variance: float  #: its variance over maps of the same surface and size

    @property
    def areas(self) -> float:
        """Return the number of independent areas: the degrees of freedom of the mean square."""
        return 2.0 * self.value**2 / self.variance if self.variance > 0.0 else math.inf

    def root(self) -> HeightInterval:
        """Return the root of the mean square, with the interval of chi-square; 0 if it is not positive."""
        if self.value <= 0.0:
            return HeightInterval(0.0, 0.0, math.sqrt(max(0.0, self.value + 2.0 * math.sqrt(self.variance))))
        if not math.isfinite(self.areas):
            return HeightInterval(*[math.sqrt(self.value)] * 3)
        chi2 = import_extra("scipy.stats").chi2
        nu = max(self.areas, 1.0)
        low, high = (math.sqrt(self.value * nu / chi2.ppf(p, nu)) for p in (1.0 - _TAIL, _TAIL))
        return HeightInterval(math.sqrt(self.value), low, high)


class CorrelationForm(NamedTuple):
    """The form of a correlation: exp(-r^(2 H)), with r^2 = (x / tau_x)^2 + (y / tau_y)^2."""

    exponent: float  #: H: 1 is Gaussian, 0.5 exponential [1]
    tau_x: float  #: length along x at which it has fallen to 1 / e [steps]
    tau_y: float  #: the same along y [steps]

    def at(self, x: Array | float, y: Array | float) -> Array:
        """Return the correlation at lags [steps]."""
        return np.exp(-(((np.asarray(x) / self.tau_x) ** 2 + (np.asarray(y) / self.tau_y) ** 2) ** self.exponent))


def _mean_of_half(values: Array, shape: tuple[int, int]) -> float:
    """Return the mean over all wave vectors of values at the half that a real Fourier transform returns."""
    twice = 2.0 * values.sum() - values[:, 0].sum()
    if shape[1] % 2 == 0:
        twice -= values[:, -1].sum()
    return float(twice / (shape[0] * shape[1]))


class Periodogram:
    """The periodogram of a field with holes, scaled so that its mean is the mean square of the field.

    Parameters
    ----------
    field : array (nx, ny)
        The field; nan are holes.
    """

    def __init__(self, field: Array) -> None:
        self.shape = field.shape
        self.count = int(np.count_nonzero(np.isfinite(field)))
        spectrum = np.fft.rfft2(np.nan_to_num(field, nan=0.0, posinf=0.0, neginf=0.0))
        self.power: Array = np.square(spectrum.real, dtype=np.float64)
        self.power += np.square(spectrum.imag)
        self.power /= max(self.count, 1)

    def mean(self, values: Array) -> float:
        """Return the mean of values over all wave vectors, of which the array has the half."""
        return _mean_of_half(values, self.shape)

    def variance(self, power: Array) -> float:
        """Return the variance of the mean of weighted periodograms over maps of the same surface and size."""
        return self.mean(power**2) / max(self.count, 1)


class FieldModel:
    """Correlated heights with white noise on the grid of a map, whose spectrum gives variances without chance.

    Parameters
    ----------
    form : CorrelationForm
        Form of the correlation.
    variance, noise : float
        Variances of the heights and of the noise.
    shape : (int, int)
        Nodes of the map.
    count : int
        Nodes that are no holes.
    """

    def __init__(
        self, form: CorrelationForm, variance: float, noise: float, shape: tuple[int, int], count: int
    ) -> None:
        x, y = (np.minimum(np.arange(n), n - np.arange(n)) for n in shape)
        self.form = form
        self.shape = shape
        self.count = count
        self.power: Array = np.maximum(np.fft.rfft2(variance * form.at(x[:, np.newaxis], y)).real, 0.0) + noise
        self.k_x: Array = np.asarray(2.0 * np.pi * np.fft.fftfreq(shape[0])[:, np.newaxis], np.float64)
        self.k_y: Array = np.asarray(2.0 * np.pi * np.fft.rfftfreq(shape[1])[np.newaxis, :], np.float64)

    def wave_number(self, axis: int) -> Array:
        """Return k [1/step] along an axis, as an array that broadcasts with periodograms."""
        return self.k_y if axis else self.k_x

    def difference_gain(self, axis: int) -> Array:
        """Return the factor of the spectrum in differences of neighbours along an axis."""
        return np.asarray(2.0 - 2.0 * np.cos(self.wave_number(axis)))

    @property
    def mean_power(self) -> float:
        """Return the variance of heights and noise."""
        return _mean_of_half(self.power, self.shape)

    def variance(self, weight: Array) -> float:
        """Return the variance of the mean of the periodogram times a weight."""
        return 2.0 * _mean_of_half((self.power * weight) ** 2, self.shape) / self.count

    def correlation_sum(self, weight: Array, power: int) -> float:
        """Return the sum over lags of a power of the correlation of the field that a weight of the spectrum makes."""
        lags = np.fft.irfft2(self.power * weight, self.shape)
        lags /= lags[0, 0]
        total = lags
        for _ in range(power - 1):
            total = total * lags
        return float(total.sum())


def covariance(z: Array, axis: int, most: int) -> Array:
    """Return the covariance of a field with holes at the lags 0 to most - 1 [steps] along an axis.

    It is the mean square less half of the mean square of differences. Pairs with a hole thus make no error at small
    lags, where differences are small.
    """
    size = 1 << (z.shape[axis] + most).bit_length()
    products, squares, pairs = np.zeros((3, size // 2 + 1), np.complex128)
    rows = z if axis == 1 else z.T
    chunk = max(1, (1 << 21) // size)
    for start in range(0, rows.shape[0], chunk):
        part = rows[start : start + chunk]
        known = np.fft.rfft(np.isfinite(part).astype(np.float64), size, axis=1)
        values = np.nan_to_num(part)
        products += np.sum(np.abs(np.fft.rfft(values, size, axis=1)) ** 2, axis=0)
        squares += np.sum(np.fft.rfft(values * values, size, axis=1) * known.conj(), axis=0)
        pairs += np.sum(np.abs(known) ** 2, axis=0)
    # the sum of squares of both ends of all pairs, since the ends of a pair change places as the lag changes its sign
    both = np.fft.irfft(2.0 * squares.real, size)[:most]
    differences = both - 2.0 * np.fft.irfft(products, size)[:most]
    count = np.maximum(np.fft.irfft(pairs, size)[:most], 0.5)
    return np.asarray(0.5 * both[0] / count[0] - 0.5 * differences / count)


@dataclass(frozen=True)
class LevelledCovariance:
    """The covariance of heights along x and y, corrected for the variance that levelling takes."""

    form: CorrelationForm  #: fit to the correlation
    #: covariances at lags of 0, 1, 2 ... steps along x and y, corrected; lag 0 without the noise of the instrument
    along: tuple[Array, Array]
    lost: float  #: share of the variance of the surface that levelling and the finite map take [1]


def levelled_covariance(z: Array, degree: int, noise: float) -> LevelledCovariance:
    """Return the corrected covariance of heights after levelling.

    Parameters
    ----------
    z : array (nx, ny) [um]
        Levelled heights; nan are holes.
    degree : int
        Degree of the polynomial that was subtracted: 0 of the mean, 1 of a plane, 2 of a paraboloid.
    noise : float [um^2]
        Variance of white noise, which is subtracted at lag 0.
    """
    x, y = (covariance(z, axis, max(4, z.shape[axis] // 2)) for axis in (0, 1))
    raw = (x, y)
    lags = [np.arange(along.size) / nodes for along, nodes in zip(raw, z.shape, strict=True)]
    for along in raw:
        along[0] -= noise
    corrected = raw
    lost = 0.0
    for _ in range(_ROUNDS):
        losses = _losses(fitted_form(corrected), z.shape, degree)
        lost = sum(losses.values())
        variance = raw[0][0] / max(1.0 - lost, 0.2)
        x, y = (
            along + variance * sum(loss * _of_covariance(orders[axis], lag) for orders, loss in losses.items())
            for axis, (along, lag) in enumerate(zip(raw, lags, strict=True))
        )
        corrected = (x, y)
    return LevelledCovariance(fitted_form(corrected), corrected, lost)


def _of_covariance(order: int, lag: Array) -> Array:
    """Return the covariance of a normalised Legendre polynomial, as `covariance` computes it, at lags of the width."""
    return 1.0 - (0.0, 6.0 * lag**2, 30.0 * (lag * (1.0 - lag)) ** 2)[order] + 0.0 * lag


def _remaining(order: int, lag: Array) -> Array:
    """Return the correlation of a normalised Legendre polynomial with itself over the overlap, at lags of the width."""
    # means of the second and fourth power of the middle of two points
    second, fourth = (1.0 - lag) ** 2 / 12.0, (1.0 - lag) ** 4 / 80.0
    if order == 0:
        return np.ones_like(lag)
    if order == 1:
        return 12.0 * (second - lag**2 / 4.0)
    mixed = fourth - second * lag**2 / 2.0 + lag**4 / 16.0
    return 5.0 * (36.0 * mixed - 6.0 * (second + lag**2 / 4.0) + 0.25)


def _losses(form: CorrelationForm, shape: tuple[int, int], degree: int) -> dict[tuple[int, int], float]:
    """Return the share of the variance that lies in each polynomial of a levelling, by its orders along x and y."""
    form = form._replace(exponent=max(form.exponent, _LEAST_OF_LOSS))
    lags = []
    weights = []
    for axis, tau in ((0, form.tau_x), (1, form.tau_y)):
        # lags in steps of the map that grow as a square: fine at 0, where the correlation is
        edge = np.linspace(-1.0, 1.0, 2 * _GRID + 1)
        edge = np.sign(edge) * edge**2
        reach = min(1.0, 12.0 * tau / shape[axis])
        middle = 0.5 * (edge[1:] + edge[:-1]) * reach
        weight = np.diff(edge) * reach * (1.0 - np.abs(middle))
        lags.append(middle * shape[axis])
        weights.append([weight * _remaining(order, np.abs(middle)) for order in range(degree + 1)])
    correlation = form.at(lags[0][:, np.newaxis], lags[1][np.newaxis, :])
    return {
        (a, b): float(weights[0][a] @ correlation @ weights[1][b])
        for a in range(degree + 1)
        for b in range(degree + 1 - a)
    }


def crossing(along: Array) -> float | None:
    """Return the lag [steps] at which a covariance falls to 1 / e of lag 0; None if it does not."""
    if along[0] <= 0.0:
        return None
    below = np.flatnonzero(along < along[0] * math.exp(-1.0))
    if not below.size:
        return None
    last = int(below[0])
    before, after = along[last - 1] / along[0], along[last] / along[0]
    if last > 1 and after > 0.0 and before < 1.0:
        # ln(-ln rho) is a line over the logarithm of the lag, where the correlation has the fitted form
        low, high = math.log(-math.log(before)), math.log(-math.log(after))
        return float((last - 1) * (last / (last - 1)) ** (-low / (high - low)))
    return float(last - 1 + (before - math.exp(-1.0)) / (before - after))


class _FittedLags(NamedTuple):
    """Lags [steps] of a fit along an axis, and the correlation there."""

    axis: int
    lag: NDArray[np.int64]
    correlation: Array


class _FittedForm(NamedTuple):
    """A fitted form, its lags, and the derivatives of the correlation by H, ln tau_x and ln tau_y."""

    form: CorrelationForm
    lags: list[_FittedLags]
    slopes: Array


def fitted_form(along: tuple[Array, Array]) -> CorrelationForm:
    """Return the form of the correlation that fits covariances along x and y best."""
    return _fit(along).form


def exponent_error(measured: LevelledCovariance, model: FieldModel, periodogram: Periodogram) -> float:
    """Return the standard error of the exponent H [1] of a fitted form."""
    fit = _fit(measured.along)
    gains = iter(np.linalg.pinv(fit.slopes)[0])
    weight: Array = np.zeros(1)
    for axis, lags, correlation in fit.lags:
        k = model.wave_number(axis)
        terms = sum(next(gains) * (np.cos(k * lag) - ratio) for lag, ratio in zip(lags, correlation, strict=True))
        weight = weight + terms / measured.along[axis][0]
    return math.sqrt(max(model.variance(weight), periodogram.variance(periodogram.power * weight)))


def _fit(along: tuple[Array, Array]) -> _FittedForm:
    """Return the fit to lags from 1 step to where the correlation has fallen."""
    least_squares = import_extra("scipy.optimize").least_squares
    lags = []
    for number, covariances in enumerate(along):
        ratio = covariances / covariances[0]
        below = np.flatnonzero(ratio < _CORRELATED)
        last = max(3, int(below[0]) if below.size else ratio.size - 1)
        steps = np.unique(np.linspace(1, min(last, ratio.size - 1), _LAGS).astype(np.int64))
        lags.append(_FittedLags(number, steps, ratio[steps]))
    lag = np.concatenate([part.lag for part in lags]).astype(np.float64)
    axis = np.concatenate([np.full(part.lag.size, part.axis) for part in lags])
    measured = np.concatenate([part.correlation for part in lags])

    def model(p: Array) -> Array:
        tau = np.exp(np.where(axis == 0, p[1], p[2]))
        return np.asarray(np.exp(-((lag / tau) ** (2.0 * p[0]))))

    starts = [math.log(crossing(covariances) or 2.0 * covariances.size) for covariances in along]
    wide = math.log(1e4 * max(covariances.size for covariances in along))
    fit = least_squares(
        lambda p: model(p) - measured,
        [0.9, *starts],
        bounds=([_SMOOTH[0], -5.0, -5.0], [_SMOOTH[1], wide, wide]),
    )
    h, tau_x, tau_y = float(fit.x[0]), float(np.exp(fit.x[1])), float(np.exp(fit.x[2]))
    return _FittedForm(CorrelationForm(h, tau_x, tau_y), lags, fit.jac)
