"""The error of a model against rays on surfaces: show, list, notebook, audit and service say the same of a material."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from brdfdb.audit import audit
from brdfdb.audit.validity import Validity
from brdfdb.microgeometry.model_errors import NO_MAP, SurfaceError, surface_error_of
from brdfdb.store.reader import Store
from tests.api.a_store import client_of, publish
from tests.pipelines.command import Captured, run

MATERIALS: dict[str, tuple[str, dict[str, float]]] = {
    "brushed": ("ward", {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.3, "alpha_y": 0.3}),
    "felt": ("oren_nayar", {"rho": 0.5, "sigma_deg": 20.0}),
    "lobe": ("torrance_sparrow", {"sigma_deg": 15.0}),
    "steep": ("oren_nayar", {"rho": 0.5, "sigma_deg": 80.0}),
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("surfaces") / "store"
    for name, (model, parameters) in MATERIALS.items():
        publish(directory, name, model, **parameters)
    return directory


def expected(name: str) -> SurfaceError | None:
    model, parameters = MATERIALS[name]
    return surface_error_of(model, parameters | {"interreflection": True})


def test_the_materials_are_of_all_kinds() -> None:
    found = {name: expected(name) for name in MATERIALS}
    assert found["brushed"] is None
    inside = {name: error.inside for name, error in found.items() if error is not None}
    assert inside == {"felt": True, "lobe": True, "steep": False}


@pytest.mark.parametrize("name", MATERIALS)
def test_all_views_agree(root: Path, name: str, capsys: Captured) -> None:
    found = expected(name)
    sentence = NO_MAP if found is None else found.sentence
    document: Any = None if found is None else asdict(found)
    cell = "" if found is None else found.in_lists
    capsys.readouterr()

    assert run("show", name, "--store", root) == 0
    assert f"\n  surface     {sentence}\n" in capsys.readouterr().out

    assert run("list", "--store", root) == 0
    _, head, *lines = capsys.readouterr().out.splitlines()
    end = head.index("surface error (median)") + len("surface error (median)")
    (line,) = (line for line in lines if line.startswith(name))
    assert re.split("  +", line[:end])[-1].strip() == (cell or line[:end].split("  ")[-1].strip())
    assert line[:end].endswith(cell or "  ")
    assert "surface error: of the formula relative to rays" in lines[-1]

    store = Store(root)
    (of_name,) = re.findall(rf"<tr><td[^>]*>{name}</td>.*?</tr>", store._repr_html_())
    assert re.findall(r"<td[^>]*>([^<]*)</td>", of_name)[6] == cell

    finding = audit(store[name]).of(Validity)
    assert finding.surface == found
    texts = [sentence.text for sentence in finding.sentences() if sentence.title == "Surface"]
    assert texts == ([] if found is None else [sentence])
    assert finding.cells()[0].text.endswith(f"rays: {cell}" if cell else "")
    assert Validity.model_validate_json(finding.model_dump_json()) == finding

    client = client_of(root)
    served = client.get(f"/v1/materials/{name}").json()["surface_error"]
    assert served == document
    (listed,) = (line for line in client.get("/v1/materials").json()["materials"] if line["name"] == name)
    assert listed["surface_error"] == document


def test_a_list_without_a_map_has_no_column(root: Path, capsys: Captured) -> None:
    capsys.readouterr()
    assert run("list", "--store", root, "--model", "ward") == 0
    out = capsys.readouterr().out
    assert "brushed" in out
    assert "surface error" not in out
