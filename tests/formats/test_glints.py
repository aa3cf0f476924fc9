"""Glints and exports: the values of every format leave them out, and every export says so."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from brdfdb.errors import CannotHoldError
from brdfdb.formats import EXPORTERS, IMPORTERS, packed, read, write
from brdfdb.formats._readings import FileTable
from brdfdb.geometry import unit_vector
from brdfdb.measurements.glints import Glints
from brdfdb.tables.table import Table
from tests.tables.glinting import GROUND, stored

SENTENCE = "not in the values of the file: the glints of the table, up to 75.4 % of the light of a direction"
REFUSED = {"glsl", "osl", "slang", "kaist"}  # shaders of models, and files of polarised tables, take no such table
LIGHT, VIEWER = np.deg2rad(60.0), np.deg2rad(60.5)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    """A table with glints, from a store."""
    return stored(tmp_path_factory.mktemp("glints"))


@pytest.mark.parametrize("file_format", sorted(EXPORTERS))
def test_every_export_says_that_it_leaves_the_glints_out(table: Table, tmp_path: Path, file_format: str) -> None:
    exporter = EXPORTERS[file_format]
    path = tmp_path / f"glinting{exporter.suffix}"
    tolerance = {"tolerance": 0.3} if "tolerance" in {option.name for option in exporter.options} else {}
    try:
        written = write(table, path, file_format, **tolerance)
    except CannotHoldError:
        assert file_format in REFUSED
        return
    assert SENTENCE in written.remarks
    if file_format in IMPORTERS:
        reading = read(path)
        assert isinstance(reading, FileTable)
        value = reading.lookup_vectors(unit_vector(LIGHT, 0.0), unit_vector(VIEWER, np.pi))
        assert np.all(np.abs(value - GROUND) < 0.4 * GROUND), value  # the smooth part, not a piece of the peak


def test_a_record_lists_the_glints_that_its_values_leave_out(table: Table, tmp_path: Path) -> None:
    write(table, tmp_path / "glinting.npz", "numpy")
    with np.load(tmp_path / "glinting.npz") as file:
        record = json.loads(str(file["record"]))
    assert SENTENCE in record["remarks"]
    assert Glints.model_validate(record["measured"]["glints"]) == table.glints


def test_a_table_without_glints_has_no_such_remark(tmp_path: Path) -> None:
    written = write(stored(tmp_path, lit=False), tmp_path / "matt.npz", "numpy")
    assert not [remark for remark in written.remarks if "glint" in remark]
    _, _, content = packed(stored(tmp_path), "fred", verdict="passes")  # as the service exports
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert SENTENCE in json.loads(archive.read("glinting.fred.txt.json"))["remarks"]
