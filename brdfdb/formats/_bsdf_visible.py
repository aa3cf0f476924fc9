"""Channels and remarks of tables in files that know visible light, and colour, but no spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brdfdb.formats._channels import channels_of

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.tables.table import Table


def visible_channels(table: Table, *, colour: bool = True) -> Channels:
    """Return CIE XYZ of a spectral table, or its Y alone, and the values themselves of others."""
    spectral = table.wavelength_nm is not None and table.wavelength_nm.size > 1
    return channels_of(table, ("xyz" if colour else "grey") if spectral else "")


def remarks_of(table: Table) -> tuple[str, ...]:
    """Return what XML files of Radiance and WINDOW cannot hold of a table."""
    remarks = []
    if table.specular is not None and np.any(table.specular > 0.0):
        remarks.append("the specular part (a Dirac delta) is left out; add a mirror to the scene for it")
    if table.wavelength_nm is not None and table.wavelength_nm.size == 1:
        remarks.append(f"f_r at {table.wavelength_nm[0]:g} nm stands in the block of visible light")
    return tuple(remarks)
