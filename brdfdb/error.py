"""What a table states of its error against its model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.geometry import degrees
from brdfdb.parameters import Floats

_STRICT = ConfigDict(frozen=True, extra="forbid")

Numbers = list[list[float]]


class Overall(BaseModel):
    """Relative error over all bands of theta_i, at the wavelength where it is largest."""

    model_config = _STRICT

    l1: float = Field(description="integral of abs(error) cos theta_r over that of f_r cos theta_r")
    median: float
    p95: float
    p99: float
    max: float


class Error(BaseModel):
    """The error of a table, abs(table - model) / max(model, floor), for each band of theta_i and each wavelength."""

    model_config = _STRICT

    theta_i_deg: list[float] = Field(description="edges of the bands")
    directions: int = Field(description="drawn above the horizon, half over the hemisphere and half in the lobe")
    seed: int
    floor: list[float] = Field(
        description="1/sr, for each wavelength: a thousandth of the Lambertian BRDF of the same albedo"
    )
    l1: Numbers = Field(
        description="[band][wavelength]: integral of abs(error) cos theta_r over that of f_r cos theta_r"
    )
    median: Numbers = Field(description="[band][wavelength]")
    p95: Numbers = Field(description="[band][wavelength]")
    p99: Numbers = Field(description="[band][wavelength]")
    max: Numbers = Field(description="[band][wavelength]")
    overall: Overall


def stated(error: Error, theta_i: Floats, brdf: Floats, wavelength: NDArray[np.int64]) -> Floats:
    """The error [1/sr] that a table states for values of f_r: the 99th percentile of their band and wavelength.

    Parameters
    ----------
    error : Error
        Of the table.
    theta_i : array [rad]
        Of each value, without the axis of the wavelengths.
    brdf : array (..., M) [1/sr]
        What was looked up.
    wavelength : int array (M,)
        Which of the wavelengths of the table.
    """
    band = np.searchsorted(error.theta_i_deg, degrees(np.nan_to_num(theta_i)), side="right") - 1
    band = np.clip(band, 0, len(error.p99) - 1)
    p99, floor = np.array(error.p99)[:, wavelength], np.array(error.floor)[wavelength]
    return np.asarray(p99[band] * np.maximum(brdf, floor) + 0.0 * brdf)
