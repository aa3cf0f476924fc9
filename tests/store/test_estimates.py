"""Estimates of a simulation: every damaged file is computed again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb.store.estimates import read_estimate, write_estimate

ARRAYS = {"one": np.linspace(0.0, 1.0, 30).reshape(5, 3, 2), "two": np.full((5, 3, 2), 0.25)}


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """The file of estimate 3."""
    write_estimate(tmp_path, 3, ARRAYS)
    return tmp_path / "000003.npz"


def test_what_is_written_is_read(written: Path) -> None:
    arrays = read_estimate(written.parent, 3)
    assert arrays is not None
    assert list(arrays) == list(ARRAYS)
    assert all(np.array_equal(arrays[name], ARRAYS[name]) for name in ARRAYS)
    assert read_estimate(written.parent, 4) is None
    with np.load(written) as other:  # numpy reads the file, too
        assert np.array_equal(other["one"], ARRAYS["one"])


def test_flipped_bits_are_found_everywhere(written: Path) -> None:
    data = written.read_bytes()
    for at in (*range(0, len(data), 5), *range(len(data) - 40, len(data))):
        flipped = bytearray(data)
        flipped[at] ^= 1 << at % 8
        written.write_bytes(flipped)
        assert read_estimate(written.parent, 3) is None, at


def test_other_files_are_no_estimates(written: Path) -> None:
    data = written.read_bytes()
    for wrong in (b"", data[:-1], data[:1000], data[32:], data + b"\0", data + data):
        written.write_bytes(wrong)
        assert read_estimate(written.parent, 3) is None
    np.save(written.with_suffix(".npy"), np.zeros(5))
    written.with_suffix(".npy").replace(written)
    assert read_estimate(written.parent, 3) is None
    np.savez(written, **ARRAYS)
    assert read_estimate(written.parent, 3) is None
    written.unlink()
    written.mkdir()
    assert read_estimate(written.parent, 3) is None
