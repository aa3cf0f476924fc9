"""RGL's tensor files: measured materials of Mitsuba 3, pbrt-v4 and RGL's own loader.

The file holds f_r times the cosine, divided by a density of half vectors, on squares that the density warps. Readers
interpolate linearly along both sides of a square, the angles of the light, and the wavelengths. They also draw
directions with the density.

A file can hold anisotropic tables and all wavelengths. A file of the kind ``rgb`` holds linear sRGB instead. The
specular part is left out.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.formats._interface import MEGABYTES, TOLERANCE, FormatOption
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._written import Written
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.table import Table

suffix = ".bsdf"
media_type = "application/octet-stream"
summary = "tensor files of RGL"
tools = "Mitsuba 3 (`measured`), pbrt-v4, RGL's loader"
kinds = ("spectral", "rgb")
options = (
    TOLERANCE,
    MEGABYTES,
    FormatOption(
        "azimuth",
        "reduced",
        "azimuths of the light in anisotropic tables: a quarter, which Mitsuba 3 completes by symmetry, or all",
        choices=("reduced", "full"),
    ),
)

# Bytes beside the values and the record: its error and remarks, headers of fields, angles; and for each wavelength
_BESIDE = 4000
_BESIDE_EACH = 30
HOLDS = (
    "spectra * ndf(half vector) / (4 sigma(light)) is f_r cos(theta_r) [1/sr], the cosine included; "
    "half vectors are warped by vndf"
)


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    kind: str = "spectral",
    tolerance: float = 0.02,
    megabytes: float = 64.0,
    azimuth: str = "reduced",
    verdict: str | None = None,
) -> Written:
    """Write a table as a tensor file.

    The kind "spectral" is for spectral renderers and has all wavelengths of the table. "rgb" is for others: linear sRGB
    under D65. No reader takes the other kind. `azimuth` "reduced" leaves out azimuths of the light that follow from the
    symmetry of an anisotropic table, as only Mitsuba 3 knows it. "full" is also for pbrt-v4 and RGL's loader: within
    the same error, the file is up to four times as large.
    """
    from brdfdb.formats._record import U_AXIS, frame_remark, record, specular_remark
    from brdfdb.formats._written import Written, whole
    from brdfdb.formats.rgl._search import smallest
    from brdfdb.formats.rgl._tensors import write_tensors

    path = path_of(path)
    wavelengths = 0 if table.wavelength_nm is None else table.wavelength_nm.size
    frame = frame_remark(table, U_AXIS)
    known = record(table, None, verdict, holds=HOLDS, remarks=frame)
    about = len(json.dumps(known)) + _BESIDE + _BESIDE_EACH * wavelengths
    fit = smallest(table, kind, tolerance, 1e6 * megabytes - about, azimuth == "full")
    remarks = (*fit.remarks, *specular_remark(table), *frame)
    document = record(table, fit.error, verdict, holds=HOLDS, remarks=remarks, tolerance=tolerance)
    document["channels"] = list(fit.channels)
    fields = replace(fit.fields, description=json.dumps(document))
    with whole(path) as (temporary,):
        write_tensors(temporary, fields.tensors())
    return Written((path,), fit.error, tolerance, remarks)


def recognises(head: bytes) -> bool:
    """Return True if the first bytes of a file are those of a tensor file with a material of RGL."""
    from brdfdb.formats.rgl._tensors import MAGIC

    return head.startswith(MAGIC) and b"vndf" in head


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of a tensor file as Mitsuba's `measured` evaluates it."""
    from brdfdb.formats._channels import GREY, RGB, names_of
    from brdfdb.formats._nodes import rows_at_vectors
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._record import document_of
    from brdfdb.formats.rgl._fields import fields_of
    from brdfdb.formats.rgl._tensors import read_tensors

    path = path_of(path)
    fields = fields_of(path, read_tensors(path))
    document = document_of(fields.description)
    name = str(document.get("name") or path.stem)
    at = None if fields.wavelength_nm is None else fields.wavelength_nm.astype(np.float64)
    channels = RGB if at is None else names_of(at)
    if document.get("channels") == ["grey"] and at is not None and at.size == 1:
        channels = GREY
        at = None

    def rows() -> ListedRows:
        return rows_at_vectors(*fields.at_nodes(), name, channels, at, document)

    return FileTable(name, channels, at, fields.evaluate, document, rows)
