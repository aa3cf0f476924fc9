"""Editions behind a web server: requests, servers that fail, flipped bits, publications that end early."""

from __future__ import annotations

import pickle
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import brdfdb
from brdfdb.errors import NoEditionError, StoreError
from brdfdb.store.edition import objects, publishing
from brdfdb.store.edition.publishing import publish_edition
from brdfdb.store.edition.reader import Edition
from brdfdb.store.edition.verification import damages
from brdfdb.store.reader import Store
from tests.pipelines.command import run
from tests.store.a_store import contents, in_threads, lambert, publish
from tests.store.edition.an_edition import LONE, STACKED, FileServer, answers, same, served
from tests.store.test_fork import FORKING

Published = tuple[Store, Path]
FLIPS = 200
CRASHES = 30


def _looked_up(edition: Any, name: str) -> Callable[[], object]:
    return lambda: edition[name].lookup(0.3, 0.0, 0.4, 2.0)


def _requests(server: FileServer) -> list[int]:
    """Return the requests of an open, and of lookups: the first of a group, two further ones of it, a decoded one."""
    opened: list[Edition] = []
    counts = [server.count(lambda: opened.append(Edition(server.url)))]
    return counts + [server.count(_looked_up(opened[0], name)) for name in (*STACKED[:3], STACKED[0])]


def test_requests(published: Published, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, place = published
    with served(place) as server:
        assert _requests(server) == [2, 2, 1, 1, 0]
        edition = Edition(server.url)
        assert server.count(lambda: (list(edition), len(edition), "white" in edition, "grey" in edition)) == 0
        assert server.count(lambda: edition.dataset("shade-001").load()) == 2
    monkeypatch.setattr(publishing, "FEW_NAMES", 0)
    publish_edition(store.root, tmp_path)
    with served(tmp_path) as server:
        assert _requests(server)[0] == 2
        edition = Edition(server.url)
        assert server.count(_looked_up(edition, STACKED[1])) <= 2 + 5  # records of groups whose names are around
        assert server.count(_looked_up(edition, STACKED[2])) == 1
        assert server.count(_looked_up(edition, STACKED[1])) == 0
        edition = Edition(server.url)
        assert answers(edition, store) == {}
        assert list(edition) == list(store)
        assert list(damages(edition, ["white"])) == []


def test_the_gallery_draws_an_edition_at_an_address(published: Published, tmp_path: Path) -> None:
    pytest.importorskip("colour")
    with served(published[1]) as server:
        assert run("gallery", "white", "copper", "--store", server.url, "--out", tmp_path / "sheet.png") == 0
    assert (tmp_path / "sheet.png").stat().st_size > 0


def test_servers_without_ranges(published: Published) -> None:
    store, place = published
    with served(place, ranges=False) as server:
        assert answers(Edition(server.url), store) == {}


@pytest.mark.parametrize("faults", [[500], [503, 502, 429], ["half"], ["half", 504, "half"]], ids=str)
def test_failures_that_pass_are_waited_for(
    faults: list[int | str], published: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, place = published
    monkeypatch.setattr(objects, "_WAIT_S", 0.001)
    with served(place) as server:
        server.faults += faults
        edition = Edition(server.url)
        server.faults += faults
        same(edition, store, "shade-001")
        server.faults += faults
        same(edition, store, "shade-002")


@pytest.mark.parametrize(
    ("faults", "sentence"),
    [
        ([500] * 4, r"^http://.* answered 500 for edition.json$"),
        (["half"] * 8, r"^no answer from http://.*IncompleteRead"),
        ([403], r"^http://.* answered 403 for edition.json$"),
        ([301], r"^http://.* redirects edition.json to https://elsewhere.example/edition.json; open "),
    ],
    ids=str,
)
def test_failures_that_stay_are_named(
    faults: list[int | str], sentence: str, published: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, place = published
    monkeypatch.setattr(objects, "_WAIT_S", 0.001)
    with served(place) as server:
        edition = Edition(server.url)
        server.faults += faults
        with pytest.raises(StoreError, match=sentence):
            Edition(server.url)
        server.faults[:] = faults
        with pytest.raises(StoreError):
            edition["shade-001"]
        server.faults.clear()
        same(edition, store, "shade-001")
        server.faults[:] = [404]
        with pytest.raises(StoreError, match=r"^http://.* has no groups/[0-9a-f]*/brdf/c/0/0/0/0$"):
            edition["shade-002"]
        server.faults[:] = [404]
        with pytest.raises(NoEditionError):
            Edition(server.url)
        server.faults[:] = [404, 404, 404]
        with pytest.raises(StoreError, match=f"^{server.url} has neither an edition nor a brdfdb service$"):
            brdfdb.open(server.url)
        for digest in ("0" * 64, "of-none"):
            with pytest.raises(StoreError, match=f"^{server.url} has no edition with the digest {digest}$"):
                Edition(server.url, digest=digest)


def _flip(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def test_flipped_bits_are_named_and_never_read(published: Published, copy: Path) -> None:
    store, place = published
    rng = random.Random(7)
    files: dict[str, list[Path]] = {}  # by group, in each of which a bit flips: damaged records hide its other files
    for path in sorted(path.relative_to(copy) for path in copy.rglob("*") if path.is_file()):
        if path.parts[0] in ("groups", "families", "catalogue"):
            files.setdefault(path.parts[1].removesuffix(".records"), []).append(path)
    flips = 0
    while flips < FLIPS:
        flipped = [rng.choice(group) for group in files.values()]
        for path in flipped:
            _flip(copy / path, rng)
        edition = Edition(copy)
        answers(edition, store)  # what is read is that of the store
        found = list(damages(edition))
        assert [path for path in flipped if not any(str(path) in sentence for sentence in found)] == []
        for path in flipped:
            shutil.copyfile(place / path, copy / path)
        flips += len(flipped)
    assert list(damages(Edition(copy))) == []


def test_flipped_bits_of_root_and_index_are_named(published: Published, copy: Path) -> None:
    _, place = published
    rng = random.Random(7)
    for path in [copy / "edition.json", next((copy / "index").iterdir())]:
        for _ in range(20):
            _flip(path, rng)
            with pytest.raises(StoreError, match=re.escape(f"{copy} is damaged: ") + f".*{path.name}"):
                Edition(copy)
            shutil.copyfile(place / path.relative_to(copy), path)
    for content in (b"", b"{}", b"<html>"):
        (copy / "edition.json").write_bytes(content)
        with pytest.raises(StoreError, match=r" is damaged: the first line of edition\.json is not its digest$"):
            Edition(copy)


def test_lost_and_exchanged_objects_are_named(published: Published, copy: Path) -> None:
    store, _ = published
    edition = Edition(copy)
    pair = ["white", LONE]
    first, second = (copy / edition.revision(name)._records.shard for name in pair)
    content = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(content)
    assert answers(edition, store).keys() == set(pair)
    assert len(list(damages(edition))) >= 2
    for path in (next(copy.glob("catalogue/*")), next(copy.glob("families/*")), next(copy.glob("groups/*.records"))):
        path.unlink()
        assert any(path.name in sentence for sentence in damages(Edition(copy)))


class CrashError(Exception):
    """The end of a process, at a moment that a test chooses."""


def test_a_publication_that_ends_early_at_any_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    publish(tmp_path / "older", white=lambert(0.1))
    publish(tmp_path / "newer", white=lambert(0.5), grey=lambert(0.3), wide=lambert(0.2).isel(theta_i=slice(3)))
    store = brdfdb.open(tmp_path / "newer")
    assert isinstance(store, Store)
    publish_edition(store.root, tmp_path / "second")
    publish_edition(tmp_path / "older", tmp_path / "first")
    older = brdfdb.open(tmp_path / "older")
    assert isinstance(older, Store)
    write_file = objects.write_file
    total = len(contents(tmp_path / "second")) - 1  # the lock file is not written so
    for number in range(CRASHES):
        there = Path(shutil.copytree(tmp_path / "first", tmp_path / str(number)))
        writes = iter(range(number * total // (CRASHES - 1)))

        def ends(*arguments: Any, left: Any = writes, **keywords: Any) -> Any:
            if next(left, None) is None:
                raise CrashError
            return write_file(*arguments, **keywords)

        monkeypatch.setattr(objects, "write_file", ends)
        try:
            publish_edition(store.root, there)
        except CrashError:
            assert answers(Edition(there), older) == {}
            assert list(damages(Edition(there))) == []
        monkeypatch.undo()
        publish_edition(store.root, there)
        assert answers(Edition(there), store) == {}
        assert list(damages(Edition(there))) == []
        shutil.rmtree(there)


def test_a_publication_that_is_killed(published: Published, tmp_path: Path) -> None:
    store, place = published
    there = tmp_path / "edition"
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "publish", str(there), "--store", str(store.root)]
    rng = random.Random(5)
    ended = 0
    for _ in range(6):
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            while not (there / "groups").exists() and process.poll() is None:
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 0.3))
            process.send_signal(signal.SIGKILL)
        ended += process.returncode == -signal.SIGKILL
        if (there / "edition.json").exists():
            assert answers(Edition(there), store) == {}
        shutil.rmtree(there, ignore_errors=rng.random() < 0.5) if rng.random() < 0.3 else None
    assert ended >= 3
    subprocess.run(command, check=True, capture_output=True)
    assert answers(Edition(there), store) == {}
    assert list(damages(Edition(there))) == []
    left = {key for key in contents(there) if key.rpartition("/")[2].startswith(".")}
    assert {key: value for key, value in contents(there).items() if key not in left} == {
        key: value for key, value in contents(place).items() if not key.startswith(".")
    }


def test_threads_share_an_edition(published: Published) -> None:
    store, place = published
    with served(place) as server:
        edition = Edition(server.url, cache_bytes=50_000)
        joined = in_threads(16, lambda: [same(edition, store, name) for name in store])
        assert joined() == []
        shared = Edition(server.url)
        assert server.count(lambda: in_threads(16, _looked_up(shared, "shade-001"))()) == 2


def test_a_copy_by_pickle_is_of_the_same_edition(tmp_path: Path) -> None:
    publish(tmp_path / "store", white=lambert(0.25))
    publish_edition(tmp_path / "store", tmp_path / "edition")
    dumped = pickle.dumps(Edition(tmp_path / "edition"))
    publish(tmp_path / "store", white=lambert(0.5))
    publish_edition(tmp_path / "store", tmp_path / "edition")
    assert round(float(pickle.loads(dumped)["white"].brdf[0, 0, 0]) * 3.14159265, 4) == 0.25
    dataset = Edition(tmp_path / "edition").dataset("white")
    assert pickle.loads(pickle.dumps(dataset)).identical(dataset)


def test_a_child_that_was_forked_while_threads_decode_reads_on(tmp_path: Path) -> None:
    publish(tmp_path / "store", white=lambert(1.0), black=lambert(0.0))
    publish_edition(tmp_path / "store", tmp_path / "edition")
    with served(tmp_path / "edition") as server:
        for place in (str(tmp_path / "edition"), server.url):
            text = FORKING.replace(
                "brdfdb.store.reader import Store", "brdfdb.store.edition.reader import Edition as Store"
            )
            command = [sys.executable, "-c", text, place, "10"]
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600.0)
            assert (done.returncode, done.stderr) == (0, "")
