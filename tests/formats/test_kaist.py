"""Mueller matrices as .pbsdf: Mitsuba's `measured_polarized` is the judge, of matrices and of a picture."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import CannotHoldError, ParameterError
from brdfdb.formats import kaist
from brdfdb.formats.rgl._tensors import read_tensors
from brdfdb.materials import Material
from brdfdb.measurements.samples import Samples
from brdfdb.tables.planner import plan
from brdfdb.tables.polarisation import planned_theta_d
from brdfdb.tables.table import Table
from tests.formats.a_file import random_pairs
from tests.formats.round_trip import round_trip
from tests.formats.small_tables import table_of
from tests.formats.test_rgl import mitsuba_of
from tests.mitsuba.polarised import as_mitsuba_has_them, off_by, picture_of_lookups, picture_of_mitsuba

VARIANT = "scalar_spectral_polarized"
TOLERANCE, NM = 0.005, 500.0
IMAGE = 0.01  # largest share of a Stokes component that a picture is off by; measured 0.0019


@functools.cache
def plastic() -> Table:
    """A rough dielectric: it polarises, and a tenth of its light is depolarised."""
    written = {
        "title": "Made up",
        "model": "he_torrance",
        "source": "no paper",
        "parameters": {"sigma_0_um": 0.3, "tau_um": 1.5, "a": 0.1},
        "refractive_index": "other/ZeonexE48R/Sultanova",
    }
    material, at = Material.from_table("plastic", written), np.array([NM, 600.0])
    layout = replace(plan(material, at, TOLERANCE), facet_theta_d_deg=planned_theta_d(material, at, TOLERANCE))
    return table_of(layout)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kaist") / "plastic.pbsdf"
    written = kaist.write(plastic(), path, tolerance=TOLERANCE)
    assert written.within
    assert written.nbytes <= 64e6
    return path


@pytest.mark.judge
def test_matrices_are_those_of_mitsuba(path: Path) -> None:
    mitsuba = mitsuba_of(VARIANT)
    surface = mitsuba.load_dict({"type": "measured_polarized", "filename": str(path)})
    wi, wr = random_pairs(1000, 8, 0.1)
    theirs = []
    for light, viewer in zip(wi, wr, strict=True):
        interaction = mitsuba.SurfaceInteraction3f()
        interaction.wi = mitsuba.Vector3f(*viewer)  # in radiance mode, light arrives along wo
        interaction.wavelengths = [NM] * 4
        value = surface.eval(mitsuba.BSDFContext(), interaction, mitsuba.Vector3f(*light))
        theirs.append([[np.array(value[i, j])[0] / light[2] for j in range(4)] for i in range(4)])
    ours = as_mitsuba_has_them(mitsuba, plastic().mueller_vectors(wi, wr, NM), wi, wr)
    wrong = np.abs(np.array(theirs) - ours) / ours[:, :1, :1]
    assert np.percentile(wrong, 99.0, axis=0).max() <= TOLERANCE  # measured 0.0046
    assert np.abs(ours[:, 1:, 1:] / ours[:, :1, :1]).max() > 0.5  # the light is polarised


@pytest.mark.judge
def test_the_stokes_picture_of_a_sphere_is_that_of_mitsuba(path: Path) -> None:
    surface = {"type": "measured_polarized", "filename": str(path), "wavelength": NM}
    theirs = picture_of_mitsuba(mitsuba_of(VARIANT), surface)
    ours = picture_of_lookups(lambda wi, wr: plastic().mueller_in_plane(wi, wr, NM))
    polarised = np.abs(ours[..., 1:3]).sum() / ours[..., 0].sum()
    assert polarised > 0.1
    assert max(off_by(theirs, ours)) <= IMAGE
    assert np.abs(theirs[..., 3]).max() <= 1e-6  # one reflection of unpolarised light makes no circular light
    assert np.abs(ours[..., 3]).max() <= 1e-6


def test_f_r_is_read_again_within_what_the_file_states(path: Path, tmp_path: Path) -> None:
    trip = round_trip(plastic(), tmp_path, "kaist", tolerance=0.1)
    assert trip.within
    assert isinstance(trip.reading, Samples)
    assert trip.measured <= 1e-4  # samples are nodes, at float32 angles; measured 2.2e-5
    assert trip.reading.record["revision"] == "r000001"
    assert read_tensors(path)["wvls"].tolist() == [500, 600]


def test_a_size_for_which_no_file_is_small_enough_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"megabytes: 0.08 MB are too few for any file of plastic"):
        formats.write(plastic(), tmp_path / "x.pbsdf", "kaist", megabytes=0.1, tolerance=1e-4)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_may_not_be_large_states_the_error_it_has(tmp_path: Path) -> None:
    written = kaist.write(plastic(), tmp_path / "small.pbsdf", tolerance=TOLERANCE, megabytes=0.5)
    assert written.nbytes <= 0.5e6
    assert not written.within


def test_a_spectrum_is_written_at_five_wavelengths() -> None:
    table = plastic()
    assert table.facets is not None
    assert table.wavelength_nm is not None
    channels = kaist._channels(replace(table, wavelength_nm=np.linspace(450.5, 650.5, 9)))
    assert channels.names == ("451nm", "501nm", "550nm", "600nm", "650nm")
    assert "straight lines lie between them" in channels.remarks[0]
    single = kaist._channels(replace(table, wavelength_nm=np.array([632.8])))
    assert (single.names, single.wavelength_nm) == (("633nm",), np.array([632.8]))
    assert single.remarks == ("of 632.8 nm, which the file calls 633 nm",)
    with pytest.raises(CannotHoldError, match="plastic: 70000 nm; the format holds wavelengths up to 65535 nm"):
        kaist._channels(replace(table, wavelength_nm=np.array([70000.0])))
