"""EXR slices: every pixel read back, orientation pinned by physical facts, attributes, failures."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from brdfdb import spectra
from brdfdb.formats import exr
from brdfdb.geometry import unit_vector
from brdfdb.tables import slices
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.places import BANDS_DEG
from brdfdb.tables.stated_error import Error, Overall

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

Floats = NDArray[Any]
Lobe = Callable[[Floats, Floats, Floats, Floats], Floats]

FLOAT32_RTOL = 2.0**-23  # closed forms against pixels, rounded once to 24 bits: worst seen 5.9e-8
RGB_RTOL = 1e-6  # a sum of 41 float32 products; worst seen 2e-7

VISIBLE_NM = np.linspace(380.0, 780.0, 41)
REDDISH = np.where(VISIBLE_NM > 600.0, 1.0, 0.125)
SLICES = (slices.half_difference_slice, slices.in_plane_slice, slices.lobe_map)
WAVELENGTHS = {
    "grey": None,
    "spectral": VISIBLE_NM,
    "one wavelength": np.array([2000.0]),
    "two wavelengths": np.array([500.0, 632.8]),
}


class FakeTable:
    """What a slice needs of a table, around a function of the four angles."""

    name = "fake-brass"
    revision = "r000003"
    digest = "0" * 64
    anisotropic = False
    specular: Floats | None = None

    def __init__(self, lobe: Lobe, wavelength_nm: Floats | None, spectrum: Floats | None) -> None:
        self.metadata = TableMetadata(model="ward", title="Fake brass")
        self.lobe = lobe
        self.wavelength_nm = wavelength_nm
        self.spectrum = spectrum
        self.error = None

    def lookup(self, theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        angles = np.broadcast_arrays(theta_i, phi_i, theta_r, phi_r)
        above = (angles[0] < np.pi / 2) & (angles[2] < np.pi / 2)
        value = np.zeros(above.shape)
        value[above] = self.lobe(*(angle[above] for angle in angles))
        return value if self.spectrum is None else value[..., np.newaxis] * self.spectrum


def table(lobe: Lobe, wavelength_nm: Floats | None = None, spectrum: Floats | None = None) -> Table:
    if wavelength_nm is not None and spectrum is None:
        spectrum = 1.0 + np.arange(wavelength_nm.size) / 8.0
    return cast("Table", FakeTable(lobe, wavelength_nm, spectrum))


def ward_like(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
    half = unit_vector(theta_i, phi_i) + unit_vector(theta_r, phi_r)
    tan2 = (half[..., 0] ** 2 + half[..., 1] ** 2) / half[..., 2] ** 2
    return np.asarray(0.1 + np.exp(-tan2 / 0.04) / np.sqrt(np.cos(theta_i) * np.cos(theta_r)))


def lobe_towards(theta: Callable[[Floats], Floats], turned_deg: float) -> Lobe:
    """A lobe about the direction `theta` of theta_i, turned by `turned_deg` about the normal from the light."""

    def lobe(theta_i: Floats, phi_i: Floats, theta_r: Floats, phi_r: Floats) -> Floats:
        axis = unit_vector(theta(theta_i), phi_i + np.deg2rad(turned_deg))
        return np.asarray(np.exp(200.0 * (np.sum(axis * unit_vector(theta_r, phi_r), axis=-1) - 1.0)))

    return lobe


MIRROR = lobe_towards(lambda theta_i: theta_i, 180.0)
RETRO = lobe_towards(lambda theta_i: theta_i, 0.0)


def read(path: Path) -> tuple[dict[str, Any], dict[str, Floats]]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return dict(file.header()), {name: channel.pixels.copy() for name, channel in file.channels().items()}


def written(
    folder: Path, source: Table, image: slices.Slice | None = None, *, half: bool = False
) -> tuple[dict[str, Any], dict[str, Floats]]:
    """Return the header and the channels of a slice, by default that of the plane of incidence, as it was written."""
    exr.write_slice(folder / "slice.exr", image or slices.in_plane_slice(source), source, half=half)
    return read(folder / "slice.exr")


def slice_of(values: Floats, wavelength_nm: Floats | None) -> slices.Slice:
    return replace(slices.in_plane_slice(table(ward_like)), values=values, wavelength_nm=wavelength_nm)


def lobe_position(image: slices.Slice) -> tuple[float, float]:
    """Where a lobe map peaks: degrees to the right of the centre, degrees upwards."""
    row, column = np.unravel_index(np.argmax(image.values), image.values.shape)
    pitch = 180.0 / 256
    return (float(column) + 0.5) * pitch - 90.0, 90.0 - (float(row) + 0.5) * pitch


# The file holds the pixels


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("make", SLICES)
@pytest.mark.parametrize("kind", WAVELENGTHS)
def test_every_pixel_of_every_channel_reads_back(
    tmp_path: Path, kind: str, make: Callable[[Table], slices.Slice], half: bool
) -> None:
    source = table(ward_like, WAVELENGTHS[kind])
    image = make(source)
    header, channels = written(tmp_path, source, image, half=half)
    if source.wavelength_nm is None:
        expected = dict.fromkeys("RGB", image.values)
    else:
        names = [f"T.{wavelength:.1f}nm".replace(".", ",").replace("T,", "T.") for wavelength in source.wavelength_nm]
        expected = {name: image.values[..., index] for index, name in enumerate(names)}
        if kind == "spectral":
            rgb = spectra.linear_srgb(source.wavelength_nm, image.values)
            expected |= {name: rgb[..., index] for index, name in enumerate("RGB")}
        else:
            mean = np.asarray(image.values, dtype=np.float64).mean(axis=-1)
            expected |= dict.fromkeys("RGB", mean.astype(np.float32))
    dtype = np.float16 if half else np.float32
    assert set(channels) == set(expected)
    for name, pixels in channels.items():
        assert pixels.dtype == dtype
        np.testing.assert_array_equal(pixels, expected[name].astype(dtype), err_msg=name)
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION


def test_a_strided_and_a_transposed_slice_are_written_right(tmp_path: Path) -> None:
    full = slices.in_plane_slice(table(ward_like, VISIBLE_NM))
    transposed = np.moveaxis(np.ascontiguousarray(np.moveaxis(full.values, -1, 0)), 0, -1)
    for values, wavelength_nm in ((full.values[..., ::2], VISIBLE_NM[::2]), (transposed, VISIBLE_NM)):
        assert not values.flags.c_contiguous
        _, channels = written(tmp_path, table(ward_like), slice_of(values, wavelength_nm))
        assert len(channels) == 3 + wavelength_nm.size
        for index, wavelength in enumerate(wavelength_nm):
            np.testing.assert_array_equal(channels[f"T.{wavelength:.0f},0nm"], values[..., index])


def test_half_clips_to_the_largest_half_and_counts(tmp_path: Path) -> None:
    values = np.array([[0.1, 65504.0, 65505.0], [1e6, np.inf, np.nan]], dtype=np.float32)
    header, channels = written(tmp_path, table(ward_like), slice_of(values, None), half=True)
    expected = np.array([[0.1, 65504.0, 65504.0], [65504.0, 65504.0, np.nan]], dtype=np.float16)
    np.testing.assert_array_equal(channels["G"], expected)
    assert header["brdf:half"] == "values above 65504 are written as 65504: 9 in all channels"  # 3 pixels in R, G, B
    header, channels = written(tmp_path, table(ward_like), slice_of(values, None))
    np.testing.assert_array_equal(channels["G"], values)
    assert "brdf:half" not in header


# Names and colour


@pytest.mark.parametrize(
    ("wavelength_nm", "names"),
    [
        ([550.0], ["T.550,0nm"]),
        ([500.0, 632.8, 2000.0], ["T.0500,0nm", "T.0632,8nm", "T.2000,0nm"]),
        ([1000.0 / 3.0], ["T.333,3333333333333nm"]),
        ([550.0, 550.25, 1e5], ["T.000550,00nm", "T.000550,25nm", "T.100000,00nm"]),
    ],
)
def test_channel_names_follow_the_spectral_layout(tmp_path: Path, wavelength_nm: list[float], names: list[str]) -> None:
    header, channels = written(tmp_path, table(ward_like, np.array(wavelength_nm)))
    assert set(channels) == {*"RGB", *names}
    assert all(re.fullmatch(r"T\.\d+,\d+nm", name) for name in names)
    assert header["spectralLayoutVersion"] == "1.0"
    assert [float(text) for text in header["brdf:wavelength_nm"].split()] == wavelength_nm


def test_channels_of_the_file_and_the_attribute_have_the_same_order(tmp_path: Path) -> None:
    """OpenEXR lists channels by name: T.1000 stood before T.950, while the attribute began with 950."""
    at = [402.5, 950.0, 1000.0, 1050.0]
    source = table(ward_like, np.array(at), np.array([0.1, 0.2, 0.3, 0.4]))
    image = slices.in_plane_slice(source)
    exr.write_slice(tmp_path / "slice.exr", image, source)
    with OpenEXR.File(str(tmp_path / "slice.exr"), separate_channels=True) as file:
        listed = [channel.name for channel in file.header()["channels"]]
        pixels = {name: channel.pixels.copy() for name, channel in file.channels().items()}
        stated = [float(text) for text in file.header()["brdf:wavelength_nm"].split()]
    # Names as the reference implementation of the layout takes them apart
    layout = re.compile(r"^T\.(\d*,?\d*([Ee][+-]?\d+)?)(Y|Z|E|P|T|G|M|k|h|da|d|c|m|u|n|p)?(m|Hz)$")
    matches = [match for name in listed if (match := layout.match(name))]
    assert [float(match[1].replace(",", ".")) for match in matches] == stated == at
    assert all(match[3] + match[4] == "nm" for match in matches)
    for index, match in enumerate(matches):
        np.testing.assert_array_equal(pixels[match[0]], image.values[..., index])


def test_equal_wavelengths_are_refused(tmp_path: Path) -> None:
    source = table(ward_like, np.array([500.0, 550.0, 550.0]))
    with pytest.raises(ValueError, match=r"channel T\.550,0nm occurs twice"):
        written(tmp_path, source)
    assert list(tmp_path.iterdir()) == []


def test_a_reddish_spectrum_is_red_and_a_flat_one_is_white(tmp_path: Path) -> None:
    header, channels = written(tmp_path, table(ward_like, VISIBLE_NM, REDDISH))
    assert header["brdf:rgb"] == "linear sRGB, D65"
    assert np.all(channels["R"] > 2.0 * channels["G"])
    assert np.all(channels["R"] > 2.0 * channels["B"])
    _, channels = written(tmp_path, table(ward_like, VISIBLE_NM, np.ones(41)))
    for name in "RGB":
        np.testing.assert_allclose(channels[name], channels["T.550,0nm"], rtol=RGB_RTOL)


@pytest.mark.parametrize("kind", ["grey", "one wavelength", "two wavelengths"])
def test_without_colour_the_file_says_so(tmp_path: Path, kind: str) -> None:
    header, _ = written(tmp_path, table(ward_like, WAVELENGTHS[kind]))
    assert header["brdf:rgb"].startswith("grey: colour was not measured")
    assert ("mean over the wavelengths" in header["brdf:rgb"]) == (kind != "grey")
    assert ("spectralLayoutVersion" in header) == (kind != "grey")


# Attributes


EXPECTED_AXES = {
    "half_difference": (("theta_h", 0.5, 89.5), ("theta_d", 0.5, 89.5), {"phi_h": "0.0", "phi_d": "90.0"}),
    "in_plane": (("signed theta_r", -89.5, 89.5), ("theta_i", 0.5, 89.5), {"phi_i": "0.0"}),
    "lobe": (
        ("-theta_r cos(phi_r - phi_i)", -89.6484375, 89.6484375),
        ("-theta_r sin(phi_r - phi_i)", -89.6484375, 89.6484375),
        {"theta_i": "45.0", "phi_i": "0.0"},
    ),
}


def test_each_kind_of_slice_has_its_attributes(tmp_path: Path) -> None:
    assert {exr.SPHERE, *EXPECTED_AXES} == set(exr.kinds)
    for kind, (x, y, fixed) in EXPECTED_AXES.items():
        exr.write(table(ward_like, VISIBLE_NM), tmp_path / f"{kind}.exr", kind=kind)
        header, channels = read(tmp_path / f"{kind}.exr")
        own = {name.removeprefix("brdf:"): value for name, value in header.items() if name.startswith("brdf:")}
        for letter, axis, direction in (("x", x, "left to right"), ("y", y, "bottom to top")):
            assert own.pop(f"{letter}_axis") == axis[0]
            assert own.pop(f"{letter}_first_last").tolist() == list(axis[1:])
            assert own.pop(f"{letter}_unit") == "degree"
            assert own.pop(f"{letter}_direction") == direction
        assert len(own.pop("description")) > 20
        assert json.loads(own.pop("record"))["audit"] == "not stated"
        assert own == {
            "material": "fake-brass",
            "revision": "r000003",
            "model": "ward",
            "title": "Fake brass",
            "quantity": "f_r",
            "unit": "1/sr",
            "dirac": "none",
            "error_p99": "not measured",
            "slice": kind,
            "rgb": "linear sRGB, D65",
            "wavelength_nm": " ".join(f"{wavelength:.1f}" for wavelength in VISIBLE_NM),
            **{f"{name}_deg": value for name, value in fixed.items()},
        }
        assert header["spectralLayoutVersion"] == "1.0"
        assert len(channels) == 44


def test_an_image_says_what_it_leaves_out_of_a_table_with_a_dirac_part(tmp_path: Path) -> None:
    source = table(ward_like)
    cast(Any, source).specular = np.array([0.25, 0.5], dtype=np.float32)
    header, _ = written(tmp_path, source, slices.lobe_map(source, theta_i_deg=0.1 + 0.2))
    sentence = "not in the file: the specular part, up to 0.5 of the light in the exact mirror direction"
    assert header["brdf:dirac"] == sentence
    assert float(header["brdf:theta_i_deg"]) == 0.1 + 0.2


def test_an_image_says_the_error_that_its_table_states(tmp_path: Path) -> None:
    numbers = [[0.01]] * 9
    overall = {"l1": 0.003, "median": 0.001, "p95": 0.006, "p99": 0.0123, "max": 0.4}
    source = table(ward_like)
    cast(Any, source).error = Error(
        theta_i_deg=BANDS_DEG.tolist(),
        directions=10,
        seed=1,
        floor=[1e-4],
        overall=Overall(**overall),
        **dict.fromkeys(overall, numbers),
    )
    header, _ = written(tmp_path, source)
    assert header["brdf:error_p99"] == "0.0123"
    stated = json.loads(header["brdf:record"])["error"]
    assert (stated["against"], stated["p98"]) == ("the model", 0.0125)  # 0.0123 / (1 - 0.0123)
    assert stated["places"]["bands"] == [0.0102] * 9


# Failures


def test_a_disk_that_fills_up_leaves_the_old_file_and_no_other(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    source = table(ward_like)
    image = slices.lobe_map(source)
    path = tmp_path / "slice.exr"
    exr.write_slice(path, image, source)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, limits[1]))
    try:
        with pytest.raises(OSError, match=r"cannot write .*slice\.exr: "):
            exr.write_slice(path, replace(image, values=image.values + 1.0), source)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before
