"""The computed libraries: substances, entries of n and k, finishes, and the limits of the model."""

from __future__ import annotations

import math

import numpy as np
import pytest

import brdfdb
from brdfdb.audit.model_energy import model_energy_of
from brdfdb.audit.validity import validity_of
from brdfdb.errors import ParameterError
from brdfdb.materials import PAPERS, Material, libraries, presets
from brdfdb.materials.preset_files import COMPUTED, Entry, Substance, entries
from brdfdb.refractive_indices import _optical_constants, refractive_index

# Symbols that the library must have, typed from the request of its users
ELEMENTS = {
    *("Ag", "Al", "Au", "Be", "Co", "Cr", "Cu", "Fe", "Ge", "Ir", "Mg", "Mo", "Nb", "Ni", "Pd", "Pt", "Rh", "Si"),
    *("Ta", "Ti", "V", "W", "Zn"),
}
FINISHES = {"mirror", "polished", "satin", "rough"}
COMPUTED_LIBRARIES = [name for name in libraries() if name != PAPERS]
WAVELENGTHS = {"metals": np.arange(380.0, 781.0, 10.0), "metals-infrared": np.arange(350.0, 2501.0, 50.0)}
OPAQUE = 1.0 / (4.0 * math.pi)  # least k at which light vanishes within a wavelength
SUBSTANCES = {entry.substance.symbol: entry.substance for name in COMPUTED_LIBRARIES for entry in entries(name)}
# He et al. 1991, sections 4 and 5: sigma_0 and tau [um] of samples and pictures, without the assumed ones
SIGMA_0_UM = (0.0, 0.13, 0.18, 0.20, 0.28, 0.38, 0.48, 0.58, 1.45, 1.90, 2.50)
TAU_UM = (1.2, 1.77, 2.0, 3.0, 13.2, 16.0)


def wavelengths_of(library: str, entry: Entry) -> np.ndarray:
    stated = entry.material.wavelengths_nm
    return WAVELENGTHS[library] if stated is None else np.array(stated)


def test_the_papers_stay_the_default() -> None:
    assert list(libraries()) == [PAPERS, "metals", "metals-infrared"]
    assert brdfdb.presets() == presets(PAPERS) == presets(library="papers")


def test_names_are_unique_across_libraries() -> None:
    names = [name for library in libraries() for name in presets(library)]
    assert len(names) == len(set(names))
    assert all(material.name == name for library in libraries() for name, material in presets(library).items())


def test_an_unknown_library_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ParameterError, match=r"^library: 'metal' is not one of papers, metals, metals-infrared$"):
        presets("metal")


def test_metals_and_semiconductors_have_four_finishes_each() -> None:
    opaque = [entry for entry in entries("metals") if entry.substance.kind != "dielectric"]
    by_symbol: dict[str, set[str]] = {entry.substance.symbol: set() for entry in opaque}
    for entry in opaque:
        by_symbol[entry.substance.symbol].add(entry.material.name.rpartition("-")[2])
    assert set(by_symbol) >= ELEMENTS | {"Cu70Zn30", "Cu90Zn10"}
    assert len(by_symbol) >= 24
    assert all(finishes == FINISHES for finishes in by_symbol.values())
    assert {entry.substance.symbol for entry in entries("metals")} >= {"N-BK7", "SiO2", "PMMA", "PS", "PC", "PET"}


@pytest.mark.parametrize("library", COMPUTED_LIBRARIES)
def test_every_material_says_that_it_is_computed_and_from_what(library: str) -> None:
    for entry in entries(library):
        material = entry.material
        assert material.source.startswith(COMPUTED)
        assert material.title.endswith(", computed")
        assert f"({material.refractive_index})" in material.source
        assert material.sources["refractive_index"] == entry.substance.citation
        attributes = material.attributes()
        assert COMPUTED in attributes["source"]
        assert "chosen" in attributes["parameter_sources"]["sigma_0_um"]
        assert not material.assumed
        assert material.known_excess is None


@pytest.mark.parametrize("substance", SUBSTANCES.values(), ids=SUBSTANCES)
def test_the_stated_range_is_that_of_the_entry(substance: Substance) -> None:
    low, high = _optical_constants(substance.refractive_index).get_wl_range(unit="nm")
    assert low <= substance.covers_nm[0] <= low + 0.1
    assert high - 10.0 <= substance.covers_nm[1] <= high * (1.0 + 1e-9)
    assert substance.covers_nm[1] > high - 0.1 or high > 10_000.0


@pytest.mark.parametrize("library", COMPUTED_LIBRARIES)
def test_n_and_k_exist_at_every_wavelength_and_metals_have_k(library: str) -> None:
    for entry in entries(library):
        wavelength_nm = wavelengths_of(library, entry)
        n, k = refractive_index(entry.substance.refractive_index, wavelength_nm)
        assert np.all(n > 0.0)
        assert np.all(k >= 0.0)
        if entry.substance.kind == "metal":
            assert k.min() >= OPAQUE
        low, high = WAVELENGTHS[library][[0, -1]]
        first, last = wavelength_nm[[0, -1]]
        step = WAVELENGTHS[library][1] - low
        assert first == low or first - step < entry.substance.covers_nm[0]
        assert last == high or last + step > entry.substance.covers_nm[1]


@pytest.mark.parametrize("library", COMPUTED_LIBRARIES)
def test_finishes_lie_between_the_samples_of_the_paper(library: str) -> None:
    for entry in entries(library):
        assert min(SIGMA_0_UM) <= entry.finish.sigma_0_um <= max(SIGMA_0_UM)
        assert min(TAU_UM) <= entry.finish.tau_um <= max(TAU_UM)
        assert "He et al. 1991" in entry.finish.source
    slopes = [entry.finish.sigma_0_um / entry.finish.tau_um for entry in entries(library)[:4]]
    assert slopes == sorted(slopes)


@pytest.mark.parametrize("library", COMPUTED_LIBRARIES)
def test_every_material_is_inside_the_stated_validity_at_each_wavelength(library: str) -> None:
    # Outside may be one limit only, light from below the surface, of dielectrics and of silicon, whose notes say so
    for entry in entries(library):
        wavelength_nm = wavelengths_of(library, entry)
        transparent = refractive_index(entry.substance.refractive_index, wavelength_nm)[1].min() < OPAQUE
        for at in wavelength_nm[[0, wavelength_nm.size // 2, -1]]:
            judged = validity_of(entry.material, np.array([at]))
            outside = {limit.quantity for limit in judged.limits if limit.standing != "inside"}
            assert outside <= ({"reflections but the first"} if transparent else set())
        assert validity_of(entry.material, wavelength_nm).verdict == ("outside" if transparent else "inside")
        assert transparent == (entry.substance.kind == "dielectric" or entry.substance.symbol == "Si")
        assert ("outside" in entry.material.note) == transparent


def test_limits_hold_by_their_closed_form() -> None:
    # Slope, and the rms radius of curvature of a Gaussian surface, tau^2 / (sqrt(12) sigma_0), in wavelengths
    for entry in entries("metals-infrared"):
        sigma, tau = entry.finish.sigma_0_um, entry.finish.tau_um
        assert sigma / tau <= 0.1
        assert tau**2 / (math.sqrt(12.0) * sigma) >= 10.0 * 2.5


def largest_albedo(material: Material, wavelength_nm: list[float]) -> float:
    return model_energy_of(material, np.array(wavelength_nm), None).max_albedo or math.inf


@pytest.mark.parametrize("finish", sorted(FINISHES))
def test_no_finish_lets_silver_reflect_more_than_arrives(finish: str) -> None:
    # Silver has the highest reflectance of the library, 0.997 at 2500 nm
    wavelength_nm = [350.0, 780.0, 2500.0]
    assert largest_albedo(presets("metals-infrared")[f"silver-{finish}-infrared"], wavelength_nm) < 1.0


def test_between_polished_and_satin_the_model_creates_energy() -> None:
    # The reason why metals have no finish there: silver, frosted as the dielectrics are
    silver, frosted = presets("metals")["silver-satin"], presets("metals")["n-bk7-frosted"]
    changed = silver.model_copy(update={"parameters": frosted.parameters})
    assert largest_albedo(changed, [480.0, 780.0]) == pytest.approx(1.03, abs=0.005)
    assert largest_albedo(frosted, [480.0, 780.0]) < 1.0


def test_the_notes_on_doubtful_entries_are_true() -> None:
    at = np.array([550.0])

    def reflectance(entry: str) -> float:
        n, k = refractive_index(entry, at)
        return float(((n - 1.0) ** 2 + k**2)[0] / ((n + 1.0) ** 2 + k**2)[0])

    excess = [reflectance(f"main/{s}/Werner") - reflectance(SUBSTANCES[s].refractive_index) for s in ("Mo", "Pt", "W")]
    assert [round(min(excess), 2), round(max(excess), 2)] == [0.20, 0.38]
    assert "0.20 to 0.38" in SUBSTANCES["Ta"].note
    visible = WAVELENGTHS["metals"]
    querry = refractive_index("main/Zn/Querry", visible)[0]
    assert [round(float(querry.min()), 1), round(float(querry.max()), 1)] == [9.7, 13.9]
    metals = [s for s in SUBSTANCES.values() if s.kind == "metal" and s.symbol != "Zn"]
    assert max(refractive_index(s.refractive_index, visible)[0].max() for s in metals) < 4.0
    silicon = refractive_index(SUBSTANCES["Si"].refractive_index, visible)[1]
    assert visible[silicon >= OPAQUE].max() == 450.0
    assert "From 460 nm on" in SUBSTANCES["Si"].note
