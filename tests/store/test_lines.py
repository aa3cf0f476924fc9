"""Lines of lists: read from pointers alone, from the metadata if the pointer is older, and checked by verify."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from brdfdb.errors import StoreError
from brdfdb.store import reader
from brdfdb.store.catalogue import Choice
from brdfdb.store.files import read_sealed, sealed
from brdfdb.store.paths import manifest_path, pointer_path
from brdfdb.store.publication import publish_layout
from brdfdb.store.reader import Store
from brdfdb.store.shelf import Shelf
from brdfdb.store.summary_words import surface_error
from brdfdb.store.verification import material
from tests.store.a_store import layout

NEWER = ("measured", "model_title", "model_reference", "source", "anisotropic", "parameters", "incomplete")


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """A store of a table that a build has made."""
    publish_layout(tmp_path, "white", layout(0.5), {"asked": "by a test"})
    return tmp_path


def rewrite(root: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the summary of the current revision in its manifest and its pointer, with all digests right."""
    group = root / "materials" / "white" / "r000001"
    manifest = read_sealed(manifest_path(group), "white")
    head = read_sealed(pointer_path(group.parent), "white")
    change(manifest["summary"])
    change(head)
    manifest_path(group).write_bytes(sealed(manifest))
    head["manifests"] = {"r000001": hashlib.sha256(manifest_path(group).read_bytes()).hexdigest()}
    pointer_path(group.parent).write_bytes(sealed(head))


def without_newer(content: dict[str, Any]) -> None:
    for key in NEWER:
        del content[key]


def test_filters_read_pointers_alone(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        pytest.fail("a file beside the pointer was read")

    monkeypatch.setattr(reader, "check_manifest", fail)
    monkeypatch.setattr(Store, "metadata", fail)
    lines = Shelf(built, [])
    assert lines.line("white")["source"] == "no paper"
    assert [name for _, _, name in Choice(model="lambert", q="paper").chosen(["white"], lines.line)] == ["white"]


def test_a_pointer_of_an_older_program_gives_the_same_line(built: Path) -> None:
    line = Shelf(built, []).line("white")
    head = Store(built).summary("white")
    assert (line["model"], line["anisotropic"], line["incomplete"]) == ("lambert", False, None)
    assert head["parameters"] == {"rho": 0.5}
    words = surface_error(head, dict)
    rewrite(built, without_newer)
    assert material(built, "white").findings == []
    assert Shelf(built, []).line("white") == line
    assert surface_error(Store(built).summary("white"), lambda: Store(built).attributes("white")) == words
    (built / "materials" / "white" / "r000001" / "zarr.json").write_bytes(b"{}")
    assert set(Shelf(built, []).line("white")) == {"name", "damaged"}


def test_a_page_names_damage_that_filters_do_not_see(built: Path) -> None:
    (built / "materials" / "white" / "r000001" / "zarr.json").write_bytes(b"{}")
    assert Shelf(built, []).line("white")["title"] == "White"
    assert set(Shelf(built, []).summary("white")) == {"name", "damaged"}


@pytest.mark.parametrize(
    ("key", "value"), [("source", "another paper"), ("anisotropic", True), ("parameters", {"rho": 0.25})]
)
def test_verify_compares_what_lines_show_with_the_table(built: Path, key: str, value: Any) -> None:
    rewrite(built, lambda content: content.update({key: value}))
    (finding,) = material(built, "white").findings
    assert f"says {key} {value!r}, where the table has " in str(finding)
    with pytest.raises(StoreError, match=f"says {key} "):
        Store(built).verify("white")
