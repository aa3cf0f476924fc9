"""Documents of reflected Stokes vectors: what a polarised table makes of one incident Stokes vector."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, Field

from brdfdb.errors import ParameterError
from brdfdb.tables import stokes
from brdfdb.tables.points import Points

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

_ROUNDING = 1e-6  # of the degree of polarisation of what is written as decimals


class StokesDocument(BaseModel):
    """Reflected light of a polarised table, for one incident Stokes vector."""

    incident: list[float] = Field(description="Stokes vector (I, Q, U, V) of the irradiance")
    reflected: list[Any] = Field(description="Stokes vector of the radiance [1/sr]: shape of brdf, then I, Q, U, V")
    specular: list[Any] = Field(
        description="of the specular part, without unit, towards phi_i + 180 degrees: shape of specular_reflectance, "
        "then I, Q, U, V"
    )
    convention: str = Field(description="meaning of Q, U and V, in words")
    basis: str = Field(description="basis of both vectors, in words")
    element_error: float | None = Field(
        description="99 of 100 of the elements m_ij / m_00 of the Mueller matrix are within it; null: not stated"
    )


def read_stokes(text: str) -> tuple[float, ...]:
    """Return the Stokes vector of a text such as 1,0.5,0,0; ParameterError if it is none of any light."""
    try:
        numbers = tuple(float(number) for number in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 4 or "_" in text or not np.all(np.isfinite(numbers)):
        shown = text.encode("ascii", "backslashreplace").decode()[:40]
        raise ParameterError("stokes", f"{shown!r} is not made of four finite numbers, I,Q,U,V", text)
    intensity, *others = numbers
    if not float(np.linalg.norm(others)) <= (1.0 + _ROUNDING) * intensity:
        raise ParameterError("stokes", f"Q, U and V make more than I = {intensity:g}, which no light does", text)
    return numbers


def stokes_document(table: Table, points: Points, incident: Sequence[float]) -> dict[str, Any]:
    """Return the fields of `StokesDocument`, with numpy arrays; ParameterError as by `Table.mueller`."""
    record = table.metadata.polarisation
    light = np.array(incident)
    specular = table.specular_mueller(points.angles[0], points.wavelength_nm) @ light
    return {
        "incident": list(incident),
        "reflected": np.ascontiguousarray(table.mueller(*points.angles, points.wavelength_nm) @ light),
        "specular": np.ascontiguousarray(specular),
        "convention": stokes.CONVENTION,
        "basis": stokes.SURFACE_BASIS,
        "element_error": None if record is None or record.error is None else record.error.worst_p99,
    }
