"""Lookups of materials: the values of their models, in the shape that a table gives."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.materials import presets


@pytest.mark.parametrize("name", ["rolled-brass", "scene-copper-sphere", "aluminum-cylinder-12f"])
@pytest.mark.parametrize("wavelength_nm", [550.0, [500.0, 600.0]], ids=["one", "two"])
def test_a_material_is_looked_up_as_its_table_would_be(name: str, wavelength_nm: float | list[float]) -> None:
    material = presets()[name]
    theta_r = np.array([0.2, 0.5])
    values = material.lookup(0.5, 0.1, theta_r, 3.0, wavelength_nm)
    mirrored = material.specular_reflectance(theta_r, wavelength_nm)
    assert values.shape == mirrored.shape == (2, *np.shape(wavelength_nm))
    for w, wavelength in enumerate(np.atleast_1d(wavelength_nm)):
        arguments = material.arguments(wavelength)
        expected = material.spec.evaluate(0.5, 0.1, theta_r, 3.0, **arguments)
        np.testing.assert_array_equal(values.reshape(2, -1)[:, w], expected)
        if material.spec.specular is None:
            assert not mirrored.any()
        else:
            known = {key: arguments[key] for key in material.spec.specular_parameters}
            np.testing.assert_array_equal(mirrored.reshape(2, -1)[:, w], material.spec.specular(theta_r, **known))
