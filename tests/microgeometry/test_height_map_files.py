"""Files of height maps: the same heights from all formats, and a sentence on each file that is no height map."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.microgeometry import height_map_files
from brdfdb.microgeometry.height_map_files import MapOptions, read_heights
from tests.microgeometry.made_maps import MadeMap, sdf, write

MADE = MadeMap(nodes=(48, 40), holes=0.05)
GIVEN = MapOptions((0.5,), 0.001)
RAMP = (np.arange(48)[:, np.newaxis] * 100 + np.arange(40)).astype(np.uint16)


@pytest.mark.parametrize("suffix", ["npy", "tif", "png", "sdf"])
@pytest.mark.parametrize("step_y", [0.5, 0.8])
def test_heights_steps_and_holes_are_those_that_were_written(suffix: str, step_y: float, tmp_path: Path) -> None:
    measured = replace(MADE, step_y=step_y).measured(1)
    path = tmp_path / f"map.{suffix}"
    options = write(path, measured)
    found = read_heights(path, options)
    assert (found.step_x_um, found.step_y_um) == pytest.approx((0.5, step_y), rel=1e-12)
    assert np.array_equal(np.isnan(found.heights_um), np.isnan(measured.heights_um))
    difference = found.heights_um - measured.heights_um
    quantum = 0.5 * (options.height_um or 0.0) if suffix in ("tif", "png") else 1e-12
    assert np.nanmax(np.abs(difference - np.nanmean(difference))) <= 1.1 * quantum
    assert found.name == "map"
    assert found.holes == measured.holes


def test_a_text_with_positions_needs_a_unit_and_a_matrix_needs_lengths(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(48) * 0.5, np.arange(40) * 0.5, indexing="ij")
    path = tmp_path / "map.xyz"
    np.savetxt(path, np.column_stack([x.T.ravel(), y.T.ravel(), RAMP.T.ravel()]))
    with pytest.raises(ParameterError, match=r"unit: .* states no unit"):
        read_heights(path)
    found = read_heights(path, MapOptions(unit="nm"))
    assert found.step_x_um == pytest.approx(0.0005)
    assert np.allclose(found.heights_um, 0.001 * RAMP)
    matrix = tmp_path / "map.txt"
    np.savetxt(matrix, RAMP.T[::-1].astype(float) + 0.5)
    with pytest.raises(ParameterError, match=r"pixel_um: .* does not state the distance of its nodes"):
        read_heights(matrix)
    with pytest.raises(ParameterError, match=r"height_um: .* states no unit of its heights"):
        read_heights(matrix, MapOptions((0.5,)))
    assert np.allclose(read_heights(matrix, GIVEN).heights_um, 0.001 * (RAMP + 0.5))


def test_a_microscope_file_with_several_channels(tmp_path: Path) -> None:
    gwy = tmp_path / "map.gwy"
    gwy.write_bytes(
        gwyddion({"Error": ("V", 2.0 * RAMP), "Height": ("m", 1e-9 * RAMP), "Height retrace": ("m", 2e-9 * RAMP)})
    )
    found = read_heights(gwy)
    assert np.allclose(found.heights_um, 1e-3 * RAMP)
    assert "channel 'Height' was read; other channels of heights: Height retrace" in found.notes[0]
    assert np.allclose(read_heights(gwy, MapOptions(channel="Height retrace")).heights_um, 2e-3 * RAMP)
    with pytest.raises(ParameterError, match="channel: 'Phase' is not one of Height, Height retrace"):
        read_heights(gwy, MapOptions(channel="Phase"))
    gwy.write_bytes(gwyddion({"Error": ("V", 2.0 * RAMP)}))
    with pytest.raises(FileFormatError, match="the file has no channel of heights"):
        read_heights(gwy)


def x3p(z: np.ndarray, step_um: float) -> bytes:
    """Return a file of ISO 25178-72 with heights [um], whose first index runs along x."""
    axis = "<{0}><AxisType>{1}</AxisType><DataType>D</DataType><Increment>{2}</Increment><Offset>0</Offset></{0}>"
    step = step_um * 1e-6
    axes = axis.format("CX", "I", step) + axis.format("CY", "I", step) + axis.format("CZ", "A", 1)
    size = "<SizeX>{}</SizeX><SizeY>{}</SizeY><SizeZ>1</SizeZ>".format(*z.shape)
    document = (
        '<?xml version="1.0" encoding="UTF-8"?><p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2">'
        f"<Record1><Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType><Axes>{axes}</Axes></Record1>"
        "<Record2><Date>2026-01-01T00:00:00</Date></Record2>"
        f"<Record3><MatrixDimension>{size}</MatrixDimension>"
        "<DataLink><PointDataLink>bindata/data.bin</PointDataLink></DataLink></Record3></p:ISO5436_2>"
    )
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("main.xml", document)
        archive.writestr("bindata/data.bin", np.ascontiguousarray(1e-6 * z.T).astype("<f8").tobytes())
    return packed.getvalue()


@pytest.mark.parametrize("name", ["npy", "txt", "csv", "semicolon.csv", "tif", "png", "gwy", "sdf", "x3p"])
def test_directions_are_the_same_in_all_formats(name: str, tmp_path: Path) -> None:
    # heights rise by 3 along x and by 1 along y, and a ridge is at the largest x and y
    x, y = np.meshgrid(np.arange(48.0), np.arange(40.0), indexing="ij")
    z = 3.0 * x + y
    z[40:, 35:] += 100.0
    rows = z.T[::-1]  # as one sees it: the first row is the uppermost
    path = tmp_path / f"map.{name}"
    given = MapOptions((0.5,), 1.0)
    match name:
        case "npy":
            np.save(path, rows)
        case "txt":
            np.savetxt(path, rows, header="heights")
        case "csv":
            np.savetxt(path, rows, delimiter=",", header="heights")
        case "semicolon.csv":
            np.savetxt(path, rows, delimiter=";")
        case "tif":
            tifffile.imwrite(path, rows.astype(np.uint16))
        case "png":
            Image.fromarray(rows.astype(np.uint16)).save(path)
        case "gwy":
            path.write_bytes(gwyddion({"Height": ("m", 1e-6 * z)}))
            given = MapOptions()
        case "sdf":
            path.write_bytes(sdf(z, 0.5, 0.5))
            given = MapOptions()
        case "x3p":
            path.write_bytes(x3p(z, 0.5))
            given = MapOptions()
    found = read_heights(path, given)
    assert np.allclose(found.heights_um, z)
    assert (found.step_x_um, found.step_y_um) == pytest.approx((0.5, 0.5))
    assert found.axes == ("x and y of the file" if name in ("sdf", "x3p") else height_map_files.ROWS)


# Arrays in archives, and microscopes whose files are TIFF files


def test_an_archive_has_the_axes_of_an_array_and_names_for_channels(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    np.savez(path, heights=RAMP.T[::-1], twice=2.0 * RAMP.T[::-1], line=RAMP[0])
    found = read_heights(path, MapOptions((0.5, 0.8), 0.001))
    assert np.allclose(found.heights_um, 0.001 * RAMP)
    assert (found.step_x_um, found.step_y_um) == (0.5, 0.8)
    assert found.notes == ("channel 'heights' was read; other channels of heights: twice",)
    assert np.allclose(read_heights(path, MapOptions((0.5,), 0.001, channel="twice")).heights_um, 0.002 * RAMP)
    with pytest.raises(ParameterError, match="channel: 'phase' is not one of heights, twice"):
        read_heights(path, MapOptions((0.5,), 0.001, channel="phase"))


def lext(z_pm: np.ndarray, step_pm: int) -> bytes:
    """Return a file of an Olympus LEXT microscope: an overview with XML in its tags, and a page of heights [pm]."""
    axes = "".join(f"<HeightDataUnit{axis}>-12</HeightDataUnit{axis}>" for axis in "XYZ")
    axes += "".join(
        f"<HeightDataPerPixel{a}>{n}</HeightDataPerPixel{a}>" for a, n in zip("XYZ", (step_pm,) * 2 + (1,), strict=True)
    )
    calibration = "".join(f"<MakerCalibrationValue{axis}>1e6</MakerCalibrationValue{axis}>" for axis in "XYZ")
    exif = f"<ExifTagDescData><ImageCommonSettingsInfo>{calibration}</ImageCommonSettingsInfo></ExifTagDescData>"
    overview = f"<TiffTagDescData><HeightInfo>{axes}</HeightInfo></TiffTagDescData>"
    content = b"II*\0" + struct.pack("<I", 0)
    link = 4  # where the position of the next page stands
    for description, settings in ((overview, exif), ("HEIGHT", "")):
        rows = np.ascontiguousarray(z_pm.T[::-1]).astype("<u2")
        text = description.encode() + b"\0"
        place = len(content)
        content += rows.tobytes() + text + b"\0" * (len(text) % 2)
        tags = [(256, 3, 1, rows.shape[1]), (257, 3, 1, rows.shape[0]), (258, 3, 1, 16), (259, 3, 1, 1), (262, 3, 1, 1)]
        tags += [(270, 2, len(text), place + rows.nbytes), (273, 4, 1, place), (277, 3, 1, 1)]
        tags += [(278, 3, 1, rows.shape[0]), (279, 4, 1, rows.nbytes)]
        if settings:
            text = settings.encode() + b"\0"
            start = len(content) + len(text) + len(text) % 2
            content += text.ljust(start - len(content), b"\0")
            content += struct.pack("<HHHIII", 1, 41995, 2, len(text), start - len(text) - len(text) % 2, 0)
            tags.append((34665, 4, 1, start))
        content = content[:link] + struct.pack("<I", len(content)) + content[link + 4 :]
        content += struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", *tag) for tag in tags)
        link = len(content)
        content += struct.pack("<I", 0)
    return content


def jpk(path: Path, z_um: np.ndarray, step_um: float) -> None:
    """Write an image scan of a JPK microscope: a thumbnail, and a page of 32-bit numbers with their scale."""
    nx, ny = z_um.shape
    size = [(0x8042, "d", 1, 1e-6 * step_um * nx, True), (0x8043, "d", 1, 1e-6 * step_um * ny, True)]
    size += [(0x8003, "s", 0, "2026-01-01 12:00:00.000 GMT", True)]
    scale = [(0x8050, "s", 0, "height", True), (0x8051, "q", 1, 0, True), (0x8052, "s", 0, "Height", True)]
    scale += [(0x8080, "I", 1, 1, True), (0x8081, "s", 0, "nominal", True), (0x8090, "s", 0, "nominal", True)]
    scale += [(0x80A2, "s", 0, "m", True), (0x80A3, "s", 0, "LinearScaling", True)]
    scale += [(0x80A4, "d", 1, 1e-9, True), (0x80A5, "d", 1, 5e-6, True)]
    numbers = np.rint((z_um - 5.0) / 1e-3).astype(np.int32)
    with tifffile.TiffWriter(path) as file:
        file.write(np.zeros((8, 8), np.uint8), extratags=size, metadata=None)
        # the first line of a scan is the lowest
        file.write(np.ascontiguousarray(numbers.T), extratags=scale, metadata=None)


def park(path: Path, z_um: np.ndarray, step_um: float) -> None:
    """Write a file of a Park Systems microscope: a picture in colour, and heights and their header in tags."""

    def text(words: str, count: int) -> bytes:
        return words.encode("utf-16-le").ljust(2 * count, b"\0")

    nx, ny = z_um.shape
    head = struct.pack("<I", 0) + text("Z Height", 32) + text("", 8)
    head += struct.pack("<dIIIIdIdIII", 0.0, 0, 0, nx, ny, 0.0, 0, 0.0, 1, 1, 0)
    head += struct.pack("<6d", step_um * nx, step_um * ny, 0.0, 0.0, 1.0, 0.0) + text("", 8)
    head += struct.pack("<5d", 0.0, 0.0, 1.0, 1e-3, 5.0) + text("um", 8) + struct.pack("<3i3I", 0, 0, 0, 0, 0, 0)
    # the first line of a scan is the lowest
    data = np.rint((z_um - 5.0) / 1e-3).astype("<i2").T.tobytes()
    tags = [(50432, "I", 1, 0x0E031301, True), (50433, "I", 1, 0x1000001, True)]
    tags += [(50434, "B", len(data), data, True), (50435, "B", len(head), head, True)]
    tifffile.imwrite(path, np.zeros((16, 16, 3), np.uint8), photometric="rgb", extratags=tags, metadata=None)


@pytest.mark.parametrize("name", ["lext", "jpk", "tiff"])
def test_microscopes_that_write_tiff_files(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"map.{name}"
    if name == "lext":
        path.write_bytes(lext(RAMP, 500_000))
        unit_um = 1e-6
    else:
        (jpk if name == "jpk" else park)(path, 0.001 * RAMP, 0.5)
        unit_um = 1e-3
    found = read_heights(path)
    assert np.allclose(found.heights_um, unit_um * RAMP, rtol=1e-9)
    assert (found.step_x_um, found.step_y_um) == pytest.approx((0.5, 0.5))
    assert found.axes == height_map_files.ROWS
    with pytest.raises(ParameterError, match=r"pixel_um: .* states its own pixel size"):
        read_heights(path, GIVEN)


def test_suffixes_that_sentences_and_pages_name_are_those_of_readers() -> None:
    readers = pytest.importorskip("SurfaceTopography.IO").readers
    read = [kind for kind in readers if kind.format() not in height_map_files._LEFT_OUT]
    known = {suffix for kind in read for suffix in kind.file_extensions()}
    assert set(height_map_files.SUFFIXES) <= known
    page = Path(__file__).parents[2] / "docs/tutorials/height-maps.md"
    named = set(re.findall(r"\.([a-z][a-z0-9]+)\b", page.read_text("utf-8").split("\n## Files\n")[1].split("\n## ")[0]))
    assert named >= set(height_map_files.SUFFIXES)
    assert named <= known | {"npy"}


# Facts that pictures state


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_picture_is_turned_as_its_tag_says(orientation: int, tmp_path: Path) -> None:
    # TIFF 6.0, Orientation: the sides of the picture where row 0 and column 0 are stored
    row_side, column_side = [
        *(("top", "left"), ("top", "right"), ("bottom", "right"), ("bottom", "left")),
        *(("left", "top"), ("right", "top"), ("right", "bottom"), ("left", "bottom")),
    ][orientation - 1]
    seen = RAMP.T[::-1]  # 40 rows from above
    height, width = seen.shape
    place = {
        "top": lambda n: n,
        "bottom": lambda n: height - 1 - n,
        "left": lambda n: n,
        "right": lambda n: width - 1 - n,
    }
    upright = row_side in ("top", "bottom")
    stored = np.empty(seen.shape if upright else seen.shape[::-1], np.uint16)
    for row in range(stored.shape[0]):
        for column in range(stored.shape[1]):
            first, second = place[row_side](row), place[column_side](column)
            stored[row, column] = seen[first, second] if upright else seen[second, first]
    path = tmp_path / "map.tif"
    tifffile.imwrite(path, stored, extratags=[(274, "H", 1, orientation, True)])
    found = read_heights(path, GIVEN)
    assert np.allclose(found.heights_um, 0.001 * RAMP)
    assert len(found.notes) == (orientation != 1)


@pytest.mark.parametrize(
    ("options", "notes"),
    [
        ({}, []),
        ({"photometric": "miniswhite"}, ["the file states that 0 is white (WhiteIsZero)"]),
        ({"resolution": (20_000, 20_000), "resolutionunit": "CENTIMETER"}, []),
        (
            {"resolution": (20_000, 10_000), "resolutionunit": "CENTIMETER"},
            ["the file states pixels of 0.5 x 1 um by its X- and YResolution, which differ from pixel_um, 0.5 x 0.5"],
        ),
        ({"resolution": (72, 72), "resolutionunit": "INCH"}, ["the file states pixels of 352.8 x 352.8 um"]),
        ({"imagej": True, "resolution": (2, 2), "metadata": {"unit": "um"}}, []),
        (
            {"imagej": True, "resolution": (2, 2), "metadata": {"unit": "nm", "spacing": 0.7}},
            ["ImageJ states spacing = 0.7, which is not used", "the file states pixels of 0.0005 x 0.0005 um"],
        ),
        (
            {"extratags": [(42113, "s", 0, "100", True)]},
            ["the number 100 is a hole, as the file states by GDAL_NODATA"],
        ),
    ],
)
def test_what_a_tiff_file_states_is_said(options: dict[str, Any], notes: list[str], tmp_path: Path) -> None:
    path = tmp_path / "map.tif"
    tifffile.imwrite(path, RAMP.T[::-1], **{"photometric": "minisblack", **options})
    found = read_heights(path, GIVEN)
    assert len(found.notes) == len(notes)
    for note, words in zip(found.notes, notes, strict=True):
        assert note.startswith(words)
    assert found.holes == any("is a hole" in note for note in notes)
    assert np.nanmax(np.abs(found.heights_um - 0.001 * RAMP)) < 1e-9
    assert found.step_x_um == 0.5
    if options.get("resolution") == (20_000, 20_000):
        with pytest.raises(ParameterError, match=r"states pixels of 0\.5 x 0\.5 um by its X- and YResolution"):
            read_heights(path, MapOptions(height_um=1.0))


def test_what_a_png_file_states_is_said(tmp_path: Path) -> None:
    path = tmp_path / "map.png"
    Image.fromarray(np.ascontiguousarray(RAMP.T[::-1])).save(path, dpi=(25_400, 25_400), transparency=100)
    found = read_heights(path, GIVEN)
    assert found.notes[0].startswith("the file states pixels of 1 x 1 um by its pHYs, which differ from pixel_um")
    assert found.notes[1] == "the number 100 is a hole, as the file states by tRNS"
    assert np.argwhere(np.isnan(found.heights_um)).tolist() == [[1, 0]]


@pytest.mark.parametrize("suffix", ["npy", "tif", "png"])
@pytest.mark.parametrize(
    ("options", "parameter", "sentence"),
    [
        (MapOptions(), "pixel_um", "does not state the distance of its nodes; give it in um"),
        (MapOptions((0.5,)), "height_um", "does not state the height of the number 1; give it in um"),
        (MapOptions((0.5,), 0.001, unit="nm"), "unit", "give pixel_um and height_um instead"),
        (MapOptions((0.5,), 0.001, channel="Height"), "channel", "has a single map"),
    ],
)
def test_arrays_and_pictures_need_lengths(
    suffix: str, options: MapOptions, parameter: str, sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / f"map.{suffix}"
    write(path, MADE.measured(0))
    with pytest.raises(ParameterError, match=sentence) as found:
        read_heights(path, options)
    assert found.value.parameter == parameter


@pytest.mark.parametrize(
    ("options", "parameter"),
    [(MapOptions((0.5,)), "pixel_um"), (MapOptions(height_um=0.001), "height_um"), (MapOptions(unit="nm"), "unit")],
)
def test_lengths_that_the_file_states_are_refused(options: MapOptions, parameter: str, tmp_path: Path) -> None:
    path = tmp_path / "map.sdf"
    write(path, MADE.measured(0))
    with pytest.raises(ParameterError, match="leave") as found:
        read_heights(path, options)
    assert found.value.parameter == parameter


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"pixel_um": (0.0,)}, r"pixel_um: 0 um is outside \[1e-06, 1e\+09\] um"),
        ({"pixel_um": (1.0, 1.0, 1.0)}, "pixel_um: 3 numbers are given; allowed are 1 or 2"),
        ({"height_um": float("nan")}, r"height_um: nan um is outside \[1e-15, 1e\+09\] um"),
        ({"unit": "inch"}, "unit: 'inch' is not one of m, mm, um"),
    ],
)
def test_options_are_checked(given: dict[str, object], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        MapOptions(**given)  # type: ignore[arg-type]


def written(folder: Path, kind: str) -> Path:
    """Write a file that is no height map."""
    path = folder / kind
    small = RAMP[:20]
    match kind:
        case "8-bit.png":
            Image.fromarray((RAMP // 256).astype(np.uint8)).save(path)
        case "colour.png":
            Image.fromarray(np.zeros((40, 48, 3), np.uint8)).save(path)
        case "8-bit.tif":
            tifffile.imwrite(path, (RAMP // 256).astype(np.uint8))
        case "colour.tif":
            tifffile.imwrite(path, np.zeros((40, 48, 3), np.uint16), photometric="rgb")
        case "pages.tif":
            tifffile.imwrite(path, np.zeros((2, 40, 48), np.uint16), photometric="minisblack")
        case "small.npy":
            np.save(path, small)
        case "line.npy":
            np.save(path, RAMP[:, 0])
        case "bytes.npy":
            np.save(path, RAMP.astype(np.uint8))
        case "bytes.npz":
            np.savez(path, RAMP.astype(np.uint8))
        case "truncated.npz":
            np.savez(folder / "map.npz", RAMP)
            path.write_bytes((folder / "map.npz").read_bytes()[:2000])
        case "small.sdf":
            path.write_bytes(sdf(small.astype(float), 0.5, 0.5))
        case "truncated.npy" | "truncated.png" | "truncated.tif" | "truncated.sdf":
            whole = folder / f"map.{path.suffix[1:]}"
            write(whole, MADE.measured(0))
            path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
        case "zero.sdf":
            path.write_bytes(sdf(RAMP.astype(float), 0.0, 0.5))
        case "noise.bin":
            path.write_bytes(np.random.default_rng(0).bytes(2 * 50 * 50))
        case "empty.sdf":
            path.write_bytes(b"")
        case "circle.tif":  # a page without tags, followed by itself
            path.write_bytes(b"II*\0" + struct.pack("<IHI", 8, 0, 8))
        case "circle-of-two.tif":
            path.write_bytes(b"MM\0*" + struct.pack(">IHIHI", 8, 0, 14, 0, 8))
        case "imagej.tif":
            tifffile.imwrite(path, RAMP.T, description="ImageJ=1.54f\nimages=3\n", metadata=None)
        case "tag.tif":  # a type of field that does not exist, of the last tag: Software
            tifffile.imwrite(path, RAMP.T)
            content = path.read_bytes()
            tag = content.index(struct.pack("<HH", 305, 2))
            path.write_bytes(content[: tag + 2] + b"\x99\0" + content[tag + 4 :])
        case "negative.npy":
            whole = folder / "map.npy"
            np.save(whole, RAMP)
            path.write_bytes(whole.read_bytes().replace(b"(48, 40)", b"(48, -4)"))
        case "high.npy":
            np.save(path, 1e300 * RAMP)
        case "low.npy":
            np.save(path, 1e-300 * RAMP)
        case "holes.npy":
            np.save(path, np.full((48, 40), np.nan))
        case "words.csv":
            path.write_text("1,2,3,4,5\n1,2,three,4,5\n")
        case "text.txt":
            path.write_text("a plate of brass\n")
    return path


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        ("8-bit.png", "the picture has 8 bits; heights need a grey picture of 16 bits"),
        ("colour.png", "the picture is in colour; heights need a grey picture"),
        ("8-bit.tif", "the picture has 8 bits; heights need a grey picture of 16 bits"),
        ("colour.tif", "the picture is in colour; heights need a grey picture"),
        (
            "pages.tif",
            r"the file has 2 pictures, and is not of a microscope .*; export the heights as a single picture",
        ),
        ("bytes.npz", "numbers of type uint8 are no heights"),
        ("truncated.npz", "no reader recognises the file as a height map"),
        ("small.npy", "40 x 20 heights are too few; at least 32 x 32 are needed"),
        ("small.sdf", "20 x 40 heights are too few; at least 32 x 32 are needed"),
        ("line.npy", r"an array of shape \(48,\) is no map of heights"),
        ("bytes.npy", "numbers of type uint8 are no heights"),
        ("truncated.npy", "the array cannot be read"),
        ("truncated.png", "the picture cannot be read"),
        ("truncated.tif", "the picture cannot be read"),
        ("truncated.sdf", "the heights cannot be read"),
        ("zero.sdf", "the file states a map of 0 x 20, which is no area"),
        ("circle.tif", "its pages follow each other in a circle"),
        ("circle-of-two.tif", "its pages follow each other in a circle"),
        ("imagej.tif", "the file has 3 pictures"),
        ("tag.tif", "its header is damaged"),
        ("negative.npy", "the array cannot be read"),
        ("high.npy", r"heights reach 4\.74e\+300 um, more than the 1e\+09 um that are allowed"),
        ("low.npy", r"heights differ by 4\.74e-300 um, less than the 1e-09 um that are allowed"),
        ("holes.npy", "all heights are holes"),
        ("words.csv", "the table cannot be read .*three"),
        ("noise.bin", "no reader recognises the file as a height map"),
        ("empty.sdf", "empty.sdf: the file is empty"),
        ("text.txt", "line 1 is no row of numbers: 'a plate of brass'; allowed are numbers with commas"),
    ],
)
def test_files_that_are_no_height_maps_are_a_sentence(kind: str, sentence: str, tmp_path: Path) -> None:
    path = written(tmp_path, kind)
    options = MapOptions() if path.suffix == ".sdf" else GIVEN
    with pytest.raises(FileFormatError, match=sentence) as found:
        read_heights(path, options)
    assert str(found.value).startswith(f"{path}: ")
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("suffix", ["npy", "tif", "png", "sdf"])
def test_maps_that_need_more_memory_are_refused_before_they_are_read(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(height_map_files, "MEMORY_GB", 1e-4)  # 1000 heights
    path = tmp_path / f"map.{suffix}"
    options = write(path, MADE.measured(0))
    with pytest.raises(FileFormatError, match=r"48 x 40 heights need 0\.000221 GB of memory, more than the 0\.0001 GB"):
        read_heights(path, options)


def test_files_that_are_too_large_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.bin"
    with path.open("wb") as file:
        file.truncate(1_200_000_000)
    with pytest.raises(FileFormatError, match=r"1\.2 GB are more than the 1 GB that are allowed"):
        read_heights(path)


def test_a_missing_file_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_heights(tmp_path / "none.sdf")


def gwyddion(channels: dict[str, tuple[str, np.ndarray]]) -> bytes:
    """Return a file of Gwyddion (.gwy), as its documentation describes it, with channels of heights [m] and others."""

    def component(name: str, kind: str, data: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + data

    def obj(name: str, data: bytes) -> bytes:
        return name.encode() + b"\0" + len(data).to_bytes(4, "little") + data

    def unit(text: str) -> bytes:
        return obj("GwySIUnit", component("unitstr", "s", text.encode() + b"\0"))

    content = b""
    for number, (title, (z_unit, values)) in enumerate(channels.items()):
        nx, ny = values.shape
        data = np.ascontiguousarray(values.T[::-1]).astype("<f8")  # "from top to bottom and from left to right"
        field = obj(
            "GwyDataField",
            component("xres", "i", nx.to_bytes(4, "little"))
            + component("yres", "i", ny.to_bytes(4, "little"))
            + component("xreal", "d", np.float64(0.5e-6 * nx).tobytes())
            + component("yreal", "d", np.float64(0.5e-6 * ny).tobytes())
            + component("si_unit_xy", "o", unit("m"))
            + component("si_unit_z", "o", unit(z_unit))
            + component("data", "D", data.size.to_bytes(4, "little") + data.tobytes()),
        )
        content += component(f"/{number}/data", "o", field)
        content += component(f"/{number}/data/title", "s", title.encode() + b"\0")
    return b"GWYP" + obj("GwyContainer", content)
