"""The error of a file: what it measures, at which pairs, and how surely it holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brdfdb.errors import CannotHoldError
from brdfdb.formats._channels import channels_of
from brdfdb.formats._record import lines, of_lines, record, specular_remark
from brdfdb.formats._stated_error import PAIRS, Comparison
from brdfdb.geometry import unit_vector
from brdfdb.materials import presets
from brdfdb.parameters import Floats
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import block
from tests.formats.small_tables import DIFFUSE, SMOOTH, SPECTRAL, small_table

BRASS = "rolled-brass"


@pytest.fixture(scope="module")
def brass() -> Table:
    layout: Layout = plan(presets()[BRASS], None, 0.02)
    return Table.of(layout, np.concatenate([block(layout, rows) for rows in layout.blocks]))


def with_source(table: Table) -> Table:
    return replace(table, attrs={**table.attrs, "source_record": presets()[BRASS].document()})


def test_the_error_is_that_of_the_worst_draw(brass: Table) -> None:
    compared = Comparison(with_source(brass))

    def high_in_the_lobe(wi: Floats, wr: Floats) -> Floats:
        half = wi + wr
        narrow = half[:, 2] / np.linalg.norm(half, axis=1) > np.cos(0.05)
        return compared.truth * np.where(narrow, 1.22, 1.001)[:, np.newaxis]

    error = compared.error_of(high_in_the_lobe)
    assert error.p99 == error.p99_lobe == pytest.approx(0.22)
    assert error.p99_hemisphere < error.p99_lobe
    assert error.largest == pytest.approx(0.22)
    assert 0.001 < error.l1 < 0.22
    assert compared.error_of(lambda *_: compared.truth).document() == dict.fromkeys(error.document(), 0.0)
    assert error.document()["p99"] >= error.p99


def test_p99_is_no_less_than_that_of_other_pairs(brass: Table) -> None:
    """A file with an error at random holds its stated p99 at pairs of another seed."""
    table = with_source(brass)
    rng = np.random.default_rng(1)
    compared = Comparison(table)
    worse = np.exp(0.01 * rng.standard_normal(compared.truth.shape))
    stated = compared.error_of(lambda *_: compared.truth * worse).p99
    fresh = np.abs(np.expm1(0.01 * rng.standard_normal(100_000)))
    assert np.quantile(fresh, 0.99) < stated < np.quantile(fresh, 0.995)


def test_a_table_without_a_known_lobe_has_one_draw(brass: Table) -> None:
    compared = Comparison(brass)
    error = compared.error_of(lambda *_: compared.truth * 1.5)
    assert error.p99 == error.p99_hemisphere == error.p99_lobe
    assert np.all(compared.wr[:, 2] > 0.0)
    assert len(compared.wi) == 2 * PAIRS


@pytest.mark.parametrize("known", [False, True])
def test_the_floor_follows_the_albedo(brass: Table, known: bool) -> None:
    table = with_source(brass) if known else brass
    grid = np.linspace(0.005, 0.995, 100)
    theta, phi = np.arcsin(np.sqrt(grid)), np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    f_r = [table.lookup(t, p, theta[:, np.newaxis], phi) for t in theta[::10] for p in phi[::20]]
    assert Comparison(table).floor == pytest.approx(1e-3 * np.mean(f_r), rel=0.05)


def test_colours_of_a_grey_table_are_alike(brass: Table) -> None:
    wi, wr = unit_vector(0.5, 0.0), unit_vector(0.5, np.pi)
    for colour, names in (("", 1), ("rgb", 3), ("xyz", 3), ("grey", 1)):
        values = channels_of(brass, colour).values(brass, wi, wr)
        assert values.shape == (names,)
        np.testing.assert_allclose(values, brass.lookup_vectors(wi, wr))


def test_a_record_survives_as_lines(brass: Table) -> None:
    document = record(with_source(brass), None, "passes", remarks=("no: specular part",), tolerance=0.02)
    assert document["audit"] == "passes"
    assert of_lines(lines(document)) == document
    assert all("\n" not in line for line in lines(document))


def test_channels_of_a_table_of_one_wavelength_are_alike() -> None:
    table = small_table(SMOOTH)
    wi, wr = unit_vector(0.3, 0.0), unit_vector(0.6, 2.0)
    for colour, names in (("rgb", ("R", "G", "B")), ("xyz", ("X", "Y", "Z")), ("grey", ("Y",)), ("auto", ("Y",))):
        channels = channels_of(table, colour)
        assert channels.names == names
        np.testing.assert_array_equal(channels.values(table, wi, wr), [table.lookup_vectors(wi, wr)[0]] * len(names))
        assert channels.remarks == (f"{'all channels are ' if len(names) > 1 else ''}f_r at 460 nm",)


def test_channels_name_what_is_lost_of_a_spectrum() -> None:
    table = small_table(SPECTRAL)
    assert channels_of(table).remarks == ()
    assert channels_of(table, "auto").names == ("X", "Y", "Z")
    assert channels_of(table, "rgb").remarks == ("of the spectrum: linear sRGB under D65",)
    assert specular_remark(table)[0].startswith("not in the file: the specular part, up to 0.")
    assert specular_remark(small_table(DIFFUSE)) == ()
    infrared = replace(table, wavelength_nm=np.array([1000.0, 1500.0, 2000.0]))
    with pytest.raises(CannotHoldError, match="copper: wavelengths of 1000 to 2000 nm give no colour"):
        channels_of(infrared, "grey")
