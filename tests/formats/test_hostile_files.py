"""Files of strangers: what is wrong is refused in a sentence that names the file, soon, and in little memory."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats import _input
from brdfdb.formats.rgl._tensors import read_tensors, write_tensors
from tests.formats.a_file import check_refused, check_texts_refused, exported
from tests.formats.small_tables import DIFFUSE, GREY, SPECTRAL

NESTED = "[" * 200_000
AXES = {"theta_i": [0.0, 90.0], "theta_r": [0.0, 90.0], "delta_phi": [0.0, 180.0]}


def archive_of(path: Path, **arrays: Any) -> Path:
    given = {**AXES, "axes": list(AXES), "brdf": np.ones((2, 2, 2)), **arrays}
    np.savez(path, **{name: array for name, array in given.items() if array is not None})
    return path


def in_text(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def in_doc(path: Path) -> None:
    before, _, rest = path.read_text(encoding="utf-8").partition('doc="')
    path.write_text(f'{before}doc="{NESTED}"{rest[rest.index(chr(34)) + 1 :]}', encoding="utf-8")


def in_audit(path: Path) -> None:
    in_text(path, "audit: ", f"audit: {NESTED}")


def rewrite(path: Path, arrays: dict[str, Any]) -> None:
    """Write a tensor file anew, of which `arrays` may be a map of memory."""
    write_tensors(path.with_suffix(".new"), arrays)
    path.with_suffix(".new").replace(path)


def in_description(path: Path) -> None:
    rewrite(path, read_tensors(path) | {"description": np.frombuffer(NESTED.encode(), np.uint8)})


def beside(path: Path) -> None:
    path.with_name(f"{path.name}.json").write_text(NESTED)


DEEP: dict[str, Callable[[Path], None]] = {
    **dict.fromkeys(("ssdd", "zemax", "klems", "csv"), in_audit),
    **dict.fromkeys(("merl", "utia", "fred"), beside),
    "materialx": in_doc,
    "rgl": in_description,
}


@pytest.mark.parametrize("name", DEEP)
def test_a_record_that_is_nested_too_deep_is_no_record(name: str, tmp_path: Path) -> None:
    path = exported(tmp_path, name, **({"data": "ascii"} if name == "ssdd" else {}))
    DEEP[name](path)
    reading = formats.read(path, name)
    assert np.all(reading.lookup(0.5, 0.0, 0.5, 1.0) > 0.0)
    assert DEEP[name] is in_audit or reading.record == {}


def test_a_text_that_is_cut_between_lights_is_not_whole(tmp_path: Path) -> None:
    path = exported(tmp_path, "fred")
    lines = path.read_text().splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if len(line.split()) == 2)
    path.write_text("".join(lines[:last]))
    check_refused(path, r"a\.fred\.txt: its record states \d+ viewers, but the file has \d+")
    path.with_name(f"{path.name}.json").unlink()
    formats.read(path)  # as a laboratory publishes it


# Tensor files


def vndf_of_zeros(arrays: dict[str, Any]) -> dict[str, Any]:
    vndf = arrays["vndf"].copy()
    vndf[0, 1] = 0.0
    return {"vndf": vndf}


TENSORS: list[tuple[Callable[[Any], dict[str, Any]], str]] = [
    (vndf_of_zeros, "'vndf' has a negative number, or a slice of zeros"),
    (lambda arrays: {"vndf": -arrays["vndf"]}, "'vndf' has a negative number"),
    (lambda arrays: {"vndf": arrays["vndf"][..., :1]}, "vndf"),
    (lambda arrays: {"sigma": arrays["sigma"] * np.float32(0.0)}, "'sigma' has the number 0"),
    (lambda arrays: {"sigma": -arrays["sigma"]}, "'sigma' has the number -"),
    (lambda arrays: {"sigma": arrays["sigma"].astype(np.float64)}, "sigma"),
    (lambda arrays: {"theta_i": np.rad2deg(arrays["theta_i"])}, r"'theta_i' is from 0 to \S+; allowed is \[0, 1.571"),
    (lambda arrays: {"theta_i": arrays["theta_i"] - np.float32(0.1)}, "'theta_i' is from -0.1 to"),
    (lambda arrays: {"theta_i": arrays["theta_i"][::-1].copy()}, "theta_i"),
    (lambda arrays: {"phi_i": arrays["phi_i"] + np.float32(90.0)}, "'phi_i' is from 90 to 90"),
    (lambda arrays: {"luminance": arrays["luminance"] * np.float32(np.nan)}, "luminance"),
    (lambda arrays: {"jacobian": np.concatenate([arrays["jacobian"]] * 2)}, "jacobian"),
]


def test_fields_of_a_tensor_file_are_there_and_in_range(tmp_path: Path) -> None:
    path = exported(tmp_path, "rgl")
    arrays = read_tensors(path)
    for change, words in TENSORS:
        rewrite(path, arrays | change(arrays))
        check_refused(path, words)
    for name in ("theta_i", "vndf", "sigma", "luminance", "jacobian"):
        rewrite(path, {key: array for key, array in arrays.items() if key != name})
        check_refused(path, name)


def test_a_density_may_be_zero_on_a_line(tmp_path: Path) -> None:
    path = exported(tmp_path, "rgl")
    arrays = read_tensors(path)
    vndf = arrays["vndf"].copy()
    vndf[..., :2, :] = 0.0
    rewrite(path, arrays | {"vndf": vndf})
    theta = np.linspace(0.0, 1.5, 400)
    assert np.all(np.isfinite(formats.read(path).lookup(theta, 0.0, theta, np.pi)))


def test_sizes_in_a_tensor_file_are_those_of_its_bytes(tmp_path: Path) -> None:
    path = exported(tmp_path, "rgl")
    whole = path.read_bytes()
    for length in (5, 12, 17, 30, 200, 400, len(whole) - 1):
        path.write_bytes(whole[:length])
        check_refused(path, "", "rgl")
    spectra = whole.index(b"spectra") + len(b"spectra") + 2 + 1 + 8
    ndf = whole.index(b"\x03\x00ndf") + 5 + 11  # behind the name, the number of axes, the type and the offset
    empty = (0).to_bytes(8, "little") + (1 << 63).to_bytes(8, "little")
    for place, number, words in (
        *((spectra, size.to_bytes(8, "little"), "spectra") for size in (2**63, 2**40, 7)),
        (ndf, empty, r"'ndf' of shape \(0, 9223372036854775808\) is empty"),
        (14, b"\xff\xff\xff\xff", "4294967295 fields"),
    ):
        path.write_bytes(whole[:place] + number + whole[place + len(number) :])
        check_refused(path, words, "rgl")


# Archives of NumPy


def test_arrays_of_an_archive_are_in_range_and_have_one_shape(tmp_path: Path) -> None:
    damages: list[tuple[dict[str, Any], str]] = [
        ({"brdf": np.full((2, 2, 2), 1e300)}, "infinite or too large for 32-bit floats"),
        ({"brdf": np.full((2, 2, 2), np.nan)}, "only holes"),
        ({"brdf": np.ones((2, 3, 2))}, r"shape \(2, 3, 2\), not numbers of shape \(2, 2, 2\)"),
        ({"brdf": np.ones((2, 2)), "axes": ["theta_i", "theta_r"]}, "grid axes"),
        ({"theta_i": np.zeros(3_000_000)}, "has 24000128 bytes"),
        ({"record": np.array(NESTED[:1000]), "axes": [*AXES, "wavelength"], "wavelength": [np.inf]}, "positive number"),
    ]
    for arrays, words in damages:
        check_refused(archive_of(tmp_path / "a.npz", **arrays), words)


def header_of(text: str) -> bytes:
    line = text.encode().ljust(118) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(line).to_bytes(2, "little") + line


def large_header() -> bytes:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": (10**12,)})
    return header.getvalue()


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (header_of("{{{{"), "it is not an archive of NumPy arrays, or is damaged"),
        (header_of("(" * 9000), "it is not an archive of NumPy arrays, or is damaged"),
        (
            header_of(f"{{'descr': '<f8', 'fortran_order': False, 'shape': (0, {10**22})}}"),
            "it is not an archive of NumPy arrays, or is damaged",
        ),
        (large_header(), "has 0 bytes"),
    ],
    ids=range(4),
)
def test_headers_of_an_archive_are_parsed_without_surprises(header: bytes, words: str, tmp_path: Path) -> None:
    path = archive_of(tmp_path / "a.npz", brdf=None)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("brdf.npy", header)
    check_refused(path, words)


def test_an_archive_may_not_be_what_was_compressed(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **AXES, axes=list(AXES), brdf=np.random.default_rng(1).random((2, 2, 2)))
    data = bytearray(path.read_bytes())
    at = data.index(b"brdf.npy") + 60
    data[at : at + 30] = b"\xff" * 30
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match="or is damaged") as caught:
        formats.read(path)
    assert isinstance(caught.value.__cause__, zlib.error | zipfile.BadZipFile)


def test_an_archive_may_be_compressed_and_by_columns(tmp_path: Path) -> None:
    path, values = tmp_path / "a.npz", np.random.default_rng(1).random((2, 2, 2))
    np.savez_compressed(path, **AXES, axes=list(AXES), brdf=np.asfortranarray(values))
    in_the_middle = formats.read(path).lookup(np.pi / 4.0, 0.0, np.pi / 4.0, np.pi)
    assert in_the_middle == pytest.approx(values[..., 1].mean(), rel=1e-6)


# Entries of texts, and units


SSDD = [
    ("WAVELENGTH_LIST nan 500 600", "field WAVELENGTH_LIST: 'nan' is not a finite number"),
    ("WAVELENGTH_LIST -5 500 600", "field WAVELENGTH_LIST: -5 is not a wavelength in nm"),
    ("WAVELENGTH_LIST 600 550 500", "field WAVELENGTH_LIST: its numbers are missing or do not increase"),
    ("WAVELENGTH_LIST abc 550 600", "field WAVELENGTH_LIST: 'abc' is not a finite number"),
    ("DATA base64", "field DATA: 'base64' is not one of binary and ascii"),
    ("PARAM0_LIST 0 45 inf", "field PARAM0_LIST: 'inf' is not a finite number"),
    ("PARAM0_LIST nan", "field PARAM0_LIST: 'nan' is not a finite number"),
    ("PARAM0_LIST -90 0 90", r"field PARAM0_LIST: it is from -90 to 90 degrees; allowed is \[0, 90\]"),
]
ZEMAX = [
    ("AngleOfIncidence 1e300", "AngleOfIncidence: '1e300' is not a number of values"),
    ("AngleOfIncidence 1.5", "AngleOfIncidence: '1.5' is not a number of values"),
]


@pytest.mark.parametrize(
    ("name", "kind", "entries", "options"), [("ssdd", SPECTRAL, SSDD, {"data": "ascii"}), ("zemax", GREY, ZEMAX, {})]
)
def test_entries_are_in_range(
    name: str, kind: str, entries: list[tuple[str, str]], options: Any, tmp_path: Path
) -> None:
    path = exported(tmp_path, name, kind, **options)
    lines = path.read_text().splitlines()
    for entry, words in entries:
        at = next(number for number, line in enumerate(lines) if line.startswith(f"{entry.split()[0]} "))
        check_texts_refused(path, {"\n".join([*lines[:at], entry, *lines[at + 1 :], ""]): words})


def test_values_of_zemax_are_of_32_bits(tmp_path: Path) -> None:
    path = exported(tmp_path, "zemax")
    head, mark, rest = path.read_text().partition("\nTIS ")
    tis, _, values = rest.partition("\n")
    path.write_text(f"{head}{mark}{tis}\n1e300 {values.partition(' ')[2]}")
    check_refused(path, r"a value exceeds 3\.40282e\+38")


def test_units_of_netcdf_count(tmp_path: Path) -> None:
    path = exported(tmp_path, "netcdf", SPECTRAL, axes="light_viewer")
    with xr.open_dataset(path, engine="scipy") as opened:
        dataset = opened.load()
    expected = formats.read(path)
    turned = dataset.assign_coords(
        wavelength=("wavelength", dataset["wavelength"].values / 1e3, {"units": "um"}),
        theta_i=("theta_i", np.deg2rad(dataset["theta_i"].values), {"units": "rad"}),
    )
    turned.to_netcdf(path, engine="scipy")
    reading = formats.read(path)
    np.testing.assert_array_equal(reading.wavelength_nm, expected.wavelength_nm)
    np.testing.assert_array_equal(reading.lookup(0.5, 0.0, 0.6, 2.0), expected.lookup(0.5, 0.0, 0.6, 2.0))
    for name, unit in (("wavelength", "eV"), ("theta_i", "gon"), ("brdf", "percent sr-1")):
        other = dataset.copy()
        other[name].attrs["units"] = unit
        other.to_netcdf(path, engine="scipy")
        check_refused(path, f"{name} has the units '{unit}'; allowed")


def test_units_of_bird_count(tmp_path: Path) -> None:
    path = exported(tmp_path, "bird", SPECTRAL)
    text = path.read_text()
    for name, unit in (("BRDF", "%/sr"), ("theta_i", "gon"), ("wavelength_i", "eV")):
        document = json.loads(text)
        document["data"][name]["unit"] = unit
        check_texts_refused(path, {json.dumps(document): f"{name}: it has the unit '{unit}'; allowed are"})


BIRD = {
    "is not JSON": lambda text: text[: len(text) // 2],
    "is not a JSON object": lambda _: "[1, 2]",
    "field data.theta_i: it is missing": lambda _: "{}",
    "BRDF: it is not a list of numbers": lambda text: text.replace('"1/sr","values":[', '"1/sr","values":["x",', 1),
}
OPENMATERIAL = {
    "is not JSON": lambda text: text[: len(text) // 2],
    "is not a JSON object": lambda _: "[1, 2]",
    "not a list of rows of five numbers": lambda _: "{}",
    r"row 1, \[5.5e-07, 0.0, 0.0, .*\], is not five finite numbers": lambda text: text.replace(
        "[5.5e-07,0.0,", "[5.5e-07,", 1
    ),
}


@pytest.mark.parametrize(("name", "damages"), [("bird", BIRD), ("openmaterial", OPENMATERIAL)])
def test_documents_have_their_lists(name: str, damages: dict[str, Callable[[str], str]], tmp_path: Path) -> None:
    path = exported(tmp_path, name, resolution=45.0)
    text = path.read_text(encoding="utf-8")
    check_texts_refused(path, [(change(text), sentence) for sentence, change in damages.items()], name)


# Files that are no files, or large


def test_what_is_no_regular_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for name in (*formats.IMPORTERS, ""):
        for path in (Path("/dev/zero"), tmp_path / "fifo"):
            check_refused(path, f"^{path}: it is not a regular file$", name)
        check_refused(tmp_path, "it is a directory, but not a zarr group", name)


def test_files_beyond_two_gigabytes_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.touch()
    os.truncate(path, (1 << 31) + 1)
    for name in formats.IMPORTERS:
        check_refused(path, "more than 2147483648 bytes", name)


def test_a_group_holds_regular_files_alone(tmp_path: Path) -> None:
    path = exported(tmp_path, "zarr", axes="light_viewer")
    assert formats.read(path).name == DIFFUSE
    metadata = path / "theta_i" / "zarr.json"
    metadata.unlink()
    metadata.symlink_to("/dev/zero")
    with pytest.raises(FileFormatError, match=r"theta_i/zarr\.json: it is not a regular file"):
        formats.read(path)


@pytest.mark.parametrize(("array", "shape"), [("theta_i", [250_000_000]), ("brdf", [30_000, 30_000, 3])])
def test_a_group_that_claims_many_nodes_is_refused_before_they_are_read(
    array: str, shape: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = exported(tmp_path, "zarr", axes="light_viewer")
    metadata = path / array / "zarr.json"
    metadata.write_text(json.dumps(json.loads(metadata.read_text()) | {"shape": shape}))
    monkeypatch.setattr(xr, "open_zarr", lambda *_, **__: pytest.fail("it is refused before xarray opens it"))
    check_refused(path, f"{array} has \\d+ numbers; at most")


@pytest.mark.parametrize("name", ["ssdd", "zemax", "csv", "fred", "astm"])
def test_a_text_ends_at_the_first_zero_byte(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_input, "_LONGEST", 1 << 16)
    path = exported(tmp_path, name)
    with path.open("r+b") as file:
        file.truncate(int(0.7 * path.stat().st_size))
        file.truncate(1 << 29)  # sparse
    check_refused(path, "zero byte")


@pytest.mark.parametrize("name", ["klems", "radiance"])
def test_a_document_is_parsed_in_pieces(name: str, tmp_path: Path) -> None:
    path = exported(tmp_path, name)
    for size, words in ((1 << 29, "it is not XML|zero byte"), ((1 << 29) + 1, "more than 536870912 bytes")):
        os.truncate(path, size)
        check_refused(path, words)


def test_xml_that_declares_entities_is_refused(tmp_path: Path) -> None:
    entities = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 12))
    bomb = f'<!DOCTYPE x [<!ENTITY e0 "aaaaaaaaaa">{entities}]><WindowElement>&e11;</WindowElement>'
    check_texts_refused(tmp_path / "bomb.xml", {bomb: "declares a document type"})


def test_every_reader_refuses_other_files_in_a_sentence(tmp_path: Path) -> None:
    for number, content in enumerate((b"", b"one two\n", b"\0" * 100, b"\x89PNG\r\n" + bytes(range(256)) * 40)):
        path = tmp_path / f"other{number}"
        path.write_bytes(content)
        for name in formats.IMPORTERS:
            check_refused(path, "", name)
    for suffix in (".csv", ".bsdf", ".xml", ".json", ".h5", ".zip", ".txt"):
        for content in (b"", b"\0" * 5000, b"\xff" * 5000, b"\xff\xfe\xff", b"theta_i,theta_r"):
            path = tmp_path / f"nothing{suffix}"
            path.write_bytes(content)
            check_refused(path, "no format recognises it")


GIGABYTE = 10**9
MOST_KB = 400_000  # of a process that imports the library and reads such a file
CODE = """
import re, sys
from pathlib import Path
from brdfdb import formats
from brdfdb.errors import FileFormatError
for text in sys.argv[1:]:
    path, _, name = text.partition("@")
    try:
        formats.samples(path, name)
    except FileFormatError as error:
        assert "\\n" not in str(error), error
        print(path, error)
# of this program alone: ru_maxrss may be that of the process that started it
print(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
"""
HEADS = {
    **{f"zeros.{suffix}": b"" for suffix in ("csv", "bsdf", "xml", "binary", "json", "h5", "zip", "npz", "bin")},
    "table.csv": b"theta_i,theta_r,delta_phi,brdf\n",
    "sheet.txt": b"sza\tvza\traa\t550nm\n1\t2\t3\t.4\n",
    "paint.bsdf": b"Source Measured\nSymmetry PlaneSymmetrical\nAngleOfIncidence 999999999\n",
    "window.xml": b'<?xml version="1.0"?><WindowElement><Optical>',
    "merl.binary": b"Z\0\0\0Z\0\0\0\xb4\0\0\0",
    "bird.json": b'{"metadata":{"type":"BRDF"',
    "network.h5": b"\x89HDF\r\n\x1a\n",
    "rgl.bsdf": b"tensor_file\0\x01\0\xff\0\0\0vndf",
    "scatter.fred.txt": b"type bsdf_data\nformat angles=deg bsdf=value scale=1\n",
    "table.ssdd": b"VERSION 0.3\n",
    "shade.dat": b"#format: theta phi DSF\n",
    "asphalt.xompt": b'{"$schema":"material_brdf_schema"',
}
BY_FORCE = ("csv", "text", "fred", "zemax", "astm", "ssdd", "rgl", "kaist", "klems", "bird", "neural", "pabopto")


def test_a_gigabyte_of_zeros_is_one_sentence_in_little_memory(tmp_path: Path) -> None:
    files = [f"{tmp_path / name}@" for name in HEADS] + [f"{tmp_path / 'zeros.csv'}@{name}" for name in BY_FORCE]
    for name, head in HEADS.items():
        with (tmp_path / name).open("wb") as file:
            file.write(head)
            file.truncate(GIGABYTE)  # which takes no room
    done = subprocess.run([sys.executable, "-c", CODE, *files], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *sentences, peak_kb = done.stdout.splitlines()
    assert len(sentences) == len(files)
    assert int(peak_kb) < MOST_KB
