"""Functions as sources: what they give, what is refused in a sentence, and what a document keeps of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.materials import FunctionRecord, FunctionSource, presets, source_of
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout

ABOUT = {"name": "made-up", "title": "Made up", "provenance": "a test"}
AXES = {"theta_i": [0, 60], "theta_r": [0, 60], "delta_phi": [0, 180]}


def white(wi: np.ndarray, _wr: np.ndarray, _wavelength_nm: Any) -> np.ndarray:
    return np.full(len(wi), 1.0 / np.pi)


def sheen(wi: np.ndarray, wr: np.ndarray, wavelength_nm: np.ndarray) -> np.ndarray:
    return (1.0 - wi[:, 2:]) * (1.0 - wr[:, 2:]) * wavelength_nm / 1000.0


def test_a_grey_function_is_the_same_at_all_wavelengths_and_0_below_the_horizon() -> None:
    source = FunctionSource(brdf=white, **ABOUT)
    assert source.lookup(0.3, 0.0, 0.2, 1.0) == 1.0 / np.pi
    found = source.lookup(0.3, 0.0, [0.2, 2.0, np.nan], 1.0, [400.0, 500.0])
    np.testing.assert_array_equal(found, np.array([[1.0, 1.0], [0.0, 0.0], [np.nan, np.nan]]) / np.pi)
    assert source.brdf_at(None)(np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.6, 0.8]])).tolist() == [[1.0 / np.pi]]


def test_a_spectral_function_is_called_with_the_wavelengths_and_has_them_last() -> None:
    source = FunctionSource(brdf=sheen, wavelengths_nm=(400.0, 700.0), **ABOUT)
    theta_i, theta_r = np.array([[0.1], [0.4]]), np.array([0.2, 0.3, 1.0])
    expected = (1.0 - np.cos(theta_i)) * (1.0 - np.cos(theta_r))
    np.testing.assert_allclose(source.lookup(theta_i, 0.0, theta_r, 1.0, 500.0), 0.5 * expected, rtol=1e-14)
    both = source.lookup(theta_i, 0.0, theta_r, 1.0)
    np.testing.assert_allclose(both, expected[..., np.newaxis] * [0.4, 0.7], rtol=1e-14)
    vectors = source.lookup_vectors(unit_vector(theta_i, 0.0), unit_vector(theta_r, 1.0), [600.0])
    np.testing.assert_allclose(vectors, 0.6 * expected[..., np.newaxis], rtol=1e-14)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"name": "Made up"}, "name: 'Made up' is not lower-case letters, digits and single hyphens"),
        ({"title": None}, "title: None is not a text"),
        ({"alpha": -0.1}, "alpha: -0.1 must be greater than 0"),
        ({"alpha": (0.1, 0.2)}, "alpha: (0.1, 0.2) differs along x and y; an isotropic function has one width"),
        ({"elliptical": True}, "elliptical: an isotropic function has more symmetry than an ellipse; leave it out"),
        ({"wavelengths_nm": (700.0, 400.0)}, "wavelengths_nm: [700.0, 400.0] must be positive and increasing"),
        ({"colour": "red"}, "colour: unknown key"),
        ({"brdf": lambda wi, wr, _: wi[:, 2] * 2.0 + wr[:, 2]}, "brdf: made-up is not reciprocal; set"),
        ({"brdf": lambda wi, wr, _: 2.0 + wi[:, 0] * wr[:, 0]}, "brdf: made-up is anisotropic; set"),
        (
            {"brdf": lambda wi, wr, _: 2.0 + wi[:, 0] * wr[:, 1] + wi[:, 1] * wr[:, 0], "anisotropic": True}
            | {"elliptical": True},
            "brdf: made-up lacks mirror symmetry: ",
        ),
        ({"brdf": lambda wi, wr, _: wi[:, 2] * wr[:, 2] - 0.5}, "brdf: made-up gave -0."),
        ({"brdf": lambda wi, _wr, _: np.full(len(wi), np.inf)}, "brdf: made-up gave inf for the light ("),
        ({"brdf": lambda wi, _wr, _: np.zeros((len(wi), 3))}, "brdf: made-up gave float64 of shape (64, 3) for 64 "),
        ({"wavelengths_nm": (400.0, 500.0)}, "brdf: made-up gave float64 of shape (64,) for 64 pairs"),
    ],
)  # fmt: skip
def test_what_is_no_brdf_is_refused_in_one_sentence(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ParameterError) as refused:
        FunctionSource(**{"brdf": white, **ABOUT, **given})
    assert str(refused.value).startswith(sentence)
    assert "\n" not in str(refused.value)


def test_a_function_without_a_provenance_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^provenance: missing; a function needs "):
        FunctionSource(brdf=white, name="made-up", title="Made up")


def test_a_wavelength_outside_the_range_is_refused() -> None:
    source = FunctionSource(brdf=sheen, wavelengths_nm=(400.0, 700.0), **ABOUT)
    with pytest.raises(ParameterError, match=r"^wavelength_nm: 800 is outside \[400, 700\] nm of made-up$"):
        source.lookup(0.1, 0.0, 0.2, 0.0, 800.0)


def test_a_document_keeps_all_of_a_function_but_the_function() -> None:
    source = FunctionSource(brdf=sheen, wavelengths_nm=(400.0, 700.0), alpha=0.2, grazing_pole=True, **ABOUT)
    record = source_of(source.document())
    assert record == FunctionRecord(wavelengths_nm=(400.0, 700.0), alpha=(0.2, 0.2), grazing_pole=True, **ABOUT)
    assert not isinstance(record, FunctionSource)


def test_a_document_keeps_every_preset_whole() -> None:
    for material in presets().values():
        assert source_of(material.document()) == material


def test_a_document_of_nothing_known_is_refused() -> None:
    with pytest.raises(BrdfdbError, match=r"^source: the document names neither a material nor a function$"):
        source_of({"material_name": "foam"})
    unknown = presets()["foam"].document()
    unknown["material"]["model"] = "not_installed"
    with pytest.raises(BrdfdbError, match=r"^source: .*'not_installed' is not one of lambert"):
        source_of(unknown)


def test_the_layout_of_a_function_says_that_it_cannot_leave_the_process() -> None:
    document = Layout(FunctionSource(brdf=white, **ABOUT), Grid(AXES)).document()
    assert document["function"]["provenance"] == "a test"
    with pytest.raises(BrdfdbError, match=r"^made-up: is a function, which no other process can read from a file; tab"):
        Layout.from_document(document)


def test_a_material_without_its_uniform_part_is_short_of_that_part() -> None:
    brass = presets()["rolled-brass"]
    angles = (0.3, 0.0, 0.5, 2.0)
    uniform = brass.uniform_at(None)
    assert uniform == brass.numbers["rho_d"] / np.pi
    np.testing.assert_allclose(brass.without_uniform().lookup(*angles) + uniform, brass.lookup(*angles), rtol=1e-14)
    assert brass.without_uniform().without_uniform().lookup(*angles) == brass.without_uniform().lookup(*angles)


def test_a_lossless_material_is_the_model_at_the_changed_arguments() -> None:
    for name in ("clay-vase", "rolled-brass", "sandpaper-220-grit"):
        material = presets()[name]
        lossless = material.lossless
        at = np.array([500.0]) if material.spectral else None
        wi, wr = unit_vector([0.3], [0.0]), unit_vector([0.5], [2.0])
        expected = material.spec.vectors(wi, wr, **{**material.arguments(at), **lossless.changes})
        np.testing.assert_array_equal(lossless.source.brdf_at(at)(wi, wr)[:, 0], np.ravel(expected))
