"""Editions of a store: equal to the store to the bit, written once, swapped by one publisher, and refused places."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

import brdfdb
from brdfdb.errors import ParameterError, StoreError, UnknownFamilyError, UnknownMaterialError, UnknownRevisionError
from brdfdb.store.edition import groups, objects
from brdfdb.store.edition.objects import ChangedRootError, objects_at
from brdfdb.store.edition.publishing import publish_edition
from brdfdb.store.edition.reader import Edition
from brdfdb.store.edition.records import encoded_root, index_key, sha256
from brdfdb.store.edition.verification import damages
from brdfdb.store.reader import Store
from tests.pipelines.command import Captured, refused, run
from tests.store.a_store import contents, lambert, publish
from tests.store.edition.an_edition import ANGLES, LONE, STACKED, answers, same

Published = tuple[Store, Path]


@pytest.mark.filterwarnings("ignore:Failed to open Zarr store with consolidated metadata")  # the table of others
def test_every_table_is_that_of_the_store(published: Published) -> None:
    store, place = published
    edition = Edition(place)
    assert list(edition) == list(store)
    assert len(edition) == len(list(store)) == 14
    assert answers(edition, store) == {}
    for name in store:
        assert name in edition
        assert edition.summary(name) == {key: value for key, value in store.summary(name).items()
                                         if key not in ("manifests", "last")}  # fmt: skip
        assert edition.attributes(name) == store.attributes(name)
        assert edition.metadata(name) == store.metadata(name)
        assert edition.head(name) == store.head(name)
        edition.verify(name)
        assert edition.dataset(name).load().identical(store.dataset(name).load())
        revision = edition.revision(name)
        assert all(revision.read(key) == store.revision(name).read(key) for key in revision.manifest["files"])
    assert list(damages(edition)) == []
    groups_of = {name: edition.revision(name).group for name in store}
    assert len({groups_of[name] for name in STACKED}) == 1
    assert groups_of["copper"] == groups_of["bronze"]
    assert len(set(groups_of.values())) == 10  # white is lambert on another grid than the shades
    assert (
        edition.index["bytes"]
        == sum(path.stat().st_size for path in place.rglob("*") if path.is_file() and path.parent.name != "index")
        - (place / "edition.json").stat().st_size
    )


def test_families_and_mueller_matrices_are_those_of_the_store(published: Published) -> None:
    store, place = published
    edition = brdfdb.open(place)
    assert isinstance(edition, Edition)
    assert edition.families() == store.families() == ["shade"]
    assert edition.family_content("shade") == store.family_content("shade")
    between, expected = (opened.family("shade").lookup(*ANGLES, rho=0.3) for opened in (edition, store))
    np.testing.assert_array_equal(between, expected)
    matrices, expected = (opened["polarised-copper"].mueller(*ANGLES) for opened in (edition, store))
    np.testing.assert_array_equal(matrices, expected)
    with pytest.raises(UnknownFamilyError):
        edition.family("shades")


def test_what_an_edition_does_not_have(published: Published) -> None:
    edition = Edition(published[1])
    for name in ("shade-005", "Shade", "../edition", "", "a" * 300):
        assert name not in edition
        with pytest.raises(UnknownMaterialError):
            edition[name]
    with pytest.raises(UnknownMaterialError, match="closest: shade-00"):
        edition.summary("shade-005")
    assert edition.revisions("white") == ["r000002"]
    pinned = f"r000002-{edition['white'].digest[:16]}"
    assert edition.table("white", "r000002") is edition.table("white", pinned) is edition["white"]
    with pytest.raises(UnknownRevisionError, match=f"white has no revision 'r000001'; this edition has {pinned}"):
        edition.table("white", "r000001")
    with pytest.raises(StoreError, match=r"white of .* has no file brdf/c/9"):
        edition.revision("white").read("brdf/c/9")


def test_a_snapshot_is_published_as_it_was(published: Published, tmp_path: Path) -> None:
    store, _ = published
    publish_edition(store.root, tmp_path, "first")
    edition = Edition(tmp_path)
    assert edition["white"].brdf[0, 0, 0] * np.pi == pytest.approx(0.25, rel=1e-6)
    pinned = brdfdb.open(store.root, snapshot="first")
    assert isinstance(pinned, Store)
    same(edition, pinned, "white")
    assert edition.index["snapshot"]["name"] == "first"


def test_a_second_publication_writes_no_group_and_the_same_root(
    published: Published, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, place = published
    written: list[str] = []
    write_file = objects.write_file

    def counted(path: Path, *rest: Any, **keywords: Any) -> Any:
        written.append(path.relative_to(copy).parts[0])
        return write_file(path, *rest, **keywords)

    monkeypatch.setattr(objects, "write_file", counted)
    publish_edition(store.root, copy)
    assert sorted(written) == ["catalogue", "edition.json", "families", "index"]
    assert contents(copy).keys() - {".edition.json.lock"} == contents(place).keys() - {".edition.json.lock"}
    assert contents(copy) == contents(place)


def test_a_newer_edition_leaves_readers_of_the_older_one(tmp_path: Path) -> None:
    publish(tmp_path / "store", white=lambert(0.25), grey=lambert(0.5))
    publish_edition(tmp_path / "store", tmp_path / "edition")
    before = Edition(tmp_path / "edition")
    publish(tmp_path / "store", white=lambert(0.75))
    publish_edition(tmp_path / "store", tmp_path / "edition")
    after = Edition(tmp_path / "edition")
    assert after.digest != before.digest
    assert [round(float(each["white"].brdf[0, 0, 0] * np.pi), 6) for each in (before, after)] == [0.25, 0.75]
    pinned = Edition(tmp_path / "edition", digest=before.digest)
    assert pinned["white"].digest == before["white"].digest


def test_plain_arrays_are_f_r_at_the_nodes(published: Published, tmp_path: Path) -> None:
    store, place = published
    edition = publish_edition(store.root, tmp_path, plain=True)
    assert edition.plain_bytes > 0
    opened = Edition(tmp_path)
    assert answers(opened, store) == {}
    assert list(damages(opened)) == []
    for name in set(store) - {"of-others"}:
        group = zarr.open_group(tmp_path / "groups" / opened.revision(name).group, mode="r")
        brdf = np.asarray(group["brdf"][...])  # type: ignore[index]
        if "material" in group:
            brdf = brdf[list(group["material"][:]).index(name)]  # type: ignore[index, arg-type]
        np.testing.assert_allclose(brdf, store.dataset(name)["brdf"].values, rtol=1e-6)
    assert sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file()) > sum(
        path.stat().st_size for path in place.rglob("*") if path.is_file()
    )


def test_a_second_publisher_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    publish(tmp_path / "store", white=lambert(0.25))
    publish(tmp_path / "other", white=lambert(0.75))
    there = tmp_path / "edition"

    def overtaken(*_: object) -> Any:
        monkeypatch.undo()
        publish_edition(tmp_path / "other", there)
        return groups.grouped(*_)  # type: ignore[arg-type]

    for _ in range(2):  # the first edition of a place, and a later one
        monkeypatch.setattr("brdfdb.store.edition.publishing.grouped", lambda revisions, **_: overtaken(revisions))
        with pytest.raises(ChangedRootError, match=r"^another edition was published at .*edition meanwhile"):
            publish_edition(tmp_path / "store", there)
        assert float(Edition(there)["white"].brdf[0, 0, 0] * np.pi) == pytest.approx(0.75)
        publish_edition(tmp_path / "store", there)
        assert float(Edition(there)["white"].brdf[0, 0, 0] * np.pi) == pytest.approx(0.25)


def test_two_publishers_of_the_same_edition_both_succeed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    publish(tmp_path / "store", white=lambert(0.25))
    there = tmp_path / "edition"
    first: list[Any] = []

    def overtaken(revisions: Any, **_: object) -> Any:
        monkeypatch.undo()
        first.append(publish_edition(tmp_path / "store", there))
        return groups.grouped(revisions)

    monkeypatch.setattr("brdfdb.store.edition.publishing.grouped", overtaken)
    assert publish_edition(tmp_path / "store", there) == first[0]


def test_revisions_that_wait_for_others_of_their_kind_take_little_memory(
    published: Published, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, place = published
    for most in ("_MOST_WAITING_BYTES", "_MOST_BYTES"):
        monkeypatch.setattr(groups, most, 20_000)
        publish_edition(store.root, tmp_path / most)
        edition = Edition(tmp_path / most)
        assert answers(edition, store) == {}
        assert len(edition.index["groups"]) > len(Edition(place).index["groups"])
    monkeypatch.setattr(groups, "MOST_MEMBERS", 2)
    publish_edition(store.root, tmp_path / "pairs")
    assert max(entry["materials"] for entry in Edition(tmp_path / "pairs").index["groups"]) == 2


def test_lost_and_damaged_objects_are_written_again(published: Published, copy: Path, capsys: Captured) -> None:
    store, place = published
    group = copy / "groups" / Edition(copy).revision(STACKED[0]).group
    (group / "brdf/c/0/0/0/0").unlink()
    assert run("verify", "--store", copy) == 2
    said = capsys.readouterr().err
    assert "brdf/c/0/0/0/0 is missing; `brdfdb publish` or `brdfdb build --to`, with --rewrite, writes it again" in said
    assert run("verify", "--store", copy, LONE) == 0
    assert run("publish", copy, "--store", store.root) == 0
    assert run("verify", "--store", copy) == 2
    assert run("publish", copy, "--store", store.root, "--rewrite") == 0
    capsys.readouterr()
    assert run("verify", "--store", copy) == 0
    assert "14 materials in 10 groups verified" in capsys.readouterr().out
    assert contents(copy) == contents(place)


def test_a_publication_names_the_edition_that_it_replaces(tmp_path: Path, capsys: Captured) -> None:
    publish(tmp_path / "store", white=lambert(0.25))
    command = ("publish", tmp_path / "edition", "--store", tmp_path / "store")
    for _ in range(2):
        assert run(*command) == 0
        assert "replaces" not in capsys.readouterr().out
    old = Edition(tmp_path / "edition").digest
    publish(tmp_path / "store", black=lambert(0.0))
    assert run(*command) == 0
    assert capsys.readouterr().out.endswith(f"; it replaces an edition of 1 material, sha256 {old}\n")


def test_a_damaged_store_is_not_published(tmp_path: Path) -> None:
    publish(tmp_path / "store", white=lambert(0.25))
    chunk = tmp_path / "store/materials/white/r000001/brdf/c/0/0/0"
    chunk.write_bytes(chunk.read_bytes()[:-1] + b"x")
    with pytest.raises(StoreError, match=r"brdf/c/0/0/0"):
        publish_edition(tmp_path / "store", tmp_path / "edition")
    assert not (tmp_path / "edition" / "edition.json").exists()


BAD: Mapping[str, tuple[list[str], str]] = {
    "a store": (["publish", "STORE"], r"^destination: .*STORE is a store, or lies in one; name another directory$"),
    "inside": (["publish", "STORE/materials/x"], r"^destination: .* is a store, or lies in one; name ano"),
    "a file": (["publish", "STORE.toml"], r"^cannot write .*Not a directory$"),
    "read only": (["publish", "https://example.org/ed"], r"^place: https://example.org/ed is only read; write to"),
    "no snapshot": (["publish", "NEW", "--snapshot", "second"], r"second"),
    "no store": (["publish", "NEW", "--store", "NEW"], r"^no store at .*NEW: brdfdb.json is missing there"),
    "an edition": (["publish", "NEW", "--store", "EDITION"], r"EDITION is an edition, which is only read; name"),
    "no edition": (["list", "--store", "http://127.0.0.1:9/ed"], r"^no answer from http://127.0.0.1:9/ed: "),
    "build": (["build", "STORE.toml", "--store", "EDITION"], r"EDITION is an edition; `brdfdb build RECIPE --to "),
    "no name": (["verify", "EDITION"], r"^no material .* in the store; to verify an edition, give --store .*EDITION$"),
    "no address": (["verify", "s3://a/b"], r"^no material 's3://a/b' .*; to verify an edition, give --store s3://a/b$"),
    "audit": (["audit", "--store", "EDITION"], r"EDITION is an edition, which is only read"),
    "gc": (["gc", "--store", "EDITION"], r"EDITION is an edition, which is only read"),
    "rollback": (["rollback", "white", "r000001", "--store", "EDITION"], r"EDITION is an edition, which is only read"),
    "snapshot": (["snapshot", "second", "--store", "EDITION"], r"EDITION is an edition, which is only read"),
    "of an edition": (["list", "--snapshot", "first", "--store", "EDITION"], r"that of an edition by `brdf"),
    "verify": (["verify", "nothing", "--store", "EDITION"], r"^no material 'nothing'"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "sentence"), BAD.values(), ids=BAD)
def test_bad_input_is_refused_in_a_sentence(
    arguments: list[str], sentence: str, published: Published, tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "STORE.toml").write_text('materials = ["foam"]\ntolerance = 0.2\n')
    (tmp_path / "STORE").symlink_to(published[0].root)
    (tmp_path / "EDITION").symlink_to(published[1])
    places = {"NEW", "STORE", "STORE.toml", "EDITION", "STORE/materials/x"}
    given = [str(tmp_path / each) if each in places else each for each in arguments]
    if "--store" not in given:
        given += ["--store", str(tmp_path / "STORE")]
    before = contents(published[1])
    said = refused(capsys, *given)
    assert re.search(sentence, said), said
    assert contents(published[1]) == before
    assert not (tmp_path / "NEW").exists()


def test_options_of_buckets_are_for_buckets(published: Published, tmp_path: Path) -> None:
    store, place = published
    for at in (store.root, place, "http://127.0.0.1:9"):
        with pytest.raises(
            ParameterError, match=r"^storage_options: .* takes none; they are for s3://, gs:// and az://"
        ):
            brdfdb.open(at, storage_options={"region": "here"})
    with pytest.raises(ParameterError, match=r"^place: 's3:///edition': "):
        Edition("s3:///edition")
    with pytest.raises(StoreError, match=r"^no edition at .*; `brdfdb publish` makes one$"):
        Edition(tmp_path)


def test_formats_of_later_versions_are_refused(copy: Path) -> None:
    index = next((copy / "index").iterdir())
    document = json.loads(index.read_bytes()) | {"version": 2}
    there = objects_at(copy)
    content = json.dumps(document).encode()
    there.put({index_key(sha256(content)): content})
    (copy / "edition.json").write_bytes(encoded_root(sha256(content)))
    with pytest.raises(StoreError, match="is of format brdfdb-edition-index version 2; this program reads"):
        Edition(copy)
    (copy / "edition.json").write_bytes(encoded_root("0" * 64).replace(b'"version": 1', b'"version": 2'))
    with pytest.raises(StoreError, match=r"edition\.json changed"):
        Edition(copy)


def test_a_system_without_file_locks_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    publish(tmp_path / "store", white=lambert(0.25))
    monkeypatch.setattr(objects, "fcntl", None)
    with pytest.raises(StoreError, match="this system has no file locks; use Linux or macOS"):
        publish_edition(tmp_path / "store", tmp_path / "edition")
