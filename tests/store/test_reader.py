"""The store: what was published stays as it is, readers never see half of a build, and damage is never read as data."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

import brdfdb
from brdfdb.errors import StoreError, UnknownMaterialError, UnknownRevisionError
from brdfdb.materials import Material
from brdfdb.store import codec, table_cache
from brdfdb.store import reader as module
from brdfdb.store.files import sealed
from brdfdb.store.reader import Store
from brdfdb.store.records import Head
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from tests.store.a_store import GRID, contents, lambert, publish, rho

COPPER = {
    "title": "Rakić's copper",
    "model": "he_torrance",
    "source": "no paper",
    "refractive_index": "main/Cu/Johnson",
    "parameters": {"sigma_0_um": 0.1, "tau_um": 2.0},
}


def copper() -> xr.Dataset:
    return tabulate(Layout(Material.from_table("copper", COPPER), GRID, np.array([450.0, 500.0, 700.0])))


# Revisions


def test_a_second_build_leaves_every_byte_of_the_first_revision_alone(root: Path) -> None:
    before = contents(root / "materials" / "white")
    assert publish(root, white=lambert(0.75)) == ["r000002"]
    after = contents(root / "materials" / "white")
    assert dict(before.items() - after.items()).keys() == {"HEAD.json"}
    assert [json.loads(files["HEAD.json"])["revision"] for files in (before, after)] == ["r000001", "r000002"]
    assert rho(brdfdb.open(root)) == 0.75
    assert sorted(path.name for path in root.iterdir()) == [".staging", "brdfdb.json", "materials"]
    assert not list((root / ".staging").iterdir())


def test_a_store_is_a_mapping(root: Path) -> None:
    publish(root, copper=copper())
    store = brdfdb.open(root)
    assert (list(store), len(store)) == (["copper", "white"], 2)
    assert ["white" in store, "grey" in store, 5 in store] == [True, False, False]
    assert store.get("grey") is None
    assert (store.head("white"), store.path("white")) == ("r000001", root / "materials" / "white" / "r000001")
    assert store.metadata("copper").title == "Rakić's copper"
    assert (store["copper"].name, store["copper"].revision) == ("copper", "r000001")


def test_a_store_that_is_not_named_is_that_of_the_environment(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_STORE", str(root))
    assert list(brdfdb.open()) == ["white"]
    monkeypatch.delenv("BRDFDB_STORE")
    monkeypatch.chdir(root.parent)
    with pytest.raises(StoreError, match="brdf-store"):
        brdfdb.open()


def test_a_table_is_what_was_published(root: Path) -> None:
    dataset = copper()
    publish(root, copper=dataset)
    table = brdfdb.open(root)["copper"]
    np.testing.assert_array_equal(table.brdf, dataset["brdf"].values)
    np.testing.assert_array_equal(table.specular, dataset["specular_reflectance"].values.astype(np.float32))
    np.testing.assert_array_equal(table.wavelength_nm, [450.0, 500.0, 700.0])
    found = [(name, nodes.tolist()) for name, nodes in table.axes_deg.items()]
    assert found == [(name, nodes.tolist()) for name, nodes in GRID.axes.items()]
    assert dict(table.attrs) == dataset.attrs


def test_reading_a_table_loads_no_heavy_package(root: Path) -> None:
    program = (
        "import sys, brdfdb; from brdfdb_pipelines import cli; root = sys.argv[1]\n"
        "sys.argv = ['brdfdb', 'lookup', 'nothing', '0', '0', '0', '0', '--store', root]\n"
        "cli.main()\n"
        "brdfdb.open(root)['white']\n"
        "print({'xarray', 'pandas', 'zarr', 'numba', 'matplotlib'} & set(sys.modules))"
    )
    ended = subprocess.run([sys.executable, "-c", program, str(root)], capture_output=True, text=True, check=True)
    assert ended.stdout == "set()\n"  # half a second of a server's start


def test_an_open_store_serves_the_new_head_and_the_old_table_stays_whole(root: Path) -> None:
    store = brdfdb.open(root)
    old = store["white"]
    publish(root, white=lambert(0.75), black=lambert(0.0))
    assert (rho(store), store["white"].revision) == (0.75, "r000002")
    assert list(store) == ["black", "white"]
    assert old.lookup(0.1, 0.0, 0.2, 0.0) == pytest.approx(0.25 / np.pi, rel=1e-6)


def test_a_table_never_mixes_two_revisions(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = brdfdb.open(root)
    read = module.head_from
    waiting = [lambert(0.75)]

    def overtaken(path: Path, data: bytes) -> Head:
        head = read(path, data)
        if waiting:  # another process publishes while we read
            publish(root, white=waiting.pop())
        return head

    monkeypatch.setattr(module, "head_from", overtaken)
    table = store["white"]
    assert not waiting
    assert (table.revision, float(table.brdf[0, 0, 0])) == ("r000001", np.float32(0.25 / np.pi))
    assert (store["white"].revision, rho(store)) == ("r000002", 0.75)


def test_decoded_tables_are_kept_and_the_one_not_used_for_longest_goes(root: Path) -> None:
    publish(root, grey=lambert(0.5), black=lambert(0.0))
    size = brdfdb.open(root)["white"].nbytes
    store = Store(root, cache_bytes=2 * (size + table_cache._OBJECTS_BYTES))
    white = store["white"]
    grey = store["grey"]
    assert store["white"] is white
    black = store["black"]
    assert (store["white"], store["black"], store.held("grey")) == (white, black, None)
    assert store["grey"] is not grey
    small = Store(root, cache_bytes=1)  # the last table is kept, however large
    white = small["white"]
    assert small.held("white") is white
    assert small["grey"] is small.held("grey")
    assert small.held("white") is None


def test_each_revision_that_is_kept_can_be_read(root: Path) -> None:
    publish(root, white=lambert(0.75))
    store = brdfdb.open(root)
    assert store.revisions("white") == ["r000001", "r000002"]
    found = [float(store.table("white", each).brdf[0, 0, 0] * np.pi) for each in ("r000001", "r000002")]
    np.testing.assert_allclose(found, [0.25, 0.75], rtol=1e-6)
    for revision in ("r000003", "../white/r000001", "r1"):
        with pytest.raises(UnknownRevisionError, match=r"white has no revision '.*'; the current one is r000002"):
            store.table("white", revision)


# The format


def test_a_revision_copied_elsewhere_is_a_whole_zarr_group(root: Path, tmp_path: Path) -> None:
    dataset = copper()
    publish(root, copper=dataset)
    copy = shutil.copytree(brdfdb.open(root).path("copper"), tmp_path / "copy")
    shutil.rmtree(root)
    assert sorted(zarr.open_group(copy, mode="r").array_keys()) == sorted(map(str, dataset.variables))
    for keywords in ({}, {"consolidated": False}):
        with xr.open_zarr(copy, **keywords) as found:
            xr.testing.assert_identical(found.load(), dataset)
    metadata = json.loads((copy / "zarr.json").read_bytes())
    with pytest.warns(UserWarning, match="Consolidated metadata is currently not part"):
        zarr.consolidate_metadata(copy)
    assert json.loads((copy / "zarr.json").read_bytes()) == metadata


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_chunks_of_one_value_are_written_like_all_others(root: Path, value: float) -> None:
    dataset = lambert(0.5)
    dataset["brdf"][...] = value
    publish(root, white=dataset)
    group = brdfdb.open(root).path("white")
    assert [path for path in (group / "brdf" / "c").rglob("*") if path.is_file()]
    np.testing.assert_array_equal(brdfdb.open(root)["white"].brdf, np.full((4, 3, 3), value, dtype=np.float32))


@pytest.mark.parametrize(
    ("shape", "rows"),
    [((5,), 5), ((91, 91, 181), 63), ((46, 73, 46, 73), 4), ((4, 1 << 21), 1), ((1, 1, 1, 1), 1)],
)
def test_chunks_are_whole_rows_of_about_four_megabytes(shape: tuple[int, ...], rows: int) -> None:
    assert codec._chunks(shape) == (rows, *shape[1:])


def test_each_of_many_chunks_matters(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(codec, "_CHUNK_VALUES", 18)
    dataset = copper()
    publish(root, copper=dataset)
    store = brdfdb.open(root)
    files = sorted(path for path in (store.path("copper") / "brdf" / "c").rglob("*") if path.is_file())
    assert len(files) == 4
    np.testing.assert_array_equal(store["copper"].brdf, dataset["brdf"].values)
    for chunk in files:
        data = chunk.read_bytes()
        chunk.unlink()
        with pytest.raises(StoreError, match="is missing"):
            brdfdb.open(root)["copper"]
        chunk.write_bytes(data)


# What is no store, and what is not in it


def test_no_store_is_one_sentence(tmp_path: Path) -> None:
    for missing in (tmp_path / "none", tmp_path):
        with pytest.raises(StoreError, match=f"^no store at {missing}: .*`brdfdb build --store {missing}` .* edition$"):
            brdfdb.open(missing)


INSIDE = ("materials", "materials/white", "materials/white/r000001", "materials/white/r000001/brdf", ".staging")


@pytest.mark.parametrize("inside", [*INSIDE, "materials/white/HEAD.json"])
def test_a_place_inside_a_store_is_recognised(root: Path, inside: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(root)
    sentence = f"{root / inside} lies in the store at {root}; name that directory"
    with pytest.raises(StoreError) as raised:
        brdfdb.open(root / inside)
    assert str(raised.value) == sentence
    with pytest.raises(StoreError) as raised:
        publish(root / inside, white=lambert(0.5))
    assert str(raised.value).startswith(sentence)
    assert contents(root) == before
    monkeypatch.chdir(root)
    with pytest.raises(StoreError, match=f"{inside} lies in the store at {root}"):
        brdfdb.open(inside)


def test_a_path_that_leaves_a_store_again_is_beside_it(root: Path) -> None:
    assert brdfdb.open(root / "materials" / "..").root.samefile(root)
    for other in (root / ".." / "other", root / "other"):  # a directory that is none of the store may hold another
        with pytest.raises(StoreError, match=r"no store at|lies in the store at"):
            brdfdb.open(other)
        publish(other, white=lambert(0.5))
        assert list(brdfdb.open(other)) == ["white"]


def test_a_store_of_another_format_is_neither_read_nor_written(tmp_path: Path) -> None:
    for marker in (b"", b"{", b"[]", b"5", b"{}", b'{"format": "brdfdb", "version": 2}', b'{"format": "zarr"}'):
        (tmp_path / "brdfdb.json").write_bytes(marker)
        for ask in (brdfdb.open, lambda root: publish(root, white=lambert(0.5))):
            with pytest.raises(StoreError, match=r"brdfdb\.json"):
                ask(tmp_path)
        assert contents(tmp_path) == {"brdfdb.json": marker}
    for marker, said in (
        (sealed({"format": "brdfdb", "version": 3}), "3, this program reads brdfdb version 2; update brdfdb$"),
        (b'{\n "format": "brdfdb",\n "version": 1\n}', "1, .*; `brdfdb build RECIPE --store DIR` builds"),  # not sealed
    ):
        (tmp_path / "brdfdb.json").write_bytes(marker)
        with pytest.raises(StoreError, match=f"says format brdfdb version {said}"):
            brdfdb.open(tmp_path)


def test_names_are_matched_and_never_joined_to_a_path(root: Path) -> None:
    shutil.copytree(root / "materials" / "white", root / "x")
    store = brdfdb.open(root)
    for name in ("whit", "../x", "../materials/white", "white/", "white/r000001", ".", "..", "", "/"):
        for ask in (Store.__getitem__, Store.head, Store.path, Store.metadata, Store.dataset, Store.verify):
            with pytest.raises(UnknownMaterialError) as caught:
                ask(store, name)
            assert caught.value.name == name


def test_an_unknown_name_comes_with_the_closest_ones(root: Path) -> None:
    publish(root, **{"white-tile": lambert(0.5), "copper": lambert(0.5)})
    for name, closest in (("whit", "; closest: white, white-tile"), ("zzz", "")):
        with pytest.raises(UnknownMaterialError, match=f"^no material '{name}' in the store{closest}$"):
            brdfdb.open(root)[name]
