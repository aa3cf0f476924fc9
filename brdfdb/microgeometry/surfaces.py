"""Made surfaces: Gaussian height fields with a given correlation, and V-grooves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, import_extra
from brdfdb.microgeometry.height_map import HeightMap

Correlation = Literal["gaussian", "exponential", "band"]
Kind = Literal["gaussian", "exponential", "band", "grooves", "gaussian-grooves"]
KINDS: tuple[Kind, ...] = get_args(Kind)

_FLATTEST, _STEEPEST = 1e-3, 10.0  # slopes of made surfaces [1]
_MOST_NODES = 2048  # along each axis; the facets of a map of so many nodes take 2 GB


def gaussian_field(
    *,
    sigma_0_um: float,
    tau_x_um: float,
    tau_y_um: float | None = None,
    step_um: float,
    nodes: int,
    correlation: Correlation = "gaussian",
    seed: int = 0,
) -> HeightMap:
    """Return a periodic height map whose heights are a Gaussian random field.

    Parameters
    ----------
    sigma_0_um : float [um]
        Standard deviation of the heights. The map that is drawn departs from it: `HeightMap.realised` says by how much.
    tau_x_um, tau_y_um : float [um]
        Lengths of correlation along x and y; `tau_y_um` is by default that of x. With r^2 = (x / tau_x)^2 +
        (y / tau_y)^2 the correlation is exp(-r^2) if it is "gaussian", and exp(-r) if it is "exponential"; that of
        "band" is the correlation of a flat spectrum up to the frequency 2 / tau, 2 J_1(2 r) / (2 r).
    step_um : float [um]
        Distance of nodes.
    nodes : int
        Number of nodes along each axis.
    seed : int
        The same seed gives the same map.

    Returns
    -------
    HeightMap

    Raises
    ------
    ParameterError
        If a length is not positive, if fewer than ten lengths of correlation fit on the map, or if fewer than two nodes
        fit into a length of correlation.

    Notes
    -----
    The slopes of a Gaussian correlation have the standard deviation sqrt(2) sigma_0 / tau along each axis. Those of an
    exponential correlation have none: it grows as the step becomes smaller.
    """
    lengths = {"tau_x_um": tau_x_um, "tau_y_um": tau_x_um if tau_y_um is None else tau_y_um}
    for name, length in {"sigma_0_um": sigma_0_um, "step_um": step_um, **lengths}.items():
        if not 0.0 < length < np.inf:
            raise ParameterError(name, f"{length:g} um is not a positive length", length, (0.0, np.inf))
    for name, tau in lengths.items():
        if nodes * step_um < 10.0 * tau:
            fitting = nodes * step_um / tau
            raise ParameterError(name, f"{tau:g} um fits {fitting:.3g} times on the map; at least 10 are needed", tau)
        if tau < 2.0 * step_um:
            raise ParameterError(name, f"{tau:g} um is less than two steps of {step_um:g} um", tau)
    power = _power(correlation, lengths["tau_x_um"] / step_um, lengths["tau_y_um"] / step_um, nodes)
    white = np.random.default_rng(seed).standard_normal((nodes, nodes))
    heights = np.fft.ifft2(np.fft.fft2(white) * np.sqrt(power / power.mean())).real
    return HeightMap(sigma_0_um * heights, step_um, step_um, periodic=True, name=f"{correlation} {seed}")


def _power(correlation: str, tau_x: float, tau_y: float, nodes: int) -> NDArray[np.float64]:
    """Return the spectrum of a correlation on a grid, but for its scale, with lengths in steps of the grid."""
    frequency = 2.0 * np.pi * np.fft.fftfreq(nodes)
    k2 = (frequency[:, np.newaxis] * tau_x) ** 2 + (frequency * tau_y) ** 2
    match correlation:
        case "gaussian":
            power = np.exp(-0.25 * k2)
        case "exponential":
            power = (1.0 + k2) ** -1.5
        case "band":
            power = np.where(k2 <= 4.0, 1.0, 0.0)
        case _:
            allowed = get_args(Correlation)
            text = f"{correlation!r} is not one of {', '.join(allowed)}"
            raise ParameterError("correlation", text, correlation, allowed)
    power[0, 0] = 0.0  # the mean height means nothing
    return power


def v_grooves(slope: float, *, grooves: int = 8) -> HeightMap:
    """Return periodic V-grooves along y, whose walls have one slope angle.

    Parameters
    ----------
    slope : float [rad]
        Angle of the walls to the horizontal, in (0, pi/2).
    grooves : int
        Number of grooves, each of which is 1 um wide.
    """
    if not 0.0 < slope < np.pi / 2:
        raise ParameterError("slope", f"{np.degrees(slope):g} degrees is not in (0, 90)", slope, (0.0, np.pi / 2))
    row = np.where(np.arange(2 * grooves) % 2 == 0, 0.0, -0.5 * np.tan(slope))
    heights = np.repeat(row[:, np.newaxis], 2, axis=1)
    return HeightMap(heights, 0.5, 0.5 * grooves, periodic=True, name=f"V-grooves of {np.degrees(slope):g} degrees")


@dataclass(frozen=True)
class MadeSurface:
    """A kind of made surface, of which each seed draws another map.

    Rays see the shape alone, so that lengths are free: the shorter length of correlation is 1 um, and grooves are 1 um
    wide. ParameterError if a value is outside its range.

    Grooves of Gaussian slopes are symmetric, with their edges in one plane, as those of Oren and Nayar 1994. Over the
    horizontal area, the density of their slope angles theta_a is exp(-theta_a^2 / (2 sigma^2)). With `all_azimuths`,
    where they are polar angles of normals, it is sin(theta_a) exp(-theta_a^2 / (2 sigma^2)), eq. (26) of that paper.
    """

    kind: Kind = "gaussian"  #: correlation of a Gaussian field, or grooves
    #: standard deviation of the slopes of the facets along x, the same in each map but for chance; of "grooves" the
    #: slope of all walls, of "gaussian-grooves" tan(sigma) [1]
    slope: float = 0.3
    slope_y: float | None = None  #: along y; by default as along x, and of grooves 0 [1]
    all_azimuths: bool = False  #: True for grooves that run in all directions, each over an area of its own
    nodes: int = 512  #: nodes of a map along each axis; of "gaussian-grooves", two a groove
    steps: int = 10  #: steps of the grid in the shorter length of correlation; of no effect on grooves

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ParameterError("kind", f"{self.kind!r} is not one of {', '.join(KINDS)}", self.kind, KINDS)
        for name, slope in (("slope", self.slope), ("slope_y", self.slope_y)):
            if slope is not None and not _FLATTEST <= slope <= _STEEPEST:
                text = f"{slope:g} is no slope of a made surface; allowed are {_FLATTEST:g} to {_STEEPEST:g}"
                raise ParameterError(name, text, slope, (_FLATTEST, _STEEPEST))
        if self._grooves and self.slope_y is not None:
            raise ParameterError("slope_y", f"{self.kind} have no slope along y; leave it out", self.slope_y)
        if self.all_azimuths and not self._grooves:
            raise ParameterError("all_azimuths", "is allowed only for grooves", True, (False,))
        if not 16 <= self.nodes <= _MOST_NODES:
            text = f"{self.nodes} is no number of nodes; allowed are 16 to {_MOST_NODES}"
            raise ParameterError("nodes", text, self.nodes, (16, _MOST_NODES))
        if not self._grooves and self.steps < 2:
            raise ParameterError(
                "steps", f"{self.steps} is no number of steps; allowed is 2 or more", self.steps, (2, None)
            )
        if not self._grooves and self.nodes < (least := 10 * self.steps):
            text = f"{self.nodes} nodes are less than ten lengths of correlation; allowed is {least} or more"
            raise ParameterError("nodes", text, self.nodes, (least, _MOST_NODES))
        if not self._grooves:
            self._shape()

    @property
    def _grooves(self) -> bool:
        return self.kind in ("grooves", "gaussian-grooves")

    @property
    def isotropic(self) -> bool:
        """True if f_r does not change when the surface is turned about its normal."""
        return self.all_azimuths if self._grooves else self.slope_y in (None, self.slope)

    @property
    def gaussian_slopes(self) -> tuple[float, float] | None:
        """Standard deviations of the slopes along x and y [1] of a Gaussian field; None of grooves."""
        return None if self._grooves else (self.slope, self.slope if self.slope_y is None else self.slope_y)

    def draw(self, seed: int) -> HeightMap:
        """Return the periodic map of a seed."""
        if self.kind == "grooves":
            return v_grooves(float(np.arctan(self.slope)))
        if self.kind == "gaussian-grooves":
            return self._gaussian_grooves(seed)
        sigma_0, tau_x, tau_y = self._shape()
        return gaussian_field(
            sigma_0_um=sigma_0,
            tau_x_um=tau_x,
            tau_y_um=tau_y,
            step_um=1.0 / self.steps,
            nodes=self.nodes,
            correlation=self.kind,
            seed=seed,
        )

    def _shape(self) -> tuple[float, float, float]:
        """Return sigma_0, tau_x and tau_y [um] with which the facets of the grid have these slopes in the mean."""
        steepest, flattest = self.slope, self.slope if self.slope_y is None else self.slope_y
        along_x = steepest >= flattest
        if not along_x:
            steepest, flattest = flattest, steepest

        def slopes(ratio: float) -> NDArray[np.float64]:
            """Return the slopes, of heights of 1 um, along the axis of the shorter length and of the longer."""
            power = _power(self.kind, self.steps, self.steps * ratio, self.nodes)
            rise = (2.0 * self.steps * np.sin(np.pi * np.fft.fftfreq(self.nodes))) ** 2
            return np.asarray(np.sqrt([rise @ power.sum(axis=1), rise @ power.sum(axis=0)] / power.sum()))

        ratio = 1.0
        if steepest != flattest:
            longest = self.nodes / (10.0 * self.steps)
            wanted = steepest / flattest
            if wanted > float(np.divide(*slopes(longest))):
                text = f"with slopes of {steepest:g} and {flattest:g}, ten lengths of correlation need more than "
                text += f"{self.nodes} nodes"
                raise ParameterError("slope_y", text, self.slope_y)
            brentq = import_extra("scipy.optimize").brentq
            ratio = float(brentq(lambda trial: np.divide(*slopes(trial)) - wanted, 1.0, longest, xtol=1e-9))
        sigma_0 = steepest / float(slopes(ratio)[0])
        return (sigma_0, 1.0, ratio) if along_x else (sigma_0, ratio, 1.0)

    def _gaussian_grooves(self, seed: int) -> HeightMap:
        """Return grooves whose slopes are spread evenly over their distribution, in a random order."""
        sigma = np.arctan(self.slope)
        theta_a = np.linspace(0.0, np.pi / 2, 100_001)
        density = np.exp(-0.5 * (theta_a / sigma) ** 2) * (np.sin(theta_a) if self.all_azimuths else 1.0)
        share = np.cumsum(density) - 0.5 * density - 0.5 * density[0]
        rng = np.random.default_rng(seed)
        count = self.nodes // 2
        places = (rng.permutation(count) + rng.random(count)) / count
        drawn = np.interp(places * share[-1], share, theta_a)
        row = np.zeros(2 * count)
        row[1::2] = -0.5 * np.tan(drawn)
        heights = np.repeat(row[:, np.newaxis], 2, axis=1)
        return HeightMap(heights, 0.5, 0.5 * count, periodic=True, name=f"grooves of Gaussian slopes {seed}")
