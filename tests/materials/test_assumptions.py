"""What the presets assume: every recorded albedo computed again, and no excess that rests on a choice of ours."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material, presets
from brdfdb.materials.provenance import Number
from brdfdb.reference import oren_nayar_1994

WITH_SURFACE = ("foam", "cotton-towel", "wood-shavings")  # samples D to F of Oren and Nayar 1994, eq. 32
ANGLES_DEG = (0.0, 30.0, 60.0, 75.0, 80.0, 82.5, 85.0, 87.0, 89.0, 89.9, 89.99, 90.0)
VISIBLE_NM = (450.0, 550.0, 650.0)  # of a material that may be used at any wavelength
RECORDED = 6e-4  # absolute, of a largest albedo: three decimals are recorded, and the quadrature is good to 1e-4


def largest_albedo(material: Material) -> float:
    """The largest directional albedo, Dirac part included, over angles and wavelengths."""
    theta_i, mirror = np.deg2rad(ANGLES_DEG), material.spec.specular is not None
    largest = []
    for wavelength_nm in (material.wavelengths_nm or VISIBLE_NM) if material.spectral else (None,):
        arguments = material.arguments(wavelength_nm)
        found = directional_albedo(material.model, theta_i, tolerance=1e-4, specular=mirror, **arguments)
        largest.append(float(np.max(found.albedo)))
    return max(largest)


def changed(material: Material, **values: Number | str) -> Material:
    """The material with other values of its file, and nothing assumed or known of them."""
    index = values.pop("refractive_index", material.refractive_index)
    table = {
        "title": material.title,
        "model": material.model,
        "source": material.source,
        "parameters": {**material.file_parameters(), **values},
        "refractive_index": index,
        "wavelengths_nm": material.wavelengths_nm and list(material.wavelengths_nm),
    }
    return Material.from_table(material.name, table)


@pytest.mark.parametrize("name", [name for name, material in presets().items() if material.assumed])
def test_the_sensitivity_to_every_assumption_is_what_is_recorded(name: str) -> None:
    material = presets()[name]
    own = largest_albedo(material)
    for assumption in material.assumed.values():
        assert assumption.max_albedo == pytest.approx(own, abs=RECORDED)
        assert assumption.alternatives
        for other in assumption.alternatives:
            found = largest_albedo(changed(material, **other.parameters))
            assert other.max_albedo == pytest.approx(found, abs=RECORDED)


def test_verdicts_that_rest_on_an_assumption_are_known() -> None:
    deciding = {
        (name, own) for name, material in presets().items() for own in material.assumed if decides(material, own)
    }
    assert deciding == {
        ("cotton-towel", "e_0"),
        ("rendered-sphere-10deg", "rho"),
        ("rendered-sphere-20deg", "rho"),
        ("scene-object-rough", "rho"),
    }
    # as they are, none of the four reflects more than it receives
    assert all(presets()[name].assumed[own].max_albedo < 1.0 for name, own in deciding)


def decides(material: Material, name: str) -> bool:
    found = material.assumed[name].decides
    assert found is not None
    return found


def test_no_excess_rests_on_an_assumption() -> None:
    for material in presets().values():
        if material.known_excess:
            assert not any(decides(material, name) for name in material.assumed)


def test_samples_with_a_surface_conserve_energy_whatever_unit_is_taken_but_one() -> None:
    # with E_0 = 1, eq. 31 as it stands, the towel would reflect half as much again as it receives
    literal = {name: largest_albedo(changed(presets()[name], e_0=1.0)) for name in WITH_SURFACE}
    assert [name for name, albedo in literal.items() if albedo > 1.0] == ["cotton-towel"]
    assert 1.5 < literal["cotton-towel"] < 1.6
    assert all(largest_albedo(presets()[name]) < 1.0 for name in WITH_SURFACE)


def test_the_surface_of_the_towel_is_seen_relative_to_a_white_facet() -> None:
    towel, angles = presets()["cotton-towel"], (0.5, 0.7, 2.5)
    theta_i, theta_r, delta_phi = angles
    found = towel.spec.evaluate(theta_i, 0.0, theta_r, delta_phi, **towel.parameters)
    body, _, surface = oren_nayar_1994.body_surface(*angles, 0.75, np.deg2rad(42.0), k_b=1, k_s=0.085 / np.pi)
    assert found == pytest.approx(float(body + surface), rel=1e-12)
