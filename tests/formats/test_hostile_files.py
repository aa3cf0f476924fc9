"""Files of strangers: what is wrong is refused in a sentence that names the file, soon, and in little memory."""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats import _input
from brdfdb.formats.rgl._tensors import read_tensors, write_tensors
from tests.formats.refusals import check_refused, check_texts_refused
from tests.formats.small_tables import DIFFUSE, GREY, SPECTRAL, small_table

NESTED = "[" * 200_000
REGULAR = {"axes": "light_viewer", "resolution": 30.0}
AXES = {"theta_i": [0.0, 90.0], "theta_r": [0.0, 90.0], "delta_phi": [0.0, 180.0]}


def written(folder: Path, name: str, of: str = DIFFUSE, **options: Any) -> Path:
    return formats.write(small_table(of), folder / f"a{formats.EXPORTERS[name].suffix}", name, **options).paths[0]


def archive_of(path: Path, **arrays: Any) -> Path:
    given = {**AXES, "axes": list(AXES), "brdf": np.ones((2, 2, 2)), **arrays}
    np.savez(path, **{name: array for name, array in given.items() if array is not None})
    return path


def replaced(path: Path, old: str, new: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("ssdd", {"data": "ascii", "tolerance": 1.0}),
        ("zemax", {"tolerance": 1.0}),
        ("klems", {"kind": "quarter"}),
        ("csv", REGULAR),
        ("materialx", {}),
    ],
)
def test_a_record_that_is_nested_too_deep_is_no_record(name: str, options: dict[str, Any], tmp_path: Path) -> None:
    path = written(tmp_path, name, **options)
    if name == "materialx":
        text = path.read_text(encoding="utf-8")
        before, _, rest = text.partition('doc="')
        path.write_text(before + f'doc="{NESTED}"' + rest.partition('"')[2], encoding="utf-8")
    else:
        replaced(path, "audit: ", f"audit: {NESTED}")
    assert formats.read(path, name).lookup(0.5, 0.0, 0.5, 1.0) > 0.0


def test_a_record_in_a_field_is_no_record_if_it_is_nested_too_deep(tmp_path: Path) -> None:
    path = written(tmp_path, "rgl", tolerance=1.0, megabytes=0.1)
    arrays = read_tensors(path) | {"description": np.frombuffer(NESTED.encode(), np.uint8)}
    write_tensors(path, arrays)
    assert formats.read(path).record == {}


@pytest.mark.parametrize("name", ["merl", "utia", "fred"])
def test_a_record_beside_a_file_is_no_record_if_it_is_nested_too_deep(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, name, tolerance=1.0)
    path.with_name(f"{path.name}.json").write_text(NESTED)
    assert formats.read(path).record == {}


def test_a_text_that_is_cut_between_lights_is_not_whole(tmp_path: Path) -> None:
    path = written(tmp_path, "fred", tolerance=1.0)
    lines = path.read_text().splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if len(line.split()) == 2)
    path.write_text("".join(lines[:last]))
    with pytest.raises(FileFormatError, match=r"a\.fred\.txt: its record says \d+ viewers, and it has \d+"):
        formats.read(path)
    path.with_name(f"{path.name}.json").unlink()
    formats.read(path)  # as a laboratory publishes it


def vndf_of_zeros(arrays: dict[str, Any]) -> dict[str, Any]:
    vndf = arrays["vndf"].copy()
    vndf[0, 1] = 0.0
    return {"vndf": vndf}


def test_fields_of_a_tensor_file_are_in_range(tmp_path: Path) -> None:
    changes: list[tuple[Any, str]] = [
        (vndf_of_zeros, "'vndf' has a negative number, or a slice of zeros"),
        (lambda arrays: {"vndf": -arrays["vndf"]}, "'vndf' has a negative number"),
        (lambda arrays: {"sigma": arrays["sigma"] * np.float32(0.0)}, "'sigma' has the number 0"),
        (lambda arrays: {"sigma": -arrays["sigma"]}, "'sigma' has the number -"),
        (
            lambda arrays: {"theta_i": np.rad2deg(arrays["theta_i"])},
            r"'theta_i' is from 0 to \S+; allowed is \[0, 1.571",
        ),
        (lambda arrays: {"theta_i": arrays["theta_i"] - np.float32(0.1)}, "'theta_i' is from -0.1 to"),
        (lambda arrays: {"phi_i": arrays["phi_i"] + np.float32(90.0)}, "'phi_i' is from 90 to 90"),
    ]
    path = written(tmp_path, "rgl", tolerance=1.0, megabytes=0.1)
    arrays = read_tensors(path)
    for change, words in changes:
        write_tensors(tmp_path / "b.bsdf", arrays | change(arrays))
        check_refused(tmp_path / "b.bsdf", words)


def test_a_density_may_be_zero_on_a_line(tmp_path: Path) -> None:
    path = written(tmp_path, "rgl", tolerance=1.0, megabytes=0.1)
    arrays = read_tensors(path)
    vndf = arrays["vndf"].copy()
    vndf[..., :2, :] = 0.0
    write_tensors(path, arrays | {"vndf": vndf})
    theta = np.linspace(0.0, 1.5, 400)
    assert np.all(np.isfinite(formats.read(path).lookup(theta, 0.0, theta, np.pi)))


def test_a_field_of_no_size_has_no_shape_beyond_all_arrays(tmp_path: Path) -> None:
    path = written(tmp_path, "rgl", tolerance=1.0, megabytes=0.1)
    data = path.read_bytes()
    at = data.index(b"\x03\x00ndf") + 5 + 11  # behind the name, the number of axes, the type and the offset
    path.write_bytes(data[:at] + (0).to_bytes(8, "little") + (1 << 63).to_bytes(8, "little") + data[at + 16 :])
    with pytest.raises(FileFormatError, match=r"'ndf' of shape \(0, 9223372036854775808\) is empty"):
        formats.read(path)


def test_numbers_of_an_archive_are_in_range(tmp_path: Path) -> None:
    damages: list[tuple[dict[str, Any], str]] = [
        ({"brdf": np.full((2, 2, 2), 1e300)}, "not finite, or above those of 32 bits"),
        ({"theta_i": np.zeros(3_000_000)}, "has 24000128 bytes"),
        ({"record": np.array(NESTED[:1000]), "axes": [*AXES, "wavelength"], "wavelength": [np.inf]}, "positive number"),
    ]
    for arrays, words in damages:
        check_refused(archive_of(tmp_path / "a.npz", **arrays), words)


@pytest.mark.parametrize(
    "header", ["{{{{", "(" * 9000, f"{{'descr': '<f8', 'fortran_order': False, 'shape': (0, {10**22})}}"]
)
def test_headers_of_an_archive_are_parsed_without_surprises(header: str, tmp_path: Path) -> None:
    path = archive_of(tmp_path / "a.npz", brdf=None)
    text = header.encode().ljust(118) + b"\n"
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("brdf.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text)
    with pytest.raises(FileFormatError, match=r"a\.npz: it is no archive of NumPy arrays, or is damaged"):
        formats.read(path)


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


def test_samples_of_a_text_are_samples(tmp_path: Path) -> None:
    damages = [
        ("theta_i,theta_r,brdf\n0,-10,inf\n10,20,1\n", "line 2, field brdf: 'inf' is not a number"),
        ("theta_i,theta_r,brdf\nnan,-10,1\n10,20,1\n", "field theta_i: an angle is missing"),
        ("theta_i,theta_r,brdf\n1000,-10,1\n10,20,1\n", "theta_i of 1000 degrees is no polar angle"),
        ("theta_i,theta_r,brdf\n10,-200,1\n10,20,1\n", "theta_r of 200 degrees is no polar angle"),
        ("theta_i,theta_r,delta_phi,nannm\n10,10,0,1\n10,20,0,1\n", "is none of values"),
        ("theta_i,theta_r,delta_phi,-5nm\n10,10,0,1\n10,20,0,1\n", "-5nm: a wavelength is less than 10 nm"),
        ("theta_i,theta_r,delta_phi,-550nm\n10,10,0,1\n10,20,0,1\n", "-550nm: a wavelength is less than 10 nm"),
    ]
    check_texts_refused(tmp_path / "a.csv", damages)


def test_lists_of_ssdd_are_in_range(tmp_path: Path) -> None:
    entries = [
        ("WAVELENGTH_LIST nan 500 600", "WAVELENGTH_LIST is not of positive numbers"),
        ("WAVELENGTH_LIST -5 500 600", "WAVELENGTH_LIST is not of positive numbers"),
        ("WAVELENGTH_LIST 600 550 500", "WAVELENGTH_LIST is not of positive numbers"),
        ("WAVELENGTH_LIST abc 550 600", "wavelengths, cannot be read"),
        ("DATA base64", "DATA is 'base64'; allowed are binary and ascii"),
        ("PARAM0_LIST 0 45 inf", "PARAM0_LIST is from 0 to inf degrees"),
        ("PARAM0_LIST nan", "PARAM0_LIST is from nan to nan degrees"),
        ("PARAM0_LIST -90 0 90", r"PARAM0_LIST is from -90 to 90 degrees; allowed is \[0, 90\]"),
    ]
    path = written(tmp_path, "ssdd", SPECTRAL, data="ascii", tolerance=1.0, size=0.1)
    lines = path.read_text().splitlines()
    for entry, words in entries:
        name = entry.split()[0]
        at = next(number for number, line in enumerate(lines) if line.startswith(f"{name} "))
        check_texts_refused(path, {"\n".join([*lines[:at], entry, *lines[at + 1 :]]): words})


def test_counts_of_zemax_are_short_and_whole(tmp_path: Path) -> None:
    path = written(tmp_path, "zemax", tolerance=1.0)
    lines = path.read_text().splitlines(keepends=True)
    for count in ("1e300", "1.5"):
        changed = (f"AngleOfIncidence {count}\n" if line.startswith("AngleOfIncidence") else line for line in lines)
        check_texts_refused(path, {"".join(changed): f"AngleOfIncidence: '{count}' is no number of values"})


def test_values_of_zemax_are_of_32_bits(tmp_path: Path) -> None:
    path = written(tmp_path, "zemax", tolerance=1.0)
    head, mark, rest = path.read_text().partition("\nTIS ")
    tis, _, values = rest.partition("\n")
    path.write_text(f"{head}{mark}{tis}\n1e300 {values.partition(' ')[2]}")
    with pytest.raises(FileFormatError, match=r"a value is beyond 3\.40282e\+38"):
        formats.read(path)


def test_units_of_netcdf_count(tmp_path: Path) -> None:
    import xarray as xr

    path = written(tmp_path, "netcdf", SPECTRAL, **REGULAR)
    with xr.open_dataset(path, engine="scipy") as opened:
        dataset = opened.load()
    expected = formats.read(path)
    turned = dataset.assign_coords(
        wavelength=("wavelength", dataset["wavelength"].values / 1e3, {"units": "um"}),
        theta_i=("theta_i", np.deg2rad(dataset["theta_i"].values), {"units": "rad"}),
    )
    turned.to_netcdf(tmp_path / "b.nc", engine="scipy")
    reading = formats.read(tmp_path / "b.nc")
    np.testing.assert_array_equal(reading.wavelength_nm, expected.wavelength_nm)
    np.testing.assert_array_equal(reading.lookup(0.5, 0.0, 0.6, 2.0), expected.lookup(0.5, 0.0, 0.6, 2.0))
    for name, unit in (("wavelength", "eV"), ("theta_i", "gon"), ("brdf", "percent sr-1")):
        other = dataset.copy()
        other[name].attrs["units"] = unit
        other.to_netcdf(tmp_path / "c.nc", engine="scipy")
        with pytest.raises(FileFormatError, match=f"{name} has the units '{unit}'; allowed"):
            formats.read(tmp_path / "c.nc")


def test_units_of_bird_count(tmp_path: Path) -> None:
    path = written(tmp_path, "bird", SPECTRAL, resolution=30.0)
    text = path.read_text()
    for name, unit in (("BRDF", "%/sr"), ("theta_i", "gon"), ("wavelength_i", "eV")):
        document = json.loads(text)
        document["data"][name]["unit"] = unit
        check_texts_refused(path, {json.dumps(document): f"{name} has the unit '{unit}'; allowed are"})


def test_what_is_no_regular_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for name in (*formats.IMPORTERS, ""):
        for path in (Path("/dev/zero"), tmp_path / "fifo"):
            check_refused(path, f"^{path}: it is no regular file$", name)
        check_refused(tmp_path, "it is a directory that is no zarr group", name)


def test_files_beyond_two_gigabytes_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.touch()
    os.truncate(path, (1 << 31) + 1)
    for name in formats.IMPORTERS:
        check_refused(path, "more than 2147483648 bytes", name)


def test_a_group_holds_regular_files_alone(tmp_path: Path) -> None:
    path = written(tmp_path, "zarr", **REGULAR)
    assert formats.read(path).name == DIFFUSE
    metadata = path / "theta_i" / "zarr.json"
    metadata.unlink()
    metadata.symlink_to("/dev/zero")
    with pytest.raises(FileFormatError, match=r"theta_i/zarr\.json: it is no regular file"):
        formats.read(path)


@pytest.mark.parametrize(("array", "shape"), [("theta_i", [250_000_000]), ("brdf", [30_000, 30_000, 3])])
def test_a_group_that_claims_many_nodes_is_refused_before_they_are_read(
    array: str, shape: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import xarray as xr

    path = written(tmp_path, "zarr", **REGULAR)
    metadata = path / array / "zarr.json"
    document = json.loads(metadata.read_text())
    document["shape"] = shape
    metadata.write_text(json.dumps(document))
    monkeypatch.setattr(xr, "open_zarr", lambda *_, **__: pytest.fail("it is refused before xarray opens it"))
    with pytest.raises(FileFormatError, match=f"numbers of {array} are more than"):
        formats.read(path)


@pytest.mark.parametrize(
    ("name", "kind"), [("ssdd", GREY), ("zemax", GREY), ("csv", DIFFUSE), ("fred", DIFFUSE), ("astm", DIFFUSE)]
)
def test_a_text_ends_at_the_first_zero_byte(
    name: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_input, "_LONGEST", 1 << 16)
    path = written(tmp_path, name, kind, **(REGULAR if name == "csv" else {"tolerance": 1.0}))
    with path.open("r+b") as file:
        file.truncate(int(0.7 * path.stat().st_size))
        file.truncate(1 << 29)  # sparse
    with pytest.raises(FileFormatError, match="zero byte"):
        formats.read(path)


@pytest.mark.parametrize("name", ["klems", "radiance"])
def test_a_document_is_parsed_in_pieces(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, name)
    with path.open("r+b") as file:
        file.truncate(1 << 29)
    with pytest.raises(FileFormatError, match="it is not XML"):
        formats.read(path)
    with path.open("r+b") as file:
        file.truncate((1 << 29) + 1)
    with pytest.raises(FileFormatError, match=r"more than 536870912 bytes"):
        formats.read(path)
