"""A bit that flips in any kind of file of a store: named and repaired, and never another answer in silence."""

from __future__ import annotations

from pathlib import Path

from tests.benchmarks import bitflips

KINDS = {"HEAD.json", "brdfdb.json", "chunk", "family record", "manifest", "snapshot", "zarr.json"}
SEED = 15


def test_a_bit_in_each_kind_of_file_is_named_and_repaired(tmp_path: Path) -> None:
    found = bitflips.flips(len(KINDS) + 3, SEED, tmp_path)
    assert found.faults == []
    assert set(found.kinds) == KINDS
    assert found.repaired == found.kinds
    assert found.kinds.total() == len(KINDS) + 3
