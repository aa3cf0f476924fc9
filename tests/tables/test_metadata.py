"""Metadata of tables: one record, read from whatever attributes a table has, and written back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brdfdb.materials import presets
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.metadata import REQUIRED, TableMetadata
from brdfdb.tables.table import table_from
from brdfdb.tables.tabulation import metadata_of, tabulate
from tests.json_schema import validate

SCHEMA = json.loads((Path(__file__).parents[2] / "schemas" / "table.schema.json").read_text(encoding="utf-8"))
GRID = Grid({"theta_i": [0, 45, 85], "theta_r": [0, 45, 85], "delta_phi": [0, 90, 180]})
RECORDED = {"source_record": {"material": {}}}  # without a record of its source a table cites nothing
ISOTROPIC = [material for material in presets().values() if not material.anisotropic]


def layout(name: str) -> Layout:
    material = presets()[name]
    return Layout(material, GRID, np.array([500.0, 600.0]) if material.spectral else None)


@pytest.mark.parametrize("name", [material.name for material in ISOTROPIC])
def test_what_is_written_is_read_back_and_fits_the_schema(name: str) -> None:
    written = metadata_of(layout(name))
    attributes = json.loads(json.dumps(written.attributes(), allow_nan=False))
    validate(attributes, SCHEMA)
    read = TableMetadata.read(attributes)
    assert (read, read.gaps) == (written, "")
    assert read.attributes() == attributes


def test_no_attributes_are_no_error_but_a_phrase() -> None:
    bare = TableMetadata.read({})
    assert (bare.title, bare.error, bare.parameters, bare.interpolation) == (None, None, {}, Interpolation())
    assert bare.missing == list(REQUIRED)
    assert bare.gaps == (
        "does not state its title, material, table version, model, model version, parameters, source, conventions"
    )


def test_a_strange_attribute_is_named_and_leaves_the_others() -> None:
    read = TableMetadata.read({"title": ["White"], "model": "lambert", "note": None, "colour": "white", **RECORDED})
    assert (read.title, read.model, read.note) == (None, "lambert", "")
    assert set(read.strange) == {"title", "note"}
    assert "title" not in read.missing
    assert "states its title wrongly (['White'] is not a text, in quotes)" in read.gaps
    assert TableMetadata.read({"assumed": ["rho"], **RECORDED}).assumed == {"rho": None}  # as earlier tables state it


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"brdf": np.zeros((3, 3, 2), np.float32)}, r"^brdf: shape \(3, 3, 2\) is not \(3, 3, 3\), of its axes$"),
        ({"brdf": None, "rho": np.zeros(3)}, r"^brdf: neither it nor parts is among the arrays "),
        ({"wavelength": np.zeros(())}, r"^wavelengths_nm: must be positive and increase strictly$"),
        ({"theta_i": None}, r"^grid axes: none of "),
    ],
)
def test_arrays_that_make_no_table_are_refused_with_a_sentence(change: dict[str, np.ndarray], said: str) -> None:
    dataset = tabulate(layout("clay-vase"))
    arrays = {str(key): variable.values for key, variable in dataset.variables.items()} | change
    with pytest.raises(ValueError, match=said):
        table_from("odd", "r000001", {key: array for key, array in arrays.items() if array is not None}, {})


def test_interpolations_and_records_of_measured_data_that_this_program_does_not_know_are_refused() -> None:
    """Measured data are no table of a model: where nothing was measured, the error is not known."""
    dataset = tabulate(layout("clay-vase"))
    arrays = {str(key): variable.values for key, variable in dataset.variables.items()}
    for how in ({"method": "quintic"}, {"method": "cubic", "knots": 3}):
        with pytest.raises(ValueError, match=r"^interpolation: "):
            table_from("odd", "r000001", arrays, {"interpolation": how})
    measured = {
        "channels": ["grey"], "samples": 300, "negative": 0.0, "interpolation": "", "reciprocity": {"assumed": True},
        "mirror": None, "hull": [[0.0, 0.0, 0.0]],
    }  # fmt: skip
    attributes = {**dataset.attrs, "measured": measured}
    with pytest.raises(ValueError, match=r"^measured: its record is of another version, .*build the table anew$"):
        table_from("odd", "r000001", arrays, attributes)
    served = replace(table_from("odd", "r000001", arrays, dataset.attrs), attrs=attributes)
    with pytest.raises(ValueError, match=r"^measured: its record is of another version, .*build the table anew$"):
        served.extrapolated(0.3, 0.0, 0.2, 1.0)
