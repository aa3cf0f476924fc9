"""Samples of files: the values of grids at their own directions, and those that files list."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats import zemax
from brdfdb.formats.netcdf import write_samples
from brdfdb.formats.rgl._tensors import write_tensors
from brdfdb.measurements import Instrument, Samples
from tests.formats.a_file import check_changes_refused, check_texts_refused, samples_of


def of_zemax(folder: Path, values: np.ndarray[Any, Any]) -> Samples:
    """Return samples of a Zemax file with one incidence of 60 degrees and an azimuth step of 90."""
    angles = np.zeros(1), np.array([60.0]), np.array([0.0, 90.0, 180.0]), np.array([0.0, 40.0])
    comments = ("Sample: paint", "Scatterometer: bench", "Light source: laser (650 nm, 3.5mm spot diam.)")
    tis, values = np.full((1, 1, 1), 0.1), values.reshape(1, 1, 1, 3, 2)
    with (folder / "paint.bsdf").open("wb") as stream:
        text = zemax.ZemaxText(comments, "PlaneSymmetrical", "Monochrome", "BRDF", angles, tis, values)
        zemax.write_text(stream, text)
    return formats.samples(folder / "paint.bsdf")


def test_a_grid_about_the_specular_direction_is_turned_and_loses_what_is_below_the_horizon(tmp_path: Path) -> None:
    samples = of_zemax(tmp_path, np.array([1.0, 2.0, 1.0, -3.0, 1.0, 4.0]))
    # The mirror direction stands in the file three times; 40 degrees beyond it, at azimuth 180, is below the horizon
    assert samples.record["repeated"] == 2
    assert samples.record["below_the_horizon"] == 1
    assert np.degrees(samples.theta_r) == pytest.approx(
        [60.0, 20.0, np.degrees(np.arccos(0.5 * np.cos(np.radians(40.0))))]
    )
    assert samples.values[:, 0].tolist() == [1.0, 2.0, -3.0]
    assert np.degrees(samples.phi_r[:2]) == pytest.approx([180.0, 180.0])
    assert samples.channels == ("650nm",)
    assert samples.record["notes"] == ["The wavelength 650 nm was read from the comments of the file."]
    assert samples.instrument == Instrument("bench", spot_mm=3.5)
    assert samples.record["tis"] == [[[0.1]]]


def test_negative_numbers_of_merl_files_are_holes(tmp_path: Path) -> None:
    planes = np.full((3, 90, 90, 180), -1.0)
    planes[:, 0, 10, 90] = 1500.0
    path = tmp_path / "one.binary"
    path.write_bytes(np.array([90, 90, 180], "<i4").tobytes() + planes.tobytes())
    samples = formats.samples(path)
    (row,) = np.flatnonzero(samples.known.all(axis=1))
    assert samples.values[row].tolist() == pytest.approx([1.0, 1.15, 1.66])
    half = samples.w_i[row] + samples.w_r[row]
    assert np.degrees(np.arccos(half[2] / np.linalg.norm(half))) == pytest.approx(0.25 / 90.0, abs=1e-6)
    assert np.degrees(0.5 * np.arccos(samples.w_i[row] @ samples.w_r[row])) == pytest.approx(10.5)


def test_a_dense_grid_with_holes_gives_samples(tmp_path: Path) -> None:
    axes = {"theta_i": [0.0, 60.0], "theta_r": [0.0, 60.0], "delta_phi": [0.0, 180.0]}
    values = np.arange(8.0).reshape(2, 2, 2)
    values[1, 1, 0] = np.nan
    np.savez(tmp_path / "holes.npz", **axes, axes=list(axes), brdf=values)
    samples = formats.read(tmp_path / "holes.npz")
    assert isinstance(samples, Samples)
    assert len(samples) == 8
    assert np.argwhere(~samples.known).tolist() == [[6, 0]]


def test_samples_come_back_from_the_netcdf_that_was_written_of_them(tmp_path: Path) -> None:
    samples = of_zemax(tmp_path, np.arange(1.0, 7.0))
    write_samples(samples, tmp_path / "paint.nc")
    again = formats.samples(tmp_path / "paint.nc")
    np.testing.assert_array_equal(again.values, samples.values)
    np.testing.assert_allclose(again.theta_r, samples.theta_r, rtol=1e-14)
    assert again.record["tis"] == samples.record["tis"]
    assert again.instrument == samples.instrument


def test_the_solid_angle_of_an_openmaterial_file_is_that_of_the_instrument(tmp_path: Path) -> None:
    text = (
        '{"$schema": "material_brdf_schema.json", "metadata": {"name": "asphalt", "sources": "measurement"}, "brdf": '
        '{"wavelengths": [5.5e-7], "receiverSolidAngles": [{"wavelength": 5.5e-7, "solidAngle": 0.002}], '
        '"lookupTable": [[5.5e-7, 0.1, 0.2, 0.0, 0.03], [5.5e-7, 0.2, 0.2, 0.0, -0.01]]}}'
    )
    samples = samples_of(tmp_path, text, "asphalt.xompt")
    assert samples.instrument.receiver_solid_angle_sr == 0.002
    assert samples.values.tolist() == [[0.03], [-0.01]]
    assert samples.channels == ("550nm",)


def test_null_is_a_hole_and_ubrdf_the_uncertainty_of_a_bird_file(tmp_path: Path) -> None:
    text = (
        '{"metadata": {"type":"BRDF"}, "data": {"theta_i": {"unit": "deg", "values": [10, 20]}, '
        '"phi_i": {"values": [0, 0]}, "theta_r": {"values": [5, 5]}, "phi_r": {"values": [180, 180]}, '
        '"BRDF": {"values": [0.3, null]}, "uBRDF": {"values": [0.01, 0.02]}}}'
    )
    samples = samples_of(tmp_path, text, "tile.json")
    assert samples.known[:, 0].tolist() == [True, False]
    assert samples.uncertainty is not None
    assert samples.uncertainty[:, 0].tolist() == [0.01, 0.02]


def test_the_first_element_of_mueller_matrices_is_read(tmp_path: Path) -> None:
    axes = {"phi_d": [-np.pi, 0.0, np.pi], "theta_d": [0.0, 0.5], "theta_h": [0.0, 0.3]}
    arrays: dict[str, Any] = {name: np.array([axis], np.float32) for name, axis in axes.items()}
    arrays["wvls"] = np.array([450, 550], np.uint16)
    matrix = np.full((3, 2, 2, 2, 4, 4), 7.0, np.float32)
    matrix[..., 0, 0] = np.arange(24).reshape(3, 2, 2, 2)
    matrix[0, ..., 0, 0] = matrix[2, ..., 0, 0]  # the same azimuth
    matrix[1, 1, 1] = np.nan
    write_tensors(tmp_path / "gold.pbsdf", {**arrays, "M": matrix})
    samples = formats.samples(tmp_path / "gold.pbsdf")
    assert samples.channels == ("450nm", "550nm")
    at_normal = (samples.theta_i < 1e-6) & (samples.theta_r < 1e-6)
    assert samples.values[at_normal].tolist() == [[16.0, 17.0], [8.0, 9.0]]
    far = np.flatnonzero(np.isclose(samples.theta_i, 0.2) & np.isclose(samples.theta_r, 0.8))  # phi_d of half a turn
    assert samples.values[far].tolist() == [[22.0, 23.0]]
    arrays["M"] = matrix[:2]
    write_tensors(tmp_path / "short.pbsdf", arrays)
    with pytest.raises(FileFormatError, match="field 'M' is float32 of shape"):
        formats.samples(tmp_path / "short.pbsdf")


LIGHTTOOLS = """# LightTools
Symmetry Asymmetric
SpectralContent Monochrome
ScatterAzimuth 2
90 270
ScatterRadial 2
0 30
DataBegin
AOI 20
POI 0
Side Front
Wavelength 550
ScatterType BRDF
TIS 0.25
0.1 0.2
0.1 0.4
AOI 20
POI 0
Side Back
Wavelength 550
ScatterType BRDF
TIS 0.5
9 9
9 9
DataEnd
"""


def test_the_light_of_a_lighttools_file_has_an_azimuth_of_90_degrees(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, LIGHTTOOLS, "sheet.bsdf")
    assert samples.values[:, 0].tolist() == [0.1, 0.2, 0.4]
    assert np.degrees(samples.theta_i).tolist() == pytest.approx([20.0] * 3)
    delta = np.degrees(samples.phi_r - samples.phi_i) % 360.0
    assert delta[1:] == pytest.approx([0.0, 180.0])
    assert samples.channels == ("550nm",)
    assert samples.record["tis"] == [[[0.25]]]


def test_a_damaged_lighttools_file_is_refused_with_line_and_field(tmp_path: Path) -> None:
    changes = [
        ("0.1 0.4", "0.1 x", "line 16, field TIS of block 1: 'x' is not a number"),
        ("ScatterRadial 2\n0 30", "ScatterRadial 9\n0 30", "line 8, field ScatterRadial: 'DataBegin' is not a number"),
        ("ScatterAzimuth 2", "ScatterAzimuth 99999", "line 4, field ScatterAzimuth: '99999' is not a number of values"),
        ("AOI 20\nPOI 0\nSide Front", "AOI up\nPOI 0\nSide Front", "line 14, field AOI: 'up' is not a number"),
        ("DataEnd\n", "", "field DataEnd: the file ends without it, after 2 blocks"),
        ("Side Back", "Side Front", "field AOI: 20 degrees are listed twice for 550"),
    ]
    check_changes_refused(tmp_path / "sheet.bsdf", LIGHTTOOLS, changes, "")


PABOPTO = '#sample_name "shade"\n#format: theta phi DSF\n#incident_angle 150 20\n'


def test_the_cosine_of_a_pab_opto_file_is_divided_out_and_its_back_turned(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, PABOPTO + "120 30 0.05\n60 30 0.9\n", "shade.dat")
    assert samples.name == "shade"
    assert np.degrees([samples.theta_i[0], samples.theta_r[0]]) == pytest.approx([30.0, 60.0])
    assert samples.values[:, 0] == pytest.approx([0.1])  # the other row is transmitted
    assert samples.record["below_the_horizon"] == 1
    damages = {
        PABOPTO + "120 30\n": "line 4 has 2 fields; expected are 3: theta, phi and values",
        PABOPTO + "120 30 much\n": "line 4: 'much' is not a finite number",
        PABOPTO.replace("DSF", "radiance")
        + "1 2 3\n": "field #format: 'theta phi radiance' is not theta phi and one of dsf",
        PABOPTO.replace("150 20", "150") + "1 2 3\n": "field #incident_angle",
    }
    check_texts_refused(tmp_path / "shade.dat", damages)


def test_keywords_that_a_format_does_not_have_are_refused(tmp_path: Path) -> None:
    for keywords, sentence in (
        ({"member": "x"}, r"member: the format of .* does not have this keyword"),
        ({"file_format": "text", "theta_q": "x"}, "theta_q: no format has this keyword; allowed are angles, delta_phi"),
        ({"file_format": "paper"}, "file_format: 'paper' is not one of"),
    ):
        with pytest.raises(ParameterError, match=sentence):
            samples_of(tmp_path, PABOPTO + "120 30 0.05\n", "shade.dat", **keywords)
