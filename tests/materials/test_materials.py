"""The presets against the numbers of the papers, typed again here, and what a wrong material is told."""

import re

import numpy as np
import pytest
from pydantic import ValidationError

from brdfdb.errors import MaterialError
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material, presets
from brdfdb.models import MODELS

TOGETHER = 3e-13  # relative, of copper in one call or in a call each, through the table of eq. 78: 1.9e-13

# Ward 1992, section 6, first table: rho_d, rho_r, alpha_x, alpha_y
WARD_SURFACES = {
    "rolled-brass": (0.10, 0.33, 0.050, 0.16),
    "rolled-aluminum": (0.1, 0.21, 0.04, 0.09),
    "lightly-brushed-aluminum": (0.15, 0.19, 0.088, 0.13),
    "varnished-plywood": (0.33, 0.025, 0.04, 0.11),
    "enamel-finished-metal": (0.25, 0.047, 0.080, 0.096),
    "painted-cardboard-box": (0.19, 0.043, 0.076, 0.085),
    "white-ceramic-tile": (0.70, 0.050, 0.071, 0.071),
    "glossy-grey-paper": (0.29, 0.083, 0.082, 0.082),
    "ivory-computer-plastic": (0.45, 0.043, 0.13, 0.13),
    "plastic-laminate": (0.67, 0.070, 0.092, 0.092),
}
# Ward 1992, section 6, the two Latex tables: columns brushed, rolled, sprayed; rho_d "around 0.45" for both paints
WARD_LATEX = {
    ("semi-gloss", 0.048): {
        "metal": ((0.037, 0.064), (0.045, 0.068), (0.041, 0.055)),
        "sheetrock": ((0.078, 0.12), (0.083, 0.12), (0.096, 0.11)),
        "wood": ((0.097, 0.24), (0.12, 0.26), (0.099, 0.26)),
    },
    ("gloss", 0.059): {
        "metal": ((0.037, 0.063), (0.054, 0.080), (0.038, 0.054)),
        "sheetrock": ((0.10, 0.10), (0.12, 0.12), (0.10, 0.10)),
        "wood": ((0.13, 0.22), (0.13, 0.20), (0.12, 0.17)),
    },
}
WARD = WARD_SURFACES | {
    f"latex-{paint}-{application}-{ground}": (0.45, rho_r, *alphas)
    for (paint, rho_r), table in WARD_LATEX.items()
    for ground, row in table.items()
    for application, alphas in zip(("brushed", "rolled", "sprayed"), row, strict=True)
}
# Oren and Nayar 1994: rho, sigma [degree]
OREN_NAYAR = {
    "wall-plaster": (0.90, 30),  # sample A, Fig. 15
    "painted-sandpaper": (0.80, 40),  # sample B, Fig. 16
    "white-sand": (0.80, 35),  # sample C, Fig. 17
    "foam": (0.8, 20),  # sample D, Fig. 19
    "cotton-towel": (0.75, 42),  # sample E, Fig. 20
    "wood-shavings": (0.7, 26),  # sample F, Fig. 21
    "clay-vase": (0.7, 40),  # section 6, Fig. 22
    # section 6, images spheres.tif and scene.1.tif to scene.4.tif, which print sigma only; 0.9 as in Figs 8 to 13
    "rendered-sphere-0deg": (0.9, 0),
    "rendered-sphere-10deg": (0.9, 10),
    "rendered-sphere-20deg": (0.9, 20),
    "rendered-sphere-40deg": (0.9, 40),
    "scene-object-smooth": (0.9, 0),
    "scene-object-rough": (0.9, 30),
}
SURFACE_TERM_RATIOS = {"foam": 0.019, "cotton-towel": 0.085, "wood-shavings": 0.043}  # k_s/k_b, Figs 19 to 21
# He et al. 1991: sigma_0 [um], tau [um], a, wavelength [um] where a value is stated for one; None is not printed
HE_TORRANCE = {
    "roughened-aluminum-500nm": (0.28, 1.77, 0, 0.5),  # section 4, Fig. 8
    "roughened-aluminum-2000nm": (0.28, 1.77, 0, 2.0),  # section 4, Fig. 7
    "magnesium-oxide-ceramic": (1.45, 13.2, 0.9, 0.5),  # section 4, Fig. 9
    "sandpaper-220-grit": (None, None, 0, 0.55),  # section 4, Fig. 10: sigma_0/tau = 4.4
    "blue-plastic": (0, None, 0.15, 0.46),  # section 4, Fig. 11
    "aluminum-cylinder-12a": (0.18, 3.0, 0, None),  # Fig. 12
    "aluminum-cylinder-12b": (0.28, 3.0, 0, None),
    "aluminum-cylinder-12c": (0.38, 3.0, 0, None),
    "aluminum-cylinder-12d": (0.48, 3.0, 0, None),
    "aluminum-cylinder-12e": (0.58, 3.0, 0, None),
    "aluminum-cylinder-12f": (2.50, 16.0, 0, None),
    "aluminum-cylinder-13a": (2.5, 16.0, 0, None),  # Fig. 13, "the same as cylinder (f) in Figure 12"
    "aluminum-cylinder-13b": (0, None, 0, None),
    "scene-aluminum-cylinder": (0.18, 3.0, 0, None),  # section 5, Fig. 14
    "scene-copper-sphere": (0.13, 1.2, 0, None),
    "scene-plastic-cube": (0, 2.0, 0.28, 0.55),
    "scene-plastic-table": (0.20, 2.0, 0.28, 0.55),
}
HE_IDEAL_DIFFUSE = "aluminum-cylinder-13c"
ASSUMED = {
    **{name: {"interreflection"} for name in OREN_NAYAR},
    **{name: {"rho", "interreflection"} for name in OREN_NAYAR if name.startswith(("rendered-", "scene-"))},
    **{name: {"k_b", "e_0"} for name in SURFACE_TERM_RATIOS},
    "sandpaper-220-grit": {"sigma_0_um", "tau_um", "refractive_index"},
    "blue-plastic": {"tau_um", "refractive_index"},
    "aluminum-cylinder-13b": {"tau_um"},
    HE_IDEAL_DIFFUSE: {"rho"},
    "scene-plastic-cube": {"refractive_index"},
    "scene-plastic-table": {"refractive_index"},
}

PAPER_PLACE = re.compile(
    r"(Ward 1992|Oren and Nayar 1994|He et al\. 1991), .*(table|Figs? ?\.? ?\d|section \d|images?)"
)
JOURNAL_PLACE = re.compile(r"\w.* (19|20)\d\d, .* \d+, \d+")
WITHOUT_COLOUR = re.compile(r"[Gg]rey\.|no colour\.|grey\.")


def preset(name: str) -> Material:
    return presets()[name]


def test_the_presets_are_those_of_the_papers():
    assert (len(WARD), len(OREN_NAYAR), len(HE_TORRANCE) + 1) == (28, 13, 18)
    assert set(presets()) == {*WARD, *OREN_NAYAR, *HE_TORRANCE, HE_IDEAL_DIFFUSE}


@pytest.mark.parametrize("name", WARD)
def test_ward(name):
    material = preset(name)
    assert material.model == "ward"
    assert material.file_parameters() == dict(zip(("rho_d", "rho_s", "alpha_x", "alpha_y"), WARD[name], strict=True))
    assert material.anisotropic is (WARD[name][2] != WARD[name][3])


@pytest.mark.parametrize("name", OREN_NAYAR)
def test_oren_nayar(name):
    material = preset(name)
    rho, sigma_deg = OREN_NAYAR[name]
    model, more = "oren_nayar", {"interreflection": True}
    if name in SURFACE_TERM_RATIOS:
        model = "oren_nayar_body_surface"
        more = {"k_s": SURFACE_TERM_RATIOS[name], "k_b": 1.0, "e_0": np.pi, "interreflection": False}
    assert material.model == model
    assert material.file_parameters() == {"rho": rho, "sigma_deg": sigma_deg, **more}
    assert material.parameters["sigma"] == pytest.approx(sigma_deg * np.pi / 180.0, rel=1e-15)
    assert not material.anisotropic


@pytest.mark.parametrize("name", HE_TORRANCE)
def test_he_torrance(name):
    material = preset(name)
    sigma_0_um, tau_um, a, wavelength_um = HE_TORRANCE[name]
    printed = {"sigma_0_um": sigma_0_um, "tau_um": tau_um, "a": a}
    assert material.model == "he_torrance"
    for parameter, value in printed.items():
        assert value in (None, material.file_parameters()[parameter]), parameter
        assert value is not None or parameter in material.assumed
    assert material.wavelengths_nm == (None if wavelength_um is None else (round(1000 * wavelength_um),))


def test_sandpaper_has_the_printed_ratio_and_is_very_rough():
    parameters = preset("sandpaper-220-grit").parameters
    assert parameters["sigma_0_um"] / parameters["tau_um"] == pytest.approx(4.4, rel=1e-15)
    g = (4.0 * np.pi * parameters["sigma_0_um"] / 0.55) ** 2  # eq. 79 at normal incidence and reflection
    assert g == pytest.approx(1e6, rel=0.02)


def test_the_ideal_diffuser_is_lambert():
    material = preset(HE_IDEAL_DIFFUSE)
    assert (material.model, material.file_parameters()) == ("lambert", {"rho": 1.0})


def test_every_value_has_a_place_in_a_paper():
    for name, material in presets().items():
        assert PAPER_PLACE.match(material.source), name
        for value, source in material.sources.items():
            assert (JOURNAL_PLACE if value == "refractive_index" else PAPER_PLACE).match(source), name
        assert ("refractive_index" in material.sources) is material.spectral, name
        assert set(material.assumed) == ASSUMED.get(name, set()), name
        assert all(assumption.why.endswith(".") for assumption in material.assumed.values()), name
        metal = material.refractive_index in ("main/Al/Rakic", "main/Cu/Johnson")
        assert bool(WITHOUT_COLOUR.search(material.note)) is not metal, name  # a colour is never invented


@pytest.mark.parametrize("name", presets())
def test_a_preset_calls_its_model(name):
    material = preset(name)
    wavelength_nm = np.array([450.0, 650.0]) if material.spectral and material.wavelengths_nm is None else None
    values = material.spec.evaluate(0.5, 0.0, 0.7, 2.0, **material.arguments(wavelength_nm))
    assert np.all(np.isfinite(values) & (values >= 0.0))
    assert np.shape(values) == (() if not material.spectral else (2,) if wavelength_nm is not None else (1,))


def dielectric_reflectance(theta: float, n: float) -> float:
    """Fresnel reflectance of unpolarised light, from the angle of refraction."""
    if theta == 0.0:
        return ((n - 1.0) / (n + 1.0)) ** 2
    t = np.arcsin(np.sin(theta) / n)
    return 0.5 * float((np.sin(theta - t) / np.sin(theta + t)) ** 2 + (np.tan(theta - t) / np.tan(theta + t)) ** 2)


def test_blue_plastic_reflects_what_was_measured():
    arguments = preset("blue-plastic").arguments()
    rho_dh = arguments["a"] + dielectric_reflectance(0.0, arguments["n"].item())
    assert rho_dh == pytest.approx(0.195, abs=0.0005)  # section 4, printed to three digits


def test_only_known_presets_exceed_one():
    known = {name for name, material in presets().items() if material.known_excess}
    assert known == {"magnesium-oxide-ceramic", "blue-plastic", "scene-plastic-cube"}


@pytest.mark.parametrize("name", ["blue-plastic", "scene-plastic-cube"])
def test_the_excess_of_a_smooth_plastic_is_fresnel_plus_a(name):
    material = preset(name)
    arguments, excess = material.arguments(), material.known_excess
    assert excess.max_albedo == 1.0 + arguments["a"]  # the reflectance of a surface at grazing incidence is 1
    onset = np.deg2rad([excess.from_theta_i_deg, excess.from_theta_i_deg + 0.1])
    below, above = (dielectric_reflectance(theta, arguments["n"].item()) + arguments["a"] for theta in onset)
    assert below <= 1.0 < above


def test_the_excess_of_magnesium_oxide():
    # albedo from an independent evaluation of the model: 1.116 at 85 degrees, 1 at about 54
    excess = preset("magnesium-oxide-ceramic").known_excess
    assert 1.11 < excess.max_albedo < 1.13
    assert 53.0 < excess.from_theta_i_deg < 54.0


def test_arguments_of_a_spectral_material():
    cylinder, sandpaper = preset("aluminum-cylinder-12a"), preset("sandpaper-220-grit")
    arguments = cylinder.arguments([400.0, 700.0])
    assert list(arguments) == ["sigma_0_um", "tau_um", "a", "wavelength_nm", "n", "k"]
    assert arguments["n"].shape == arguments["k"].shape == arguments["wavelength_nm"].shape == (2,)
    assert sandpaper.arguments()["wavelength_nm"].tolist() == [550.0]
    with pytest.raises(ValueError, match="wavelength_nm: aluminum-cylinder-12a needs wavelengths"):
        cylinder.arguments()
    with pytest.raises(ValueError, match=r"wavelength_nm: 3000 .* main/Cu/Johnson"):
        preset("scene-copper-sphere").arguments([3000.0])
    assert preset("rolled-brass").arguments([550.0]) == preset("rolled-brass").parameters  # it is grey


@pytest.mark.parametrize("directions", [1, 2, 300, 3000])
def test_wavelengths_of_one_call_have_the_values_of_a_call_each(directions):
    copper, wavelength_nm = presets()["scene-copper-sphere"], np.array([450.0, 550.0, 650.0])
    wi = unit_vector(np.linspace(0.0, 1.5, directions), 0.2)
    wr = unit_vector(np.linspace(0.3, 1.7, directions), 3.0)
    values = copper.brdf_at(wavelength_nm)(wi, wr)
    expected = [MODELS["he_torrance"].vectors(wi, wr, **copper.arguments(w)) for w in wavelength_nm]
    np.testing.assert_allclose(values, np.stack(expected, axis=-1), rtol=TOGETHER if directions == 1 else 0.0)


def test_f_r_of_a_grey_material_has_one_column():
    wi, wr = unit_vector([0.1, 0.9], 0.0), unit_vector([0.4, 1.2], 2.0)
    brass = presets()["rolled-brass"]
    expected = MODELS["ward"].vectors(wi, wr, **brass.parameters)
    np.testing.assert_array_equal(brass.brdf_at(None)(wi, wr), expected[:, np.newaxis])


def test_presets_can_be_taken_apart_without_harm():
    mine = presets()
    mine.clear()
    assert len(presets()) == 59
    with pytest.raises(ValidationError, match="frozen"):
        preset("rolled-brass").title = "Gold"


EXCESS = {"max_albedo": 1.1, "from_theta_i_deg": 80, "citation": "Fig. 1"}


def guess(other: dict[str, object]) -> dict[str, object]:
    """An assumption on which an excess of 1.1 rests."""
    return {"why": "a guess", "max_albedo": 1.1, "alternatives": [{"parameters": other, "max_albedo": 0.9}]}


def plaster(**changes: object) -> dict[str, object]:
    """A right table of a TOML file, with changes; None takes a key out."""
    table: dict[str, object] = {
        "title": "Plaster",
        "model": "oren_nayar",
        "parameters": {"rho": 0.9, "sigma_deg": 30},
        "source": "Oren and Nayar 1994, Fig. 15",
    }
    return {key: value for key, value in (table | changes).items() if value is not None}


def cylinder(**changes: object) -> dict[str, object]:
    """The same for a spectral model."""
    parameters = {"sigma_0_um": 0.2, "tau_um": 3}
    return plaster(model="he_torrance", parameters=parameters) | {"refractive_index": "main/Al/Rakic"} | changes


def test_defaults_are_filled_in_and_integers_are_numbers():
    material = Material.from_table("plaster", plaster(parameters={"rho": 1, "sigma_deg": 90}))
    assert material.parameters == {"rho": 1.0, "sigma": np.pi / 2, "interreflection": True}
    assert [type(value) for value in material.parameters.values()] == [float, float, bool]
    assert material.file_parameters() == {"rho": 1.0, "sigma_deg": 90.0, "interreflection": True}


REFUSED = (
    (plaster(model="phong"), "model"),
    (plaster(model=None), "model"),
    (plaster(model=["ward"]), "model"),
    (plaster(parameters={"rho": 0.9, "sigma": 0.5}), "sigma"),
    (plaster(parameters={"rho": 0.9}), "sigma_deg"),
    (plaster(parameters={"rho": 0.9, "sigma_deg": 91}), "sigma_deg"),
    (plaster(parameters=None), "rho"),
    (plaster(parameters={"rho": 1.2, "sigma_deg": 30}), "rho"),
    (plaster(parameters={"rho": np.nan, "sigma_deg": 0}), "rho"),
    (plaster(parameters={"rho": "0.9", "sigma_deg": 0}), "rho"),
    (plaster(parameters={"rho": True, "sigma_deg": 0}), "rho"),
    (plaster(parameters={"rho": 0.9, "sigma_deg": 0, "interreflection": 0.5}), "interreflection"),
    (plaster(parameters=5), "parameters"),
    (plaster(colour="red"), "colour"),
    (plaster(known_excess=EXCESS | {"max_albedo": np.inf}), "known_excess.max_albedo"),
    (plaster(source=""), "source"),
    (plaster(sources={"alpha": "Fig. 1"}), "sources"),
    (plaster(assumed={"alpha": {"why": "a guess"}}), "assumed"),
    (plaster(assumed={"sigma_deg": guess({"sigma": 20})}), "assumed alternatives"),
    (plaster(assumed={"rho": {"why": ""}}), "assumed.rho.why"),
    (plaster(assumed={"rho": {"why": "a guess", "max_albedo": 0.9}}), "assumed"),
    (plaster(assumed={"rho": guess({"rho": 0.5})}, known_excess=EXCESS), "known_excess"),
    (plaster(assumed={"rho": {"why": "a guess"}}, known_excess=EXCESS), "known_excess"),
    (plaster(refractive_index="main/Al/Rakic"), "refractive_index"),
    (cylinder(refractive_index=None), "refractive_index"),
    (cylinder(refractive_index="Al"), "refractive_index"),
    (cylinder(parameters={"sigma_0_um": 0.2, "tau_um": 3, "n": 1.5}), "n"),
    (cylinder(wavelengths_nm=[600, 500]), "wavelengths_nm"),
)


def test_a_wrong_table_is_refused_in_one_sentence_that_names_the_field():
    for table, field in (*REFUSED, (plaster(), "name")):
        name = "Wall plaster" if field == "name" else "plaster"
        with pytest.raises(MaterialError) as caught:
            Material.from_table(name, table)
        assert (caught.value.parameter, "\n" in str(caught.value)) == (field, False), table
        assert str(caught.value).startswith(f"{name}: {field}: "), table


def test_in_memory_the_units_are_those_of_the_model():
    fields = plaster(name="plaster", parameters={"rho": 0.9, "sigma": 2.0})
    with pytest.raises(ValidationError, match=r"sigma: 2 is outside \[0, 1\.5708\] rad"):
        Material.model_validate(fields)


def test_sources_and_assumptions_take_the_names_of_the_file():
    material = Material.from_table(
        "plaster", plaster(sources={"sigma_deg": "Fig. 2"}, assumed={"sigma_deg": guess({"sigma_deg": 20})})
    )
    assert material.sources == {"sigma": "Fig. 2"}
    assert list(material.assumed) == ["sigma"]
    assert material.assumed["sigma"].decides is True
