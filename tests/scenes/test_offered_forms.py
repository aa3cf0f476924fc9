"""Candidates for a material: fewer wavelengths, joined by lines, and nothing that differs in rounding alone."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.forms import catalogue
from brdfdb.materials import presets
from brdfdb.scenes.offered_forms import offered_forms

COARSE = [float(wavelength) for wavelength in range(420, 681, 20)]


def test_a_spectrum_at_a_few_wavelengths_is_joined_by_straight_lines() -> None:
    material = presets()["scene-copper-sphere"]
    wavelength = np.array(COARSE)
    few = next(each for each in offered_forms(material, wavelength, ()) if each.form.key == "sum-3-wavelengths")
    wi, wr = np.array([[0.6, 0.0, 0.8]]), np.array([[-0.6, 0.0, 0.8]])
    whole = offered_forms(material, few.wavelength_nm, ())[0].brdf(wi, wr)
    expected = np.interp(wavelength, few.wavelength_nm, whole[0])
    np.testing.assert_allclose(few.brdf(wi, wr)[0], expected, rtol=1e-12)


@pytest.mark.parametrize("name", ["wall-plaster", "rolled-brass", "scene-plastic-cube"])
def test_forms_that_differ_from_another_in_rounding_alone_are_not_offered(name: str) -> None:
    material = presets()[name]
    wavelength = np.array([550.0]) if material.spectral else None
    rounded = {form.key for form in catalogue.forms(material, wavelength, ()) if form.rounded}
    offered = {each.form.key: each.form for each in offered_forms(material, wavelength, ())}
    assert rounded
    assert not rounded & set(offered)
    assert all(form.dtype is np.float64 for form in offered.values())
