"""Stores in notebooks: their lists agree with pointers and with the last audit."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

from brdfdb.store.reader import Store
from tests.store.a_store import lambert, pointer, publish


def texts(html: str) -> list[str]:
    return [text.strip() for text in ElementTree.fromstring(html).itertext() if text.strip()]


def test_store_lists_materials_with_the_verdict_of_their_revision(root: Path) -> None:
    publish(root, dark=lambert(0.1).assign_attrs(title="<b>Dark</b>", material="dark"))
    found = texts(Store(root)._repr_html_())
    assert "2 materials" in found
    assert {"dark", "<b>Dark</b>", "white", "White", "lambert"} <= set(found)
    assert "passes" not in found
    verdicts = [
        {"material": "white", "revision": "r000001", "verdict": "passes"},
        {"material": "dark", "revision": "r000002", "verdict": "violates"},
    ]
    (root / "audit.json").write_text(json.dumps({"materials": verdicts}), encoding="utf-8")
    found = texts(Store(root)._repr_html_())
    assert "passes" in found
    assert "violates" not in found  # of another revision


def test_store_with_a_damaged_pointer_or_report_is_shown(root: Path) -> None:
    pointer(root).write_text("{}", encoding="utf-8")
    (root / "audit.json").write_text("[]", encoding="utf-8")
    assert any("white is damaged" in text for text in texts(Store(root)._repr_html_()))
