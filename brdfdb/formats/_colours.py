"""Channels of formats that hold three colours or one value, for tables of any wavelengths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brdfdb.errors import CannotHoldError, ParameterError
from brdfdb.formats._channels import Channels, channels_of

if TYPE_CHECKING:
    from brdfdb.tables.table import Table


def colours_of(table: Table, colour: str) -> tuple[Channels, tuple[str, ...]]:
    """Return the channels of a table in a colour ("rgb", "xyz" or "grey"), and remarks for its record.

    The channels of a grey table are all the same, and so are those of a table of one wavelength.

    Raises
    ------
    CannotHoldError
        If the table has several wavelengths, and they give no colour.
    """
    at = table.wavelength_nm
    names = {"rgb": ("R", "G", "B"), "xyz": ("X", "Y", "Z"), "grey": ("grey",)}[colour]
    if at is not None and at.size == 1:
        meaning = f"{'all channels are ' if len(names) > 1 else ''}f_r at {at[0]:g} nm"
        return Channels(names, at, np.ones((1, len(names))), meaning), (meaning,)
    try:
        channels = channels_of(table, "" if at is None and colour == "grey" else colour)
    except ParameterError as error:
        raise CannotHoldError(f"{table.name}: {error.sentence}") from None
    if at is None:
        return channels, ("all channels are the same: the table is grey",) if len(names) > 1 else ()
    return channels, (f"of the spectrum: {channels.meaning}",)


def specular_remark(table: Table) -> tuple[str, ...]:
    """Return what a file without a place for the specular part leaves out of a table."""
    if table.specular is None:
        return ()
    return (f"not in the file: the specular part, up to {table.specular.max():.4g} of the light",)
