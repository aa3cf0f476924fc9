"""BiRD's universal JSON and OpenMATERIAL's lookup tables: the rules of their schemas, and what is read back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.geometry import radians
from tests.formats.a_file import exported, samples_of
from tests.formats.small_tables import ANISOTROPIC, KINDS, SPECTRAL, small_table
from tests.json_schema import validate

TEXT = {"type": "string", "minLength": 1}


def _objects(required: dict[str, Any], *, others: bool = True) -> dict[str, Any]:
    return {"type": "object", "required": list(required), "properties": required, "additionalProperties": others}


def _list(unit: list[str], below: float) -> dict[str, Any]:
    values = {"type": "array", "items": {"type": "number", "minimum": 0, "exclusiveMaximum": below}}
    return _objects({"unit": {"enum": unit}, "values": values}, others=False)


# The rules of brdf_json_schema_v1.0.json of BiRD and of the schemas that it names. Its metadata require a name that its
# list of allowed keys does not have: no file is valid with both
_POLAR, _TURN = _list(["deg"], 90.0), _list(["deg"], 360.0)
_PLACE = dict.fromkeys(("country", "city", "street", "building_nr", "postal_code"), TEXT)
_PROVENANCE = {"organization": TEXT, "location": _objects(_PLACE, others=False), "email": TEXT, "contact_person": TEXT}
_SAMPLE = {"name": TEXT, "type": TEXT, "dimensions": {"type": "object"}, "shape": TEXT, "zero_azimuth_location": TEXT}
_URI, _NOT_STATED = {**TEXT, "format": "uri"}, {"const": "NA"}
_BIRD_METADATA = {
    **dict.fromkeys(("schema", "id"), _URI),
    **dict.fromkeys(("instrumentation", "environment"), _NOT_STATED),
    "type": {"const": "BRDF"},
    "timestamp": {"pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00$"},
    "provenance": _objects(_PROVENANCE),
    "license": _objects({"type": TEXT, "rights_holder": TEXT}),
    "description": TEXT,
    "method": {"enum": ["simulation", "measurement"]},
    "software": _objects(
        {"name": TEXT, "version": TEXT, "simulation_model": _objects({"name": TEXT, "description": TEXT})}
    ),
    "sample": _objects(_SAMPLE),
    "adhoc_section": {"type": "object"},
}
_BIRD_DATA = {
    **dict.fromkeys(("theta_i", "theta_r"), _POLAR),
    **dict.fromkeys(("phi_i", "phi_r"), _TURN),
    "BRDF": _list(["1/sr", "sr^-1"], np.inf),
}
BIRD = _objects({"metadata": _objects(_BIRD_METADATA, others=False), "data": _objects(_BIRD_DATA)}, others=False)
# The rules of material_brdf_schema.json of OpenMATERIAL 3D
_METRE, _QUARTER = {"minimum": 1e-9, "maximum": 0.01716}, {"minimum": 0.0, "maximum": 1.570796}
_NUMBERS = [_METRE, _QUARTER, _QUARTER, {"minimum": 0.0, "maximum": 6.283185}, {"minimum": 0.0, "maximum": np.inf}]
_ROW = {"minItems": 5, "maxItems": 5, "prefixItems": [{"type": "number", **number} for number in _NUMBERS]}
_VERSION, _TEXTS = {"pattern": r"^\d+\.\d+\.\d+$"}, {"type": "array", "minItems": 1, "items": TEXT}
_METADATA = {
    **dict.fromkeys(("name", "license", "sources"), TEXT),
    **dict.fromkeys(("materialVersion", "openMaterial3dVersion"), _VERSION),
    **dict.fromkeys(("copyrights", "authors"), _TEXTS),
    "uuid": {"pattern": r"^[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}$"},
}
_BRDF = {
    "wavelengths": {"type": "array", "items": {"type": "number", **_METRE}},
    "lookupTable": {"type": "array", "items": {"type": "array", **_ROW}},
}
_TAG = {"pattern": r"^https://raw\.githubusercontent\.com/asam-ev/OpenMATERIAL-3D/refs/tags/v\d+\.\d+\.\d+/"}
OPENMATERIAL = _objects({"$schema": _TAG, "metadata": _objects(_METADATA), "brdf": _objects(_BRDF)})
SCHEMAS = {"bird": BIRD, "openmaterial": OPENMATERIAL}
FILES = [(name, kind) for name in SCHEMAS for kind in KINDS if (name, kind) != ("openmaterial", ANISOTROPIC)]


@pytest.mark.parametrize(("name", "kind"), FILES)
def test_files_keep_to_the_schema(name: str, kind: str, tmp_path: Path) -> None:
    path = exported(tmp_path, name, kind)
    validate(json.loads(path.read_text(encoding="utf-8")), SCHEMAS[name])


def test_rows_of_openmaterial_are_sorted_and_cover_the_circle(tmp_path: Path) -> None:
    text = exported(tmp_path, "openmaterial", SPECTRAL, resolution=45.0, verdict="passes").read_text(encoding="utf-8")
    assert '"$schema"' in text.splitlines()[1]
    document = json.loads(text)
    rows = document["brdf"]["lookupTable"]
    assert rows == sorted(rows)
    assert document["brdf"]["wavelengths"] == [4e-7, 5.5e-7, 7e-7]
    assert len(rows) == 3 * 3 * 3 * 9
    assert "audit: passes" in document["metadata"]["description"]
    [value] = [row[4] for row in rows if row[:4] == [5.5e-7, 0.785398, 0.785398, 3.926991]]
    expected = small_table(SPECTRAL).lookup(radians(45.0), 0.0, radians(45.0), radians(135.0), 550.0)
    assert value == pytest.approx(float(expected), rel=5.1e-5)  # five digits


def test_entries_of_bird_stand_at_their_directions(tmp_path: Path) -> None:
    path = exported(tmp_path, "bird", ANISOTROPIC, resolution=45.0)
    data = json.loads(path.read_text(encoding="utf-8"))["data"]
    angles = np.array([data[name]["values"] for name in ("theta_i", "phi_i", "theta_r", "phi_r")])
    assert angles.max(axis=1).tolist() == [89.5, 90.0, 89.5, 315.0]
    [index] = np.flatnonzero((angles.T == [44.75, 45.0, 89.5, 225.0]).all(axis=1))
    expected = small_table(ANISOTROPIC).lookup(*radians(angles[:, index]))
    assert data["BRDF"]["values"][index] == pytest.approx(float(expected), rel=5.1e-5)  # five digits


def test_lists_of_other_programs_give_samples(tmp_path: Path) -> None:
    entries = {"theta_i": [0.5, 0.5], "phi_i": [0.1, 0.1], "theta_r": [0.2, 0.3], "phi_r": [3.0, 1.0]}
    data: dict[str, Any] = {name: {"unit": "rad", "values": values} for name, values in entries.items()}
    data |= {"BRDF": {"unit": "sr^-1", "values": [0.2, 0.3]}, "wavelength_r": {"unit": "μm", "values": [0.5, 0.5]}}
    text = json.dumps({"metadata": {"type": "BRDF"}, "data": data}, separators=(",", ":"))
    samples = samples_of(tmp_path, text, "measured.json")
    assert np.allclose(samples.theta_r, [0.2, 0.3], atol=1e-6)
    assert (samples.channels, samples.values.tolist()) == (("500nm",), [[0.2], [0.3]])
    lookup = {"wavelengths": [4e-7], "lookupTable": [[4e-7, 0.0, 0.0, 0.0, 2e-5], [4e-7, 0.017453, 0.0, 0.0, 3e-5]]}
    text = json.dumps({"metadata": {"name": "asphalt"}, "brdf": lookup})
    samples = samples_of(tmp_path, text, "in-plane.xompt", file_format="openmaterial")
    assert (samples.name, samples.channels, samples.values.tolist()) == ("asphalt", ("400nm",), [[2e-5], [3e-5]])
    assert np.allclose(np.rad2deg(samples.theta_i), [0.0, 1.0], atol=1e-9)
