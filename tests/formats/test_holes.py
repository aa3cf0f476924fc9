"""Holes of files: nan from lookups and samples, and no number of a lookup has a hole as a part of it."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats._nodes import FILL_VALUES
from brdfdb.formats._readings import FileTable
from brdfdb.formats.rgl._tensors import read_tensors, write_tensors
from brdfdb.measurements.samples import Samples
from tests.formats import made_files as made
from tests.formats.a_file import exported, notes_of, read_table, samples_of
from tests.formats.round_trip import ROUND_TRIPPED

GREEN = 1


def _in_planes(shape: tuple[int, ...], head: int) -> Callable[[Path], None]:
    """Return what writes -1 into the green plane of a MERL or a UTIA file, away from its edges."""

    def plant(path: Path) -> None:
        data = bytearray(path.read_bytes())
        numbers = np.frombuffer(data, "<f8", offset=head).reshape(3, *shape)
        numbers[(GREEN, *(count // 3 for count in shape))] = -1.0
        path.write_bytes(data)

    return plant


def _in_text(pattern: str, hole: str, share: float = 0.5) -> Callable[[Path], None]:
    """Return what replaces the number in a match of a pattern, its second group, by a hole."""

    def plant(path: Path) -> None:
        text = path.read_text(encoding="utf-8")
        matches = list(re.finditer(pattern, text, re.MULTILINE))
        match = matches[int(share * len(matches))]
        path.write_text(text[: match.start(2)] + hole + text[match.end(2) :], encoding="utf-8")

    return plant


def _in_dataset(hole: float) -> Callable[[Path], None]:
    """Return what writes a hole into the middle of `brdf` of a netCDF file or a zarr group."""

    def plant(path: Path) -> None:
        zarr = path.suffix == ".zarr"
        opened = (xr.open_zarr(path, consolidated=False) if zarr else xr.open_dataset(path, engine="scipy")).load()
        opened.close()
        opened["brdf"].values[tuple(count // 2 for count in opened["brdf"].shape)] = hole
        if zarr:
            opened.to_zarr(path, mode="w", zarr_format=3, consolidated=False)
        else:
            opened.to_netcdf(path, engine="scipy", format="NETCDF3_64BIT")

    return plant


def _in_archive(path: Path) -> None:
    arrays = dict(np.load(path))
    arrays["brdf"] = arrays["brdf"].copy()
    arrays["brdf"][tuple(count // 2 for count in arrays["brdf"].shape)] = np.nan
    np.savez(path, **arrays)


def _in_bird(path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    values = document["data"]["BRDF"]["values"]
    values[len(values) // 2] = None
    path.write_text(json.dumps(document), encoding="utf-8")


def _in_openmaterial(path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    rows = document["brdf"]["lookupTable"]
    rows[len(rows) // 2][4] = -1.0
    path.write_text(json.dumps(document), encoding="utf-8")


def _in_tensors(path: Path) -> None:
    tensors = read_tensors(path)
    matrix = tensors["M"].copy()
    matrix[tuple(count // 2 for count in matrix.shape[:4])] = np.nan
    write_tensors(path, {**tensors, "M": matrix})


PLANTED: dict[str, Callable[[Path], None]] = {
    "merl": _in_planes((90, 90, 180), 12),
    "utia": _in_planes((6, 48, 6, 48), 0),
    "astm": _in_text(r"^(0\.[3-9]\d*,0,0\.[3-9]\d*,[12]\.\d*,)([\d.e+-]+)$", "-1"),
    "fred": _in_text(r"^([2-6]\d[\d.]*\t(?:9|1[0-5])\d[\d.]*\t)([\d.e+-]+)$", "-1"),
    "ssdd": _in_text(r"^()(0\.\d+)$", "-1"),
    "zemax": _in_text(r"(\s)(0\.\d+)(?=\s)", "-1", 0.7),
    "eradiate": _in_dataset(-1.0),
    "netcdf": _in_dataset(np.nan),
    "zarr": _in_dataset(np.nan),
    "numpy": _in_archive,
    "csv": _in_text(r"^([\d.]+,[\d.]+,[\d.]+,)([\d.e+-]+)$", "nan"),
    "bird": _in_bird,
    "openmaterial": _in_openmaterial,
}
# What has no place for a hole, and whose readers refuse nan: parameters of a shader, a density that is drawn from, and
# files of Radiance, where a negative number is defined to be 0
WITHOUT = {"materialx", "rgl", "klems", "radiance"}
OPTIONS: dict[str, dict[str, Any]] = {
    "ssdd": {"data": "ascii"},
    **{name: {"resolution": 0.0, "tolerance": 0.1} for name in ("netcdf", "numpy", "zarr")},  # nodes in the middle
    "zemax": {"tolerance": 0.1, "size": 4.0},
}


def holes_of(samples: Samples) -> dict[bytes, int]:
    """Return the rows of samples with a hole or a negative number, by their directions."""
    rows = np.flatnonzero(~np.all(samples.values >= 0.0, axis=1))
    directions = np.column_stack([samples.w_i, samples.w_r]).round(6) + 0.0
    return {directions[row].tobytes(): int(row) for row in rows}


def test_each_format_that_is_written_and_read_has_a_hole_here() -> None:
    assert set(ROUND_TRIPPED) == set(PLANTED) | WITHOUT | {"kaist"}


@pytest.mark.parametrize("name", PLANTED)
def test_a_hole_is_nan_and_a_part_of_no_number(name: str, tmp_path: Path) -> None:
    path = exported(tmp_path, name, **OPTIONS.get(name, {}))
    before, listed = formats.read(path, name), formats.samples(path, name)
    PLANTED[name](path)
    after, holed = formats.read(path, name), formats.samples(path, name)
    at = np.array([row for place, row in holes_of(holed).items() if place not in holes_of(listed)])
    assert 1 <= len(at) <= 4, "a number, and what it stands for on the other side"
    assert isinstance(before, FileTable)
    if isinstance(after, Samples):
        return
    found = after.lookup_vectors(holed.w_i[at], holed.w_r[at]).reshape(len(at), -1)
    assert np.all(np.isnan(found).any(axis=1)), "the lookup at the hole"
    rng = np.random.default_rng(0)
    theta_i, theta_r, phi_i, phi_r = (
        angle[at[0]] + rng.normal(0.0, 0.2, 4000) for angle in (holed.theta_i, holed.theta_r, holed.phi_i, holed.phi_r)
    )
    theta_i, theta_r = np.clip([theta_i, theta_r], 0.0, 1.55)
    around, whole = (table.lookup(theta_i, phi_i, theta_r, phi_r).reshape(4000, -1) for table in (after, before))
    holes = np.isnan(around)
    np.testing.assert_array_equal(around[~holes], whole[~holes])
    assert holes.any(axis=1).mean() < 1.0


def test_a_hole_in_a_matrix_of_polarisation_is_a_hole(tmp_path: Path) -> None:
    axes = {name: np.linspace(0.0, 1.5, 3, dtype=np.float32)[np.newaxis] for name in ("phi_d", "theta_d", "theta_h")}
    matrix = np.full((3, 3, 3, 1, 4, 4), 0.2, np.float32)
    path = tmp_path / "paint.pbsdf"
    write_tensors(path, {**axes, "wvls": np.array([550], np.uint16), "M": matrix})
    whole = formats.samples(path, "kaist")
    _in_tensors(path)
    assert len(formats.samples(path, "kaist")) == len(whole) - 1


@pytest.mark.parametrize("fill", FILL_VALUES)
def test_fill_values_of_texts_are_holes(fill: float, tmp_path: Path) -> None:
    header = "theta_i,theta_r,phi_r,brdf"
    samples = samples_of(tmp_path, f"{header}\n10,20,180,0.5\n10,30,180,{fill!r}\n10,40,180,-0.25\n")
    assert samples.values[[0, 2], 0].tolist() == [0.5, -0.25]  # noise stays
    assert np.isnan(samples.values[1, 0])
    percent = samples_of(tmp_path, f"{header} [%]\n10,20,180,50\n10,30,180,{fill!r}\n")
    assert percent.known[:, 0].tolist() == [True, False]


@pytest.mark.parametrize(
    ("attributes", "hole"),
    [({"_FillValue": np.float32(-7.0)}, -7.0), ({"missing_value": np.float32(9e9)}, 9e9), ({"valid_min": 0.0}, -0.5)],
)
def test_what_a_netcdf_file_declares_missing_is_a_hole(
    attributes: dict[str, float], hole: float, tmp_path: Path
) -> None:
    axes = {"theta_i": [0.0, 60.0], "theta_r": [0.0, 60.0], "delta_phi": [0.0, 180.0]}
    values = np.arange(1.0, 9.0, dtype=np.float32).reshape(2, 2, 2)
    values[1, 1, 0] = hole
    dataset = xr.Dataset({"brdf": (tuple(axes), values, {"units": "sr-1"} | attributes)}, axes)
    dataset.to_netcdf(tmp_path / "some.nc", engine="scipy", format="NETCDF3_64BIT")
    samples = formats.samples(tmp_path / "some.nc")
    assert np.argwhere(~samples.known).tolist() == [[6, 0]]


def test_a_direction_that_is_nan_is_nan_from_a_file(tmp_path: Path) -> None:
    reading = read_table(exported(tmp_path, "numpy"))
    assert np.isnan(reading.lookup([0.2, np.nan], 0.0, 0.3, 1.0)).tolist() == [False, True]
    assert reading.lookup(2.0, 0.0, 0.3, 1.0) == 0.0


MARKED = {
    "a.csv": made.sheet(),
    "a.txt": made.sheet("theta_i,theta_r,delta_phi,BRDF_percent"),
    "a.astm": made.astm("BRF"),
    "a.fred.txt": made.fred().replace("scale=1", "scale=0.1"),
    "a.dat": made.pabopto("DSF"),
    "a.ssdd": made.ssdd(),
    "zemax.bsdf": made.zemax(),
    "lighttools.bsdf": made.lighttools(),
    "a.json": made.bird(),
}


def _marked(content: str, words: Sequence[str]) -> str:
    """Return a text with words instead of some numbers."""
    numbers = itertools.count()
    cycle = itertools.cycle(words)
    return re.sub(r"\b0\.\d{6}\b", lambda match: match[0] if (next(numbers) + 3) % 37 else next(cycle), content)


@pytest.mark.parametrize("name", MARKED)
def test_marks_of_saturation_are_told_and_left_out_if_they_are_stated(name: str, tmp_path: Path) -> None:
    text = _marked(MARKED[name], ["65535"])
    notes = notes_of(samples_of(tmp_path, text, name))
    count = re.search(r"Saturated\? (\d) values of 65535 .*: --missing 65535 leaves them out\.", notes)
    assert count, notes
    mended = samples_of(tmp_path, text, name, missing=65535.0)
    assert (~mended.known).sum() == int(count[1])
    assert f"Holes, as was stated: {count[1]} values of 65535." in notes_of(mended)
    assert "Saturated" not in notes_of(mended)
    assert np.nanmax(mended.values) < 1.0


def test_words_that_stand_for_no_value_are_counted(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, _marked(made.sheet(), ["overflow", "#N/A", "sat", "overflow"]))
    assert (~samples.known).sum() == 4
    assert "Words read as holes: 2 of 'overflow', 1 of '#N/A', 1 of 'sat'." in notes_of(samples)
    for name, content in (("a.astm", made.astm()), ("a.csv", "theta_h,theta_d,brdf\n1,2,3\n1,2,0.300000\n")):
        with pytest.raises(FileFormatError, match=r"line \d+, field (550nm|brdf): 'overflow' is not a number"):
            samples_of(tmp_path, re.sub(r"0\.\d{6}\n", "overflow\n", content), name)


def test_a_fill_value_of_logarithms_is_a_hole(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, _marked(made.astm("log10_BRDF"), ["-999"]), "a.astm")
    assert (~samples.known).sum() == 4
