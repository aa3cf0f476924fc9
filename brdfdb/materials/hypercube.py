"""Latin hypercubes: materials over the ranges of a model, and pairs of directions over both hemispheres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, import_extra
from brdfdb.geometry import degrees
from brdfdb.materials.written_parameters import as_written
from brdfdb.parameters import LEAST_NM, Arguments, ModelSpec, Parameter

Array = NDArray[np.float64]

# Arguments of a spectral model besides its parameters
_LIGHT = (
    Parameter("wavelength_nm", "λ", "nm", LEAST_NM, 1e7, "wavelength in vacuum"),
    Parameter("n", "n", "1", 1e-3, 100.0, "refractive index"),
    Parameter("k", "k", "1", 0.0, 1e4, "extinction coefficient"),
)
_LIGHT_RANGES = (("wavelength_nm", 400.0, 700.0), ("n", 0.2, 3.0), ("k", 0.0, 8.0))
_DECADE = 10.0  # ratio of the ends of a range from which on it is drawn evenly in its logarithm
_LEAST_SHARE = 0.01  # of the drawn materials that must satisfy the condition
_MANY = 1000  # drawn materials from which on that share is judged
_SPARE = 1.05  # more are drawn than the share of the last draw asks for


class Axis(NamedTuple):
    """A drawn parameter, as files write it, and the ends of its range."""

    parameter: Parameter
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        """True if it is drawn evenly in its logarithm."""
        return self.low > 0.0 and self.high >= _DECADE * self.low

    def values(self, u: Array) -> Array:
        """Return the values at u in [0, 1]."""
        if self.logarithmic:
            return np.asarray(np.clip(self.low * (self.high / self.low) ** u, self.low, self.high))
        return np.asarray(self.low + (self.high - self.low) * u)


def axes_of(spec: ModelSpec, ranges: Mapping[str, tuple[float, float]]) -> list[Axis]:
    """Return the drawn parameters of a model: usual ranges, or those given by names as files write them.

    ParameterError says that a name is unknown, or a range is not within that of the parameter.
    """
    usual = {name: ends for name, *ends in (*spec.draw.ranges, *_LIGHT_RANGES)}
    axes = []
    for parameter in (*spec.parameters, *(_LIGHT if spec.spectral else ())):
        if isinstance(parameter.default, bool):
            continue
        low, high = usual.get(parameter.name, (parameter.low, parameter.high))
        if parameter.unit == "rad":
            low = round(float(degrees(low)), 12)
            high = round(float(degrees(high)), 12)
        axes.append(Axis(as_written(parameter), low, high))
    known = [axis.parameter.name for axis in axes]
    for name, (low, high) in ranges.items():
        if name not in known:
            raise ParameterError(
                f"--range {name}", f"the parameters of {spec.name} are {', '.join(known)}", name, known
            )
        index = known.index(name)
        parameter = axes[index].parameter
        if not parameter.low <= low <= high <= parameter.high:
            text = f"{low:g}:{high:g} is no range within {parameter.interval}"
            raise ParameterError(f"--range {name}", text, (low, high), (parameter.low, parameter.high))
        axes[index] = Axis(parameter, low, high)
    return axes


def materials(spec: ModelSpec, axes: list[Axis], count: int, seed: int) -> dict[str, Array]:
    """Return parameters (count,) of materials, as files write them: a Latin hypercube over the axes.

    Materials that break the condition of the model are left out, and others drawn for them. ParameterError says that
    hardly any material of the ranges satisfies the condition.
    """
    rng = np.random.default_rng(seed)
    drawn = count
    while True:
        columns = _latin_hypercube(len(axes), drawn, rng)
        values = {axis.parameter.name: axis.values(u) for axis, u in zip(axes, columns, strict=True)}
        allowed = np.ones(drawn, dtype=bool) if spec.draw.allowed is None else spec.draw.allowed(values)
        kept = int(np.sum(allowed))
        if kept >= count:
            return {name: column[allowed][:count] for name, column in values.items()}
        if kept < _LEAST_SHARE * drawn and drawn >= _MANY:
            raise ParameterError("--range", f"{kept} of {drawn} materials keep {spec.draw.condition}", kept)
        drawn = int(_SPARE * drawn * count / kept) + 1 if kept else 10 * drawn


def pairs(count: int, seed: int) -> dict[str, Array]:
    """Return the angles (count,) [degree] of light and viewer, a Latin hypercube: even in solid angle of either."""
    z_i, turn_i, z_r, turn_r = _latin_hypercube(4, count, np.random.default_rng([seed, 1]))
    return {
        "theta_i": degrees(np.arccos(z_i)),
        "phi_i": 360.0 * turn_i,
        "theta_r": degrees(np.arccos(z_r)),
        "phi_r": 360.0 * turn_r,
    }


def in_units(axes: list[Axis], written: Mapping[str, Array]) -> Arguments:
    """Return parameters as files write them in the units and under the names of the model."""
    return {
        axis.parameter.name.removesuffix("_deg"): np.deg2rad(written[axis.parameter.name])
        if axis.parameter.unit == "degree"
        else written[axis.parameter.name]
        for axis in axes
    }


def _latin_hypercube(variables: int, count: int, rng: np.random.Generator) -> Array:
    """Return points (variables, count) of the unit cube."""
    hypercube = import_extra("scipy.stats.qmc").LatinHypercube
    return np.asarray(hypercube(variables, rng=rng).random(count).T)
