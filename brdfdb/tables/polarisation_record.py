"""The record of a polarised table: convention, the stored elements of the Mueller matrix, and their stated error."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.tables import stokes

POLARISATION_VERSION = 1  # of the arrays, and of the record, of a polarised table
ELEMENTS = ("m01", "m22", "m23")

Matrix = list[list[float]]


class ElementError(BaseModel):
    """Error of the normalised elements m_ij / m_00 of a table, abs(table - model), each at its worst wavelength."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    directions: int = Field(description="drawn above the horizon, half over the hemisphere and half in the lobe")
    seed: int
    p99: Matrix = Field(description="[row][column] of the Mueller matrix, between bases of the surface")
    max: Matrix = Field(description="[row][column]")
    between_p99: Matrix | None = Field(
        description="[row][column], half way between neighbouring wavelengths; null: there is one wavelength"
    )
    between_max: Matrix | None = Field(description="[row][column], as between_p99")

    facet: float = Field(
        description="largest error of the stored elements, between bases of the plane, over theta_d: what physical "
        "realisability is judged with"
    )
    between_facet: float | None = Field(description="as facet, half way between neighbouring wavelengths")

    @property
    def worst_p99(self) -> float:
        """Return the largest p99 of all elements."""
        return float(np.max(self.p99))


class Polarisation(BaseModel):
    """The record of a polarised table: convention, the stored elements, and their error."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: int = Field(description="version of the arrays mueller, mueller_theta_d and depolarised")
    convention: str = Field(description="meaning of Stokes vectors, in words")
    surface_basis: str = Field(description="basis of lookups and of the error, in words")
    plane_basis: str = Field(description="basis of the stored elements, in words")
    elements: list[str] = Field(description="stored elements, m_ij over m_00, of light that is not depolarised")
    reconstruction: str = Field(description="the way from the arrays to the Mueller matrix, in words")
    error: ElementError | None = Field(default=None, description="the stated error of the elements; null: not measured")


def record(error: ElementError | None = None) -> Polarisation:
    """Return the record of a polarised table."""
    return Polarisation(
        version=POLARISATION_VERSION,
        convention=stokes.CONVENTION,
        surface_basis=stokes.SURFACE_BASIS,
        plane_basis=stokes.PLANE_BASIS,
        elements=list(ELEMENTS),
        reconstruction=(
            "m10 = m01, m11 = 1, m33 = m22, m32 = -m23, others 0, at theta_d, half the angle between light and viewer, "
            "cubic over theta_d and wavelength; f_r - depolarised times that matrix, between bases of the plane, plus "
            "depolarised in the first element"
        ),
        error=error,
    )
