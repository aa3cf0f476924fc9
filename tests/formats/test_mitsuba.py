"""Plugins of Mitsuba for materials: both files as Mitsuba loads them, and f_r of the material."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats import mitsuba as exporter
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material
from brdfdb.models import MODELS
from brdfdb.models.mitsuba_plugins import OF_MITSUBA
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.table import Table
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, KINDS, SMOOTH, SPECTRAL, small_table
from tests.mitsuba.surfaces import variant
from tests.store.a_store import lambert

FLOAT32 = 1e-4  # of f_r: spectra of float32, straight lines between wavelengths that the file lists
WI, WR = unit_vector(0.6, 0.3), unit_vector(0.8, 3.0)
WAVELENGTHS_NM = (400.0, 550.0, 700.0, 550.0)


def f_r(mitsuba: Any, surface: Any) -> Any:
    place = mitsuba.SurfaceInteraction3f()
    place.wi, place.wavelengths = mitsuba.Vector3f(WI.tolist()), WAVELENGTHS_NM
    return np.array(surface.eval(mitsuba.BSDFContext(), place, mitsuba.Vector3f(WR.tolist()))) / WR[2]


@pytest.mark.judge
@pytest.mark.parametrize("kind", KINDS)
def test_both_files_are_the_model_of_the_material(kind: str, tmp_path: Path) -> None:
    mitsuba = variant("scalar_spectral")
    table = small_table(kind)
    written = exporter.write(table, tmp_path / f"{kind}.xml", verdict="passes")
    assert [path.name for path in written.paths] == [f"{kind}.xml", f"{kind}.xml.json"]
    assert len(written.remarks) == (kind == ANISOTROPIC)  # the x axis
    source = table.source
    assert isinstance(source, Material)
    at = None if table.wavelength_nm is None else np.clip(WAVELENGTHS_NM, *table.wavelength_nm[[0, -1]])
    expected = np.broadcast_to(source.lookup_vectors(WI, WR, at), (4,))
    from_dictionary = mitsuba.load_dict(json.loads(written.paths[1].read_text(encoding="utf-8")))
    including = f'<scene version="3.0.0"><include filename="{written.paths[0]}"/>'
    scene = mitsuba.load_string(f'{including}<shape type="sphere"><ref id="{kind}"/></shape></scene>')
    for surface in (from_dictionary, scene.shapes()[0].bsdf()):
        np.testing.assert_allclose(f_r(mitsuba, surface), expected, rtol=FLOAT32)
    assert '"audit": "passes"' in written.paths[0].read_text(encoding="utf-8")


def test_a_scene_is_only_written_and_other_xml_is_of_no_format(tmp_path: Path) -> None:
    path = exporter.write(small_table(GREY), tmp_path / "grey.xml").paths[0]
    with pytest.raises(FileFormatError, match="files of mitsuba can be written, but not read"):
        formats.read(path)
    path.write_text("<house/>", encoding="utf-8")
    with pytest.raises(FileFormatError, match="no format recognises it"):
        formats.read(path)


@pytest.mark.judge
def test_a_table_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mitsuba = variant("scalar_spectral")
    publish_dataset(tmp_path / "store", "white", lambert(0.5))
    monkeypatch.setenv("BRDFDB_STORE", str(tmp_path / "store"))
    import brdfdb

    table = brdfdb.open()["white"]
    assert isinstance(table, Table)
    written = exporter.write(table, tmp_path / "white.xml")
    assert written.remarks == (
        "Mitsuba has no plugin of its model, and reads the table from the store that BRDFDB_STORE names",
    )
    document = json.loads(written.paths[1].read_text(encoding="utf-8"))
    assert document == {"id": "white", "type": "brdfdb_table", "material": "white"}
    np.testing.assert_allclose(f_r(mitsuba, mitsuba.load_dict(document)), 0.5 / np.pi, rtol=1e-6)


@pytest.mark.parametrize("kind", [GREY, ANISOTROPIC, DIFFUSE, SPECTRAL, SMOOTH])
def test_the_table_is_taken_if_it_is_asked_for(kind: str, tmp_path: Path) -> None:
    written = exporter.write(small_table(kind), tmp_path / "a.xml", plugin="table")
    assert json.loads(written.paths[1].read_text(encoding="utf-8"))["type"] == "brdfdb_table"
    assert len(written.remarks) == (kind == ANISOTROPIC)  # the x axis


@pytest.mark.judge
def test_models_with_a_plugin_are_those_that_mitsuba_registers() -> None:
    variant("scalar_rgb")
    from brdfdb.mitsuba import PLUGINS
    from brdfdb.mitsuba.diffuse import FORMULAS, OREN_NAYAR
    from brdfdb.mitsuba.stray_light import FORMS as STRAY_LIGHT
    from brdfdb.mitsuba.ward import FORMS as WARD

    forms = {"brdfdb_ward": WARD, "brdfdb_oren_nayar": OREN_NAYAR}
    expected = {form: (plugin, True) for plugin, known in forms.items() for form in known}
    expected |= {name: (f"brdfdb_{name}", False) for name in ("he_torrance", *FORMULAS, *STRAY_LIGHT)}
    assert expected == OF_MITSUBA
    assert {plugin for plugin, _ in OF_MITSUBA.values()} | {"brdfdb_table"} == set(PLUGINS)
    assert set(OF_MITSUBA) <= set(MODELS)
