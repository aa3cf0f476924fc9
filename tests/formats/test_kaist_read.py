"""Tensor files of Mueller matrices: any number of wavelengths, holes, the share that is physical, large files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats import kaist
from brdfdb.formats._input import MOST_BYTES, check_file
from brdfdb.formats.rgl._tensors import write_tensors
from brdfdb.geometry import spherical_angles, unit_vector, vectors_from_half_difference
from brdfdb.measurements.statement import statement
from brdfdb.tables.grids import Located
from brdfdb.tables.mueller_field import field_of
from tests.formats.test_rgl import mitsuba_of
from tests.measurements.test_mueller import DEPOLARISER, TRANSPOSING, polariser
from tests.mitsuba.polarised import as_mitsuba_has_them

BANDS = np.arange(414, 951, 8)[:68].astype(np.uint16)  # 68 wavelengths, 414 to 950 nm
PHI_D, THETA_D, THETA_H = np.linspace(-np.pi, np.pi, 9), np.linspace(0.0, np.pi / 2.0, 10), np.linspace(0.0, 1.5, 8)


def tensors(matrix: np.ndarray, wavelengths: np.ndarray = BANDS, dtype: str = "f4") -> dict[str, np.ndarray]:
    """Fields of a file with a matrix for each node, wavelength, row and column."""
    shape = (PHI_D.size, THETA_D.size, THETA_H.size, wavelengths.size, 4, 4)
    axes = {"phi_d": PHI_D, "theta_d": THETA_D, "theta_h": THETA_H}
    fields = {name: axis.astype(np.float32)[np.newaxis] for name, axis in axes.items()}
    return {**fields, "wvls": wavelengths, "M": np.broadcast_to(matrix, shape).astype(dtype)}


def above() -> np.ndarray:
    """True at nodes whose light and viewer are above the horizon, in the order of the file."""
    phi_d, theta_d, theta_h = (angle.astype(np.float32).astype(float) for angle in (PHI_D, THETA_D, THETA_H))
    light, viewer = vectors_from_half_difference(theta_h, 0.0, theta_d[:, None], phi_d[:, None, None])
    return np.minimum(light[..., 2], viewer[..., 2]) > -1e-5


def test_a_hyperspectral_file_says_what_share_is_physical_and_where(tmp_path: Path) -> None:
    matrix = np.broadcast_to(0.1 * DEPOLARISER, (*above().shape, BANDS.size, 4, 4)).copy()
    judged = above()
    steep = judged & (THETA_D[:, None] > np.radians(71.0))
    matrix[steep, 60:] = 0.1 * TRANSPOSING  # from 894 nm on, theta_d above 71 degrees
    matrix[0, 3, 3] = np.nan  # a hole
    matrix[0, 4, 3, 5, 2, 2] = np.nan  # a matrix with a hole
    write_tensors(tmp_path / "made.pbsdf", tensors(matrix))
    samples = formats.samples(tmp_path / "made.pbsdf")
    assert samples.channels[0] == "414nm"
    assert samples.values.shape[1] == 68
    count = judged.sum() * 68 - 68 * judged[0, 3, 3] - judged[0, 4, 3]
    share = 1.0 - steep.sum() * 8 / count
    said = " ".join(statement(samples).sentences)
    assert f"Physical: {100.0 * share:.1f} % of {count} Mueller matrices (eigenvalues" in said
    assert "the smallest is -0.5" in said
    assert "theta_d 70 to 90 degrees" in said or "theta_d 80 to 90 degrees" in said
    assert "894 to 950 nm" in said
    assert "Stokes criterion, reflected light at most fully polarised: 100 %" in said


def test_more_matrices_than_are_judged_are_drawn_at_random(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(14)
    matrix = np.broadcast_to(0.1 * DEPOLARISER, (*above().shape, BANDS.size, 4, 4)).copy()
    matrix[rng.random(matrix.shape[:4]) < 0.055] = 0.1 * TRANSPOSING
    write_tensors(tmp_path / "made.pbsdf", tensors(matrix))
    monkeypatch.setattr(kaist, "_MOST_JUDGED", 20_000)
    first, second = formats.samples(tmp_path / "made.pbsdf").record["physical"]
    share = float(first.split()[1])
    assert abs(share - 94.5) < 4.0 * 100.0 * np.sqrt(0.055 * 0.945 / 10_000)
    assert "drawn at random from about" in first
    assert second == "The others are at no angles and wavelengths more often than chance explains."


def test_matrices_are_turned_to_the_bases_of_the_surface_and_back(tmp_path: Path) -> None:
    fields = tensors(0.2 * polariser(np.radians(30.0)), BANDS[:1], "f8")
    image = PHI_D < 0.0
    fields["M"][image] = 0.2 * polariser(np.radians(-30.0))
    write_tensors(tmp_path / "made.pbsdf", fields)
    samples = formats.samples(tmp_path / "made.pbsdf")
    assert samples.values == pytest.approx(0.1)
    field = field_of(samples)
    # the second axis of a file is -p: U and V have the other sign, and 30 degrees are -30 from s towards p
    inside = field.elements[2:8, 4:20, 3, 0]  # phi_d of 90 degrees
    expected = 2.0 * polariser(np.radians(-30.0)).ravel()[1:]
    assert np.median(np.abs(inside - expected), axis=(0, 1)).max() < 0.1


def test_large_files_are_thinned_and_said_to_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_tensors(tmp_path / "made.pbsdf", tensors(0.1 * DEPOLARISER))
    monkeypatch.setattr(kaist, "_MOST_READ", 6_800)
    monkeypatch.setattr(kaist, "_FEWEST_READ", 100)
    samples = formats.samples(tmp_path / "made.pbsdf")
    assert 10 < len(samples) <= 100
    assert "Of 9 x 10 x 8 nodes of phi_d, theta_d and theta_h" in " ".join(samples.record["notes"])
    assert np.unique(samples.theta_i.round(6)).size > 5


def test_files_of_many_gigabytes_are_not_too_large(tmp_path: Path) -> None:
    path = tmp_path / "large.pbsdf"
    with path.open("wb") as file:
        file.write(b"tensor_file\0")
        file.truncate(MOST_BYTES + 1)
    check_file(path)
    with path.open("r+b") as file:
        file.write(b"other text")
    with pytest.raises(FileFormatError, match="more than 2147483648 bytes"):
        check_file(path)


def test_angles_in_degrees_are_refused(tmp_path: Path) -> None:
    fields = tensors(0.1 * DEPOLARISER, BANDS[:2])
    write_tensors(tmp_path / "made.pbsdf", {**fields, "theta_d": np.rad2deg(fields["theta_d"])})
    with pytest.raises(FileFormatError, match=r"'theta_d' has angles of 0 to 90; allowed are 0 to 1\.571 rad"):
        formats.samples(tmp_path / "made.pbsdf")


def test_a_file_of_holes_is_refused(tmp_path: Path) -> None:
    write_tensors(tmp_path / "made.pbsdf", tensors(np.full((4, 4), np.nan), BANDS[:2]))
    with pytest.raises(FileFormatError, match=r"made.pbsdf: field 'M' has no number .* all of M\[0, 0\] are nan"):
        formats.samples(tmp_path / "made.pbsdf")


@pytest.mark.judge
def test_matrices_that_are_no_facets_are_those_of_mitsuba(tmp_path: Path) -> None:
    mitsuba = mitsuba_of("scalar_spectral_polarized")
    fields = tensors(0.2 * polariser(np.radians(30.0)), np.array([450, 500, 550], np.uint16))
    fields["M"][PHI_D < 0.0] = 0.2 * polariser(np.radians(-30.0))
    path = tmp_path / "made.pbsdf"
    write_tensors(path, fields)
    surface = mitsuba.load_dict({"type": "measured_polarized", "filename": str(path)})
    rng = np.random.default_rng(1)
    side = np.where(rng.random(40) < 0.5, 1.0, -1.0)
    wi = unit_vector(rng.uniform(0.2, 1.2, 40), np.zeros(40))
    wr = unit_vector(rng.uniform(0.2, 1.2, 40), side * rng.uniform(0.5, 2.6, 40))
    theirs = []
    for light, viewer in zip(wi, wr, strict=True):
        interaction = mitsuba.SurfaceInteraction3f()
        interaction.wi = mitsuba.Vector3f(*viewer)  # in radiance mode, light arrives along wo
        interaction.wavelengths = [500.0] * 4
        value = surface.eval(mitsuba.BSDFContext(), interaction, mitsuba.Vector3f(*light))
        theirs.append([[np.array(value[i, j])[0] / light[2] for j in range(4)] for i in range(4)])
    angles = (*spherical_angles(wi), *spherical_angles(wr))
    at_500 = Located(np.array([[1]]), np.ones((1, 1)), np.array([1]), ())
    ours = 0.1 * field_of(formats.samples(path)).of_surface(angles, np.ones((40, 1)), at_500)[:, 0]
    wrong = np.abs(np.array(theirs) - as_mitsuba_has_them(mitsuba, ours, wi, wr)) / 0.1
    assert np.median(wrong, axis=0).max() < 0.01  # next to phi_d = 0, nodes are means of both senses
    assert np.abs(np.array(theirs)[:, 2, 0]).max() > 0.05
