"""Tensor files of RGL: what Mitsuba's `measured` makes of them, and what damaged ones are told."""

from __future__ import annotations

import os
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats import rgl
from brdfdb.formats._stated_error import Comparison
from brdfdb.formats.rgl._fields import MixedSlices, Warp, fields_of
from brdfdb.formats.rgl._tensors import read_tensors, write_tensors
from brdfdb.geometry import unit_vector
from brdfdb.tables.albedo import directional_albedo
from tests.formats.a_file import random_pairs, read_table
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, SPECTRAL, WAVELENGTHS_NM, small_table

# Mitsuba computes in float32; the largest relative difference of f_r measured is 9e-5, where rows of a warp are dark
FLOAT32 = 3e-4
# Mean weight of Mitsuba's samples over the albedo, less 1; measured 0.0035, at 80 degrees
FURNACE = 0.005
# Standard deviation of a sample over the mean, at the first of three wavelengths that share it; measured 0.21
NOISE = 0.25
LIGHTS_DEG = np.array([0.0, 40.0, 75.0])
LOOSE, MEGABYTES = 0.03, 4.0  # tolerance and size of the files of these tests

Array = NDArray[Any]

KINDS = (GREY, ANISOTROPIC, DIFFUSE, SPECTRAL)


def mitsuba_of(variant: str) -> Any:
    mitsuba = pytest.importorskip("mitsuba")
    if variant not in mitsuba.variants():
        pytest.skip(f"mitsuba without {variant}")
    mitsuba.set_variant(variant)
    return mitsuba


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A spectral file of each kind of table."""
    folder = tmp_path_factory.mktemp("rgl")
    paths = {kind: folder / f"{kind}.bsdf" for kind in KINDS}
    for kind, path in paths.items():
        rgl.write(small_table(kind), path, tolerance=LOOSE, megabytes=MEGABYTES, verdict="passed")
    return paths


def seen_by_mitsuba(path: Path, variant: str, wi: Array, wr: Array, wavelength_nm: Array | None) -> Array:
    """f_r that Mitsuba makes of a file: its spectral variants look at four wavelengths at once."""
    mitsuba = mitsuba_of(variant)
    surface = mitsuba.load_dict({"type": "measured", "filename": str(path)})
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    if wavelength_nm is not None:
        interaction.wavelengths = wavelength_nm.tolist()
    values = []
    for light, viewer in zip(wi.tolist(), wr.tolist(), strict=True):
        interaction.wi = mitsuba.Vector3f(*light)
        values.append(np.array(surface.eval(context, interaction, mitsuba.Vector3f(*viewer))) / viewer[2])
    return np.array(values)


@pytest.mark.judge
@pytest.mark.parametrize("kind", KINDS)
def test_values_are_those_of_mitsuba(written: dict[str, Path], kind: str) -> None:
    wi, wr = random_pairs(400)
    ours = read_table(written[kind])
    at = ours.wavelength_nm
    wavelengths = np.full(4, 300.0) if at is None else np.array([*at, 900.0])  # beyond the last: its values
    theirs = seen_by_mitsuba(written[kind], "scalar_spectral", wi, wr, wavelengths)
    values = ours.evaluate(wi, wr)
    np.testing.assert_allclose(theirs, values[:, [0, 0, 0, 0] if at is None else [0, 1, 2, 2]], rtol=FLOAT32, atol=1e-6)


@pytest.mark.judge
def test_rgb_files_are_those_of_mitsuba(tmp_path: Path) -> None:
    table, path = small_table(SPECTRAL), tmp_path / "rgb.bsdf"
    files = rgl.write(table, path, kind="rgb", tolerance=LOOSE, megabytes=MEGABYTES)
    assert "of the spectrum: linear sRGB under D65" in files.remarks
    ours = read_table(path)
    assert ours.channels == ("R", "G", "B")
    wi, wr = random_pairs(200)
    theirs = seen_by_mitsuba(path, "scalar_rgb", wi, wr, None)
    np.testing.assert_allclose(theirs, ours.evaluate(wi, wr), rtol=FLOAT32, atol=1e-6)
    grey = tmp_path / "grey.bsdf"
    rgl.write(small_table(DIFFUSE), grey, kind="rgb", tolerance=LOOSE)
    spectra = read_tensors(grey)["rgb"]
    assert spectra.shape[2] == 3
    np.testing.assert_array_equal(spectra[:, :, 0], spectra[:, :, 2])


@pytest.mark.judge
@pytest.mark.parametrize("kind", KINDS)
def test_samples_of_mitsuba_reflect_the_albedo(written: dict[str, Path], kind: str) -> None:
    mitsuba = mitsuba_of("scalar_spectral")
    table = small_table(kind)
    albedo = directional_albedo(table, LIGHTS_DEG).albedo[:, 0]
    albedo = albedo[:, albedo.shape[1] // 2]
    surface = mitsuba.load_dict({"type": "measured", "filename": str(written[kind])})
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    interaction.wavelengths = [550.0] * 4
    lights = unit_vector(np.deg2rad(LIGHTS_DEG), np.zeros(LIGHTS_DEG.size))
    centres = ((np.arange(24) + 0.5) / 24).tolist()
    for light, expected in zip(lights.tolist(), albedo.tolist(), strict=True):
        interaction.wi = mitsuba.Vector3f(*light)
        points = [mitsuba.Point2f(u, v) for u in centres for v in centres]
        weights = [np.array(surface.sample(context, interaction, 0.5, point)[1])[0] for point in points]
        assert np.mean(weights) == pytest.approx(expected, rel=FURNACE)
        assert np.std(weights) <= NOISE * np.mean(weights)


@pytest.mark.judge
@pytest.mark.parametrize("kind", [ANISOTROPIC, SPECTRAL])
def test_densities_of_samples_pass_mitsubas_chi2(written: dict[str, Path], kind: str) -> None:
    if "DRJIT_LIBLLVM_PATH" not in os.environ:  # Mitsuba 3.9 ends the process with the LLVM 14 to 16 that it may find
        pytest.skip("DRJIT_LIBLLVM_PATH names no LLVM 19 for mitsuba's llvm variants")
    vector = mitsuba_of("llvm_ad_spectral").Vector3f(0.4, 0.3, 0.8660254)
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    surface = {"type": "measured", "filename": str(written[kind])}
    sample, density = BSDFAdapter("measured", surface, wi=vector)
    test = ChiSquareTest(SphericalDomain(), sample, density, 3, sample_count=200_000, res=51, ires=32)
    assert test.run(0.01, 2, quiet=True), test.messages


@pytest.mark.judge
def test_a_light_in_the_plane_of_symmetry_is_read_right(written: dict[str, Path]) -> None:
    _, wr = random_pairs(50)
    inside = np.tile(unit_vector(np.array([1.0]), np.array([-1e-6])), (50, 1))
    exact = inside * (1.0, 0.0, 1.0)
    values = seen_by_mitsuba(written[ANISOTROPIC], "scalar_spectral", exact, wr, np.full(4, 550.0))
    ours = read_table(written[ANISOTROPIC])
    np.testing.assert_allclose(values[:, :1], ours.evaluate(inside, wr), rtol=1e-3, atol=1e-5)


def test_files_with_all_azimuths_are_for_other_readers(tmp_path: Path) -> None:
    table, path = small_table(ANISOTROPIC), tmp_path / "full.bsdf"
    files = rgl.write(table, path, azimuth="full", tolerance=0.5, megabytes=MEGABYTES)
    phi_i = read_tensors(path)["phi_i"]
    assert (phi_i[0], phi_i[-1]) == (np.float32(-np.pi), np.float32(np.pi))  # what pbrt-v4 and RGL's loader ask for
    assert not any("azimuths" in remark for remark in files.remarks)
    assert files.error is not None
    read_back = read_table(path)
    assert Comparison(table).error_of(read_back.evaluate) == files.error


def test_a_smaller_tolerance_is_a_larger_file(tmp_path: Path) -> None:
    files = [rgl.write(small_table(GREY), tmp_path / f"{t}.bsdf", tolerance=t) for t in (0.5, 0.05)]
    assert [file.within for file in files] == [True, True]
    assert files[0].nbytes < files[1].nbytes


# The container


def test_the_bytes_of_a_tensor_file(tmp_path: Path) -> None:
    path = tmp_path / "one.bsdf"
    write_tensors(path, {"ab": np.array([[1.0, 2.0]], np.float32)})
    header = b"tensor_file\0\x01\x00\x01\x00\x00\x00" + b"\x02\x00ab\x02\x00\x0a" + struct.pack("<QQQ", 56, 1, 2)
    assert len(header) == 49
    assert path.read_bytes() == header + bytes(7) + struct.pack("<ff", 1.0, 2.0)


@pytest.mark.judge
def test_mitsuba_reads_the_bytes_of_a_tensor_file(tmp_path: Path) -> None:
    path = tmp_path / "one.bsdf"
    write_tensors(path, {"ab": np.array([[1.0, 2.0]], np.float32)})
    mitsuba_of("scalar_rgb")
    from mitsuba import tensor_io

    np.testing.assert_array_equal(tensor_io.read(str(path))["ab"], [[1.0, 2.0]])


def test_files_of_other_programs_have_no_record(written: dict[str, Path], tmp_path: Path) -> None:
    fields = fields_of("file", read_tensors(written[SPECTRAL]))
    path = tmp_path / "lab_spec.bsdf"
    write_tensors(path, replace(fields, description="measured in a laboratory").tensors())
    read_back = read_table(path)
    assert (read_back.name, dict(read_back.record)) == ("lab_spec", {})
    assert read_back.wavelength_nm is not None
    assert read_back.wavelength_nm.tolist() == WAVELENGTHS_NM


# The warp


def test_a_warp_and_its_inverse() -> None:
    values = np.random.default_rng(2).uniform(0.05, 1.0, (3, 5, 7)).astype(np.float32)
    warp = Warp(values)
    x, y = warp.forward(9)
    s = np.linspace(0.0, 1.0, 9)
    for number in range(3):
        alone = MixedSlices(np.full((1, 81), number), np.ones((1, 81)))
        s_x, s_y = warp.inverse(alone, x[number].reshape(-1), y[number].reshape(-1))
        np.testing.assert_allclose(s_x.reshape(9, 9), np.tile(s, (9, 1)), atol=1e-12)
        np.testing.assert_allclose(s_y.reshape(9, 9), np.tile(s, (9, 1)).T, atol=1e-12)
    fine = (np.arange(400) + 0.5) / 400
    everywhere = [axis.reshape(-1) for axis in np.meshgrid(fine, fine)]
    mixed = MixedSlices(np.tile([[0], [2]], 160000), np.tile([[0.25], [0.75]], 160000))
    assert np.mean(warp.density(mixed, *everywhere)) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(("kind", "azimuth"), [("spectral", "reduced"), ("rgb", "reduced"), ("rgb", "full")])
def test_a_file_is_not_larger_than_its_limit(kind: str, azimuth: str, tmp_path: Path) -> None:
    table, path = small_table(ANISOTROPIC), tmp_path / "a.bsdf"
    files = rgl.write(table, path, kind=kind, azimuth=azimuth, tolerance=1e-3, megabytes=1.5)
    assert 5e5 < path.stat().st_size <= 1.5e6
    assert any("a quarter of the azimuths" in remark for remark in files.remarks) == (azimuth == "reduced")
    with pytest.raises(ParameterError, match=r"megabytes: .* MB for the values are too few: the smallest file of "):
        rgl.write(table, path, kind=kind, azimuth=azimuth, megabytes=0.1)
