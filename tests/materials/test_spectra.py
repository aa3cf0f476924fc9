"""Reflectances that are spectra: the ways to write them, their values, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.errors import MaterialError, ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material, source_of
from brdfdb.materials.material import evaluations
from brdfdb.materials.spectrum import Spectrum, spectrum_of
from brdfdb.models import MODELS
from brdfdb.spectra import colour_science, linear_srgb

WARD: dict[str, Any] = {"rho_d": 0.2, "rho_s": 0.3, "alpha_x": 0.1, "alpha_y": 0.2}
NM = np.linspace(400.0, 700.0, 31)


def material_of(model: str, parameters: dict[str, Any]) -> Material:
    table = {"title": "A test", "model": model, "source": "a test", "parameters": parameters}
    return Material.from_table("test", table)


def ward(**changes: Any) -> Material:
    return material_of("ward", WARD | changes)


def directions(count: int) -> tuple[Any, Any]:
    rng = np.random.default_rng(5)
    return tuple(unit_vector(np.arccos(rng.uniform(0.05, 1.0, count)), rng.uniform(0.0, 6.0, count)) for _ in range(2))


@pytest.mark.parametrize("code", ["#c08040", "#ff0000", "#0000ff", "#ffffff", "#101010", [0.2, 0.7, 0.3]])
def test_a_colour_becomes_a_spectrum_with_this_colour_inside_0_and_1(code: Any) -> None:
    spectrum = spectrum_of("rho", {"srgb": code})
    values = np.array(spectrum.values)
    assert np.all((values >= 0.0) & (values <= 1.0))
    encoded = [int(code[at : at + 2], 16) / 255.0 for at in (1, 3, 5)] if isinstance(code, str) else code
    seen = linear_srgb(spectrum.wavelengths_nm, values)
    shown = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * np.abs(seen) ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(shown, encoded, atol=0.01)  # two or three of 255 steps
    assert "assumed" in spectrum.origin


def test_a_colour_is_stated_as_an_assumption_of_the_material() -> None:
    material = ward(rho_d={"srgb": "#c08040"})
    assert "#c08040" in material.assumed["rho_d"].why
    assert material.attributes()["parameter_sources"]["rho_d"] == material.assumed["rho_d"].why
    assert "rho_s" not in material.assumed


def test_a_measured_reflectance_is_that_of_colour_science() -> None:
    patch = colour_science().SDS_COLOURCHECKERS["BabelColor Average"]["dark skin"]
    spectrum = spectrum_of("rho", {"measured": "BabelColor Average/dark skin"})
    assert spectrum.values == tuple(patch.values)
    assert spectrum.wavelengths_nm == tuple(patch.wavelengths)
    assert "measured" in spectrum.origin


def test_a_file_and_a_list_hold_the_same_values(tmp_path: Path) -> None:
    (tmp_path / "clay.csv").write_text("wavelength_nm, rho # measured\n\n400, 0.1\n500; 0.3\n700 0.6\n")
    read = spectrum_of("rho", {"csv": "clay.csv"}, folder=tmp_path)
    listed = spectrum_of("rho", [0.1, 0.3, 0.6], [400, 500, 700])
    assert (read.wavelengths_nm, read.values) == (listed.wavelengths_nm, listed.values)
    assert read.at("rho", np.array([450.0, 600.0])).tolist() == pytest.approx([0.2, 0.45])


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"alpha_x": [0.1, 0.2]}, "alpha_x: a number is needed; parameters of ward that may be spectra: rho_d, rho_s"),
        ({"rho_d": [0.1, 0.2]}, "rho_d: a list of 2 values needs as many wavelengths_nm, none are given"),
        ({"rho_d": {"csv": "absent.csv"}}, "rho_d: absent.csv: No such file or directory"),
        ({"rho_d": {"srgb": [0.1, 2.0, 0.0]}}, "is not three numbers in [0, 1]"),
        ({"rho_d": {"srgb": "red"}}, "srgb: 'red' is not three numbers in [0, 1] or \"#rrggbb\""),
        ({"rho_d": {"measured": "PMC/Porc"}}, "closest: PMC/Pork"),
        ({"rho_d": {"colour": 1}}, "a spectrum with colour; give one of: wavelengths_nm and values, csv"),
        ({"rho_d": {"wavelengths_nm": [400, 700], "values": [0.1, 1.2]}}, "rho_d: 1.2 is outside [0, 1]"),
        ({"rho_d": {"wavelengths_nm": [700, 400], "values": [0.1, 0.2]}}, "must be positive and increase strictly"),
        ({"rho_d": {"wavelengths_nm": [400, 500, 600], "values": [0.1, 0.2]}}, "2 are given for 3 wavelengths"),
        ({"rho_d": {"wavelengths_nm": [], "values": []}}, "rho_d: wavelengths_nm"),
        ({"rho_d": {"wavelengths_nm": [400, 500], "values": [0.1, float("nan")]}}, "rho_d: values.1"),
        ({"rho_d": "red"}, "rho_d: 'red' is not a number"),
    ],
)
def test_a_spectrum_that_is_none_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(MaterialError) as refusal:
        ward(**changes)
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("400,0.1\nabc,0.2\n", "line 2: 'abc,0.2' is not a wavelength [nm] and a value"),
        ("400,0.1,0.3\n500,0.1,0.3\n", "line 1"),
        ("wavelength,rho\n400,0.1\n", "1 lines of values; allowed are 2 to"),
        ("", "0 lines of values"),
        ("wavelength_nm,reflectance %\n400,40\n500,50\n", "line 1: '%' in the header; give nm and fractions"),
        ("wavenumber_cm-1,rho\n400,0.1\n500,0.2\n", "line 1: 'wavenumber' in the header"),
        ("wavelength [um],rho\n0.4,0.1\n0.5,0.2\n", "line 1: 'um' in the header"),
        ("400,0.1\n400,0.2\n", "must be positive and increase strictly"),
    ],
)
def test_a_file_that_is_no_spectrum_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ParameterError) as refusal:
        spectrum_of("rho", {"csv": "a.csv"}, folder=tmp_path)
    assert sentence in str(refusal.value)


def test_a_wavelength_outside_a_spectrum_is_refused() -> None:
    material = ward(rho_d={"wavelengths_nm": [400, 700], "values": [0.1, 0.2]})
    with pytest.raises(ParameterError, match=r"wavelength_nm: 701 has no rho_d, whose spectrum covers \[400, 700\] nm"):
        material.lookup(0.1, 0.0, 0.2, 1.0, 701.0)
    with pytest.raises(ParameterError, match="needs wavelengths, a parameter is a spectrum"):
        material.lookup(0.1, 0.0, 0.2, 1.0)


def test_values_are_those_of_numbers_at_each_wavelength() -> None:
    material = ward(rho_d={"srgb": "#c08040"}, rho_s={"measured": "BabelColor Average/orange"})
    assert material.spectral
    wi, wr = directions(50)
    values = material.brdf_at(NM)(wi, wr)
    for number, wavelength in enumerate(NM):
        at = {name: material.parameters[name].at(name, wavelength) for name in ("rho_d", "rho_s")}
        grey = ward(**{name: float(value) for name, value in at.items()})
        expected = grey.lookup_vectors(wi, wr)
        np.testing.assert_allclose(values[:, number], expected, rtol=1e-13)
        np.testing.assert_allclose(material.lookup_vectors(wi, wr, wavelength), expected, rtol=1e-13)


@pytest.mark.parametrize("name", [name for name, spec in MODELS.items() if spec.degree is not None])
def test_a_polynomial_model_is_one(name: str) -> None:
    spec = MODELS[name]
    rng = np.random.default_rng(2)
    middle = {
        p.name: p.default if p.default is not None else p.low + 0.3 * (min(p.high, 1.0) - p.low)
        for p in spec.parameters
    }
    spectra = {p.name: rng.uniform(p.low, p.high, 9) for p in spec.parameters if p.reflectance}
    assert spectra
    sets, weights = evaluations(spec, middle | spectra, 9, spec.degree)
    assert len(sets) < 9
    wi, wr = directions(20)
    made = np.stack([spec.vectors(wi, wr, **one) for one in sets], axis=-1) @ weights
    for column in range(9):
        one = middle | {key: value[column] for key, value in spectra.items()}
        direct = spec.vectors(wi, wr, **one)
        np.testing.assert_allclose(made[:, column], direct, rtol=1e-12, atol=1e-13)


def test_a_document_of_a_coloured_material_reads_back() -> None:
    material = ward(rho_d={"srgb": "#c08040"})
    assert source_of(json.loads(json.dumps(material.document()))) == material
    written = material.file_parameters()["rho_d"]
    again = ward(rho_d=written.model_dump(mode="json"))
    assert again.parameters == material.parameters


def test_lossless_spectra_reflect_all_at_each_wavelength() -> None:
    material = ward(rho_d={"srgb": "#c08040"}, rho_s={"wavelengths_nm": [390, 720], "values": [0.1, 0.4]})
    arguments = material.lossless.source.arguments(NM)
    np.testing.assert_allclose(arguments["rho_d"] + arguments["rho_s"], 1.0, rtol=1e-12)


def test_limits_and_forms_take_spectra() -> None:
    material = ward(rho_d={"wavelengths_nm": [400, 700], "values": [0.1, 0.8]})
    spec, arguments = material.spec, material.arguments(NM)
    assert "1.1" in {limit.value for limit in spec.limits(arguments)}  # 0.8 + 0.3
    wi, wr = directions(5)
    for form in spec.forms(arguments):
        assert material.brdf_at(NM, form.vectors)(wi, wr).shape == (5, NM.size), form.key


@pytest.mark.parametrize("model", ["ward", "oren_nayar"])
def test_a_form_that_says_it_is_a_polynomial_is_one(model: str) -> None:
    spectrum = {"wavelengths_nm": [400, 550, 700], "values": [0.05, 0.8, 0.3]}
    parameters = {"rho": spectrum, "sigma_deg": 35} if model == "oren_nayar" else WARD | {"rho_d": spectrum}
    material = material_of(model, parameters)
    wi, wr = directions(12)
    few = np.linspace(400.0, 700.0, 5)
    judged = 0
    for form in material.spec.forms(material.arguments(few)):
        if form.degree is not None:
            made, direct = (material.brdf_at(few, form.vectors, degree)(wi, wr) for degree in (form.degree, None))
            np.testing.assert_allclose(made, direct, rtol=1e-11, err_msg=form.key)
            judged += 1
    assert judged > 4


def test_a_spectrum_of_one_wavelength_has_no_value_at_another() -> None:
    spectrum = Spectrum(wavelengths_nm=(650.0,), values=(0.2,), origin="fitted")
    assert spectrum.at("rho", np.array([650.0])).tolist() == [0.2]
    assert str(spectrum) == "0.2 at 650 nm"
    with pytest.raises(ParameterError, match=r"450 has no rho, whose spectrum covers \[650, 650\] nm"):
        spectrum.at("rho", np.array([450.0]))
