"""Every format that is written and read: what is read is as near to the table as the file states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import CannotHoldError
from brdfdb.formats import EXPORTERS
from brdfdb.materials import Material
from brdfdb.measurements.samples import Samples
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from tests.formats.round_trip import ROUND_TRIPPED, round_trip
from tests.formats.small_tables import ANISOTROPIC, KINDS, small_table, table_of

ROUNDING = 1.02  # of what is read to what is stated: formats keep float32 or decimals
# Coarse files do: each states its own error
COARSE = {"tolerance": 1.0, "size": 0.1, "cells": 2000.0, "megabytes": 0.5}
POLARISED_ALONE = ("kaist",)  # its own tests have polarised tables
ISOTROPIC_ALONE = ("eradiate", "fred", "merl", "openmaterial")
EXACT = {"astm": 1e-6, "fred": 1e-4, "ssdd": 1e-6, "zemax": 1e-9}  # of p99, by the digits of these formats
SIZE = 0.3  # [MB] of these formats
REGULAR = {"resolution": 30.0}  # of formats that would search for nodes
OPTIONS: dict[str, dict[str, Any]] = {
    **dict.fromkeys(("bird", "csv", "netcdf", "numpy", "openmaterial", "zarr"), REGULAR),
    "eradiate": {"nodes": 9},
    "klems": {"kind": "quarter"},
    **{name: {"tolerance": 0.2, "size": SIZE} for name in EXACT},
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
        trip = round_trip(table, tmp_path, name, verdict="passes", **options_of(name))
        assert trip.measured <= ROUNDING * trip.stated
        assert trip.reading.record["audit"] == "passes"
        if name in EXACT:
            assert trip.measured == pytest.approx(trip.stated, rel=EXACT[name])
            assert trip.nbytes <= 1e6 * SIZE


def test_wavelengths_have_one_order_in_every_format_that_keeps_them(tmp_path: Path) -> None:
    """950 and 1000 nm: as texts, they sort the other way round."""
    at = np.array([402.5, 950.0, 1000.0, 1050.0])
    rho = {"wavelengths_nm": at.tolist(), "values": [0.2, 0.4, 0.6, 0.8]}
    entries = {"title": "Slope", "model": "lambert", "source": "no paper", "parameters": {"rho": rho}}
    grid = Grid({"theta_i": [0, 45, 90], "theta_r": [0, 45, 90], "delta_phi": [0, 90, 180]})
    table = table_of(Layout(Material.from_table("slope", entries), grid, at))
    kept = []
    for name in ROUND_TRIPPED:
        path = tmp_path / f"slope{EXPORTERS[name].suffix}"
        try:
            formats.write(table, path, name, **options_of(name))
        except CannotHoldError:
            continue
        reading = formats.read(path, name)
        if reading.wavelength_nm is None or reading.wavelength_nm.size == 1:
            continue
        kept.append(name)
        assert np.all(np.diff(reading.wavelength_nm) > 0.0), name
        values = reading.values[:1] if isinstance(reading, Samples) else reading.lookup(0.3, 0.0, 0.5, 2.0)
        expected = np.interp(reading.wavelength_nm, at, rho["values"])
        assert np.ravel(values) * np.pi == pytest.approx(expected, rel=0.01), name  # rgl in its coarsest form: 3e-3
    assert {"csv", "netcdf", "numpy", "rgl", "ssdd", "zarr"} <= set(kept)
