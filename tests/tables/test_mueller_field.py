"""Measured Mueller matrices in tables: frames by closed forms, convex sums that stay physical, blocks, storage."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.audit.finding import Subject
from brdfdb.audit.polarisation import PolarisationFinding
from brdfdb.errors import ParameterError
from brdfdb.formats import kaist
from brdfdb.geometry import unit_vector
from brdfdb.measurements import MeasuredSource
from brdfdb.measurements.mueller import coherency_eigenvalues, from_frame
from brdfdb.measurements.samples import Samples
from brdfdb.store.publication import publish_layout
from brdfdb.tables.grids import Located
from brdfdb.tables.layout import Layout
from brdfdb.tables.measured_layout import tabulated
from brdfdb.tables.mueller_field import MuellerField, field_of
from brdfdb.tables.table import Table, source_of_table
from tests.measurements.test_mueller import TRANSPOSING, ellipsometric, polariser

NM = np.array([450.0, 650.0])
AT_FIRST = Located(np.array([[0]]), np.ones((1, 1)), np.array([0]), ())
INDEX = {450.0: 1.4 - 2.0j, 650.0: 0.2 - 3.4j}


def directions(count: int = 400, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Light from azimuth 0, viewers anywhere above the horizon."""
    rng = np.random.default_rng(seed)
    theta_i = np.radians(np.repeat(np.linspace(5.0, 80.0, 16), count // 16))
    light = unit_vector(theta_i, np.zeros(count))
    return light, unit_vector(np.arccos(rng.uniform(0.05, 1.0, count)), rng.uniform(0.0, 2.0 * np.pi, count))


def made(light: np.ndarray, viewer: np.ndarray, surface: np.ndarray, nm: np.ndarray | None = NM) -> Samples:
    """Samples with f_r that falls with the cosine of the half vector, and matrices between bases of the surface."""
    angles = [np.arccos(np.clip(w[:, 2], -1.0, 1.0)) for w in (light, viewer)]
    phi = [np.arctan2(w[:, 1], w[:, 0]) for w in (light, viewer)]
    channels = ("grey",) if nm is None else tuple(f"{at:g}nm" for at in nm)
    half = (light + viewer) / np.linalg.norm(light + viewer, axis=1, keepdims=True)
    values = np.repeat(0.1 + 0.3 * half[:, 2:] ** 8, len(channels), axis=1)
    return Samples("made", angles[0], phi[0], angles[1], phi[1], channels, nm, values, mueller=surface)


def to_surface(light: np.ndarray, viewer: np.ndarray, in_plane: np.ndarray) -> np.ndarray:
    """Turn matrices from bases of the plane to those of the surface, by angles between unit vectors s alone."""
    normal = np.cross(light, viewer)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    turned = []
    for w, travel in ((light, -light), (viewer, viewer)):
        horizontal = np.stack([-w[:, 1], w[:, 0], np.zeros(len(w))], axis=1) / np.hypot(w[:, 0], w[:, 1])[:, None]
        p = np.cross(horizontal, travel)
        angle = np.arctan2(np.sum(normal * p, axis=1), np.sum(normal * horizontal, axis=1))  # of normal, from s to p
        rotation = np.zeros((len(w), 4, 4))
        rotation[:, 0, 0] = rotation[:, 3, 3] = 1.0
        rotation[:, 1, 1] = rotation[:, 2, 2] = np.cos(2.0 * angle)
        rotation[:, 1, 2], rotation[:, 2, 1] = np.sin(2.0 * angle), -np.sin(2.0 * angle)
        turned.append(rotation)
    return np.linalg.inv(turned[1])[:, None] @ in_plane @ turned[0][:, None]


def mirrors(light: np.ndarray, viewer: np.ndarray) -> np.ndarray:
    """Facets of metals at both wavelengths, between bases of the plane, from the formula of ellipsometers."""
    theta_d = np.arccos(np.clip(np.linalg.norm(light + viewer, axis=1) / 2.0, 0.0, 1.0))
    return from_frame(np.array([[ellipsometric(angle, INDEX[at]) for at in NM] for angle in theta_d]), "p")


@pytest.fixture(scope="module")
def metal() -> Samples:
    light, viewer = directions()
    return made(light, viewer, to_surface(light, viewer, mirrors(light, viewer)))


@pytest.fixture(scope="module")
def layout(metal: Samples) -> Layout:
    smooth = MeasuredSource.of_samples(metal)
    return replace(tabulated(smooth, NM, 0.3).layout, field=field_of(metal))


@pytest.fixture(scope="module")
def table(layout: Layout, tmp_path_factory: pytest.TempPathFactory) -> Table:
    root = tmp_path_factory.mktemp("measured") / "store"
    publish_layout(root, "made-up", layout)
    return brdfdb.open(root)["made-up"]


def test_facets_that_were_measured_anywhere_are_those_of_fresnel(table: Table) -> None:
    light, viewer = directions(160, seed=9)
    expected = mirrors(light, viewer)
    found = table.mueller_in_plane(light, viewer)
    wrong = np.abs(found / found[..., :1, :1] - expected)
    assert np.percentile(wrong, 99.0) < 0.05
    assert wrong.max() < 0.1
    surface = table.mueller_vectors(light, viewer)
    wrong = np.abs(surface / surface[..., :1, :1] - to_surface(light, viewer, expected))
    assert np.percentile(wrong, 99.0) < 0.05
    assert np.abs(expected[..., 2, 3]).max() > 0.8  # light changes its ellipticity: a wrong sign would be seen


def test_the_stored_table_states_what_was_measured(table: Table, metal: Samples) -> None:
    record = table.metadata.polarisation
    assert record is not None
    assert record.version == 2
    assert record.measured is not None
    assert (record.measured.rows, record.measured.columns, record.measured.physical) == (4, 4, 1.0)
    assert 0.0 < record.measured.table_p99 < 0.1
    assert record.measured.held_out_p99 is not None
    found = table.mueller_vectors(metal.w_i, metal.w_r)
    wrong = np.abs(found / found[..., :1, :1] - metal.mueller).reshape(-1, 16)
    assert np.percentile(wrong, 99.0, axis=0).max() < 1.5 * record.measured.table_p99
    assert found[..., 0, 0] == pytest.approx(table.lookup_vectors(metal.w_i, metal.w_r), rel=1e-9)
    assert isinstance(table.facets, MuellerField)
    assert table.laid_out(source_of_table(table)).field is table.facets


def test_lights_left_out_tell_the_error_between_lights() -> None:
    lights = np.radians(np.array([10.0, 25.0, 40.0, 55.0, 70.0]))
    viewers = np.radians(np.arange(-75.0, 76.0, 5.0))
    theta_i, theta_r = (grid.ravel() for grid in np.meshgrid(lights, viewers, indexing="ij"))
    phi_r = np.where(theta_r > 0.0, np.pi, 0.0)
    wi, wr = unit_vector(theta_i, np.zeros(theta_i.size)), unit_vector(np.abs(theta_r), phi_r)
    oblique = (np.abs(theta_i + theta_r) > 0.02) & (np.abs(theta_r) > 0.02)  # s is defined
    wi, wr = wi[oblique], wr[oblique]
    field = field_of(made(wi, wr, to_surface(wi, wr, mirrors(wi, wr)[:, 1:]), NM[1:]))
    assert field.record is not None
    assert field.record.measured is not None
    between = unit_vector(theta_i[oblique] + np.radians(7.5), np.zeros(len(wi)))
    inside = between[:, 2] > np.cos(np.radians(70.0))
    found = field.in_plane(between[inside], wr[inside], np.ones((inside.sum(), 1)), AT_FIRST)
    wrong = np.abs(found - mirrors(between[inside], wr[inside])[:, 1:])
    p99 = np.percentile(wrong, 99.0, axis=0).max()
    stated = field.record.measured.held_out_p99
    assert stated is not None
    assert 0.1 * stated <= p99 <= stated  # lights are left out in gaps of twice the step


def test_between_wavelengths_matrices_are_convex_sums(table: Table) -> None:
    light, viewer = directions(48, seed=2)
    ends = table.mueller_vectors(light, viewer)
    middle = table.mueller_vectors(light, viewer, 550.0)
    normalised = ends / ends[..., :1, :1]
    assert middle / middle[..., :1, :1] == pytest.approx(normalised.mean(axis=1), abs=1e-6)


def test_a_polariser_at_an_angle_to_the_plane_keeps_the_sense_of_the_angle() -> None:
    light, viewer = directions()
    turned = np.broadcast_to(2.0 * polariser(np.radians(30.0)), (len(light), 1, 4, 4)).copy()
    image = viewer[:, 1] < 0.0  # on the other side of the plane of incidence the mirror image, at -30 degrees
    turned[image] = 2.0 * polariser(np.radians(-30.0))
    field = field_of(made(light, viewer, to_surface(light, viewer, turned), NM[:1]))
    wi, wr = directions(64, seed=8)
    found = field.in_plane(wi, wr, np.ones((64, 1)), AT_FIRST)[:, 0]
    sides = np.array([2.0 * polariser(np.radians(-30.0 if y < 0.0 else 30.0)) for y in wr[:, 1]])
    away = np.abs(wr[:, 1]) > 0.3  # nodes in the plane of incidence hold means of both sides
    assert np.median(np.abs(found[away] - sides[away]), axis=0).max() < 0.1  # U of the other sense is off by 1.7


def test_means_of_physical_matrices_are_physical_everywhere() -> None:
    rng = np.random.default_rng(11)
    light, viewer = directions()
    jones = rng.normal(size=(len(light), 1, 2, 2)) + 1j * rng.normal(size=(len(light), 1, 2, 2))
    lift = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, 1j, -1j, 0]])
    kron = np.einsum("nlij,nlab->nliajb", jones, np.conj(jones)).reshape(len(light), 1, 4, 4)
    pure = (lift @ kron @ np.linalg.inv(lift)).real
    samples = made(light, viewer, pure / pure[..., :1, :1], NM[:1])
    assert coherency_eigenvalues(samples.mueller[:, 0])[:, :3] == pytest.approx(0.0, abs=1e-12)
    field = field_of(samples)
    wi, wr = directions(800, seed=21)
    found = field.in_plane(wi, wr, np.ones((800, 1)), AT_FIRST)[:, 0]
    assert coherency_eigenvalues(found).min() > -1e-6


def test_polarisers_alone_leave_what_they_cannot_see_unknown() -> None:
    light, viewer = directions()
    surface = np.full((len(light), 1, 4, 4), np.nan)
    surface[:, :, :2, :2] = [[1.0, 0.3], [0.2, 0.6]]
    field = field_of(made(light, viewer, surface, None))
    assert field.names == ("m01", "m10", "m11")
    angles = tuple(np.array([angle]) for angle in (0.7, 0.2, 0.9, 2.0))
    found = field.of_surface(angles, np.ones((1, 1)), AT_FIRST)[0, 0]
    assert found[:2, :2] == pytest.approx(np.array([[1.0, 0.3], [0.2, 0.6]]))
    assert np.isnan(found).sum() == 12
    with pytest.raises(ParameterError, match="rows and columns I and Q between bases of the surface"):
        field.in_plane(light, viewer, np.ones((len(light), 1)), AT_FIRST)


def test_what_makes_no_polarised_table_is_refused_in_a_sentence(metal: Samples) -> None:
    with pytest.raises(ParameterError, match="polarised: made has no polarised values; known are the columns ss"):
        field_of(replace(metal, mueller=None))
    with pytest.raises(ParameterError, match="its lights have several azimuths"):
        field_of(replace(metal, phi_i=np.linspace(0.0, 3.0, len(metal))))
    with pytest.raises(ParameterError, match="its channels are colours"):
        field_of(replace(metal, channels=("a", "b"), wavelength_nm=None))
    holes = metal.mueller.copy()
    holes[3:, :, 2, 2] = np.nan
    with pytest.raises(ParameterError, match="3 samples have all elements; at least 4 are needed"):
        field_of(replace(metal, mueller=holes))


def test_measured_matrices_have_no_facet_and_no_file_of_the_format(table: Table, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="measured, and depend on all angles: they have no facet"):
        table.facet_mueller(0.5)
    assert table.specular_mueller(0.5).shape == (2, 4, 4)
    with pytest.raises(brdfdb.errors.BrdfdbError, match="measured"):
        kaist.write(table, tmp_path / "x.pbsdf")


def test_the_audit_finds_what_no_surface_has(table: Table) -> None:
    sound = PolarisationFinding.judge(Subject(table, None))
    assert sound.verdict == "passes"
    assert sound.physical == 1.0
    assert sound.measured_physical == 1.0
    elements = table.facets.elements.copy()
    names = table.facets.names
    steep = table.facets.axes_deg[1] >= 45.0
    elements[:, steep, :, 1] = [TRANSPOSING[int(name[1]), int(name[2])] for name in names]
    bad = PolarisationFinding.judge(Subject(replace(table, facets=replace(table.facets, elements=elements)), None))
    assert bad.verdict == "violates"
    assert bad.smallest_eigenvalue < -0.4
    assert 0.5 < bad.physical < 1.0
    texts = " ".join(sentence.text for sentence in bad.sentences())
    assert "not physically realisable" in texts
    assert re.search(r"theta_d (30|50) to [78]0 degrees", texts)
    assert "650 nm" in texts


def test_one_direction_has_the_matrices_that_it_has_among_many(table: Table) -> None:
    light, viewer = directions(800, seed=6)
    many = table.mueller_vectors(light, viewer, [470.0, 610.0])
    assert table.mueller_vectors(light[7], viewer[7], [470.0, 610.0]) == pytest.approx(many[7], rel=1e-9, abs=1e-12)
