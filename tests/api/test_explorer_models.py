"""Parameters that move in the explorer: sliders, marks, what is kept beside, and the recipe of what was found."""

from __future__ import annotations

import math
import tomllib
from urllib.parse import unquote

import httpx
import numpy as np
import pytest

from brdfdb.materials import Material
from tests.api.chromium import Chromium, copied, curve, frame, idle, labels, milliseconds, shown, visit
from tests.api.connections import WAIT_S

SLIDER = "document.querySelector('#parameters [name={name}]')"


def slide(browser: Chromium, name: str, share: float) -> None:
    """Move a slider of a parameter to a share of its length, as a hand does."""
    slider = SLIDER.format(name=name)
    browser.evaluate(f"{slider}.value = {share}; {slider}.dispatchEvent(new Event('input', {{ bubbles: true }}))")


def opened(browser: Chromium, link: str) -> None:
    browser.open(link)
    shown(browser)
    idle(browser, "!parameters.hidden", "parameters.children.length > 0")


def test_a_slider_changes_the_picture_to_that_of_the_model(chromium: Chromium, address: str) -> None:
    opened(chromium, f"{address}#material=rolled-brass&view=cut&axes=cartesian&scale=linear")
    before = curve(chromium, 0)
    slide(chromium, "rho_d", 0.8)
    shown(chromium, "rolled-brass(rho_d=")
    print(f"parameter to picture: {milliseconds(chromium):.0f} ms")
    assert not np.array_equal(before, curve(chromium, 0))
    link = unquote(chromium.until("location.hash.includes('rho_d') && location.hash"))
    value = float(link.split("rho_d=")[1].split(")")[0])
    known = httpx.get(f"{address}v1/materials/rolled-brass", timeout=WAIT_S).json()
    parameters = {each["name"]: each["value"] for each in known["parameters"]}
    body = {"parameters": parameters | {"rho_d": value}}
    answer = httpx.post(f"{address}v1/models/ward/lobe?view=cut&theta_i=45&phi_i=0", json=body, timeout=WAIT_S).json()
    theta, f_r = np.array(answer["axes_deg"]["theta_r"]), np.array(answer["brdf"])
    kept = np.abs(theta) <= 89.0
    _, top, _, height, low, high = frame(chromium)
    expected = top + height * (high - f_r[kept]) / (high - low)
    np.testing.assert_allclose(curve(chromium, 0)[:, 1], expected, atol=0.06)  # written to a tenth of a pixel
    assert "rolled-brass" in chromium.evaluate("document.querySelector('[aria-selected=true]').id")
    assert "neither tabulated nor audited" in chromium.evaluate("facts.innerText")


def test_a_link_restores_parameters_and_a_button_those_that_were_published(chromium: Chromium, address: str) -> None:
    opened(chromium, f"{address}#material=rolled-brass(alpha_x=0.3,rho_s=0.2)&view=cut&compare=rolled-brass")
    said = "[...parameters.querySelectorAll('label')].map(each => each.innerText.replace(/\\s+/g, ' ').trim())"
    assert chromium.evaluate(said) == [
        "rho_d 0.1 diffuse reflectance",
        "rho_s 0.2 specular reflectance",
        "alpha_x 0.3 width of the slopes along x",
        "alpha_y 0.16 width of the slopes along y",
    ]
    assert labels(chromium) == ["Rolled brass, alpha_x 0.3, rho_s 0.2", "Rolled brass"]
    chromium.click("[data-action=keep]")
    shown(chromium, "compare=rolled-brass&compare=rolled-brass(alpha_x=0.3,rho_s=0.2)")
    chromium.click("[data-action=reset]")
    shown(chromium, "#material=rolled-brass&")
    assert chromium.until(f"{said}[1].startsWith('rho_s 0.33 ')")


def test_n_and_k_are_numbers_at_the_wavelength_of_the_picture(chromium: Chromium, address: str) -> None:
    known = httpx.get(f"{address}v1/materials/scene-copper-sphere", timeout=WAIT_S).json()
    for link, nm in (("", 540), ("&nm=640", 640)):
        opened(chromium, f"{address}#material=scene-copper-sphere&view=cut{link}")
        for name in "nk":
            value = known[name][known["wavelength_nm"].index(nm)]
            said = chromium.until(f"{SLIDER.format(name=name)}?.ariaValueText")
            assert said == f"{value:.3g} at {nm} nm"
    opened(chromium, f"{address}#material=scene-copper-sphere(n=1.5,k=0)&view=cut")
    assert [chromium.evaluate(f"{SLIDER.format(name=name)}.ariaValueText") for name in "nk"] == ["1.5", "0"]


def test_marks_are_published_values_and_set_them(chromium: Chromium, address: str) -> None:
    opened(chromium, f"{address}#material=rolled-brass&view=cut")
    model = httpx.get(f"{address}v1/models/ward", timeout=WAIT_S).json()
    published = {each["value"] for each in model["parameters"][0]["published"]}
    marks = "[...document.querySelectorAll('#parameters [data-key=rho_d]')]"
    assert {float(value) for value in chromium.evaluate(f"{marks}.map(each => each.dataset.value)")} == published
    chromium.evaluate(f"{marks}.at(-1).click()")
    shown(chromium, f"rolled-brass(rho_d={max(published):g})")
    share = float(chromium.evaluate(f"{SLIDER.format(name='rho_d')}.value"))
    left = float(chromium.evaluate(f"{marks}.at(-1).style.left.replace('%', '')")) / 100.0
    assert share == pytest.approx(left, abs=0.003)  # a step of the slider


def test_a_recipe_of_moved_parameters_is_one(chromium: Chromium, address: str) -> None:
    opened(chromium, f"{address}#material=scene-copper-sphere(sigma_0_um=0.05,n=1.5)&view=cut")
    chromium.click("[data-action=recipe]")
    recipe = tomllib.loads(chromium.until("document.querySelector('#copied textarea').value"))
    (name,) = recipe["materials"]
    material = Material.from_table(name, recipe["define"][name])
    known = httpx.get(f"{address}v1/materials/scene-copper-sphere", timeout=WAIT_S).json()
    k = known["k"][known["wavelength_nm"].index(540.0)]  # what does not move stays as it was in green
    assert (material.model, material.refractive_index) == ("he_torrance", f"constant/1.5/{k:.4g}")
    assert material.parameters == {"sigma_0_um": 0.05, "tau_um": 1.2, "a": 0.0}
    assert recipe["wavelengths_nm"][0] == 400
    assert copied(chromium, "curl").startswith("curl -H 'Content-Type: application/json' -d '{\"parameters\":{")


def test_any_model_can_be_begun_with_and_drawn_in_every_view(chromium: Chromium, address: str) -> None:
    visit(chromium, address)
    names = chromium.until("models.options.length > 9 && [...models.options].slice(1).map(each => each.value)")
    known = [model["name"] for model in httpx.get(f"{address}v1/models", timeout=WAIT_S).json()["models"]]
    assert names == [f"*{name}()" for name in known]
    chromium.evaluate("models.value = '*ward()'; models.dispatchEvent(new Event('change'))")
    shown(chromium, "material=*ward()")
    for view in ("cut", "hemisphere", "slice", "spectrum", "albedo", "sphere", "sphere&surround=studio"):
        chromium.go(f"material=*ward(rho_d=0.4)&view={view}")
        shown(chromium, f"view={view}")
        assert chromium.evaluate("message.textContent") == ""


def test_the_way_back_is_over_materials_and_not_over_parameters(chromium: Chromium, address: str) -> None:
    opened(chromium, f"{address}#material=rolled-brass&view=cut")
    chromium.send("Page.resetNavigationHistory")
    start = chromium.evaluate("history.length")
    for share in (0.3, 0.5, 0.7):
        slide(chromium, "rho_s", share)
        idle(chromium, "picture.dataset.shown.includes('rho_s')")
    assert chromium.evaluate("history.length") == start
    chromium.click("#m-foam")
    shown(chromium, "material=foam")
    chromium.evaluate("history.back()")
    shown(chromium, "rolled-brass(rho_s=")
    assert math.isfinite(float(chromium.until("document.querySelector('#parameters [name=rho_s]')?.value")))


def test_sliders_are_those_of_the_last_material_whichever_model_arrives_last(chromium: Chromium, address: str) -> None:
    opened(chromium, f"{address}#material=rolled-brass&view=cut")
    chromium.evaluate(
        "(was => { fetch = async (...all) => {"
        "  if (/v1.models/.test(all[0])) await new Promise(go => release = go);"
        "  return was(...all);"
        "}; })(fetch)"
    )
    for name in ("foam", "rolled-brass"):
        chromium.go(f"material={name}&view=cut")
        shown(chromium, f"material={name}")
    chromium.evaluate("release(), new Promise(go => setTimeout(go, 500))")
    assert chromium.evaluate("[...parameters.querySelectorAll('input')].map(each => each.name)") == [
        *("rho_d", "rho_s", "alpha_x", "alpha_y")
    ]
