"""The exact twin of a material: the integral that its formula approximates, with what is known of its parameters."""

from __future__ import annotations

import pytest

from brdfdb.materials import Material, exact_material, presets


def made(model: str, **parameters: object) -> Material:
    table = {"title": "X", "model": model, "source": "made up", "parameters": parameters}
    return Material.from_table("x", table)


def test_the_fit_of_a_sample_becomes_its_facets() -> None:
    vase = presets()["clay-vase"]
    exact = exact_material(vase)
    assert exact.model == "oren_nayar_gaussian"
    assert exact.parameters == {name: vase.parameters[name] for name in ("rho", "sigma")}
    assert (exact.name, exact.title, exact.source, exact.note) == (vase.name, vase.title, vase.source, vase.note)
    assert set(vase.assumed) == {"interreflection"}
    assert exact.assumed == {}  # of a parameter that facets do not have


@pytest.mark.parametrize("name", ["rolled-brass", "scene-copper-sphere", "foam", "aluminum-cylinder-13c"])
def test_a_material_without_an_exact_model_is_its_own(name: str) -> None:
    assert exact_material(presets()[name]) is presets()[name]


def test_a_fit_without_the_bounce_is_not_that_of_facets_with_it() -> None:
    direct = made("oren_nayar", rho=0.5, sigma_deg=20, interreflection=False)
    assert exact_material(direct) is direct


def test_half_vectors_of_ward_become_his_ellipse() -> None:
    assert exact_material(made("ward_half_vector", rho_d=0.1, rho_s=0.2, alpha_x=0.2, alpha_y=0.2)).model == "ward"
