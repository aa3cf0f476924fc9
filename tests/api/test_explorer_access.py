"""The explorer for everybody: axe-core finds nothing, keys reach all, at any width, in dark and in light."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.api.chromium import Chromium, box, idle, shown, visit

AXE = Path(os.environ.get("BRDFDB_NODE", "node_modules/.bin")).parent / "axe-core" / "axe.min.js"
VIEWS = ("together", "cut&axes=cartesian&curves=rgb", "slice", "spectrum", "albedo", "sphere")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 320])
def test_axe_finds_no_violation(chromium: Chromium, address: str, scheme: str, width: int) -> None:
    if not AXE.is_file():
        pytest.skip("axe-core is not installed; BRDFDB_NODE names the folder of the programs of npm")
    rules = AXE.read_text(encoding="utf-8")
    for view in VIEWS:
        link = f"{address}#material=rolled-brass(rho_d=0.2)&compare=rolled-brass&view={view}"
        chromium.open(link, width, 900, scheme)
        shown(chromium)
        idle(chromium, "parameters.children.length > 0")
        chromium.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        chromium.evaluate(f"{rules}; undefined")
        found = json.loads(chromium.evaluate("axe.run().then(({ violations }) => JSON.stringify(violations))"))
        assert [(each["id"], [node["html"] for node in each["nodes"]]) for each in found] == [], view
        assert chromium.evaluate("document.documentElement.scrollWidth") <= width


def test_every_control_has_a_name_and_can_be_reached_by_keys(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=rolled-brass&compare=foam")
    idle(chromium, "parameters.children.length > 0")
    controls = "[...document.querySelectorAll('input, select, textarea, button:not([aria-hidden])')]"
    unnamed = "each => !each.closest('[hidden]') && !(each.labels?.[0] ?? each).innerText.trim()"
    assert chromium.evaluate(f"{controls}.filter({unnamed}).map(each => each.outerHTML)") == []
    reached, now = set(), "document.activeElement"
    seen = [f"getComputedStyle({each}).outlineStyle !== 'none'" for each in (now, f"({now}.closest('label') ?? {now})")]
    chromium.evaluate("document.body.focus()")
    for _ in range(60):
        chromium.press("Tab")
        name = f"(of => of.id || of.name || of.dataset.action || of.dataset.copy || of.innerText)({now})"
        reached.add(chromium.evaluate(name))
        assert chromium.evaluate(f"{now} === document.body || {' || '.join(seen)}")
    pictures = {"cut", "hemisphere", "sphere"}
    assert {"search", "model", "verdict", "paper", "models", "list", "view", *pictures} <= reached
    assert {"theta_i", "phi_i", "log", "compare", "axes", "curves", "exposure", "surround"} <= reached
    assert {"rho_d", "alpha_x", "reset", "keep", "recipe", "link", "curl", "python", "Foam (sample D) ×"} <= reached


def test_arrow_keys_read_curves(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=foam&view=cut")
    chromium.evaluate("document.querySelector('#cut').focus()")
    for keys, theta_r in ((["ArrowRight"], "1"), (["ArrowLeft", "ArrowLeft"], "−1")):
        chromium.press(*keys)
        assert chromium.texts("#cut .read")[0].startswith(f"θᵣ {theta_r}°: ")


def test_a_phone_shows_the_picture_first(chromium: Chromium, address: str) -> None:
    for width, height in ((390, 844), (320, 640)):
        chromium.open(f"{address}#material=foam", width, height, touch=True)
        shown(chromium)
        _, top, _, tall = box(chromium, "#sphere canvas")
        assert 0 < top < top + tall < height
        assert chromium.evaluate("search.getBoundingClientRect().top") > height
        was = chromium.evaluate("[location.hash, picture.dataset.shown]")
        chromium.click("header a")  # one link at the top reaches the list
        assert chromium.evaluate("document.activeElement.id") == "search"
        assert 0 <= chromium.evaluate("search.getBoundingClientRect().top") < height
        assert chromium.evaluate("[location.hash, picture.dataset.shown]") == was
