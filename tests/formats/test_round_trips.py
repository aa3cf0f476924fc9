"""Every format that is written and read: what is read is as near to the table as the file states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from brdfdb.errors import CannotHoldError
from brdfdb.formats import EXPORTERS
from tests.formats.round_trip import ROUND_TRIPPED, round_trip
from tests.formats.small_tables import ANISOTROPIC, KINDS, small_table

ROUNDING = 1.02  # of what is read to what is stated: formats keep float32 or decimals
# Coarse files do: each states its own error
COARSE = {"tolerance": 1.0, "size": 0.1, "cells": 2000.0, "megabytes": 0.5}
POLARISED_ALONE = ("kaist",)  # its own tests have polarised tables
ISOTROPIC_ALONE = ("eradiate", "fred", "merl", "openmaterial")
REGULAR = {"resolution": 30.0}  # of formats that would search for nodes
OPTIONS: dict[str, dict[str, Any]] = {
    **dict.fromkeys(("bird", "csv", "netcdf", "numpy", "openmaterial", "zarr"), REGULAR),
    "eradiate": {"nodes": 9},
    "klems": {"kind": "quarter"},
}


def options_of(name: str) -> dict[str, Any]:
    """Return options with which a format writes a coarse file, and writes it soon."""
    known = {option.name for option in EXPORTERS[name].options}
    return OPTIONS.get(name) or {option: value for option, value in COARSE.items() if option in known}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ROUND_TRIPPED)
def test_what_is_read_is_as_near_as_the_file_states(name: str, kind: str, tmp_path: Path) -> None:
    table = small_table(kind)
    if name in POLARISED_ALONE or (kind == ANISOTROPIC and name in ISOTROPIC_ALONE):
        with pytest.raises(CannotHoldError, match=f"^{kind}: "):
            round_trip(table, tmp_path, name, **options_of(name))
        assert list(tmp_path.iterdir()) == []
    else:
        trip = round_trip(table, tmp_path, name, **options_of(name))
        assert trip.measured <= ROUNDING * trip.stated
