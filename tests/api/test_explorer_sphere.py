"""The sphere of the explorer: radiance under light and surroundings, what a specular part reflects, and hands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb.spectra import srgb_weights, xyz_weights
from tests.api.a_store import publish, serving
from tests.api.chromium import Chromium, box, image, shown, visit

SIZE = 320  # pixels across
SKY = 0.35  # what is seen of the surroundings at the height of the eye
DISK = np.deg2rad(1.25 + 0.5)  # angle between normals that reflect the light, a disk of 5 degrees with a soft edge


def normals() -> tuple[np.ndarray, np.ndarray]:
    """The normals (n, 3) of the pixels of the sphere, and which pixels they are of (rows, columns)."""
    along = (np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0
    x, y = np.meshgrid(along, -along)
    inside = x**2 + y**2 < 1.0
    return np.stack([x[inside], y[inside], np.sqrt(1.0 - x[inside] ** 2 - y[inside] ** 2)], axis=-1), inside


def encoded(linear: np.ndarray) -> np.ndarray:
    """Levels of sRGB, 0 to 255."""
    held = np.clip(linear, 0.0, 1.0)
    return 255.0 * np.where(held <= 0.0031308, 12.92 * held, 1.055 * held ** (1.0 / 2.4) - 0.055)


def levels(browser: Chromium, link: str) -> np.ndarray:
    """The levels (n, 3) of the pixels of the sphere of a link."""
    browser.open(link)
    shown(browser, "view=sphere")
    return image(browser, "#sphere canvas")[normals()[1]][:, :3].astype(float)


@pytest.mark.parametrize(("phi_i", "axis", "side", "words"), [(0, 1, 1, "right (+x)"), (90, 0, -1, "top (+y)")])
def test_the_light_of_a_sphere(chromium: Chromium, address: str, phi_i: int, axis: int, side: int, words: str) -> None:
    visit(chromium, f"{address}#material=foam&view=sphere&theta_i=60&phi_i={phi_i}&surround=dark", "view=sphere")
    bright = image(chromium, "#sphere canvas")[..., 0].astype(float)  # rows from the top
    middle = np.sum(np.nonzero(bright)[axis] * bright[bright > 0]) / np.sum(bright)
    assert side * (middle / SIZE - 0.5) > 0.1
    assert words in chromium.evaluate("caption.textContent")


def test_a_mirror_is_spoken_of_where_there_is_one(chromium: Chromium, address: str) -> None:
    for name, mirror in (("foam", False), ("scene-copper-sphere", True)):
        visit(chromium, f"{address}#material={name}&view=sphere", "view=sphere")
        assert ("specular" in chromium.evaluate("caption.textContent")) is mirror


@pytest.mark.parametrize(
    ("name", "illuminant"),
    [("foam", "D65"), ("rolled-brass", "D65"), ("scene-copper-sphere", "D65"), ("scene-copper-sphere", "A")],
)
def test_the_radiance_of_a_sphere(chromium: Chromium, address: str, explored: Path, name: str, illuminant: str) -> None:
    theta, phi, at = 50.0, 70.0, np.arange(420.0, 681.0, 20.0)
    link = f"{address}#material={name}&view=sphere&theta_i={theta}&phi_i={phi}&illuminant={illuminant}&surround=dark"
    drawn, (normal, _) = levels(chromium, link), normals()
    # the same scene with vectors: x to the right, y up, z to the viewer; the tangent is up x normal
    light = unit_vector(np.deg2rad(theta), np.deg2rad(phi))
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    table = brdfdb.open(explored)[name]
    disk = np.any(table.specular_reflectance(0.0) > 0.0) & (normal @ half > np.cos(DISK))
    lit = (normal @ light > 0.0) & ~disk
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=-2)[lit]
    grey = table.wavelength_nm is None
    f_r = table.lookup_vectors(frame @ light, frame @ [0.0, 0.0, 1.0], None if grey else at).reshape(lit.sum(), -1)
    colours = np.ones((1, 3)) if grey else srgb_weights(tuple(at), illuminant)
    expected = encoded(np.pi * (f_r @ colours) * (normal @ light)[lit, np.newaxis])
    assert np.ptp(drawn[lit]) > 50
    # between a thousand directions f_r is linear; measured 5.7, of a table with kinks every 20 degrees
    off = np.abs(drawn[lit] - expected)
    print(f"{name}: off by {np.quantile(off, 0.99):.2f} for 99 of 100 pixels, {off.max():.2f} at most")
    assert np.quantile(off, 0.99) < 6.0
    assert np.median(off) < 0.5
    assert not drawn[~lit & ~disk].any()


def test_the_light_may_stand_in_surroundings_that_are_bright_above(chromium: Chromium, plain: str) -> None:
    drawn = levels(chromium, f"{plain}#material=white-tile&view=sphere&theta_i=89.5&exposure=0.5")
    normal, _ = normals()
    unlit = normal[:, 0] < -0.05
    # of white Lambertian surface: the integral of SKY (1 + y) over the cosine
    expected = encoded(np.sqrt(2.0) * SKY * (1.0 + 2.0 / 3.0 * normal[unlit, 1]))
    assert np.quantile(np.abs(drawn[unlit, 0] - expected), 0.99) < 2.0  # of 255; the sum is over 200 lights


def test_a_mirror_shows_its_surroundings_and_the_light(chromium: Chromium, tmp_path: Path) -> None:
    constants = {"refractive_index": "main/Cu/Johnson", "sigma_0_um": 0.0, "tau_um": 2.0}
    publish(tmp_path / "store", "mirror", "he_torrance", **constants)
    table, at = brdfdb.open(tmp_path / "store")["mirror"], np.arange(420.0, 681.0, 20.0)
    with serving(tmp_path / "store") as address:
        drawn = levels(chromium, f"{address}#material=mirror&view=sphere&theta_i=40&phi_i=90&exposure=-2")
        assert "The specular part reflects them and the light" in chromium.evaluate("caption.textContent")
        for view in ("hemisphere", "cut"):
            chromium.go(f"material=mirror&view={view}&theta_i=40")
            shown(chromium, f"view={view}")
            assert "The spike is the specular part" in chromium.evaluate("caption.textContent")
        assert chromium.evaluate("document.querySelectorAll('#cut path.spike').length") == 1
        part = 100.0 * table.specular_reflectance(np.deg2rad(40.0), at) @ xyz_weights(tuple(at), "D65")[:, 1]
        for axes in ("polar", "cartesian"):  # the legend names it: in the picture the name would cover something
            chromium.go(f"material=mirror&view=cut&theta_i=40&axes={axes}")
            chromium.until(f"picture.dataset.shown.includes('cartesian') === {str(axes == 'cartesian').lower()}")
            assert f"specular part {part:.3g} %" in chromium.texts("#cut .legend")[0]
            assert "specular" not in chromium.texts("#cut > svg")[0]
    normal, _ = normals()
    mirror = 2.0 * normal[:, 2:] * normal - [0.0, 0.0, 1.0]
    half, near = unit_vector(np.deg2rad(20.0), np.deg2rad(90.0)), normal[:, 2] > 0.3
    share = table.specular_reflectance(np.arccos(normal[:, 2]), at) @ srgb_weights(tuple(at), "D65")
    expected = encoded(0.25 * SKY * (1.0 + mirror[:, 1:2]) * share)
    away = near & (normal @ half < np.cos(DISK))
    off = np.abs(drawn[away] - expected[away])
    print(f"a mirror: off by {off.max():.2f} at most")
    assert off.max() < 2.0
    assert (drawn[normal @ half > np.cos(np.deg2rad(0.8))] == 255.0).all()


def test_a_sphere_that_is_nearly_black_says_so_and_can_be_brightened(chromium: Chromium, tmp_path: Path) -> None:
    publish(tmp_path / "store", "soot", "lambert", rho=0.002)
    with serving(tmp_path / "store") as address:
        dark = levels(chromium, f"{address}#material=soot&view=sphere")
        assert "Nearly black" in chromium.evaluate("sphere.innerText")
        chromium.click("#sphere button")
        shown(chromium, "exposure=8")
        chromium.until("picture.dataset.detail === 'fine' && picture.ariaBusy === 'false'")
        bright = image(chromium, "#sphere canvas")
        assert dark.max() < 25 < 150 < bright[..., :3].max()
        assert chromium.evaluate("sphere.innerText").strip() == ""


def test_a_hand_and_keys_move_the_light_to_where_they_point(chromium: Chromium, address: str) -> None:
    visit(chromium, f"{address}#material=foam&view=together", "material=foam")
    left, top, width, _ = box(chromium, "#sphere canvas")
    x, y = left + width * (0.5 + 0.25), top + width * 0.5  # of a normal at 30 degrees: the light is at 60
    chromium.drag(x, y)
    shown(chromium, "theta_i=60")
    chromium.evaluate("document.querySelector('#sphere').focus()")
    chromium.press("ArrowDown", "ArrowLeft")
    shown(chromium, "theta_i=55", "phi_i=5")
    left, top, width, height = box(chromium, "#cut .lamp")
    chromium.drag(left + width / 2.0, top + height / 2.0, 10.0)
    chromium.until("controls.elements.theta_i.value < 55")
