"""Regions of directions, in which errors of interpolated samples are told apart: one classification for all uses."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.errors import percent
from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements.coordinates import half_angles
from brdfdb.parameters import Floats

REGIONS = ("lobe", "off the lobe", "near the light", "grazing")
_GRAZING_DEG = 70.0  # polar angle of light or viewer from which on a pair is grazing
_NEAR_LIGHT_DEG = 15.0  # angle between light and viewer up to which a viewer is near the light
_AT_A_LIGHT_DEG = 1.0  # distance from a measured light from which on a light is between them
_FEWEST = 30  # errors that tell a region apart
_CONFIDENT = 1.0  # standard errors by which a stated percentile exceeds that of the errors
_ROUNDING = 1e-6  # error of f_r that stored angles make
_STRICT = ConfigDict(frozen=True, extra="forbid")


class RegionError(BaseModel):
    """Error of interpolated f_r at samples that were held out, in one region, relative to f_r or the floor."""

    model_config = _STRICT

    region: str = Field(description=f"one of {', '.join(REGIONS)}")
    between_lights: bool = Field(description="true: the light is none of those that were measured")
    samples: int = Field(description="errors at samples that were held out; those of all regions tell if they are few")
    p95: float = Field(description="95 of 100 samples that were held out are this near to f_r, noise included")
    p99: float


class Regions(BaseModel):
    """Regions of pairs of directions, and the error of f_r in each.

    A pair is grazing if light or viewer are beyond 70 degrees. Other pairs lie in the lobe if tan(theta_h) is at most
    `lobe`, or near the light within 15 degrees of it, or else off the lobe. Each region is told apart for measured
    lights, and for lights between them.
    """

    model_config = _STRICT

    lobe: float = Field(description="tan(theta_h) up to which the lobe outshines the rest of f_r; 0: there is no lobe")
    turned: bool = Field(description="true: the azimuth of the light counts")
    lights_deg: list[tuple[float, float]] = Field(
        description="theta_i and phi_i of the lights that were measured; empty: lights are scattered, none is between"
    )
    errors: list[RegionError] = Field(default_factory=list)

    def number(self, wi: Floats, wr: Floats) -> NDArray[np.int64]:
        """Return the number (N,) of the region of pairs of unit vectors (N, 3); four more for lights in between."""
        tan2_h, theta_d = half_angles(wi, wr)
        grazing = np.minimum(wi[:, 2], wr[:, 2]) < np.cos(radians(_GRAZING_DEG))
        chosen = [grazing, tan2_h <= self.lobe**2, 2.0 * theta_d <= radians(_NEAR_LIGHT_DEG)]
        return np.asarray(np.select(chosen, [3, 0, 2], 1) + len(REGIONS) * self.between(wi))

    def between(self, wi: Floats) -> NDArray[np.bool_]:
        """Return which lights (N, 3) are none of those that were measured."""
        if not self.lights_deg:
            return np.zeros(len(wi), dtype=bool)
        theta, phi = radians(np.array(self.lights_deg)).T
        if not self.turned:
            theta_i = np.arctan2(np.hypot(wi[:, 0], wi[:, 1]), wi[:, 2])
            known = np.sort(theta)
            at = np.searchsorted(known, theta_i)
            gaps = [np.abs(theta_i - known[np.clip(at + step, 0, known.size - 1)]) for step in (-1, 0)]
            return np.asarray(np.minimum(*gaps) > radians(_AT_A_LIGHT_DEG))
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(unit_vector(theta, phi)).query(wi)[0] > radians(_AT_A_LIGHT_DEG))

    def stated(self, number: NDArray[np.int64], errors: Floats) -> Self:
        """Return the regions with the percentiles of errors (N, C) [1] in regions of a number (N,); unknown are nan.

        Percentiles are upper limits with a confidence of 84 %. A region with few errors has the error of all regions
        at measured lights, or between lights, at least.
        """
        listed = []
        for between in (False, True):
            pooled = _known(errors[(number >= len(REGIONS)) == between])
            if not pooled.size:
                pooled = _known(errors)
            for k, name in enumerate(REGIONS):
                own = _known(errors[number == k + len(REGIONS) * between])
                limits = [_limit(own, share) for share in (0.95, 0.99)]
                if own.size < _FEWEST:
                    limits = [max(one, _limit(pooled, p)) for one, p in zip(limits, (0.95, 0.99), strict=True)]
                p95, p99 = (float(f"{limit:.3g}") for limit in limits)
                listed.append(RegionError(region=name, between_lights=between, samples=int(own.size), p95=p95, p99=p99))
        return self.model_copy(update={"errors": listed})

    def p99(self, wi: Floats, wr: Floats) -> Floats:
        """Return the relative error [1] (N,) that 99 of 100 values keep to in the regions of pairs (N, 3)."""
        return np.array([error.p99 for error in self.errors])[self.number(wi, wr)]

    @property
    def sentence(self) -> str:
        """Return the errors of all regions that have samples, in words."""
        parts = []
        for between, where in ((False, "at measured lights"), (True, "between lights")):
            told = [one for one in self.errors if one.between_lights == between and one.samples]
            if told:
                parts.append(f"{where} " + ", ".join(f"{one.region} {percent(one.p95)}" for one in told))
        return f"error at samples held out, 95 of 100, noise included: {'; '.join(parts)}"


def _known(errors: Floats) -> Floats:
    return errors[np.isfinite(errors)]


def _limit(errors: Floats, share: float) -> float:
    """Return the upper limit of a percentile of errors (N,), an order statistic, or rounding at least."""
    if not errors.size:
        return _ROUNDING
    rank = share * errors.size + _CONFIDENT * np.sqrt(share * (1.0 - share) * errors.size)
    return max(float(np.sort(errors)[min(int(np.ceil(rank)), errors.size) - 1]), _ROUNDING)
