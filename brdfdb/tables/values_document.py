"""Documents of the values of a lookup and of the view of a lobe."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from brdfdb.tables.albedo import AlbedoDocument
from brdfdb.tables.evaluation import Output, StokesDocument, Values, ViewName
from brdfdb.tables.table import Table


class Evaluated(BaseModel):
    """Values of a BRDF."""

    source: Literal["table", "model", "family"]
    unit: str = Field(description="unit of brdf and error: 1/sr")
    output: Output
    illuminant: str | None = Field(description="of a colour; null of a spectrum")
    wavelength_nm: float | list[float] | None = Field(description="of the values [nm]; null: grey")
    brdf: float | list[Any] = Field(
        description="shape of the broadcast angles, or of axes_deg, then the wavelengths unless they are one number or "
        "null; of a colour, then three numbers"
    )
    error: float | list[Any] | None = Field(
        description="in the shape of brdf, 99 of 100 values are within that of the model, or of what was measured; "
        "null: not asked for, and in a list: not known, because it is extrapolated"
    )
    extrapolated: bool | list[Any] | None = Field(
        description="shape of the broadcast angles; true: outside of the directions that were measured; null: error "
        "was not asked for"
    )
    glint: bool | list[Any] | None = Field(
        default=None,
        description="shape of the broadcast angles; true: brdf has a glint in it, a peak beside the grid; missing: "
        "the table has none",
    )
    specular_reflectance: float | list[Any] | None = Field(
        description="specular part, a reflectance without unit that is not in brdf: shape of theta_i, then as brdf"
    )


class LobeView(BaseModel):
    """One light, and the axes of the values."""

    view: ViewName
    theta_i: float | None = Field(description="degrees; null of half-difference")
    phi_i: float
    axes_deg: dict[str, list[float]] = Field(
        description="of the axes of brdf, in order; in a cut theta_r is negative back towards the light; in a "
        "hemisphere delta_phi is phi_r - phi_i"
    )


class OfTable(BaseModel):
    """The table of a material that an answer is made of."""

    material: str
    revision: str
    digest: str = Field(
        description="sha256 of the manifest of the revision; other stores use the same numbers for other tables"
    )


class Lookup(Evaluated, OfTable):
    """Values of a material."""

    stokes: StokesDocument | None = Field(
        default=None, description="reflected light of a polarised table; missing: not asked for"
    )


class TableLookups(BaseModel):
    """Values of several materials."""

    materials: list[Lookup]


class TableLobe(Lookup, LobeView):
    """f_r of a material for one light over viewers, or over half and difference angles."""


class TableAlbedoDocument(AlbedoDocument, OfTable):
    """Directional albedo of a table."""


class OfModel(BaseModel):
    """The model, and all of its parameters."""

    model: str
    model_version: int
    parameters: dict[str, Any]


class ModelLookup(Evaluated, OfModel):
    """Values of a model."""


class ModelLobe(Evaluated, LobeView, OfModel):
    """f_r of a model for one light."""


class ModelAlbedo(AlbedoDocument, OfModel):
    """Directional albedo of a model."""


class FamilyLookup(Evaluated):
    """Values of a family."""

    family: str
    parameters: dict[str, float]


def of_table(table: Table) -> dict[str, Any]:
    """Return the fields of `OfTable`."""
    return {"material": table.name, "revision": table.revision, "digest": table.digest}


def values_document(values: Values) -> dict[str, Any]:
    """Return the fields of `Evaluated`, and those of the reflected light if there is some, with numpy arrays."""
    surface = values.surface
    points = values.points
    known = values.error is not None and values.surface.kind == "table"
    lit = surface.kind == "table" and surface.source.glints is not None
    return {
        "source": surface.kind,
        "unit": "1/sr",
        "output": values.output,
        "illuminant": values.illuminant,
        "wavelength_nm": surface.wavelengths(points),
        "brdf": plain(values.brdf),
        "error": plain(values.error),
        "extrapolated": plain(surface.source.extrapolated(*points.angles)) if known else None,
        **({"glint": plain(surface.source.in_glint(*points.angles))} if lit else {}),
        "specular_reflectance": plain(values.specular_reflectance),
        **({} if values.stokes is None else {"stokes": values.stokes}),
    }


def lobe_document(
    values: Values, axes_deg: Mapping[str, Any], view: ViewName, theta_i_deg: float, phi_i_deg: float
) -> dict[str, Any]:
    """Return the fields of `LobeView` and `Evaluated` of a lobe; of half-difference there is no one light."""
    surface = values.surface
    no_light = view == "half-difference"
    document = values_document(values)
    if surface.kind == "table" and surface.source.metadata.measured is not None:
        document["extrapolated"] = plain(surface.source.extrapolated(*values.points.angles))
    if no_light:
        document["specular_reflectance"] = None
    theta_i = None if no_light else theta_i_deg
    return {"view": view, "theta_i": theta_i, "phi_i": phi_i_deg, "axes_deg": axes_deg, **document}


def plain(array: Any) -> Any:
    """Return what orjson can write: a number for a 0-d array, contiguous memory for any other."""
    if isinstance(array, np.ndarray):
        return np.ascontiguousarray(array) if array.ndim else array.item()
    return array


def arrays_of(values: Mapping[str, Values]) -> dict[str, NDArray[Any]]:
    """Return the arrays of values by name: NAME, NAME.error, and NAME.stokes of the reflected light."""
    arrays = {name: np.asarray(entry.brdf) for name, entry in values.items()}
    arrays |= {f"{name}.error": np.asarray(entry.error) for name, entry in values.items() if entry.error is not None}
    return arrays | {f"{name}.stokes": entry.stokes["reflected"] for name, entry in values.items() if entry.stokes}


def npy_bytes(array: NDArray[Any]) -> bytes:
    """Return an array as a .npy file."""
    buffer = io.BytesIO()
    array = np.asarray(array, order="C")
    np.lib.format.write_array_header_1_0(buffer, np.lib.format.header_data_from_array_1_0(array))
    return b"".join((buffer.getvalue(), array.data))  # np.save copies twice
