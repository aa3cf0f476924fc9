"""What the explorer draws: numbers of tables and models, in every view, at any width."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import httpx
import numpy as np
import pytest

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb.spectra import srgb_weights
from tests.api.chromium import SECONDS, Chromium, curve, shown

# What a view has drawn once it is there
DRAWN = {
    "cut": "#cut path.first",
    "hemisphere": "#hemisphere canvas",
    "half-difference": "#plot .heatmaplayer image",
    "spectrum": "#plot .scatterlayer path",
    "albedo": "#plot .scatterlayer path.js-line",
    "sphere": "#spheres canvas",
}
COLOURFUL = 60  # of 255: between the largest and the smallest channel
LAST = 87.0  # degrees: of the viewers of a hemisphere, those next to the horizon
PIXELS = 0.5  # edges are soft: measured 0.33
PIXEL = 0.1  # paths are written to a tenth of a pixel
LEVELS = 0.51  # of 255: levels are whole numbers, and angles travel as float32
SIZE = 96  # pixels across a sphere


def test_the_cut_shows_the_numbers_of_the_table(chromium: Chromium, address: str, explored: Path) -> None:
    chromium.open(f"{address}#material=foam&scale=linear&theta_i=30")
    shown(chromium, "material=foam", "scale=linear")
    x, y = curve(chromium, "first").T
    (centre, middle), (_, top) = curve(chromium, "mirror")[0], curve(chromium, "mirror")[1]
    assert top < middle
    degrees = np.rad2deg(np.arctan2(x - centre, middle - y))
    table = brdfdb.open(explored)["foam"]
    turned = np.where(degrees > 0.0, np.pi, 0.0)
    expected = table.lookup(np.deg2rad(30.0), 0.0, np.deg2rad(np.abs(degrees)), turned)
    radius = np.hypot(x - centre, y - middle)
    scale = radius.max() / np.max(expected)
    np.testing.assert_allclose(radius, scale * expected, atol=2.0 * PIXEL)


def test_the_pointer_reads_the_cut(chromium: Chromium, address: str, explored: Path) -> None:
    chromium.open(f"{address}#material=foam&theta_i=30")
    shown(chromium, "material=foam")
    (x, y), _ = curve(chromium, "mirror")
    left, top = chromium.evaluate(
        "(({ left, top }) => [left, top])(document.querySelector('#cut svg').getBoundingClientRect())"
    )
    aside = 100.0 * np.tan(np.deg2rad(-40.0))
    chromium.send("Input.dispatchMouseEvent", type="mouseMoved", x=left + x + aside, y=top + y - 100.0)
    value = brdfdb.open(explored)["foam"].lookup(*np.deg2rad([30.0, 0.0, 40.0, 0.0]))
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


def test_a_table_is_off_by_what_its_stated_error_means(chromium: Chromium, address: str, explored: Path) -> None:
    chromium.open(f"{address}#material=scene-copper-sphere&view=half-difference&compare=%3Amodel&nm=500")
    shown(chromium, "nm=500")
    table = brdfdb.open(explored)["scene-copper-sphere"]
    lobe = f"{address}v1/materials/scene-copper-sphere/lobe?view=half-difference&wavelength_nm=500"
    answers = [httpx.get(lobe + of, timeout=SECONDS).json()["brdf"] for of in ("&from=table", "&from=model")]
    tabulated, model = np.array(answers)
    floor = table.error.floor[list(table.wavelength_nm).index(500.0)]
    assert model.min() < floor < model.max()
    drawn = np.array(chromium.evaluate("plot.data[1].z"))
    np.testing.assert_allclose(drawn, (tabulated - model) / np.maximum(model, floor), rtol=1e-12, atol=0.0)
    assert chromium.evaluate("plot.data[1].zmax") == pytest.approx(np.quantile(np.abs(drawn), 0.99), rel=1e-2)


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


# gives every material the longest title of the presets
LONG_TITLES = """\
const ask = fetch, title = "Vase, cylindrical block and cube of the rendered scene, smooth";
globalThis.fetch = async (...all) => {
  const answer = await ask(...all);
  return /^v1.materials.[a-z-]+$/.test(all[0]) ? Response.json({ ...(await answer.json()), title }) : answer;
};
"""


@pytest.mark.parametrize("width", [1280, 390, 320])
def test_titles_of_two_maps_stand_apart_and_whole_over_their_maps(chromium: Chromium, address: str, width: int) -> None:
    script = chromium.send("Page.addScriptToEvaluateOnNewDocument", source=LONG_TITLES)
    chromium.open(f"{address}#material=foam&view=half-difference&compare=rolled-brass", width)
    chromium.send("Page.removeScriptToEvaluateOnNewDocument", identifier=script["identifier"])
    shown(chromium, "view=half-difference")
    boxes = (
        "[...document.querySelectorAll('#plot %s')].map(each => each.getBoundingClientRect())"
        ".map(({ left, right, top, bottom }) => [left, right, top, bottom])"
    )
    (page,), (buttons,), titles, maps = (
        chromium.evaluate(boxes % of)
        for of in (".main-svg:first-child", ".modebar-group:last-child", ".annotation-text", ".nsewdrag")
    )
    for (left, right, top, bottom), (begin, end, upper, _) in zip(titles, maps, strict=True):
        assert page[0] <= left < right <= page[1]
        assert page[2] < buttons[3] <= top < bottom <= upper
        assert abs((left + right) / 2 - (begin + end) / 2) < 1.0
    (_, end, *_), (begin, *_) = titles
    assert end < begin or width < 560
    words = "[...document.querySelectorAll('#plot .annotation-text')].map(each => each.textContent)"
    assert all(text.endswith("smooth") for text in chromium.evaluate(words))


@pytest.mark.parametrize("view", ["half-difference", "spectrum", "albedo"])
def test_buttons_over_a_plot_save_it_and_restore_it_and_send_nothing(
    chromium: Chromium, address: str, view: str
) -> None:
    chromium.open(f"{address}#material=foam&view={view}")
    shown(chromium, f"view={view}")
    assert chromium.evaluate("[...document.querySelectorAll('.modebar-btn')].map(each => each.dataset.title)") == [
        "Download plot as a PNG",
        "Reset axes",
    ]


@pytest.mark.parametrize("view", ["half-difference", "spectrum", "albedo"])
def test_a_finger_on_a_plot_scrolls_the_page_and_leaves_the_plot(chromium: Chromium, address: str, view: str) -> None:
    chromium.open(f"{address}#material=foam&view={view}", 390, 844, touch=True)
    shown(chromium, f"view={view}")
    chromium.evaluate("plot.scrollIntoView({ block: 'center' })")
    read = "[scrollY, plot.layout.xaxis.range, plot.layout.yaxis.range]"
    before, *axes = chromium.evaluate(read)
    x, y = chromium.evaluate(
        "(({ left, top, width, height }) => [left + width / 2, top + height / 2])"
        "(document.querySelector('#plot .nsewdrag').getBoundingClientRect())"
    )
    chromium.swipe(x, y, 100.0)
    _, *found = chromium.until(f"scrollY > {before + 50} && {read}")
    assert found == axes


@pytest.mark.parametrize("name", ["foam", "scene-copper-sphere"])
def test_the_axis_of_a_spectrum_is_wider_than_rounding(chromium: Chromium, address: str, name: str) -> None:
    chromium.open(f"{address}#material={name}&view=spectrum&compare=%3Amodel")
    shown(chromium, "view=spectrum")
    low, high = 10.0 ** np.array(chromium.evaluate("plot.layout.yaxis.range"))
    values = np.concatenate(chromium.evaluate("plot.data.map(each => each.y)"))
    values = values[values > 0.0]  # edges of the band at 0 are on no logarithmic axis
    assert low < values.min() <= values.max() < high
    assert high / low > 1.5


def test_a_spectrum_over_decades_has_numbers_at_1_2_and_5(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=foam&view=spectrum&compare=rolled-brass")
    shown(chromium, "view=spectrum")
    low, high = 10.0 ** np.array(chromium.evaluate("plot.layout.yaxis.range"))
    assert high / low > 10.0
    texts = chromium.evaluate("[...document.querySelectorAll('.ytick text')].map(each => each.textContent)")
    expected = [mantissa * 10.0**power for power in range(-3, 3) for mantissa in (1, 2, 5)]
    assert [float(each) for each in texts] == [pytest.approx(each) for each in expected if low <= each <= high]


def painted(browser: Chromium) -> np.ndarray:
    """Which pixels of the hemisphere are of its surface, or of the line to the light: all else is grey."""
    width, height, data = browser.evaluate(
        "(({ width, height }, context) => [width, height, [...context.getImageData(0, 0, width, height).data]])"
        "(...[document.querySelector('#hemisphere canvas')].flatMap(each => [each, each.getContext('2d')]))"
    )
    pixels = np.reshape(data, (height, width, 4)).astype(float)
    return (np.ptp(pixels[..., :3], axis=-1) > COLOURFUL) & (pixels[..., 3] == 255.0)


def test_the_hemisphere_of_a_white_tile_is_half_a_ball_that_keys_turn(chromium: Chromium, plain: str) -> None:
    chromium.open(f"{plain}/#material=white-tile&view=hemisphere&scale=linear")
    shown(chromium, "view=hemisphere")
    chromium.evaluate("document.querySelector('#hemisphere').focus()")
    for keys, elevation in (((), 27.0), (("ArrowDown", "ArrowLeft"), 32.0), (("Home",), 27.0)):
        chromium.press(*keys)
        rows, columns = np.nonzero(painted(chromium))
        ratio = np.ptp(rows) / np.ptp(columns)
        front = -np.cos(np.deg2rad(elevation + LAST))  # of its edge, below the centre; its top is the radius above
        assert ratio == pytest.approx((1.0 + front) / 2.0, abs=PIXELS / np.ptp(columns))
    assert f"to θᵣ = {LAST:g}°" in chromium.evaluate("caption.textContent")
    assert chromium.errors == []


def test_a_hand_turns_the_hemisphere(chromium: Chromium, address: str) -> None:
    chromium.open(f"{address}#material=rolled-brass&view=hemisphere&theta_i=60")
    shown(chromium, "view=hemisphere")
    before = painted(chromium)
    left, top = chromium.evaluate("(({ left, top }) => [left, top])(hemisphere.getBoundingClientRect())")
    half_a_turn = 360  # pixels
    for kind, x in (("mousePressed", 50), ("mouseMoved", 50 + half_a_turn), ("mouseReleased", 50 + half_a_turn)):
        chromium.send(
            "Input.dispatchMouseEvent", type=kind, x=left + x, y=top + 50, button="left", buttons=1, clickCount=1
        )
    middles = [np.nonzero(each)[1].mean() / each.shape[1] for each in (before, painted(chromium))]
    assert middles[0] > 0.55
    assert middles[1] < 0.45


def test_the_lobe_of_the_hemisphere_is_across_from_the_light(chromium: Chromium, address: str) -> None:
    middles = []
    for phi in (0, 180):  # the light is at the left, then at the right
        chromium.open(f"{address}#material=rolled-brass&view=hemisphere&theta_i=60&phi_i={phi}")
        shown(chromium, "view=hemisphere")
        surface = painted(chromium)
        middles.append(np.nonzero(surface)[1].mean() / surface.shape[1])
    assert middles[0] > 0.55
    assert middles[1] < 0.45


@pytest.mark.parametrize(("phi_i", "axis", "side", "words"), [(0, 1, 1, "right (+x)"), (90, 0, -1, "top (+y)")])
def test_the_light_of_a_sphere_is_where_its_caption_says(
    chromium: Chromium, address: str, phi_i: int, axis: int, side: int, words: str
) -> None:
    chromium.open(f"{address}#material=foam&view=sphere&theta_i=60&phi_i={phi_i}")
    shown(chromium, "view=sphere")
    drawn = chromium.evaluate(
        f"[...document.querySelector('#spheres canvas').getContext('2d').getImageData(0, 0, {SIZE}, {SIZE}).data]"
    )
    bright = np.reshape(drawn, (SIZE, SIZE, 4))[..., 0]  # rows from the top
    middle = np.sum(np.nonzero(bright)[axis] * bright[bright > 0]) / np.sum(bright)
    assert side * (middle / SIZE - 0.5) > 0.1
    assert words in chromium.evaluate("caption.textContent")


def test_a_mirror_is_spoken_of_where_there_is_one(chromium: Chromium, address: str) -> None:
    for name, mirror in (("foam", False), ("scene-copper-sphere", True)):
        chromium.open(f"{address}#material={name}&view=sphere")
        shown(chromium, "view=sphere")
        assert ("specular" in chromium.evaluate("caption.textContent")) is mirror


@pytest.mark.parametrize(
    ("name", "illuminant"),
    [("foam", "D65"), ("rolled-brass", "D65"), ("scene-copper-sphere", "D65"), ("scene-copper-sphere", "A")],
)
def test_the_sphere_has_the_radiance_of_the_table(
    chromium: Chromium, address: str, explored: Path, name: str, illuminant: str
) -> None:
    theta, phi = 50.0, 70.0
    chromium.open(f"{address}#material={name}&view=sphere&theta_i={theta}&phi_i={phi}&illuminant={illuminant}")
    shown(chromium, "view=sphere")
    drawn = chromium.evaluate(
        f"[...document.querySelector('#spheres canvas').getContext('2d').getImageData(0, 0, {SIZE}, {SIZE}).data]"
    )
    levels = np.reshape(drawn, (SIZE, SIZE, 4))[..., :3]
    # the same scene with vectors: x to the right, y up, z to the viewer; the tangent is up x normal
    x, y = np.meshgrid((np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0, 1.0 - (np.arange(SIZE) + 0.5) / SIZE * 2.0)
    normal = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
    light = unit_vector(np.deg2rad(theta), np.deg2rad(phi))
    lit = (normal[..., 2] > 0.0) & (normal @ light > 0.0)
    normal = normal[lit]
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=-2)
    table = brdfdb.open(explored)[name]
    f_r = table.lookup_vectors(frame @ light, frame @ [0.0, 0.0, 1.0]).reshape(len(normal), -1)
    colours = np.ones((1, 3)) if table.wavelength_nm is None else srgb_weights(tuple(table.wavelength_nm), illuminant)
    linear = np.clip(np.pi * (f_r @ colours) * (normal @ light)[:, np.newaxis], 0.0, 1.0)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    assert np.ptp(levels[lit]) > 50
    np.testing.assert_allclose(levels[lit], 255.0 * expected, atol=LEVELS)
    assert not levels[~lit].any()


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
