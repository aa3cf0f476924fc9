"""Damage in a store: it is found, named, and never read as data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import StoreError
from brdfdb.store.files import sealed, unsealed
from brdfdb.store.reader import Store
from tests.store.a_store import chunk, flip, lambert, pointer, publish, rho


def delete(path: Path) -> None:
    path.unlink()


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def empty(path: Path) -> None:
    path.write_bytes(b"")


FILES = ["brdf/c/0/0/0", "theta_i/c/0", "brdf/zarr.json", "zarr.json", "../r000001.MANIFEST.json"]


@pytest.mark.parametrize("damage", [delete, truncate, empty, flip])
@pytest.mark.parametrize("file", FILES)
def test_a_damaged_file_is_found_and_never_read_as_data(root: Path, file: str, damage: Callable[[Path], None]) -> None:
    damage(root / "materials" / "white" / "r000001" / file)
    store = brdfdb.open(root)
    asks: list[Callable[[Store, str], object]] = [Store.__getitem__, Store.verify]
    asks += [Store.metadata] if file == "zarr.json" else []
    asks += [Store.dataset] if "/c/" in file and damage is not flip else []  # else xarray would read nan
    for ask in asks:
        with pytest.raises(StoreError, match=r"^white r000001 is damaged: ") as caught:
            ask(store, "white")
        assert "\n" not in str(caught.value)
    if damage is not flip or not file.endswith("MANIFEST.json"):
        assert Path(file).name in str(caught.value)


def test_a_chunk_that_is_damaged_while_a_dataset_is_read_is_named(root: Path) -> None:
    with brdfdb.open(root).dataset("white") as lazy:
        flip(chunk(root))
        with pytest.raises(StoreError, match=r"^white r000001 is damaged: the content of brdf/c/0/0/0 changed$"):
            lazy["brdf"].load()


def test_a_store_of_a_relative_path_stays_where_it_was_opened(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = root.parent / "elsewhere" / root.name
    publish(other, white=lambert(0.75))
    monkeypatch.chdir(root.parent)
    store = brdfdb.open(root.name)
    monkeypatch.chdir(other.parent)
    assert (rho(store), store.path("white")) == (0.25, root / "materials" / "white" / "r000001")


def test_any_flipped_bit_of_a_chunk_is_found(root: Path) -> None:
    data = chunk(root).read_bytes()
    for bit in np.random.default_rng(0).choice(8 * len(data), 100, replace=False):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << (bit % 8)
        chunk(root).write_bytes(damaged)
        with pytest.raises(StoreError, match="white r000001 is damaged"):
            brdfdb.open(root)["white"]


def test_a_pointer_that_was_changed_is_not_followed(root: Path) -> None:
    """Not even one that was sealed again."""
    head = unsealed(pointer(root).read_bytes(), "", "")
    contents: list[bytes | dict[str, Any]] = [
        b"",
        b"not json",
        b"\xff\xfe",
        b"[]",
        b'"r000001"',
        b"{}",
        {"revision": 1},
        {"revision": "../../../white/r000001", "manifests": {"../../../white/r000001": "0"}},
        {"revision": "", "manifests": {"": "0"}},
        {"revision": "r000009"},
        {"revision": "r000009", "manifests": {"r000009": "0"}},
        {"manifests": {"r000001": "0"}},
        {"manifests": {"r000001": None}},
        {"manifests": None},
        {"material": "black"},
    ]
    for content in contents:
        pointer(root).write_bytes(sealed({**head, **content}) if isinstance(content, dict) else content)
        for ask in (Store.__getitem__, Store.verify, Store.metadata, Store.dataset):
            with pytest.raises(StoreError, match=r"^white .*(is damaged|manifest)"):
                ask(brdfdb.open(root), "white")
