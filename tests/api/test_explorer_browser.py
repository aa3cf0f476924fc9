"""The explorer in a browser: choose, turn, compare, link; keys alone; a phone; dark; and not one error on the way."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb_pipelines import cli
from tests.api.a_store import serving
from tests.api.chromium import SECONDS, Chromium

RECIPE = """\
title = "one grey, one anisotropic, one spectral"
materials = ["foam", "rolled-brass", "scene-copper-sphere"]
wavelengths_nm = [{ start = 400, stop = 700, step = 20 }]
[grids.isotropic]
theta_i_deg = [{ start = 0, stop = 80, step = 10 }, 85, 89.5]
theta_r_deg = [{ start = 0, stop = 80, step = 10 }, 85, 89.5]
delta_phi_deg = [{ start = 0, stop = 180, step = 15 }]
[grids.spectral]
theta_i_deg = [{ start = 0, stop = 80, step = 10 }, 89.5]
theta_r_deg = [{ start = 0, stop = 80, step = 10 }, 89.5]
delta_phi_deg = [{ start = 0, stop = 180, step = 30 }]
[grids.anisotropic]
theta_i_deg = [{ start = 0, stop = 80, step = 20 }, 89.5]
phi_i_deg = [{ start = 0, stop = 360, step = 30 }]
theta_r_deg = [{ start = 0, stop = 80, step = 20 }, 89.5]
phi_r_deg = [{ start = 0, stop = 360, step = 30 }]
"""
ALBEDO = {"theta_i_deg": [0.0, 90.0], "wavelength_nm": None, "albedo": [[0.5], [1.2]]}
FOUND = {each: {"verdict": "passes"} for each in ("reciprocity", "smoothness", "table_error", "sampling")} | {
    "material": "rolled-brass",
    "revision": "r000001",
    "energy": {"verdict": "violates", "reason": "reflects 1.2 at 90 degrees", "model": ALBEDO, "table": ALBEDO},
    "validity": {"standing": "at the edge"},
    "verdict": "violates",
}
# Of three materials one is audited, one was at another revision
AUDIT = {
    "when": "2026-11-21T12:00:00Z",
    "materials": [FOUND, FOUND | {"material": "scene-copper-sphere", "revision": "r000009"}],
}
# What a view has drawn once it is there
DRAWN = {
    "cut": "#cut path.first",
    "hemisphere": "#plot .gl-container canvas",
    "half-difference": "#plot .heatmaplayer image",
    "spectrum": "#plot .scatterlayer path",
    "albedo": "#plot .scatterlayer path.js-line",
    "sphere": "#spheres canvas",
}
PIXEL = 0.1  # paths are written to a tenth of a pixel
LEVELS = 0.51  # of 255: levels are whole numbers, and angles travel as float32
SIZE = 96  # pixels across a sphere


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("explored")
    (root / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    assert cli.main(["build", str(root / "recipe.toml"), "--store", str(root / "store"), "--jobs", "2"]) == 0
    (root / "store" / "audit.json").write_text(json.dumps(AUDIT), encoding="utf-8")
    return root / "store"


@pytest.fixture(scope="module")
def address(store: Path) -> Iterator[str]:
    """Where `brdfdb serve` serves the store."""
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "serve", "--store", str(store), "--port", "0"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("BRDFDB_")}
    server = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment, text=True, encoding="utf-8"
    )
    assert server.stdout is not None
    said = server.stdout.readline()
    found = re.search(r"http://\S+", said)
    assert found, said
    yield found[0]
    server.send_signal(signal.SIGINT)
    server.communicate(timeout=SECONDS)


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    """A Chromium; without one these tests are skipped, or fail where it is known to be there."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if binary := shutil.which(name):
            with Chromium(binary, tmp_path_factory.mktemp("profile")) as browser:
                yield browser
            return
    if os.environ.get("BRDFDB_NEEDS_BROWSER"):
        pytest.fail("BRDFDB_NEEDS_BROWSER is set, and no chromium, chromium-browser or google-chrome is on PATH")
    pytest.skip("no chromium, chromium-browser or google-chrome on PATH")


def shown(browser: Chromium, *parts: str) -> None:
    """Wait for a picture of the state whose link has these parts."""
    of = "(document.querySelector('#picture')?.dataset.shown ?? '')"
    browser.until(" && ".join([f"{of} !== ''", *(f"{of}.includes('{part}')" for part in parts)]))


def chosen(browser: Chromium) -> str:
    return str(browser.evaluate("document.querySelector('[aria-selected=true]').dataset.name"))


def milliseconds(browser: Chromium) -> float:
    """From what asked for a picture, a hand or the page, to the picture."""
    return float(browser.evaluate("performance.getEntriesByName('picture')[0].duration"))


def curve(browser: Chromium, kind: str) -> np.ndarray:
    """The points of a curve [pixel]."""
    path = browser.evaluate(f"document.querySelector('#cut path.{kind}').getAttribute('d')")
    return np.array([point.split() for point in path[1:].split("L")], dtype=float)


def copied(browser: Chromium, kind: str) -> str:
    browser.evaluate(f"document.querySelector('[data-copy={kind}]').click()")
    browser.until("/Copied|Selected/.test(document.querySelector('#message').textContent)")
    return str(browser.evaluate("document.querySelector('#copied textarea').value"))


def test_the_first_view_is_a_list_a_cut_and_what_is_known(chromium: Chromium, address: str) -> None:
    for server in ("just started", "at work"):
        chromium.open(address)
        shown(chromium, "material=foam")
        print(f"first view, server {server}: {milliseconds(chromium):.0f} ms")
    assert chromium.evaluate("[...document.querySelectorAll('#list li')].map(each => each.dataset.name)") == [
        *("foam", "rolled-brass", "scene-copper-sphere")
    ]
    assert chosen(chromium) == "foam"
    assert len(curve(chromium, "first")) > 100
    known = chromium.evaluate("document.querySelector('#facts').innerText")
    for words in ("Oren and Nayar 1994", "sigma_deg", "99 of 100", "no audit of it is here", "r000001"):
        assert words in known
    assert chromium.evaluate("performance.getEntriesByType('resource').map(each => new URL(each.name).origin)") == [
        address.rstrip("/")
    ] * chromium.evaluate("performance.getEntriesByType('resource').length")
    assert chromium.errors == []


def test_keys_alone_search_choose_and_turn(chromium: Chromium, address: str) -> None:
    chromium.open(address)
    shown(chromium, "material=foam")
    chromium.evaluate("document.querySelector('#search').focus()")
    chromium.type("COPPER fig")
    assert chromium.evaluate("document.querySelector('#count').textContent") == "1 of 3 materials"
    chromium.press("Enter")
    shown(chromium, "material=scene-copper-sphere")
    assert chosen(chromium) == "scene-copper-sphere"
    chromium.evaluate("search.value = ''; search.dispatchEvent(new Event('input')); list.focus()")
    chromium.press("Home", "ArrowDown", "Enter")
    shown(chromium, "material=rolled-brass")
    before = curve(chromium, "first")
    chromium.evaluate("document.querySelector('[name=theta_i]').focus()")
    chromium.press("ArrowRight")
    shown(chromium, "theta_i=45.5")
    print(f"slider to picture: {milliseconds(chromium):.0f} ms")
    after = curve(chromium, "first")
    assert before.shape != after.shape or np.abs(before - after).max() > 1.0
    assert "45.5" in chromium.until("location.hash.includes('45.5') && location.hash")
    assert chromium.errors == []


def test_the_filters_leave_what_they_name(chromium: Chromium, address: str) -> None:
    chromium.open(address)
    shown(chromium)
    chromium.evaluate("model.value = 'ward'; model.dispatchEvent(new Event('change'))")
    visible = "[...document.querySelectorAll('#list li:not([hidden])')].map(each => each.dataset.name)"
    assert chromium.evaluate(visible) == ["rolled-brass"]
    assert chromium.evaluate("[...verdict.options].map(each => each.value)") == ["", "not audited", "violates"]
    chromium.evaluate("verdict.value = 'not audited'; verdict.dispatchEvent(new Event('change'))")
    assert chromium.evaluate(visible) == []
    chromium.evaluate("model.value = ''; model.dispatchEvent(new Event('change'))")
    assert chromium.evaluate(visible) == ["foam", "scene-copper-sphere"]


def test_verdicts_are_words_in_colours_beside_the_picture(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=rolled-brass&view=albedo&compare=%3Amodel")
    shown(chromium, "view=albedo")
    chips = "[...document.querySelectorAll('#facts .chip')]"
    assert chromium.evaluate(f"{chips}.map(each => each.innerText)") == [
        *("violates", "violates", "passes", "passes", "passes", "passes", "at the edge")
    ]
    assert chromium.evaluate(f"new Set({chips}.map(each => getComputedStyle(each).color)).size") == 3
    assert "reflects 1.2 at 90 degrees" in chromium.evaluate("facts.innerText")
    curves = chromium.evaluate("plot.data.map(each => [each.name, each.y])")
    assert curves == [["table", [0.5, 1.2]], ["model", [0.5, 1.2]], ["all that arrives", [1, 1]]]
    chromium.open(f"{address}#material=scene-copper-sphere")
    shown(chromium, "material=scene-copper-sphere")
    assert "This is of revision r000009, not of the current one." in chromium.evaluate("facts.innerText")


def test_the_cut_shows_the_numbers_of_the_table(chromium: Chromium, address: str, store: Path) -> None:
    chromium.open(f"{address}#material=foam&scale=linear&theta_i=30")
    shown(chromium, "material=foam", "scale=linear")
    x, y = curve(chromium, "first").T
    (centre, middle), (_, top) = curve(chromium, "mirror")[0], curve(chromium, "mirror")[1]
    assert top < middle
    degrees = np.rad2deg(np.arctan2(x - centre, middle - y))
    table = brdfdb.open(store)["foam"]
    turned = np.where(degrees > 0.0, np.pi, 0.0)
    expected = table.lookup(np.deg2rad(30.0), 0.0, np.deg2rad(np.abs(degrees)), turned)
    radius = np.hypot(x - centre, y - middle)
    scale = radius.max() / np.max(expected)
    np.testing.assert_allclose(radius, scale * expected, atol=2.0 * PIXEL)


def test_the_pointer_reads_the_cut(chromium: Chromium, address: str, store: Path) -> None:
    chromium.open(f"{address}#material=foam&theta_i=30")
    shown(chromium, "material=foam")
    (x, y), _ = curve(chromium, "mirror")
    left, top = chromium.evaluate(
        "(({ left, top }) => [left, top])(document.querySelector('#cut svg').getBoundingClientRect())"
    )
    aside = 100.0 * np.tan(np.deg2rad(-40.0))
    chromium.send("Input.dispatchMouseEvent", type="mouseMoved", x=left + x + aside, y=top + y - 100.0)
    value = brdfdb.open(store)["foam"].lookup(*np.deg2rad([30.0, 0.0, 40.0, 0.0]))
    assert chromium.until("/sr$/.test(read.textContent) && read.textContent") == f"θᵣ −40°: {value:.3g} /sr"


def test_table_and_model_stand_side_by_side(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=scene-copper-sphere")
    shown(chromium)
    change = "; controls.elements.compare.dispatchEvent(new Event('input', { bubbles: true }))"
    chromium.evaluate("controls.elements.compare.value = ':model'" + change)
    shown(chromium, "compare=%3Amodel")
    assert len(curve(chromium, "first")) == len(curve(chromium, "second")) == len(curve(chromium, "off"))
    said = r"table − model, relative to the model, or to the floor .* is larger: \d.* % at most"
    assert re.search(said, chromium.evaluate("caption.textContent"))
    chromium.evaluate("controls.elements.compare.value = 'foam'" + change)
    shown(chromium, "compare=foam")
    assert "Foam" in chromium.evaluate("document.querySelector('.legend').textContent")
    assert chromium.evaluate("document.querySelector('#cut path.off')") is None
    assert chromium.errors == []


@pytest.mark.parametrize("name", ["scene-copper-sphere", "rolled-brass"])
def test_numbers_of_the_scale_do_not_overlap_on_a_phone(chromium: Chromium, address: str, name: str) -> None:
    chromium.open(f"{address}#material={name}", 390)
    shown(chromium, f"material={name}")
    boxes = chromium.evaluate(
        "[...document.querySelectorAll('#cut text')].map(each => each.getBoundingClientRect())"
        ".map(({ left, right, bottom }) => [bottom, left, right])"
    )
    line = sorted(box for box in boxes if box[0] == max(bottom for bottom, _, _ in boxes))
    assert len(line) >= 3
    assert all(one[2] < other[1] for one, other in pairwise(line))


def test_a_table_is_off_by_what_its_stated_error_means(chromium: Chromium, address: str, store: Path) -> None:
    chromium.open(f"{address}#material=scene-copper-sphere&view=half-difference&compare=%3Amodel&nm=500")
    shown(chromium, "nm=500")
    table = brdfdb.open(store)["scene-copper-sphere"]
    lobe = f"{address}v1/materials/scene-copper-sphere/lobe?view=half-difference&wavelength_nm=500"
    answers = [httpx.get(lobe + of, timeout=SECONDS).json()["brdf"] for of in ("&from=table", "&from=model")]
    tabulated, model = np.array(answers)
    floor = table.error.floor[list(table.wavelength_nm).index(500.0)]
    assert model.min() < floor < model.max()
    drawn = np.array(chromium.evaluate("plot.data[1].z"))
    np.testing.assert_allclose(drawn, (tabulated - model) / np.maximum(model, floor), rtol=1e-12, atol=0.0)
    assert chromium.evaluate("plot.data[1].zmax") == pytest.approx(np.quantile(np.abs(drawn), 0.99), rel=1e-2)


def test_a_picture_that_is_on_its_way_is_said_to_be(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=foam")
    shown(chromium, "material=foam")
    before = chromium.evaluate("caption.textContent")
    assert chromium.evaluate("picture.ariaBusy") == "false"
    chromium.evaluate(
        "(was => { fetch = async (...all) => { await new Promise(go => release = go); return was(...all); }; })(fetch)"
    )
    chromium.evaluate("location.hash = 'material=foam&theta_i=20'")
    chromium.until("caption.textContent === 'Loading …' && picture.ariaBusy === 'true'")
    chromium.until("release(), picture.ariaBusy === 'false'")
    assert chromium.evaluate("caption.textContent") == before
    assert chromium.errors == []


@pytest.mark.parametrize("compare", ["", "%3Amodel"])
@pytest.mark.parametrize("view", DRAWN)
def test_every_view_draws_at_any_width(chromium: Chromium, address: str, view: str, compare: str) -> None:
    link = f"{address}#material=scene-copper-sphere&view={view}&compare={compare}"
    for width in (1280, 390, 320):
        chromium.open(link, width)
        shown(chromium, "material=scene-copper-sphere", *([f"view={view}"] if view != "cut" else []))
        assert chromium.evaluate(f"document.querySelectorAll('{DRAWN[view]}').length")
        assert chromium.evaluate("document.documentElement.scrollWidth") <= width
        assert len(chromium.evaluate("caption.textContent")) > 40
        assert chromium.evaluate("message.textContent") == ""
    assert chromium.errors == []


@pytest.mark.parametrize("view", ["hemisphere", "half-difference", "spectrum", "albedo"])
def test_buttons_over_a_plot_save_it_and_restore_it_and_send_nothing(
    chromium: Chromium, address: str, view: str
) -> None:
    chromium.open(f"{address}#material=foam&view={view}")
    shown(chromium, f"view={view}")
    assert chromium.evaluate("[...document.querySelectorAll('.modebar-btn')].map(each => each.dataset.title)") == [
        "Download plot as a PNG",
        "Reset camera to default" if view == "hemisphere" else "Reset axes",
    ]


@pytest.mark.parametrize("name", ["foam", "scene-copper-sphere"])
def test_the_axis_of_a_spectrum_is_wider_than_rounding(chromium: Chromium, address: str, name: str) -> None:
    chromium.open(f"{address}#material={name}&view=spectrum&compare=%3Amodel")
    shown(chromium, "view=spectrum")
    low, high = 10.0 ** np.array(chromium.evaluate("plot.layout.yaxis.range"))
    values = np.concatenate(chromium.evaluate("plot.data.map(each => each.y)"))
    values = values[values > 0.0]  # edges of the band at 0 are on no logarithmic axis
    assert low < values.min() <= values.max() < high
    assert high / low > 1.5


def test_a_mirror_is_spoken_of_where_there_is_one(chromium: Chromium, address: str) -> None:
    for name, mirror in (("foam", False), ("scene-copper-sphere", True)):
        chromium.open(f"{address}#material={name}&view=sphere")
        shown(chromium, "view=sphere")
        assert ("Dirac" in chromium.evaluate("caption.textContent")) is mirror


@pytest.mark.parametrize("name", ["foam", "rolled-brass"])
def test_the_sphere_has_the_radiance_of_the_table(chromium: Chromium, address: str, store: Path, name: str) -> None:
    theta, phi = 50.0, 70.0
    chromium.open(f"{address}#material={name}&view=sphere&theta_i={theta}&phi_i={phi}")
    shown(chromium, "view=sphere")
    drawn = chromium.evaluate(
        f"[...document.querySelector('canvas').getContext('2d').getImageData(0, 0, {SIZE}, {SIZE}).data]"
    )
    levels = np.reshape(drawn, (SIZE, SIZE, 4))[..., 0]
    # the same scene with vectors: x to the right, y up, z to the viewer; the tangent is up x normal
    x, y = np.meshgrid((np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0, 1.0 - (np.arange(SIZE) + 0.5) / SIZE * 2.0)
    normal = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
    light = unit_vector(np.deg2rad(theta), np.deg2rad(phi))
    lit = (normal[..., 2] > 0.0) & (normal @ light > 0.0)
    normal = normal[lit]
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=-2)
    table = brdfdb.open(store)[name]
    radiance = np.pi * table.lookup_vectors(frame @ light, frame @ [0.0, 0.0, 1.0]) * (normal @ light)
    linear = np.clip(radiance, 0.0, 1.0)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    assert np.ptp(levels[lit]) > 50
    np.testing.assert_allclose(levels[lit], 255.0 * expected, atol=LEVELS)
    assert not levels[~lit].any()


def test_a_link_restores_the_view_and_copies_ask_for_the_same(chromium: Chromium, address: str, store: Path) -> None:
    link = "#material=rolled-brass&view=spectrum&theta_i=30&phi_i=20&theta_r=35&turn=170&scale=linear&compare=foam"
    chromium.open(address + link)
    shown(chromium, "material=rolled-brass", "turn=170")
    fields = "['theta_i', 'phi_i', 'theta_r', 'turn', 'compare'].map(name => controls.elements[name].value)"
    assert chromium.evaluate(fields) == ["30", "20", "35", "170", "foam"]
    assert chromium.evaluate("controls.elements.log.checked") is False
    assert copied(chromium, "link") == address + link
    point = np.deg2rad([30.0, 20.0, 35.0, 190.0])
    ran: dict[str, Any] = {}
    exec(copied(chromium, "python"), ran)
    assert ran["answer"].brdf == pytest.approx(brdfdb.open(store)["rolled-brass"].lookup(*point), rel=1e-12)
    assert re.fullmatch(rf"curl '{address}v1/materials/rolled-brass/lookup\?[\w=&.]+'", copied(chromium, "curl"))
    chromium.evaluate("location.hash = 'material=foam'")
    shown(chromium, "material=foam")
    assert chosen(chromium) == "foam"
    assert chromium.errors == []


@pytest.mark.parametrize("view", ["cut", "hemisphere", "half-difference", "sphere"])
def test_copied_python_runs_and_looks_up_the_light_of_the_sliders(
    chromium: Chromium, address: str, store: Path, view: str
) -> None:
    chromium.open(f"{address}#material=rolled-brass&view={view}&theta_i=30&phi_i=20")
    shown(chromium, f"view={view}" if view != "cut" else "theta_i=30")
    ran: dict[str, Any] = {}
    exec(copied(chromium, "python"), ran)
    sixty, at = np.deg2rad(60.0), brdfdb.open(store)["rolled-brass"].lookup
    light = np.deg2rad([30.0, 20.0])
    found, expected = {
        "cut": lambda of: (of[150], at(*light, sixty, np.deg2rad(200.0))),
        "hemisphere": lambda of: (of[60, 100], at(*light, sixty, np.deg2rad(200.0))),
        "half-difference": lambda of: (of.shape, (90, 90)),
        "sphere": lambda of: (of, at(*light, 0.0, 0.0)),
    }[view](ran["answer"])
    assert found == pytest.approx(expected, rel=1e-9)


def test_what_fails_is_said_in_the_page(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=fome")
    said = chromium.until("document.querySelector('#message')?.textContent")
    assert "fome" in said
    assert chromium.evaluate("message.getAttribute('role')") == "status"
    assert chromium.evaluate("[title.textContent, facts.textContent, picture.innerText.trim()]") == ["fome", "", ""]
    chromium.until("document.querySelectorAll('#list li').length === 3")
    chromium.evaluate("document.querySelector('#list li').click()")
    shown(chromium, "material=foam")
    assert chromium.evaluate("message.textContent") == ""


@pytest.fixture
def plain(root: Path) -> Iterator[str]:
    """Where the store of the other tests is served: of its tables only two state an error."""
    with serving(root) as found:
        yield found


@pytest.mark.parametrize("compare", ["", "%3Amodel", "grey-felt"])
def test_the_spectrum_of_a_table_that_states_no_error_is_drawn_without_one(
    chromium: Chromium, plain: str, compare: str
) -> None:
    chromium.open(f"{plain}/#material=white-tile&view=spectrum&compare={compare}")
    assert (
        chromium.until(
            "document.querySelector('#picture')?.dataset.shown && 'shown' || globalThis.message?.textContent"
        )
        == "shown"
    )
    assert (
        chromium.evaluate("plot.data.filter(each => each.mode === 'lines' && each.line.width > 0)[0].y")
        == [
            pytest.approx(1.0 / np.pi, rel=2**-24)  # stored as float32
        ]
        * 2
    )
    assert ("with the band" in chromium.evaluate("caption.textContent")) == (compare == "grey-felt")
    assert chromium.errors == []


def test_the_error_between_two_wavelengths_is_the_larger_of_theirs(
    chromium: Chromium, address: str, store: Path
) -> None:
    table = brdfdb.open(store)["scene-copper-sphere"]
    assert table.error is not None
    p99 = np.array(table.error.p99)
    # where the lower wavelength alone would say least
    band, column = np.unravel_index(np.argmax(p99[:, 1:] / p99[:, :-1]), p99[:, 1:].shape)
    lower, upper = p99[band, column : column + 2]
    low, high = table.wavelength_nm[column : column + 2]
    assert f"{100.0 * lower:.3g}" != f"{100.0 * upper:.3g}"
    for nm, expected in ((low, lower), (low + 1.0, upper), (high, upper)):
        chromium.open(f"{address}#material=scene-copper-sphere&theta_i={table.error.theta_i_deg[band]:g}&nm={nm:g}")
        shown(chromium, f"nm={nm:g}")
        assert chromium.evaluate("band.textContent") == f"within {100.0 * expected:.3g} %"


PAGES = {
    "v1/materials?limit=1000": [{"name": "a", "colour": "#010101"}],
    "v1/materials?limit=1000&cursor=a": [{"name": "b", "colour": None}],
}
# a service of two pages, and without the colour on the second one when that is first asked for
TWO_PAGES = """\
const pages = %s, ask = fetch, asked = globalThis.asked = [];
globalThis.fetch = (path, options) => {
  if (!(path in pages)) return ask(path, options);
  asked.push(path);
  const materials = pages[path].map(each => ({ title: "", model_title: "", source: "", ...each,
    colour: asked.filter(each => each === path).length > 1 ? "#020202" : each.colour }));
  return Promise.resolve(Response.json({ materials, next: path.includes("cursor") ? null : `/${path}&cursor=a` }));
};
"""


def test_the_list_asks_again_only_for_pages_without_all_of_their_colours(chromium: Chromium, plain: str) -> None:
    script = chromium.send("Page.addScriptToEvaluateOnNewDocument", source=TWO_PAGES % json.dumps(PAGES))
    chromium.open(f"{plain}/#material=white-tile")
    second = "document.querySelector('#m-b .swatch').style.background"
    assert chromium.until(f"document.querySelector('#m-b') && {second}") == "rgb(2, 2, 2)"
    assert chromium.evaluate("document.querySelector('#m-a .swatch').style.background") == "rgb(1, 1, 1)"
    assert chromium.evaluate("asked") == [*PAGES, "v1/materials?limit=1000&cursor=a"]
    chromium.send("Page.removeScriptToEvaluateOnNewDocument", identifier=script["identifier"])


def test_a_wrong_comparison_leaves_the_material(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=foam&compare=brsas")
    shown(chromium, "material=foam")
    assert "brsas" in chromium.evaluate("message.textContent")
    assert len(curve(chromium, "first")) > 100
    assert chromium.until("controls.elements.compare.options.length > 3 && controls.elements.compare.value === ''")
    chromium.evaluate("controls.elements.theta_i.value = 20")
    chromium.evaluate("controls.elements.theta_i.dispatchEvent(new Event('input', { bubbles: true }))")
    shown(chromium, "theta_i=20")
    assert "brsas" in chromium.evaluate("message.textContent")
    assert chromium.until("location.hash.includes('theta_i=20') && location.hash") == "#material=foam&theta_i=20"


def test_what_was_away_is_shown_when_it_is_back(chromium: Chromium, address: str, store: Path) -> None:
    chromium.open(f"{address}#material=foam")
    shown(chromium, "material=foam")
    head = store / "materials" / "foam" / "HEAD.json"
    kept = head.rename(head.with_suffix(".away"))
    try:
        chromium.evaluate("location.hash = 'material=foam&theta_i=20'")
        assert "foam" in chromium.until("message.textContent")
        assert chromium.evaluate("document.querySelector('#cut').hidden")
    finally:
        kept.rename(head)
    shown(chromium, "theta_i=20")
    assert chromium.evaluate("message.textContent") == ""
    assert len(curve(chromium, "first")) > 100


@pytest.mark.parametrize("width", [1280, 390])
def test_the_explorer_is_ink_on_paper_and_dark_where_that_is_asked_for(
    chromium: Chromium, address: str, width: int
) -> None:
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


def test_every_control_has_a_name_and_can_be_reached_by_keys(chromium: Chromium, address: str) -> None:
    chromium.open(address)
    shown(chromium)
    unnamed = chromium.evaluate(
        "[...document.querySelectorAll('input, select, textarea, button')]"
        ".filter(each => !(each.labels?.[0] ?? each).innerText.trim()).map(each => each.outerHTML)"
    )
    assert unnamed == []
    reached = []
    chromium.evaluate("document.body.focus()")
    for _ in range(14):
        chromium.press("Tab")
        reached.append(chromium.evaluate("document.activeElement.id || document.activeElement.name"))
    assert {"search", "model", "verdict", "list", "view", "theta_i", "log", "compare"} <= set(reached)
    assert chromium.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"
