"""Statistics of a measured surface, with intervals: heights, slopes, lengths and form of the correlation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, import_extra
from brdfdb.microgeometry.levelling import Levelled
from brdfdb.microgeometry.random_fields import (
    CONFIDENCE,
    FieldModel,
    HeightInterval,
    LevelledCovariance,
    MeanSquare,
    Periodogram,
    crossing,
    exponent_error,
    levelled_covariance,
)

Array = NDArray[np.float64]
NoiseKind = Literal["given", "estimated", "negligible", "not separable"]

FEWEST_LENGTHS = 8.0  # lengths of correlation along an axis below which no tau is stated
_STEEP = 2.0  # rms slope [1], 63 degrees, above which the units of a map are doubted
FEW_LENGTHS = 20.0  # lengths of correlation below which intervals are wide and the loss by levelling is large
_FINEST = 2.0  # steps of the grid below which a length of correlation is not resolved
_ORDERS = (4, 6)  # of the mixed differences that see noise alone
_FLAT = 0.05  # difference of the noise by both orders up to which the spectrum is flat
_SMOOTH = 0.75  # exponent H above which noise and roughness differ at the pixel
_NEGLIGIBLE = 0.01  # share of the mean squares of slopes below which the noise of the instrument may be ignored
_BLOCK = 6.0  # least lengths of correlation along a side of a block
_MOST_BLOCKS = 8  # blocks along an axis
_SCATTER = 1e-3  # probability below which blocks scatter more than those of a homogeneous Gaussian surface
_ROUNDING = 1e-20  # share of the variance of heights below which differences are errors of rounding
_LEAST_PAIRS = 500  # neighbours without holes, and mixed differences
_COARSER = (2, 4)  # steps of the grid over which slopes are also stated
_GROWTH = 1.1  # ratio of slopes over a pixel and over two from which finer pixels would show steeper ones
_OBLIQUE = 1.2  # ratio of principal slopes from which their direction matters
_TEXTURE = 3.0  # ratio of principal slopes that no isotropic surface has, also where few areas are independent
_DIFFERENT = 0.01  # probability of isotropy below which a surface is anisotropic


class Moments(NamedTuple):
    """Skewness and kurtosis of heights or slopes."""

    skewness: float  #: 0 of a Gaussian [1]
    skewness_error: float  #: its standard error for the number of independent areas [1]
    kurtosis: float  #: 3 of a Gaussian [1]
    kurtosis_error: float  #: its standard error [1]

    @property
    def gaussian(self) -> bool:
        """True if both are within three standard errors of those of a Gaussian."""
        return abs(self.skewness) <= 3.0 * self.skewness_error and abs(self.kurtosis - 3.0) <= 3.0 * self.kurtosis_error


class InstrumentNoise(NamedTuple):
    """White noise of the instrument."""

    #: "given" by the caller; "estimated" from a flat end of the spectrum, and taken out; "negligible", less than 1 %
    #: of the mean squares of slopes; "not separable" from roughness: intervals include those of 0 and of `sigma_um`
    kind: NoiseKind
    sigma_um: float  #: its standard deviation; of negligible and inseparable noise the largest possible one [um]

    @property
    def in_words(self) -> str:
        """The noise in words."""
        return {
            "given": f"{self.sigma_um:.3g} um, as given",
            "estimated": f"{self.sigma_um:.3g} um, from the flat end of the spectrum",
            "negligible": f"at most {self.sigma_um:.2g} um, negligible",
            "not separable": f"at most {self.sigma_um:.3g} um, not separable from roughness",
        }[self.kind]


class Anisotropy(NamedTuple):
    """Direction in which slopes are largest."""

    ratio: float  #: largest over smallest rms slope of all directions [1]
    direction_deg: float  #: azimuth of the largest slopes, counter-clockwise from x, in [0, 180) [degree]
    probability: float  #: probability that an isotropic surface departs as far by chance [1]

    @property
    def significant(self) -> bool:
        """True if an isotropic surface would depart as far in less than 1 % of maps, or if the ratio exceeds 3."""
        return self.probability < _DIFFERENT or self.ratio > _TEXTURE


class BlockScatter(NamedTuple):
    """Spread of a mean square over blocks of the map."""

    blocks: int  #: number of blocks
    #: their variance over that of a homogeneous Gaussian surface. Intervals are widened where it is not chance [1]
    ratio: float
    probability: float  #: probability of such a ratio by chance [1]

    @property
    def factor(self) -> float:
        """Return the factor of variances: 1 where chance explains the scatter."""
        return max(1.0, self.ratio) if self.probability < _SCATTER else 1.0


@dataclass(frozen=True)
class SurfaceStatistics:
    """Statistics of a surface, of which a map shows a part.

    Intervals contain the value of the surface (not of the map) with a probability of 95 %.
    """

    sigma_0_um: HeightInterval  #: rms height, corrected for noise and levelling [um]
    tau_x_um: HeightInterval | None  #: length along x where the correlation is 1 / e; None: not seen [um]
    tau_y_um: HeightInterval | None  #: the same along y [um]
    slope_x: HeightInterval  #: rms slope along x between neighbouring nodes, without noise [1]
    slope_y: HeightInterval  #: the same along y [1]
    exponent: HeightInterval  #: H of the correlation exp(-(r / tau)^(2 H)); 1 is Gaussian, 0.5 exponential [1]
    coarser: tuple[tuple[int, float, float], ...]  #: steps of the grid, and slopes along x and y between such nodes
    heights: Moments  #: skewness and kurtosis of heights
    slopes_x: Moments | None  #: the same of slopes along x; None: heights do not vary along x
    slopes_y: Moments | None  #: the same along y
    anisotropy: Anisotropy
    noise: InstrumentNoise
    lost: float  #: share of the variance that levelling and the finite map took; it is added to sigma_0^2 [1]
    areas: float  #: independent areas of the map, the degrees of freedom of sigma_0^2
    scatter: dict[str, BlockScatter]  #: of sigma_0, slope_x and slope_y; empty if fewer than four blocks fit
    step_um: tuple[float, float]  #: distances of nodes along x and y [um]
    width_um: tuple[float, float]  #: lengths of the map along x and y [um]
    count: int  #: heights that were used

    @property
    def tau_um(self) -> float:
        """Return the geometric mean of the lengths along x and y that are known [um]."""
        known = [tau.value for tau in (self.tau_x_um, self.tau_y_um) if tau is not None]
        return float(np.exp(np.mean(np.log(known))))

    @property
    def slope(self) -> float:
        """Return the rms slope along an axis, in the mean of both [1]."""
        return math.sqrt(0.5 * (self.slope_x.value**2 + self.slope_y.value**2))

    @property
    def form(self) -> str:
        """Return the form of the correlation in words."""
        if self.exponent.low > 1.0 and self.exponent.value > 1.05:
            return "steeper than Gaussian, as of a surface of limited bandwidth"
        gaussian = self.exponent.low <= 1.0 <= self.exponent.high
        exponential = self.exponent.low <= 0.5 <= self.exponent.high
        if gaussian and exponential:
            return "Gaussian or exponential, the map does not tell"
        if gaussian or exponential:
            return "Gaussian" if gaussian else "exponential"
        if self.exponent.value > 0.9:
            return "nearly Gaussian"
        return (
            "between exponential and Gaussian"
            if self.exponent.value > 0.5
            else "steeper than exponential at the origin"
        )

    def document(self) -> dict[str, Any]:
        """Return the statistics as JSON."""
        document = asdict(self)
        for name, value in document.items():
            if hasattr(value, "_asdict"):
                document[name] = value._asdict()
        document["scatter"] = {name: scatter._asdict() for name, scatter in self.scatter.items()}
        return document | {"form": self.form, "confidence": CONFIDENCE}


def surface_statistics(
    levelled: Levelled, *, noise_um: float | None = None, stage: Callable[[str], None] = lambda _: None
) -> SurfaceStatistics:
    """Return statistics of a surface from a levelled map, with intervals of 95 %.

    Parameters
    ----------
    levelled : Levelled
        The map, as `brdfdb.microgeometry.levelling.levelled` returns it.
    noise_um : float, optional
        Standard deviation of the white noise of the instrument [um], for example from the difference of two
        measurements over sqrt(2). By default it is estimated.
    stage : function, optional
        Called with words on what is computed next.

    Returns
    -------
    SurfaceStatistics

    Raises
    ------
    ParameterError
        If the map is shorter than eight lengths of correlation along both axes, if a length of correlation is below
        two steps of the grid, or if the noise exceeds the heights.

    Notes
    -----
    Noise has a flat spectrum. It is seen by mixed differences of orders 4 and 6 along both axes, which leave nothing of
    a smooth surface. If both orders agree, and the correlation is smooth at the pixel (H above 0.75), it is taken out.

    Levelling and the mean of a finite map take a part of the variance, and of the covariance. It is the variance of the
    surface along the polynomials that were subtracted, which follows from the fitted form of the correlation.
    """
    return _Map(levelled, stage).statistics(noise_um)


def instrument_noise(levelled: Levelled, noise_um: float | None = None) -> InstrumentNoise:
    """Return the noise of the instrument in a levelled map, as `surface_statistics` states it, with its errors.

    Maps may be of any size: the noise of few heights is not separable.
    """
    z = levelled.measured.heights_um
    if noise_um is not None:
        return _given(noise_um, z)
    differences = [_difference(z, axis) for axis in (0, 1)]
    if min(np.count_nonzero(np.isfinite(part)) for part in differences) >= _LEAST_PAIRS:
        return _Map(levelled, lambda _: None).noise(None, float(np.nanvar(z)))
    return InstrumentNoise("not separable", math.sqrt(0.5 * min(np.nanmean(part**2) for part in differences)))


def _given(noise_um: float, z: Array) -> InstrumentNoise:
    """Return noise that is given; ParameterError if the heights, or those of neighbours, differ too little."""
    most = math.sqrt(min(float(np.nanvar(z)), *(0.5 * float(np.nanmean(_difference(z, axis) ** 2)) for axis in (0, 1))))
    if not 0.0 <= noise_um < most:
        text = f"{noise_um:g} um is not at least 0 and below {most:.3g} um, the largest noise that the map can have: "
        text += "neighbouring heights differ by sqrt(2) times the noise or more"
        raise ParameterError("noise_um", text, noise_um, (0.0, most))
    return InstrumentNoise("given", noise_um)


class _Estimates(NamedTuple):
    """Estimates for one variance of the noise."""

    sigma: HeightInterval
    tau: tuple[HeightInterval | None, HeightInterval | None]
    slopes: tuple[HeightInterval, HeightInterval]
    exponent: HeightInterval


class _Map:
    """A levelled map with its periodograms."""

    def __init__(self, levelled: Levelled, stage: Callable[[str], None]) -> None:
        measured = levelled.measured
        self.z = measured.heights_um
        self.degree = levelled.degree
        self.step = (measured.step_x_um, measured.step_y_um)
        self.width = measured.widths_um
        stage("spectra of heights and slopes")
        self.heights = Periodogram(self.z)
        self.differences = tuple(Periodogram(_difference(self.z, axis)) for axis in (0, 1))
        pairs = min(difference.count for difference in self.differences)
        if pairs < _LEAST_PAIRS:
            text = f"holes leave {pairs} pairs of neighbours; at least {_LEAST_PAIRS} are needed for slopes"
            raise ParameterError("holes", text, pairs, (_LEAST_PAIRS, self.z.size))
        low, high = (Periodogram(_mixed(self.z, order)) for order in _ORDERS)
        self.rough = high
        self.seen = high.count > _LEAST_PAIRS
        self.ceiling = MeanSquare(high.mean(high.power), high.variance(high.power))
        ratio = self.ceiling.value / max(low.mean(low.power), 1e-300)
        spread = math.sqrt(self.ceiling.variance) / max(self.ceiling.value, 1e-300)
        self.flat = self.seen and abs(ratio - 1.0) < max(_FLAT, 3.0 * spread)
        self.stage = stage

    def statistics(self, noise_um: float | None) -> SurfaceStatistics:
        variance = self.heights.mean(self.heights.power)
        noise = self.noise(noise_um, variance)
        taken = noise.sigma_um**2 if noise.kind in ("given", "estimated") else 0.0
        covariance = levelled_covariance(self.z, self.degree, taken)
        self._check_lengths(covariance)
        model = self._model(covariance, taken)
        self.stage("distributions")
        moments = {"sigma_0": _moments(self.z, model, np.ones(1))}
        for axis, name in enumerate(("slope_x", "slope_y")):
            moments[name] = _moments(_difference(self.z, axis), model, model.difference_gain(axis))
        heights = moments["sigma_0"]
        assert heights is not None  # flat maps are refused by levelling
        self.stage("intervals")
        scatter = self._scatter(model)
        factors = {name: _factor(moment, scatter.get(name)) for name, moment in moments.items()}
        estimates = self._estimates(covariance, taken, noise.kind == "estimated", factors)
        if noise.kind == "not separable":
            quiet = levelled_covariance(self.z, self.degree, noise.sigma_um**2)
            estimates = _either(estimates, self._estimates(quiet, noise.sigma_um**2, True, factors))
        return SurfaceStatistics(
            sigma_0_um=estimates.sigma,
            tau_x_um=estimates.tau[0],
            tau_y_um=estimates.tau[1],
            slope_x=estimates.slopes[0],
            slope_y=estimates.slopes[1],
            exponent=estimates.exponent,
            coarser=tuple((lag, self._slope_over(lag, 0, taken), self._slope_over(lag, 1, taken)) for lag in _COARSER),
            heights=heights,
            slopes_x=moments["slope_x"],
            slopes_y=moments["slope_y"],
            anisotropy=self._anisotropy(model, taken),
            noise=noise,
            lost=covariance.lost,
            areas=MeanSquare(model.mean_power, model.variance(np.ones(1))).areas,
            scatter=scatter,
            step_um=self.step,
            width_um=self.width,
            count=self.heights.count,
        )

    def _model(self, covariance: LevelledCovariance, noise: float) -> FieldModel:
        """Return the field that has a covariance, with a variance of the noise."""
        return FieldModel(covariance.form, covariance.along[0][0], noise, self.z.shape, self.heights.count)

    def noise(self, noise_um: float | None, variance: float) -> InstrumentNoise:
        """Return the noise, given, estimated or bounded."""
        if noise_um is not None:
            return _given(noise_um, self.z)
        slopes = min(difference.mean(difference.power) for difference in self.differences)
        most = self.ceiling.value if self.seen else 0.5 * slopes  # many holes leave no mixed differences
        if 2.0 * most <= _NEGLIGIBLE * slopes:
            return InstrumentNoise("negligible", math.sqrt(most))
        if self.flat and most < variance:
            form = levelled_covariance(self.z, self.degree, most).form
            if form.exponent > _SMOOTH:
                return InstrumentNoise("estimated", math.sqrt(most))
        return InstrumentNoise("not separable", math.sqrt(min(most, 0.5 * slopes, 0.5 * variance)))

    def _slope_over(self, lag: int, axis: int, noise: float) -> float:
        """Return the rms slope [1] between nodes that are some steps apart."""
        z = self.z if axis == 0 else self.z.T
        square = float(np.nanmean((z[lag:] - z[:-lag]) ** 2)) - 2.0 * noise
        return math.sqrt(max(square, 0.0)) / (lag * self.step[axis])

    def _check_lengths(self, covariance: LevelledCovariance) -> None:
        """Refuse maps that are too small or too coarse."""
        lengths = [self._tau(covariance, axis) for axis in (0, 1)]
        form = covariance.form
        if all(tau is None for tau in lengths):
            axis = int(np.argmax([self.z.shape[0] / form.tau_x, self.z.shape[1] / form.tau_y]))
            tau_um = (form.tau_x, form.tau_y)[axis] * self.step[axis]
            text = (
                f"the map is {self.width[axis]:.3g} um long, {self.width[axis] / tau_um:.2g} lengths of correlation of "
            )
            text += f"{tau_um:.3g} um; at least {FEWEST_LENGTHS:g} are needed along an axis: measure a larger area, or "
            text += "subtract a quadratic surface if the map is bent"
            raise ParameterError("tau_um", text, tau_um)
        for axis, tau in enumerate(lengths):
            if tau is not None and tau < _FINEST:
                text = f"the length of correlation along {'xy'[axis]} is {tau:.2g} pixels; {_FINEST:g} or more are "
                text += "needed: measure with a smaller pixel"
                raise ParameterError("tau_um", text, tau * self.step[axis])

    def _tau(self, covariance: LevelledCovariance, axis: int) -> float | None:
        """Return the length of correlation [steps]; None if the map is too short for it."""
        tau = crossing(covariance.along[axis])
        return None if tau is None or self.z.shape[axis] < FEWEST_LENGTHS * tau else tau

    def _estimates(
        self, covariance: LevelledCovariance, noise: float, estimated: bool, factors: dict[str, float]
    ) -> _Estimates:
        """Return estimates with their intervals for a variance of the noise, which differences may have estimated."""
        model = self._model(covariance, noise)
        rough = response = np.zeros(1)
        if estimated:
            order = _ORDERS[1]
            both = model.difference_gain(0) * model.difference_gain(1)
            rough, response = self.rough.power, (both / math.comb(2 * order, order) ** (2.0 / order)) ** order

        def mean_square(field: Periodogram, weight: Array, times: float, name: str) -> MeanSquare:
            spread = max(field.variance(field.power - times * rough), model.variance(weight - times * response))
            return MeanSquare(field.mean(field.power) - times * noise, factors[name] * spread)

        heights = mean_square(self.heights, np.ones(1), 1.0, "sigma_0")
        sigma = heights.root().scaled(1.0 / math.sqrt(1.0 - covariance.lost))
        student = float(import_extra("scipy.stats").t.ppf(0.5 + 0.5 * CONFIDENCE, max(3.0, 0.5 * heights.areas)))
        slopes: list[HeightInterval] = []
        taus: list[HeightInterval | None] = []
        for axis, difference in enumerate(self.differences):
            square = mean_square(difference, model.difference_gain(axis), 2.0, f"slope_{'xy'[axis]}")
            slopes.append(square.root().scaled(1.0 / self.step[axis]))
            tau = self._tau(covariance, axis)
            if tau is None:
                taus.append(None)
                continue
            along = covariance.along[axis]
            weight = (np.cos(model.wave_number(axis) * tau) - math.exp(-1.0)) / along[0]
            variance = max(self.heights.variance(self.heights.power * weight), model.variance(weight))
            fall = (along[int(tau)] - along[int(tau) + 1]) / along[0]
            error = math.sqrt(variance * factors["sigma_0"]) / max(fall, 1e-9) / tau
            factor = math.exp(student * error)
            taus.append(HeightInterval(tau, tau / factor, tau * factor).scaled(self.step[axis]))
        h = covariance.form.exponent
        error = student * exponent_error(covariance, model, self.heights)
        exponent = HeightInterval(h, h - error, h + error)
        return _Estimates(sigma, (taus[0], taus[1]), (slopes[0], slopes[1]), exponent)

    def _scatter(self, model: FieldModel) -> dict[str, BlockScatter]:
        """Return the scatter of mean squares over blocks of several lengths of correlation."""
        lengths = (model.form.tau_x, model.form.tau_y)
        count = [
            int(np.clip(nodes // (_BLOCK * tau), 1, _MOST_BLOCKS))
            for nodes, tau in zip(self.z.shape, lengths, strict=True)
        ]
        blocks = count[0] * count[1]
        if blocks < 4:
            return {}
        chi2 = import_extra("scipy.stats").chi2
        scatter = {}
        fields = {"sigma_0": (self.z, np.ones(1))}
        for axis, name in enumerate(("slope_x", "slope_y")):
            fields[name] = (_difference(self.z, axis), model.difference_gain(axis))
        for name, (field, weight) in fields.items():
            squares = [
                float(np.nanmean(part**2))
                for rows in np.array_split(field, count[0], axis=0)
                for part in np.array_split(rows, count[1], axis=1)
                if np.count_nonzero(np.isfinite(part)) > part.size // 4
            ]
            if len(squares) >= 4:
                ratio = float(np.var(squares, ddof=1)) / (model.variance(weight) * blocks)
                free = len(squares) - 1
                scatter[name] = BlockScatter(len(squares), ratio, float(chi2.sf(ratio * free, free)))
        return scatter

    def _anisotropy(self, model: FieldModel, noise: float) -> Anisotropy:
        """Return the direction and ratio of the principal slopes, and whether chance explains them."""
        h_x, h_y = self.step
        power = [field.power / h**2 for field, h in zip(self.differences, self.step, strict=True)]
        xx, yy = (self.heights.mean(part) - 2.0 * noise / h**2 for part, h in zip(power, self.step, strict=True))
        # noise cancels in the difference of both diagonals
        rising = self.z[1:, 1:] - self.z[:-1, :-1]
        falling = self.z[1:, :-1] - self.z[:-1, 1:]
        xy = float(np.nanmean(rising**2 - falling**2)) / (4.0 * h_x * h_y)
        total = max(xx + yy, 1e-300)
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
        half = math.hypot(0.5 * (xx - yy), xy)
        least = max(0.5 * total - half, 1e-12 * total)
        weights = [model.difference_gain(axis) / h**2 for axis, h in enumerate(self.step)]
        straight = max(1e-300, model.variance(weights[0] - weights[1]), self.heights.variance(power[0] - power[1]))
        oblique = np.sin(model.k_x) * np.sin(model.k_y) * (2.0 / (h_x * h_y))
        skew = max(1e-300, model.variance(oblique), self.heights.variance(self.heights.power * oblique))
        square = (xx - yy) ** 2 / straight + (2.0 * xy) ** 2 / skew
        ratio = math.sqrt((0.5 * total + half) / least)
        return Anisotropy(ratio, math.degrees(angle) % 180.0, math.exp(-0.5 * square))


def _factor(moments: Moments | None, scatter: BlockScatter | None) -> float:
    """Return the factor of the variance of a mean square, against that of a homogeneous Gaussian surface.

    The variance of squares is (kurtosis - 1) / 2 times that of a Gaussian. Blocks tell the rest.
    """
    factor = 1.0 if scatter is None else scatter.factor
    if moments is None or moments.gaussian:
        return factor
    return max(factor, 0.5 * (moments.kurtosis - 1.0), 1.0 if scatter is None else scatter.ratio)


def _either(first: _Estimates, second: _Estimates) -> _Estimates:
    """Return the first estimates with intervals that contain those of both."""

    def both(interval: HeightInterval, other: HeightInterval) -> HeightInterval:
        return HeightInterval(interval.value, min(interval.low, other.low), max(interval.high, other.high))

    taus = [a if a is None or b is None else both(a, b) for a, b in zip(first.tau, second.tau, strict=True)]
    slopes = [both(a, b) for a, b in zip(first.slopes, second.slopes, strict=True)]
    return _Estimates(
        both(first.sigma, second.sigma),
        (taus[0], taus[1]),
        (slopes[0], slopes[1]),
        both(first.exponent, second.exponent),
    )


def _difference(z: Array, axis: int) -> Array:
    """Return differences of neighbours along an axis, with a last row or column of holes."""
    difference = np.full(z.shape, np.nan)
    if axis == 0:
        difference[:-1] = z[1:] - z[:-1]
    else:
        difference[:, :-1] = z[:, 1:] - z[:, :-1]
    return difference


def _mixed(z: Array, order: int) -> Array:
    """Return mixed differences of an order along both axes, scaled so that white noise keeps its variance."""
    edge = order // 2
    mixed = np.full(z.shape, np.nan)
    inner = np.diff(np.diff(z, order, axis=0), order, axis=1) / math.comb(2 * order, order)
    mixed[edge : edge + inner.shape[0], edge : edge + inner.shape[1]] = inner
    return mixed


def _moments(field: Array, model: FieldModel, weight: Array) -> Moments | None:
    """Return skewness and kurtosis, with their standard errors for Gaussian fields; None of a field that is 0."""
    values = field[np.isfinite(field)]
    values = values - values.mean()
    squares = values * values
    square = float(squares.mean())
    if square <= _ROUNDING * model.mean_power:
        return None
    cubes = model.correlation_sum(weight, 3)
    fourth = model.correlation_sum(weight, 4)
    return Moments(
        float(np.mean(squares * values)) / square**1.5,
        math.sqrt(6.0 * max(cubes, 0.0) / values.size),
        float(np.mean(squares * squares)) / square**2,
        math.sqrt(24.0 * max(fourth, 0.0) / values.size),
    )


def uncertain(levelled: Levelled, surface: SurfaceStatistics) -> list[str]:
    """Return a sentence on each reason to doubt the statistics of a map."""
    sentences = []
    size = levelled.measured.heights_um.size
    if levelled.filled:
        sentences.append(f"{levelled.filled} heights of {size} are interpolated, and smoother than the surface")
    elif levelled.holes:
        sentences.append("instruments lose steep facets first: slopes may be larger than stated")
    if levelled.outliers and not levelled.left_out:
        sentences.append(f"{levelled.outliers} outliers are kept; they raise sigma_0, slopes and kurtosis")
    if levelled.steps and not levelled.removed:
        sentences.append(f"{len(levelled.steps)} steps are kept; they raise sigma_0 and lengthen the correlation")
    if surface.noise.kind == "not separable":
        sentences.append(
            "the surface is rough down to the pixel: intervals contain the values without noise and with the largest "
            "possible noise; noise_um, from two measurements of the same area, narrows them"
        )
    for axis, tau, width in zip("xy", (surface.tau_x_um, surface.tau_y_um), surface.width_um, strict=True):
        if tau is None:
            sentences.append(f"the correlation along {axis} is longer than an eighth of the map; no tau is stated")
        elif width < FEW_LENGTHS * tau.value:
            lengths = width / tau.value
            sentences.append(
                f"the map has only {lengths:.3g} lengths of correlation along {axis}; 20 or more are better"
            )
    for axis, fine, coarse in (
        ("x", surface.slope_x.value, surface.coarser[0][1]),
        ("y", surface.slope_y.value, surface.coarser[0][2]),
    ):
        if fine > _GROWTH * coarse:
            sentences.append(
                f"slopes along {axis} grow from {coarse:.3g} over two pixels to {fine:.3g} over one: finer "
                "pixels would show steeper slopes"
            )
    steepest = max(surface.slope_x.value, surface.slope_y.value)
    if steepest > _STEEP:
        sentences.append(
            f"rms slopes of {steepest:.3g} are those of {math.degrees(math.atan(steepest)):.0f} degrees, steeper than "
            "instruments measure: are the units of heights and pixels right?"
        )
    turned = surface.anisotropy
    if turned.significant and turned.ratio > _OBLIQUE and 10.0 < turned.direction_deg % 90.0 < 80.0:
        sentences.append(
            f"the texture is oblique, {turned.direction_deg:.0f} degrees from x: tau and slopes along x and y are not "
            "the principal ones; turn the sample"
        )
    if not surface.heights.gaussian:
        sentences.append(
            "the heights are not Gaussian: intervals are widened by their kurtosis, and may still be too narrow"
        )
    wider = [name for name, scatter in surface.scatter.items() if scatter.factor > 1.0]
    if wider:
        sentences.append(
            f"{' and '.join(wider)} of blocks of the map differ by more than chance: the surface is not homogeneous or "
            "not Gaussian, and another place on it may differ more"
        )
    return sentences
