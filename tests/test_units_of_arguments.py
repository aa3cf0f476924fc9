"""Degrees given for radians, and micrometres for nanometres: a warning or a sentence, wherever they come in."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import derivatives, formats, models
from brdfdb.conversion.convert import compare
from brdfdb.errors import BrdfdbError, DegreesWarning, ParameterError
from brdfdb.formats._readings import FileTable
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import FunctionSource, Material, presets
from brdfdb.materials.spectrum import Spectrum
from brdfdb.measurements.samples import Samples
from brdfdb.models import MODELS
from brdfdb.refractive_indices import refractive_index
from brdfdb.tables.evaluation import PointsBody
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb_pipelines.recipe_file import load
from tests.models.draws import drawn
from tests.tables.made_up import made_up

MISTAKEN = (0.52, 0.0, 0.52, 180.0)
TURNED = (0.52, 0.0, 0.52, float(np.fmod(180.0, 2.0 * np.pi)))
SURFACE = {"sigma_0_um": 0.18, "tau_um": 3.0, "n": 0.77, "k": 6.08}


GREY_FUNCTION = FunctionSource(brdf=lambda wi, _wr, _: np.full(len(wi), 0.1), name="a", title="A", provenance="made up")
FILE = FileTable("file", ("grey",), None, lambda wi, _: np.full((len(wi), 1), 0.1))
SPECTRAL_FILE = FileTable("file", ("450nm",), np.array([450.0]), lambda wi, _: np.full((len(wi), 1), 0.1))
LOOKUPS: dict[str, Callable[..., Any]] = {
    "material": presets()["foam"].lookup,
    "function": GREY_FUNCTION.lookup,
    "table": made_up("isotropic").lookup,
    "table of half vectors": made_up("anisotropic").lookup,
    "file": FILE.lookup,
}


def test_lookups_warn_of_degrees_and_answer() -> None:
    many = tuple(np.full(3000, angle) for angle in MISTAKEN)
    for name, lookup in LOOKUPS.items():
        for angles, threads in ((MISTAKEN, 1), (many, 2)):
            more = {"threads": threads} if threads > 1 and name.startswith("table") else {}
            with pytest.warns(DegreesWarning, match="^phi_r: 180 rad is more than two turns") as caught:
                f_r = lookup(*angles, **more)
            assert caught[0].filename == __file__  # the line of the caller, so that each place is told once
            assert np.atleast_1d(f_r)[0] == pytest.approx(float(lookup(*TURNED)), rel=1e-9), name


def test_every_model_warns_of_degrees_and_answers() -> None:
    wound = -90.0 + 30.0 * np.pi
    for name, spec in MODELS.items():
        parameters = drawn(spec, np.random.default_rng(3))
        with pytest.warns(DegreesWarning, match=r"^phi_i: -90 rad"):
            f_r = spec.evaluate(0.3, -90.0, 0.4, 2.0, **parameters)
        assert f_r == pytest.approx(spec.evaluate(0.3, wound, 0.4, 2.0, **parameters), rel=1e-6), name


def test_more_functions_of_azimuths_warn() -> None:
    ward = {"rho_d": 0.1, "rho_s": 0.3, "alpha_x": 0.1, "alpha_y": 0.2}
    for call in (
        lambda: derivatives.gradient("ward", *MISTAKEN, **ward),
        lambda: directional_albedo("ward", 0.3, 45.0, **ward),
        lambda: models.oren_nayar_parts(*MISTAKEN, rho=0.5, sigma=0.3),
    ):
        with pytest.warns(DegreesWarning):
            call()


def test_an_unwrapped_scan_may_filter_the_warning() -> None:
    scan = np.linspace(0.0, 40.0, 50)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", DegreesWarning)
        f_r = LOOKUPS["table"](0.5, 0.0, 0.6, scan)
    np.testing.assert_allclose(f_r, LOOKUPS["table"](0.5, 0.0, 0.6, np.mod(scan, 2.0 * np.pi)), rtol=1e-9)
    assert LOOKUPS["table"](0.5, 0.0, 0.6, 4.0 * np.pi) > 0.0  # two turns are usual: pytest makes a warning an error


def test_polar_angles_in_degrees_are_refused() -> None:
    for look in (*LOOKUPS.values(), lambda *angles: models.lambert(*angles, rho=0.5)):
        with pytest.raises(ParameterError, match=r"^theta_i: 30 rad \(1718\.87 degrees\) is outside \[0, pi\] rad$"):
            look(30, 0, 30, 180)


COPPER_TABLE = {
    "title": "Copper",
    "model": "he_torrance",
    "source": "no paper",
    "parameters": {"sigma_0_um": 0.1, "tau_um": 2.0, "a": 0.0},
    "refractive_index": "main/Cu/Johnson",
}
COPPER = Material.from_table("copper", COPPER_TABLE)
WAVELENGTHS: dict[str, Callable[[float], Any]] = {
    "model": lambda nm: models.he_torrance(0.5, 0.0, 0.5, 3.0, wavelength_nm=nm, **SURFACE),
    "model of vectors": lambda nm: models.he_torrance_vectors([0, 0, 1], [0, 0, 1], wavelength_nm=nm, **SURFACE),
    "polarised": lambda nm: models.he_torrance_mueller(0.5, 0.0, 0.5, 3.0, wavelength_nm=nm, **SURFACE),
    "microfacets": lambda nm: models.ggx(0.5, 0, 0.5, 3, alpha_x=0.1, alpha_y=0.1, n=1.5, k=0.0, wavelength_nm=nm),
    "material": lambda nm: COPPER.lookup(0.5, 0.0, 0.5, 3.0, nm),
    "grey material": lambda nm: presets()["foam"].lookup(0.5, 0.0, 0.5, 3.0, nm),
    "specular part of a grey material": lambda nm: presets()["foam"].specular_reflectance(0.5, nm),
    "function": lambda nm: GREY_FUNCTION.lookup(0.5, 0.0, 0.5, 3.0, nm),
    "table": lambda nm: made_up("isotropic", np.array([400.0, 700.0])).lookup(0.5, 0.0, 0.5, 3.0, nm),
    "grey table": lambda nm: made_up("isotropic").lookup(0.5, 0.0, 0.5, 3.0, [600.0, nm]),
    "specular part": lambda nm: made_up("isotropic", dirac=True).specular_reflectance(0.5, nm),
    "file": lambda nm: SPECTRAL_FILE.lookup(0.5, 0.0, 0.5, 3.0, nm),
    "refractive index": lambda nm: refractive_index("main/Cu/Johnson", nm),
    "constant index": lambda nm: refractive_index("constant/1.5/0", [nm]),
    "spectrum": lambda nm: Spectrum(wavelengths_nm=(nm, 700.0), values=(0.1, 0.2), origin="listed"),
    "layout": lambda nm: Layout(
        COPPER, Grid({"theta_i": [0, 80], "theta_r": [0, 80], "delta_phi": [0, 180]}), np.array([nm, 700.0])
    ),
    "comparison": lambda nm: compare(COPPER, COPPER, [nm, 700.0]),
    "samples": lambda nm: Samples("some", *np.full((4, 1), 0.1), ("a",), np.array([nm]), np.ones((1, 1))),
    "json": lambda nm: PointsBody(theta_i=30, theta_r=30, wavelength_nm=[nm]),
}


def test_a_wavelength_in_micrometres_is_refused_with_the_hint() -> None:
    for function in WAVELENGTHS.values():
        for wrong in (0.55, 0.999, 1e-4):
            with pytest.raises((BrdfdbError, ValueError), match=rf"{wrong:g} [^\n]*is it in micrometres\?"):
                function(wrong)


def test_a_recipe_or_a_file_in_micrometres_is_refused_with_the_hint(tmp_path: Path) -> None:
    path = tmp_path / "copper.toml"
    path.write_text('materials = ["rolled-brass"]\nwavelengths_nm = [0.45, 0.55]\ntolerance = 0.02\n')
    with pytest.raises(BrdfdbError, match=r"wavelengths_nm: 0\.45 is below 1 nm; is it in micrometres"):
        load(path)
    with pytest.raises(ParameterError, match=r"wavelengths_nm: 0\.55 is below 1 nm; is it in micrometres"):
        Material.from_table("rod", {**COPPER_TABLE, "wavelengths_nm": [0.55]})
    axes = {"theta_i": [0.0, 60.0], "theta_r": [0.0, 60.0], "delta_phi": [0.0, 180.0], "wavelength": [0.45, 0.55]}
    np.savez(tmp_path / "some.npz", **axes, axes=list(axes), brdf=np.ones((2, 2, 2, 2)))
    with pytest.raises(BrdfdbError, match=r"some\.npz: .*0\.45 is below 1 nm; is it in micrometres\?"):
        formats.read(tmp_path / "some.npz")
