"""The explorer in a browser: choose, filter, turn, link, copy; keys alone; dark; and not one error on the way."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.microgeometry.model_errors import surface_error_of
from tests.api.a_store import serving
from tests.api.chromium import Chromium, chosen, copied, curve, idle, milliseconds, shown, visit


def test_the_first_view_is_a_list_three_pictures_and_what_is_known(chromium: Chromium, address: str) -> None:
    for server in ("just started", "at work"):
        visit(chromium, address, "material=scene-copper-sphere")
        print(f"first view, server {server}: {milliseconds(chromium):.0f} ms")
    assert chromium.evaluate("[...document.querySelectorAll('#list li')].map(each => each.dataset.name)") == [
        *("foam", "rolled-brass", "scene-copper-sphere")
    ]
    assert chosen(chromium) == "scene-copper-sphere"
    assert len(curve(chromium, 0)) > 100
    places = "[...document.querySelectorAll('#stage > div:not([hidden])')].map(each => each.id)"
    assert chromium.evaluate(places) == ["cut", "hemisphere", "sphere"]
    (known,) = chromium.texts("#facts")
    for words in ("He et al. 1991", "sigma_0_um", "99 of 100", "Not audited at this revision", "r000001"):
        assert words in known
    origins = chromium.evaluate("performance.getEntriesByType('resource').map(each => new URL(each.name).origin)")
    assert set(origins) == {address.rstrip("/")}


def test_keys_alone_search_choose_and_turn(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#view=cut&material=foam", "material=foam")
    chromium.evaluate("document.querySelector('#search').focus()")
    chromium.type("COPPER fig")
    assert chromium.texts("#count") == ["1 of 3 materials"]
    chromium.press("Enter")
    shown(chromium, "material=scene-copper-sphere")
    assert chosen(chromium) == "scene-copper-sphere"
    chromium.evaluate("search.value = ''; search.dispatchEvent(new Event('input')); list.focus()")
    chromium.press("Home", "ArrowDown", "Enter")
    shown(chromium, "material=rolled-brass")
    before = curve(chromium, 0)
    chromium.evaluate("document.querySelector('[name=theta_i]').focus()")
    chromium.press("ArrowRight")
    shown(chromium, "theta_i=45.5")
    print(f"slider to picture: {milliseconds(chromium):.0f} ms")
    after = curve(chromium, 0)
    assert before.shape != after.shape or np.abs(before - after).max() > 1.0
    assert "45.5" in chromium.until("location.hash.includes('45.5') && location.hash")


def test_the_filters_leave_what_they_name(chromium: Chromium, address: str) -> None:
    visit(chromium, address)
    papers = ["", "Oren and Nayar 1994", "Ward 1992", "He et al. 1991"]
    assert chromium.evaluate("[...paper.options].map(each => each.value)") == papers
    assert chromium.evaluate("[...verdict.options].map(each => each.value)") == ["", "not audited", "violates"]
    for of, value, names in [
        ("model", "ward", ["rolled-brass"]),
        ("verdict", "not audited", []),
        ("model", "", ["foam", "scene-copper-sphere"]),
        ("paper", "He et al. 1991", ["scene-copper-sphere"]),
    ]:
        chromium.evaluate(f"{of}.value = '{value}'; {of}.dispatchEvent(new Event('change'))")
        visible = "[...document.querySelectorAll('#list li:not([hidden])')].map(each => each.dataset.name)"
        assert chromium.evaluate(visible) == names, (of, value)
    assert chromium.texts("#count") == ["1 of 3 materials"]


def test_a_slider_has_one_request_on_its_way_and_ends_where_it_rests(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=scene-copper-sphere&view=hemisphere", "view=hemisphere")
    chromium.evaluate(
        "asked = [], under = 0, most = 0, (was => { fetch = async (...all) => {"
        "  if (!all[1]?.body) return was(...all);"  # of the list, and of models
        "  asked.push(JSON.parse(all[1].body).theta_i);"
        "  most = Math.max(most, under += 1);"
        "  try { return await was(...all); } finally { under -= 1; }"
        "}; })(fetch);"
        "for (let theta = 20; theta <= 40; theta += 1) {"
        "  controls.elements.theta_i.value = theta;"
        "  controls.elements.theta_i.dispatchEvent(new Event('input', { bubbles: true }));"
        "}"
    )
    shown(chromium, "theta_i=40")
    chromium.until("picture.dataset.detail === 'fine' && picture.ariaBusy === 'false'")
    assert "theta_i=40" in chromium.evaluate("picture.dataset.shown")
    first, *rest = chromium.evaluate("asked")
    assert (first, set(rest)) == (20, {40})
    assert len(rest) <= 2  # quickly, and finely once it rests
    assert chromium.evaluate("most") == 1


def test_a_verdict_is_a_sentence_and_its_details_are_folded(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=rolled-brass&view=albedo&compare=%3Amodel", "view=albedo")
    sentence = chromium.evaluate("document.querySelector('#facts .verdict').innerText")
    assert sentence.startswith("violates It is what the paper says: the table is within")
    assert sentence.endswith("It does not conserve energy: albedo 1.2 at 90°.")
    assert "reflects 1.2 at 90 degrees" not in chromium.evaluate("facts.innerText")
    chromium.evaluate("document.querySelectorAll('#facts details').forEach(each => { each.open = true; })")
    assert "reflects 1.2 at 90 degrees" in chromium.evaluate("facts.innerText")
    chips = "[...document.querySelectorAll('#facts details .chip')]"
    assert chromium.evaluate(f"{chips}.map(each => each.innerText)") == [
        *("yes", "no: albedo 1.2 at 90°", "violates", "passes", "at the edge")
    ]
    assert chromium.evaluate(f"new Set({chips}.map(each => getComputedStyle(each).color)).size") == 3
    table, model, limit = (curve(chromium, number, "albedo") for number in range(3))
    np.testing.assert_array_equal(table, model)
    assert table[-1, 1] < limit[-1, 1] < table[0, 1]  # 1.2, 1 and 0.5, from the top
    visit(chromium, f"{address}#material=scene-copper-sphere", "material=scene-copper-sphere")
    assert "This audit is of revision r000009" in chromium.evaluate("facts.textContent")


def test_the_error_against_a_surface_is_the_sentence_of_all_views(chromium: Chromium, own: Path) -> None:
    felt = brdfdb.open(own)["grey-felt"].metadata
    error = surface_error_of(felt.model, felt.parameters)
    assert error is not None
    with serving(own) as served:
        for name, said in (("grey-felt", error.sentence), ("copper-foil", "not compared with rays")):
            visit(chromium, f"{served}#material={name}", f"material={name}")
            assert f"Of the formula against a surface{said}" in chromium.evaluate("facts.textContent")


def test_the_list_has_pictures_and_marks_only_what_is_wrong(chromium: Chromium, address: str) -> None:
    visit(chromium, address)
    lines = "[...document.querySelectorAll('#list li')]"
    marks = chromium.evaluate(f"{lines}.map(each => [...each.querySelectorAll('.chip')].map(chip => chip.innerText))")
    assert marks == [[], ["energy: no: albedo 1.2 at 90°"], []]
    chromium.until(f"{lines}.every(each => each.querySelector('img').naturalWidth > 40)")


def test_what_is_asked_for_early_is_asked_for_once_and_thumbnails_wait(chromium: Chromium, address: str) -> None:
    for link, name in (("", "scene-copper-sphere"), ("#material=foam&view=cut", "foam")):
        visit(chromium, address + link, f"material={name}")
        idle(chromium, "document.querySelector('#list img').src")
        entries = "performance.getEntriesByType('resource')"
        loaded = chromium.evaluate(f"{entries}.map(({{ name, startTime }}) => [name, startTime])")
        for path in ("v1/materials?limit=1000", f"v1/materials/{name}"):
            assert [each for each, _ in loaded].count(address + path) == 1
        of_picture = "performance.getEntriesByName('picture')[0]"
        end = chromium.evaluate(f"(({{ startTime, duration }}) => startTime + duration)({of_picture})")
        assert all(start >= end for each, start in loaded if "thumbnail" in each)


def test_a_picture_that_is_on_its_way_is_said_to_be(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=foam&view=cut", "material=foam")
    before = chromium.evaluate("caption.textContent")
    assert chromium.evaluate("picture.ariaBusy") == "false"
    chromium.evaluate(
        "(was => { fetch = async (...all) => { await new Promise(go => release = go); return was(...all); }; })(fetch)"
    )
    chromium.go("material=foam&view=cut&theta_i=20")
    chromium.until("caption.textContent === 'Loading …' && picture.ariaBusy === 'true'")
    chromium.until("release(), picture.ariaBusy === 'false'")
    assert chromium.evaluate("caption.textContent") == before


def test_a_link_restores_the_view_and_copies_ask_for_the_same(chromium: Chromium, address: str, explored: Path) -> None:
    link = (
        "#material=rolled-brass&view=spectrum&theta_i=30&phi_i=20&theta_r=35&turn=170&scale=linear&compare=foam"
        "&compare=:model&illuminant=A&exposure=1"
    )
    visit(chromium, address + link, "material=rolled-brass", "turn=170")
    fields = "[...controls.elements].filter(({ name }) => /theta|phi|turn|expo|ill/.test(name)).map(of => of.value)"
    assert chromium.evaluate(fields) == ["30", "20", "35", "170", "1", "A"]
    beside = "[...document.querySelectorAll('#beside button')].map(each => each.innerText)"
    assert chromium.evaluate(beside) == ["Foam (sample D) ×", "model of Rolled brass ×"]
    assert chromium.evaluate("controls.elements.log.checked") is False
    assert copied(chromium, "link") == address + link
    point = np.deg2rad([30.0, 20.0, 35.0, 190.0])
    ran: dict[str, Any] = {}
    exec(copied(chromium, "python"), ran)
    assert ran["answer"].brdf == pytest.approx(brdfdb.open(explored)["rolled-brass"].lookup(*point), rel=1e-12)
    assert re.fullmatch(rf"curl '{address}v1/materials/rolled-brass/lookup\?[\w=&.]+'", copied(chromium, "curl"))
    chromium.go("material=foam")
    shown(chromium, "material=foam")
    assert chosen(chromium) == "foam"


@pytest.mark.parametrize("view", ["cut", "hemisphere", "slice", "spectrum", "albedo", "sphere"])
def test_copied_requests_run(chromium: Chromium, address: str, explored: Path, view: str) -> None:
    visit(chromium, f"{address}#material=rolled-brass&view={view}&theta_i=30&phi_i=20", f"view={view}")
    ran = subprocess.run(["sh", "-c", copied(chromium, "curl")], capture_output=True, check=True)
    answer = json.loads(ran.stdout)
    python: dict[str, Any] = {}
    exec(copied(chromium, "python"), python)
    found = python["answer"]
    assert answer["material"] == "rolled-brass"
    if view == "albedo":
        assert (answer["theta_i"][0], found["theta_i"][0]) == (0.0, 0.0)
        return
    axes, f_r = answer.get("axes_deg", {}), np.array(answer["brdf"])
    if view == "slice":
        assert (f_r.shape, found.shape) == ((90, 90), (90, 90))
        return
    viewer = {"spectrum": (45.0, 200.0), "sphere": (0.0, 0.0)}.get(view, (60.0, 200.0))
    expected = brdfdb.open(explored)["rolled-brass"].lookup(*np.deg2rad([30.0, 20.0, *viewer]))
    if "theta_r" in axes:
        f_r = f_r[axes["theta_r"].index(60.0)]
        found = found[150] if view == "cut" else found[60, 100]
    if "delta_phi" in axes:
        f_r = f_r[axes["delta_phi"].index(180.0)]
    assert f_r == pytest.approx(expected, rel=1e-9)
    assert getattr(found, "brdf", found) == pytest.approx(expected, rel=1e-9)


def test_what_fails_is_said_in_the_page(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=fome")
    said = chromium.until("document.querySelector('#message')?.textContent")
    assert said == "no material 'fome' in the store; closest: foam"
    assert chromium.errors == []  # an address that is not there would be one
    resting = "['views', 'controls', 'copies'].map(id => document.getElementById(id).inert)"
    assert chromium.evaluate(resting) == [True, True, True]
    assert chromium.evaluate("message.getAttribute('role')") == "status"
    assert chromium.evaluate("[title.textContent, facts.textContent, picture.innerText.trim()]") == ["fome", "", ""]
    chromium.click("#message a")
    shown(chromium, "material=foam")
    assert chromium.evaluate("message.textContent") == ""
    assert chromium.evaluate(resting) == [False, False, False]


def test_an_empty_store_is_said_to_be_one(chromium: Chromium, own: Path) -> None:
    for material in (own / "materials").iterdir():
        shutil.rmtree(material)
    with serving(own) as empty:
        chromium.open(empty)
        told = chromium.until("document.querySelector('#message')?.textContent")
        assert told == "The store has no material to show."
        assert chromium.evaluate("[count.textContent, picture.innerText.trim()]") == ["0 materials", ""]
        assert chromium.evaluate("controls.inert")


def test_the_stated_error_between_two_wavelengths(chromium: Chromium, address: str, explored: Path) -> None:
    table = brdfdb.open(explored)["scene-copper-sphere"]
    assert table.error is not None
    p99 = np.array(table.error.p99)
    # where the lower wavelength alone would say least
    band, column = np.unravel_index(np.argmax(p99[:, 1:] / p99[:, :-1]), p99[:, 1:].shape)
    lower, upper = p99[band, column : column + 2]
    low, high = table.wavelength_nm[column : column + 2]
    assert f"{100.0 * lower:.3g}" != f"{100.0 * upper:.3g}"
    assert table.error.between is not None
    between = max(upper, table.error.between.bands[band][column])
    for nm, expected in ((low, lower), (low + 1.0, between), (high, upper)):
        link = f"{address}#material=scene-copper-sphere&theta_i={table.error.theta_i_deg[band]:g}&nm={nm:g}"
        visit(chromium, link, f"nm={nm:g}")
        assert chromium.evaluate("band.textContent") == f"within {100.0 * expected:.3g} %"


def test_a_wrong_comparison_leaves_the_material(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=foam&view=cut&compare=brsas", "material=foam")
    assert "brsas" in chromium.evaluate("message.textContent")
    assert len(curve(chromium, 0)) > 100
    assert chromium.until("controls.elements.compare.options.length > 3 && beside.children.length === 0")
    chromium.choose("theta_i", 20)
    shown(chromium, "theta_i=20")
    assert "brsas" in chromium.evaluate("message.textContent")
    chromium.until("location.hash === '#material=foam&view=cut&theta_i=20'")


@pytest.mark.parametrize(
    ("wrong", "said", "kept"),
    [
        ("(rho_d=abc)", "rho_d: 'abc' is not a number; the published value is shown.", ""),
        ("(rho_d=)", "rho_d: '' is not a number; the published value is shown.", ""),
        ("(rho_d=NaN,rho_s=0.2)", "rho_d: 'NaN' is not a number; the published value is shown.", "(rho_s=0.2)"),
        ("&theta_i=500", "theta_i: '500' is not a number from 0 to 89.5; 89.5 is shown.", "&theta_i=89.5"),
        ("&theta_i=x", "theta_i: 'x' is not a number from 0 to 89.5; 45 is shown.", ""),
        ("&axes=foo", "axes: 'foo' is not one of polar, cartesian; polar is shown.", ""),
    ],
)
def test_wrong_links(chromium: Chromium, address: str, wrong: str, said: str, kept: str) -> None:
    visit(chromium, f"{address}#material=rolled-brass{wrong}")
    assert idle(chromium, "message.textContent") == said
    assert chromium.evaluate("picture.dataset.shown") == f"#material=rolled-brass{kept}"
    assert chromium.evaluate("title.textContent") == "Rolled brass" + (", changed" if "(" in kept else "")
    chromium.choose("phi_i", 20)
    shown(chromium, "phi_i=20")
    assert idle(chromium, "message.textContent === ''")
    chromium.go("material=foam&view=foo")
    shown(chromium, "material=foam")
    assert chromium.until("message.textContent").endswith("sphere; together is shown.")


def test_a_refused_parameter_is_asked_for_once_and_can_be_moved_back(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=scene-copper-sphere(sigma_0_um=-4)")
    said = chromium.until("document.querySelector('#message')?.textContent")
    assert said.startswith("sigma_0_um: -4 is outside")
    for width in (1200, 1100):  # a window that changes draws again
        chromium.send("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        chromium.evaluate("new Promise(go => setTimeout(go, 300))")
    assert len(chromium.errors) == 1
    chromium.errors.clear()
    assert chromium.until("!parameters.hidden && parameters.children.length > 0")
    chromium.click("[data-action=reset]")
    shown(chromium, "#material=scene-copper-sphere")
    assert chromium.evaluate("message.textContent") == ""


def test_keys_pass_over_names_to_compare_with_until_enter(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=rolled-brass&view=cut")
    chromium.until("controls.elements.compare.options.length > 3")
    chromium.evaluate("controls.elements.compare.focus()")
    for letter in "foa":  # no letter of another name: a second between two letters begins a new word
        chromium.send("Input.dispatchKeyEvent", type="keyDown", key=letter, text=letter, code=f"Key{letter.upper()}")
        chromium.send("Input.dispatchKeyEvent", type="keyUp", key=letter, code=f"Key{letter.upper()}")
    assert chromium.until("controls.elements.compare.value === 'foam'")
    chromium.press("ArrowDown", "ArrowUp")
    assert chromium.evaluate("beside.children.length") == 0
    chromium.press("Enter")
    shown(chromium, "compare=foam")
    assert chromium.evaluate("[...beside.children].map(each => each.dataset.text)") == ["foam"]
    chromium.choose("compare", ":model")  # as a click in the open list does
    shown(chromium, "compare=foam&compare=:model")


def test_the_list_of_operations_is_one_column(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}docs", 1400)
    chromium.until("document.querySelectorAll('section').length > 20")
    lefts = "[...document.querySelectorAll('main > *')].map(each => each.getBoundingClientRect().left)"
    assert len(set(chromium.evaluate(lefts))) == 1
    assert chromium.evaluate("document.querySelector('section').getBoundingClientRect().width") > 700


def test_what_was_away_is_shown_when_it_is_back(chromium: Chromium, address: str, explored: Path) -> None:
    visit(chromium, f"{address}#material=foam", "material=foam")
    head = explored / "materials" / "foam" / "HEAD.json"
    kept = head.rename(head.with_suffix(".away"))
    try:
        chromium.go("material=foam&theta_i=20")
        assert "foam" in chromium.until("message.textContent")
        assert chromium.evaluate("cut.hidden")
    finally:
        kept.rename(head)
    shown(chromium, "theta_i=20")
    assert chromium.evaluate("message.textContent") == ""
    assert len(curve(chromium, 0)) > 100
    chromium.errors.clear()  # the service answered 503


# gives every material an albedo above 1
BRIGHT = """\
const ask = fetch, largest_albedo = { albedo: 1.05, tolerance: 0.01, theta_i_deg: 0, wavelength_nm: 700 };
globalThis.fetch = async (...all) => {
  const answer = await ask(...all);
  return /^v1.materials.[a-z-]+$/.test(all[0]) ? Response.json({ ...(await answer.json()), largest_albedo }) : answer;
};
"""
# widths in em of texts beside the picture that take more than one line
BROKEN_LINES = """\
[...facts.querySelectorAll('dt, dd, p, .chip, .quiet')].flatMap(part => [...part.childNodes].flatMap(node => {
  const text = document.createRange();
  text.selectNodeContents(node);
  const broken = node.nodeType === Node.TEXT_NODE && text.getClientRects().length > 1;
  return broken ? [part.getBoundingClientRect().width / parseFloat(getComputedStyle(part).fontSize)] : [];
}))
"""


@pytest.mark.parametrize("width", [1600, 1280, 420])
def test_texts_beside_the_picture_are_wide_enough_to_read(chromium: Chromium, address: str, width: int) -> None:
    script = chromium.send("Page.addScriptToEvaluateOnNewDocument", source=BRIGHT)
    chromium.open(f"{address}#material=rolled-brass", width)
    shown(chromium, "material=rolled-brass")
    chromium.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    words = chromium.evaluate("facts.innerText")
    assert "does the published model conserve energy?" in words
    assert re.search(r"albedo above 1\s+1\.05 at 0°, 700 nm", words)
    assert all(each >= 8.0 for each in chromium.evaluate(BROKEN_LINES))
    assert chromium.evaluate("facts.scrollWidth <= facts.clientWidth")
    assert chromium.evaluate("document.documentElement.scrollWidth") <= width
    chromium.send("Page.removeScriptToEvaluateOnNewDocument", **script)


@pytest.mark.parametrize("width", [1280, 390])
def test_light_and_dark_pages(chromium: Chromium, address: str, width: int) -> None:
    chromium.open(f"{address}#material=foam", width)
    shown(chromium)
    light = chromium.picture()
    assert np.median(light) > 0.95
    assert (light < 0.5).mean() > 0.005
    chromium.open(f"{address}#material=foam", width, scheme="dark")
    shown(chromium)
    dark = chromium.picture()
    assert np.median(dark) < 0.1
    assert (dark > 0.6).mean() > 0.005
