"""A bit that flips in any kind of file of a store: named and repaired, and never another answer in silence."""

from __future__ import annotations

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "bitflips.py"
KINDS = {"HEAD.json", "brdfdb.json", "chunk", "family record", "manifest", "snapshot", "zarr.json"}
SEED = 15


def test_a_bit_in_each_kind_of_file_is_named_and_repaired(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("bitflips", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    bitflips = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bitflips)
    found = bitflips.flips(len(KINDS) + 3, SEED, tmp_path)
    assert found.faults == []
    assert set(found.kinds) == KINDS
    assert dict(found.outcomes) == {"named and repaired": len(KINDS) + 3}
