"""Audits of measured tables: reciprocity and energy within their uncertainty, and after they are made to keep a law."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import brdfdb
from brdfdb.audit import MaterialAudit, audit
from brdfdb.audit.energy import Energy
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.materials import presets
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats
from brdfdb.store.publication import publish
from tests.measurements.made_up import scattered, source_of


def _audited(root: Path, source: MeasuredSource) -> MaterialAudit:
    publish(root, source, tolerance=0.1)
    return audit(brdfdb.open(root)[source.name])


def _bright(wi: Floats, wr: Floats) -> Floats:
    return np.asarray(0.4 * (1.0 + wi[:, 2:]) + 0.0 * wr[:, 2:])


def test_asymmetry_of_unknown_uncertainty_is_reported_and_not_judged(tmp_path: Path) -> None:
    audited = _audited(tmp_path, source_of(_bright, name="bright"))
    finding = audited.of(Reciprocity)
    assert finding.verdict == "passes"
    assert 0.05 < finding.table_random.median < finding.table_random.p99 < 0.4
    assert "not judged, because the uncertainty of the data is not known" in finding.sentences()[0].text
    assert audited.of(Energy).verdict == "violates"


def test_laws_are_kept_by_tables_that_are_made_to_keep_them(tmp_path: Path) -> None:
    audited = _audited(tmp_path, source_of(_bright, name="bright").made("reciprocal").made("conserving"))
    assert audited.verdict == "passes"
    assert audited.of(Reciprocity).table_random.max < 1e-6
    # each light reflects too much before, and nearly all of it afterwards
    albedo = np.array(audited.of(Energy).table.albedo, dtype=np.float64)
    assert albedo.min() > 0.985  # measured 0.993
    assert albedo.max() <= 1.0
    metadata = brdfdb.open(tmp_path).metadata("bright")
    assert [change.law for change in metadata.measured.changes] == ["reciprocal", "conserving"]


def test_asymmetry_beyond_noise_violates_only_where_noise_is_less(tmp_path: Path) -> None:
    clay = presets()["clay-vase"].brdf_at(None)
    samples = scattered(lambda wi, wr: clay(wi, wr) * (0.3 + wi[:, 2:] ** 2), 300, 0.03)
    finding = _audited(tmp_path, MeasuredSource.of_samples(samples, name="lopsided")).of(Reciprocity)
    assert finding.verdict == "violates"
    assert finding.table_random.tolerance < 0.3
    noisy = scattered(lambda wi, wr: clay(wi, wr) * (0.8 + 0.2 * wi[:, 2:] ** 2), 300, 0.25)
    found = _audited(tmp_path, MeasuredSource.of_samples(noisy, name="noisy"))
    assert found.of(Reciprocity).verdict == "passes"


def test_albedo_above_1_by_less_than_the_uncertainty_passes(tmp_path: Path) -> None:
    def white(wi: Floats, _: Floats) -> Floats:
        return np.full((len(wi), 1), 1.02 / np.pi)

    samples = scattered(white, 300, 0.1)
    audited = _audited(tmp_path, MeasuredSource.of_samples(samples, name="white"))
    assert (audited.of(Energy).table.max_albedo or 0.0) > 1.0
    assert audited.of(Energy).table.verdict == "passes"
    assert _audited(tmp_path, source_of(white, name="exact")).of(Energy).table.verdict == "violates"
