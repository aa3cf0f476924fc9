"""The explorer as time goes by: new revisions, a store that is away, and the way back in the history of the browser."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

import brdfdb
from tests.api.a_store import publish, serving
from tests.api.chromium import Chromium, chosen, shown, visit
from tests.api.explored import AUDIT, FOUND

LINE = "document.querySelector('#m-grey-felt .marks').textContent"
LATE = """
const { clone, json } = Response.prototype;
const pause = () => new Promise((go) => setTimeout(go, 1000));
async function late() { await pause(); pause().then(() => { globalThis.later = true; }); return json.call(this); }
Response.prototype.clone = function () { return Object.assign(clone.call(this), { json: late }); };
"""  # who reads a copy of an answer gets it a second after those who read the answer; another second is `later`


@pytest.mark.parametrize(
    ("view", "compare"), [("cut", ""), ("sphere", "white-tile"), ("albedo", "%3Amodel"), ("spectrum", "")]
)
def test_facts_follow_a_new_revision(chromium: Chromium, own: Path, view: str, compare: str) -> None:
    found = FOUND | {"material": "grey-felt"}
    (own / "audit.json").write_text(json.dumps(AUDIT | {"materials": [found]}), encoding="utf-8")
    with serving(own) as address:
        visit(chromium, f"{address}/#material=grey-felt&view={view}&compare={compare}", "material=grey-felt")
        assert chromium.until(f"document.querySelector('#m-grey-felt') && {LINE}") == "energy: no: albedo 1.2 at 90°"
        assert "revision r000001" in chromium.evaluate("facts.textContent")
        publish(own, "grey-felt", "oren_nayar", rho=0.25, sigma_deg=40.0, error=True)
        chromium.choose("theta_i", 20)
        shown(chromium, "theta_i=20")
        known = chromium.evaluate("facts.textContent")
        assert "revision r000002" in known
        assert "This audit is of revision r000001" in known
        error = brdfdb.open(own)["grey-felt"].error
        assert error is not None
        assert f"within {100.0 * error.overall.p99:.3g} %" in known
        assert chromium.evaluate(LINE) == ""
        assert chromium.evaluate("[...verdict.options].map(each => each.value)") == ["", "not audited", "violates"]


def test_facts_follow_a_store_that_is_built_anew(chromium: Chromium, own: Path) -> None:
    with serving(own) as address:
        visit(chromium, f"{address}/#material=grey-felt&view=cut", "material=grey-felt")
        assert "Test grey-felt" in chromium.evaluate("document.title")
        anew = own.with_name("anew")
        assert publish(anew, "grey-felt", "oren_nayar", rho=0.25, sigma_deg=41.0) == "r000001"
        shutil.rmtree(own / "materials" / "grey-felt")
        (anew / "materials" / "grey-felt").rename(own / "materials" / "grey-felt")
        chromium.choose("theta_i", 20)
        shown(chromium, "theta_i=20")
        known = chromium.evaluate("facts.textContent")
        assert "revision r000001" in known
        assert "41" in known


def test_what_is_asked_for_early_is_taken_or_forgotten(chromium: Chromium, address: str) -> None:
    added = chromium.send("Page.addScriptToEvaluateOnNewDocument", source=LATE)
    visit(chromium, f"{address}#material=foam", "material=foam")
    chromium.send("Page.removeScriptToEvaluateOnNewDocument", **added)
    chromium.until("globalThis.later")
    names = chromium.evaluate("performance.getEntriesByType('resource').map(each => each.name)")
    assert names.count(f"{address}v1/materials/foam") == 1
    assert chromium.evaluate("early.size") == 0  # a later picture would be of an outdated answer


def test_facts_are_of_the_table_again_after_other_parameters(chromium: Chromium, own: Path) -> None:
    with serving(own) as address:
        visit(chromium, f"{address}/#material=grey-felt(rho=0.3)", "material=grey-felt(rho=0.3)")
        assert "your own parameters" in chromium.evaluate("facts.textContent")
        chromium.go("material=grey-felt")
        chromium.until("picture.dataset.shown === '#material=grey-felt'")
        assert "grey-felt, revision r000001" in chromium.evaluate("facts.textContent")


@pytest.mark.parametrize("link", ["", "#material=grey-felt&compare=white-tile"])
def test_a_page_that_is_opened_while_the_store_is_away(chromium: Chromium, own: Path, link: str) -> None:
    away = own.rename(own.with_name("away"))
    with serving(own) as address:
        chromium.open(f"{address}/{link}")
        said = chromium.until("globalThis.count?.textContent")
        assert "store" in said
        assert chromium.until("message.textContent || caption.textContent === ''")
        chromium.until("list.children.length === 0 && caption.textContent === ''")  # where it asks again, it says so
        away.rename(own)
        shown(chromium, "compare=white-tile" if link else "material=copper-foil")
        chromium.until("list.children.length")
        names = ["brushed-metal", "copper-foil", "grey-felt", "white-tile"]
        assert chromium.evaluate("[...list.children].map(each => each.dataset.name)") == names
        assert chromium.evaluate("[count.textContent, message.textContent]") == ["4 materials", ""]
        assert chromium.evaluate("[controls.inert, controls.elements.compare.options.length]") == [False, 6]
        chromium.errors.clear()  # the service answered 503


def test_the_way_back_is_over_materials_and_views_as_they_were_left(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=foam&view=cut", "material=foam")
    chromium.send("Page.resetNavigationHistory")  # full at fifty addresses, those of the tests before counted
    start = chromium.evaluate("history.length")
    chromium.choose("theta_i", 20)  # not yet in the link when the next material is chosen
    chromium.click("#m-rolled-brass")
    shown(chromium, "material=rolled-brass", "theta_i=20")
    for theta_i in (30, 40):
        chromium.choose("theta_i", theta_i)
        shown(chromium, f"theta_i={theta_i}")
    chromium.until("location.hash.includes('theta_i=40')")
    chromium.click("[value=sphere]")
    shown(chromium, "view=sphere")
    chromium.click("#m-rolled-brass")  # which is shown already
    assert chromium.evaluate("history.length") == start + 2
    sphere, cut, foam = (
        "#material=rolled-brass&view=sphere&theta_i=40",
        "#material=rolled-brass&view=cut&theta_i=40",
        "#material=foam&view=cut&theta_i=20",
    )
    for way, link in (("back", cut), ("back", foam), ("forward", cut), ("forward", sphere)):
        chromium.evaluate(f"history.{way}()")
        chromium.until(f"picture.ariaBusy === 'false' && picture.dataset.shown === '{link}'")
        name = re.findall(r"material=([\w-]+)", link)[0]
        assert chosen(chromium) == name
        assert f"{name}, revision" in chromium.evaluate("facts.textContent")
        assert chromium.evaluate("[controls.elements.theta_i.value, sphere.hidden, location.hash]") == [
            *(re.findall(r"theta_i=(\d+)", link)[0], "view=sphere" not in link, link)
        ]
    assert chromium.evaluate("history.length") == start + 2
