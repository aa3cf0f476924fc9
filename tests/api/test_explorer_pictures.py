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
from tests.api.a_store import serving
from tests.api.chromium import Chromium, box, curve, frame, idle, image, labels, shown, visit
from tests.api.connections import WAIT_S

# What a view has drawn once it is there
DRAWN = {
    "together": "#cut path.curve, #hemisphere canvas, #sphere canvas",
    "cut": "#cut path.curve",
    "cut&axes=cartesian": "#cut .chart path.curve",
    "cut&curves=rgb": "#cut path.curve",
    "cut&curves=wavelengths": "#cut path.curve",
    "hemisphere": "#hemisphere canvas",
    "slice": "#slice canvas",
    "spectrum": "#spectrum path.curve",
    "albedo": "#albedo path.curve",
    "sphere": "#sphere canvas",
}
COLOURFUL = 60  # of 255: between the largest and the smallest channel
LAST = 88.0  # degrees: of the viewers of a hemisphere, those next to the horizon
PIXELS = 1.1  # the four ends of width and height are whole pixels, and edges are soft: measured 1.02
PIXEL = 0.1  # paths are written to a tenth of a pixel
READ = "document.querySelector('#stage > div:not([hidden]) .read').textContent"


def test_the_cut_shows_the_numbers_of_the_table(chromium: Chromium, address: str, explored: Path) -> None:
    visit(chromium, f"{address}#material=foam&view=cut&scale=linear&theta_i=30", "material=foam", "scale=linear")
    x, y = curve(chromium, 0).T
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
    visit(chromium, f"{address}#material=foam&view=cut&theta_i=30", "material=foam")
    (x, y), _ = curve(chromium, "mirror")
    left, top, _, _ = box(chromium, "#cut svg")
    aside = 100.0 * np.tan(np.deg2rad(-40.0))
    chromium.send("Input.dispatchMouseEvent", type="mouseMoved", x=left + x + aside, y=top + y - 100.0)
    value = brdfdb.open(explored)["foam"].lookup(*np.deg2rad([30.0, 0.0, 40.0, 0.0]))
    assert chromium.until(f"/sr$/.test({READ}) && {READ}") == f"θᵣ −40°: {value:.3g} /sr"


def test_any_number_of_series_lie_over_one_another(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=scene-copper-sphere&view=cut")
    chromium.until("controls.elements.compare.options.length > 3")
    chromium.choose("compare", ":model")
    shown(chromium, "compare=:model")
    assert len(curve(chromium, 0)) == len(curve(chromium, 1)) == len(curve(chromium, "off"))
    said = r"able − model, relative to the model, or to the floor .* is larger: \d.* % at most"
    assert re.search(said, chromium.evaluate("caption.textContent"))
    for name in ("foam", "rolled-brass"):
        chromium.choose("compare", name)
        shown(chromium, f"compare={name}")
    assert chromium.evaluate("document.querySelectorAll('#cut > svg path.curve').length") == 4
    paths = "[...document.querySelectorAll('#cut > svg path.curve')]"
    strokes = f"{paths}.map(({{ style }}) => style.stroke + style.strokeDasharray)"
    assert len(set(chromium.evaluate(strokes))) == 4
    assert "Foam" in chromium.evaluate("document.querySelector('#cut .legend').textContent")
    assert chromium.evaluate("document.querySelector('#cut path.off')") is None
    chromium.click("#beside button", 1)
    idle(chromium, "!picture.dataset.shown.includes('foam')")
    assert "compare=:model&compare=rolled-brass" in chromium.evaluate("picture.dataset.shown")


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_chart_has_the_numbers_of_the_table(chromium: Chromium, address: str, explored: Path, scale: str) -> None:
    link = f"{address}#material=scene-copper-sphere&view=cut&axes=cartesian&curves=wavelengths&scale={scale}"
    visit(chromium, link, "view=cut")
    left, top, width, height, low, high = frame(chromium)
    table = brdfdb.open(explored)["scene-copper-sphere"]
    assert labels(chromium) == ["450 nm", "500 nm", "550 nm", "600 nm", "650 nm"]
    for number, label in enumerate(labels(chromium)):
        x, y = curve(chromium, number).T
        theta = np.deg2rad(-90.0 + 180.0 * (x - left) / width)
        f_r = table.lookup(np.deg2rad(45.0), 0.0, np.abs(theta), np.where(theta > 0.0, np.pi, 0.0), float(label[:3]))
        place = np.maximum(np.log10(f_r), low) if scale == "log" else f_r
        slope = np.gradient(place, x)  # a tenth of a pixel across is more along a steep curve
        expected = top + height * (high - place) / (high - low)
        np.testing.assert_allclose(y, expected, atol=2.0 * PIXEL + PIXEL * np.abs(slope).max() * height / (high - low))


@pytest.mark.parametrize("name", ["scene-copper-sphere", "rolled-brass"])
def test_numbers_of_the_scale_do_not_overlap_on_a_phone(chromium: Chromium, address: str, name: str) -> None:
    chromium.open(f"{address}#material={name}&view=cut", 390)
    shown(chromium, f"material={name}")
    boxes = chromium.evaluate(
        "[...document.querySelectorAll('#cut text')].map(each => each.getBoundingClientRect())"
        ".map(({ left, right, bottom }) => [bottom, left, right])"
    )
    line = sorted(box for box in boxes if box[0] == max(bottom for bottom, _, _ in boxes))
    assert len(line) >= 3
    assert all(one[2] < other[1] for one, other in pairwise(line))


def test_a_table_is_off_by_what_its_stated_error_means(chromium: Chromium, address: str, explored: Path) -> None:
    visit(chromium, f"{address}#material=scene-copper-sphere&view=slice&compare=%3Amodel&nm=500", "nm=500")
    table = brdfdb.open(explored)["scene-copper-sphere"]
    lobe = f"{address}v1/materials/scene-copper-sphere/lobe?view=half-difference&wavelength_nm=500"
    answers = [httpx.get(lobe + of, timeout=WAIT_S).json()["brdf"] for of in ("&from=table", "&from=model")]
    tabulated, model = np.array(answers)
    floor = table.error.floor[list(table.wavelength_nm).index(500.0)]
    assert model.min() < floor < model.max()
    off = (tabulated - model) / np.maximum(model, floor)
    most = np.sort(np.abs(off), axis=None)[int(0.99 * off.size)]
    (said,) = re.findall(r"\+([\d.]+) % red", chromium.evaluate("slice.innerText"))
    assert float(said) == pytest.approx(100.0 * most, rel=5e-3)  # three digits
    drawn = image(chromium, "#slice figure:nth-of-type(2) canvas")[::-1].swapaxes(0, 1)  # theta_h first
    reds = drawn[..., 0].astype(int) - drawn[..., 2]
    assert (reds[off > 0.3 * most] > 0).all()
    assert (reds[off < -0.3 * most] < 0).all()


def test_a_slice_has_half_angles_across_and_a_click_picks_directions(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=scene-copper-sphere&view=slice&nm=500", "view=slice")
    brightness = image(chromium, "#slice canvas")[..., 1].astype(int)  # green grows along the scale
    assert brightness[45, 0] > brightness[45, 30] > brightness[45, 80]  # away from the half vector
    left, top, width, height = box(chromium, "#slice canvas")
    x, y = left + width * 20.5 / 90.0, top + height * (1.0 - 60.5 / 90.0)
    chromium.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    assert chromium.evaluate(READ).startswith("θh 20.5°, θd 60.5°: ")  # before the click: it draws anew
    chromium.drag(x, y)
    shown(chromium, "theta_r=")
    names = ("theta_i", "phi_i", "theta_r", "turn")
    theta_i, phi_i, theta_r, turn = np.deg2rad(
        [float(chromium.evaluate(f"controls.elements.{each}.value")) for each in names]
    )
    light, viewer = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_i + turn)
    half = (light + viewer) / np.linalg.norm(light + viewer)
    assert np.rad2deg(np.arccos(half[2])) == pytest.approx(20.5, abs=0.8)  # sliders have steps
    assert np.rad2deg(np.arccos(half @ light)) == pytest.approx(60.5, abs=0.8)
    assert np.rad2deg(np.arctan2(half[1], half[0])) == pytest.approx(0.0, abs=2.0)


@pytest.mark.parametrize("compare", ["", "%3Amodel"])
@pytest.mark.parametrize("view", DRAWN)
def test_every_view_draws_at_any_width(chromium: Chromium, address: str, view: str, compare: str) -> None:
    link = f"{address}#material=scene-copper-sphere&view={view}&compare={compare}"
    for width in (1280, 390, 320):
        chromium.open(link, width)
        shown(chromium, "material=scene-copper-sphere")
        assert chromium.evaluate(f"document.querySelectorAll('{DRAWN[view]}').length")
        assert chromium.evaluate("document.documentElement.scrollWidth") <= width
        assert len(chromium.evaluate("caption.textContent")) > 40
        assert chromium.evaluate("message.textContent") == ""


@pytest.mark.parametrize("view", ["hemisphere", "slice", "spectrum", "albedo"])
def test_a_finger_on_a_picture_scrolls_the_page(chromium: Chromium, address: str, view: str) -> None:
    chromium.open(f"{address}#material=foam&view={view}", 390, 844, touch=True)
    shown(chromium, f"view={view}")
    left, top, width, height = box(chromium, f"#{view} > svg, #{view} canvas")
    chromium.swipe(left + width / 2.0, top + height / 2.0, 100.0)
    chromium.until("scrollY > 50")


@pytest.mark.parametrize("name", ["foam", "scene-copper-sphere"])
def test_the_axis_of_a_spectrum_is_wider_than_rounding(chromium: Chromium, address: str, name: str) -> None:
    visit(chromium, f"{address}#material={name}&view=spectrum&compare=%3Amodel", "view=spectrum")
    _, top, _, height, low, high = frame(chromium, "spectrum")
    assert high - low > np.log10(1.5)
    assert len(chromium.texts("#spectrum text.end")) > 2
    ys = np.concatenate([curve(chromium, number, "spectrum")[:, 1] for number in range(2)])
    assert top < ys.min() <= ys.max() < top + height


def test_a_spectrum_over_decades_has_numbers_at_1_2_and_5(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=foam&view=spectrum&compare=rolled-brass", "view=spectrum")
    low, high = 10.0 ** np.array(frame(chromium, "spectrum")[4:])
    assert high / low > 10.0
    texts = chromium.texts("#spectrum text.end")
    expected = [mantissa * 10.0**power for power in range(-3, 3) for mantissa in (1, 2, 5)]
    assert [float(each) for each in texts] == [pytest.approx(each) for each in expected if low <= each <= high]


def middle(browser: Chromium) -> float:
    """The mean place of the surface of a hemisphere across the picture, 0 to 1."""
    surface = painted(browser)
    return float(np.nonzero(surface)[1].mean() / surface.shape[1])


def painted(browser: Chromium) -> np.ndarray:
    """Which pixels of the hemisphere are of its surface, or of the line to the light: all else is grey."""
    pixels = image(browser, "#hemisphere canvas").astype(float)
    return (np.ptp(pixels[..., :3], axis=-1) > COLOURFUL) & (pixels[..., 3] == 255.0)


def test_the_hemisphere_of_a_white_tile_is_half_a_ball_that_keys_turn(chromium: Chromium, plain: str) -> None:
    visit(chromium, f"{plain}/#material=white-tile&view=hemisphere&scale=linear", "view=hemisphere")
    chromium.evaluate("document.querySelector('#hemisphere').focus()")
    for keys, elevation in (((), 27.0), (("ArrowDown", "ArrowLeft"), 32.0), (("Home",), 27.0)):
        chromium.press(*keys)
        rows, columns = np.nonzero(painted(chromium))
        ratio = np.ptp(rows) / np.ptp(columns)
        front = -np.cos(np.deg2rad(elevation + LAST))  # of its edge, below the centre; its top is the radius above
        width = 2.0 * np.sin(np.deg2rad(LAST))
        assert ratio == pytest.approx((1.0 + front) / width, abs=PIXELS / np.ptp(columns))
    assert f"to θᵣ = {LAST:g}°" in chromium.evaluate("caption.textContent")


def test_the_lobe_of_a_hemisphere_is_across_from_the_light_and_turns_with_it(chromium: Chromium, address: str) -> None:
    for phi, at_the_right in ((0, True), (180, False)):
        visit(chromium, f"{address}#material=rolled-brass&view=hemisphere&theta_i=60&phi_i={phi}", "view=hemisphere")
        assert (middle(chromium) > 0.55, middle(chromium) < 0.45) == (at_the_right, not at_the_right)
    left, top, _, _ = box(chromium, "#hemisphere canvas")
    chromium.drag(left + 50, top + 50, 360.0)  # half a turn
    assert middle(chromium) > 0.55


@pytest.mark.parametrize("compare", ["", "%3Amodel", "grey-felt"])
def test_the_spectrum_of_a_table_without_a_stated_error(chromium: Chromium, plain: str, compare: str) -> None:
    chromium.open(f"{plain}/#material=white-tile&view=spectrum&compare={compare}")
    of_picture = "document.querySelector('#picture')?.dataset.shown"
    assert chromium.until(f"{of_picture} && 'shown' || globalThis.message?.textContent") == "shown"
    bands = chromium.evaluate("document.querySelectorAll('#spectrum path.band').length")
    assert bands == (compare == "grey-felt")
    assert f"is grey: {1.0 / np.pi:.3g} /sr" in chromium.evaluate("caption.textContent")
    assert ("with the band" in chromium.evaluate("caption.textContent")) == (compare == "grey-felt")


def test_what_a_measured_table_extrapolates_is_dashed(chromium: Chromium, measured: Path) -> None:
    with serving(measured) as address:
        for theta_i, dashed in ((35, False), (80, True)):
            link = f"{address}/#material=my-clay&view=cut&axes=cartesian&theta_i={theta_i}"
            visit(chromium, link, f"theta_i={theta_i}")
            curves = "[...document.querySelectorAll('#cut > svg path.curve')]"
            assert "3, 4" in chromium.evaluate(f"{curves}.map(each => each.style.strokeDasharray)")
            path = chromium.evaluate(f"{curves}.at(-1).getAttribute('d')")
            assert (len(re.findall("[ML]", path)) > 150) is dashed  # at 80 degrees nothing was measured
            assert "Dashed lines are extrapolated" in chromium.evaluate("caption.textContent")
            assert chromium.evaluate("parameters.hidden")
