"""Kept stores and editions, one of each format version: this version opens, verifies and publishes them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import StoreError
from brdfdb.store import verification
from brdfdb.store.edition.publishing import publish_edition
from brdfdb.store.edition.reader import Edition
from brdfdb.store.edition.records import FORMAT_VERSION as EDITION_VERSION
from brdfdb.store.edition.verification import damages
from brdfdb.store.reader import Store
from brdfdb.store.records import FORMAT_VERSION

KEPT = Path(__file__).parent / "kept"
STORES = sorted(KEPT.glob("store-*.zip"))
EDITIONS = sorted(KEPT.glob("edition-*.zip"))
NUMBERS: dict[str, Any] = json.loads((KEPT / "numbers.json").read_text(encoding="utf-8"))


@pytest.fixture
def kept(archive: Path, tmp_path: Path) -> Path:
    shutil.unpack_archive(archive, tmp_path / "kept")
    return tmp_path / "kept"


def check_numbers(opened: Store | Edition) -> None:
    """Compare lookups with the numbers that were kept: those of the version that wrote the tables."""
    angles = np.radians(np.array(NUMBERS["directions_deg"], dtype=np.float64)).T
    assert sorted(opened) == sorted(NUMBERS["materials"])
    for name, known in NUMBERS["materials"].items():
        table = opened[name]
        assert (table.revision, table.digest) == (known["revision"], known["digest"])
        for row in known["lookups"]:
            at = {} if row["wavelength_nm"] is None else {"wavelength_nm": row["wavelength_nm"]}
            f_r, error = table.lookup_with_error(*angles, **at)
            np.testing.assert_allclose(f_r, row["f_r"], rtol=1e-6)  # float32, by other processors
            np.testing.assert_allclose(error, row["error"], rtol=1e-6)
            assert float(table.specular_reflectance(0.5, **at)) == pytest.approx(row["specular"], rel=1e-6)
    for name, known in NUMBERS["families"].items():
        f_r = opened.family(name).lookup(*angles, sigma=known["sigma"])
        np.testing.assert_allclose(f_r, known["f_r"], rtol=1e-6)


def test_a_store_and_an_edition_of_the_current_version_are_kept() -> None:
    assert STORES[-1].stem == f"store-{FORMAT_VERSION}"
    assert EDITIONS[-1].stem == f"edition-{EDITION_VERSION}"


@pytest.mark.parametrize("archive", STORES, ids=lambda path: path.stem)
def test_a_kept_store_opens_and_is_sound(kept: Path) -> None:
    check_numbers(Store(kept))
    check_numbers(Store(kept, snapshot="kept"))
    for name in Store(kept):
        assert verification.material(kept, name)[1] == []
    assert verification.family(kept, "grey")[1] == []
    assert verification.snapshots(kept) == []


@pytest.mark.parametrize("archive", STORES, ids=lambda path: path.stem)
def test_a_kept_store_is_published(kept: Path, tmp_path: Path) -> None:
    publish_edition(kept, tmp_path / "edition", "kept")
    check_numbers(Edition(tmp_path / "edition"))


@pytest.mark.parametrize("archive", EDITIONS, ids=lambda path: path.stem)
def test_a_kept_edition_opens_and_is_sound(kept: Path) -> None:
    opened = Edition(kept)
    check_numbers(opened)
    assert list(damages(opened)) == []


def test_a_store_of_version_1_names_the_command_that_builds_it_anew(tmp_path: Path) -> None:
    old = tmp_path / "old"
    shutil.unpack_archive(STORES[-1], old)
    (old / "brdfdb.json").write_text(json.dumps({"format": "brdfdb", "version": 1}, indent=1), encoding="utf-8")
    with pytest.raises(
        StoreError, match=r"says format brdfdb version 1, .* `brdfdb build RECIPE --store DIR` "
    ) as said:
        brdfdb.open(old)
    assert "\n" not in str(said.value)
