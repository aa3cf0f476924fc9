"""A cache between service and client: nginx keeps what it may, and no answer is that of another store."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

import brdfdb
from brdfdb.errors import StoreError, UnknownRevisionError
from brdfdb.store.reader import Store
from tests.api.a_store import pinned_of, publish, serving
from tests.api.connections import WAIT_S
from tests.api.proxies import free_port, nginx

# What is kept, and for how long, is what the service says
SHOWN = {"proxy_cache brdfdb;": "proxy_cache brdfdb; add_header X-Cache $upstream_cache_status;"}
ANGLES = np.array([[0.1, 0.4, 0.9], [0.0, 0.1, 0.2], [0.2, 0.5, 1.0], [1.0, 2.0, 3.0]])
LOOKUP = "lookup?theta_i=10&theta_r=20"


@pytest.fixture
def upstream() -> int:
    """The port at which the stores are served, one after the other."""
    return free_port()


@pytest.fixture
def proxy(tmp_path: Path, upstream: int) -> Iterator[str]:
    """The address of the nginx of the documentation."""
    folder = tmp_path / "nginx"
    folder.mkdir()
    with nginx(folder, upstream, SHOWN) as port:
        yield f"http://127.0.0.1:{port}"


@pytest.fixture
def stores(tmp_path: Path) -> tuple[Path, Path]:
    """Two stores whose tables have the same names and numbers of revisions, and other values."""
    for folder, rho in (("first", 0.2), ("second", 0.8)):
        publish(tmp_path / folder, "tile", "oren_nayar", rho=rho, sigma_deg=20.0)
    return tmp_path / "first", tmp_path / "second"


def _state(proxy: str, path: str) -> str:
    return httpx.get(f"{proxy}{path}", timeout=WAIT_S).headers["x-cache"]


def test_the_cache_keeps_answers_with_a_digest(proxy: str, upstream: int, stores: tuple[Path, Path]) -> None:
    pinned = pinned_of(Store(stores[0]), "tile")
    with serving(stores[0], port=upstream):
        for path in (f"materials/tile/revisions/{{}}/{LOOKUP}", "store/materials/tile/{}/brdf/c/0/0/0"):
            for _ in range(2):
                assert _state(proxy, f"/v1/{path.format('r000001')}") == "MISS"
            states = [_state(proxy, f"/v1/{path.format(pinned)}") for _ in range(2)]
            assert states == ["MISS", "HIT"]


def test_lookups_are_those_of_the_store_that_is_served(proxy: str, upstream: int, stores: tuple[Path, Path]) -> None:
    one_point = (0.3, 0.0, 0.4, 2.0)
    tables = []
    for root in stores:
        here = brdfdb.open(root)["tile"]
        with serving(root, port=upstream):
            table = brdfdb.open(proxy)["tile"]
            tables.append(table)
            for _ in range(2):
                assert table.lookup(*one_point) == pytest.approx(float(here.lookup(*one_point)), rel=1e-12)
                np.testing.assert_allclose(table.lookup(*ANGLES), here.lookup(*ANGLES), rtol=1e-12)
                assert dict(table.attrs) == {key: value for key, value in here.attrs.items() if key != "request"}
            answer = httpx.get(f"{proxy}/v1/materials/tile/revisions/r000001/{LOOKUP}", timeout=WAIT_S).json()
            expected = here.lookup(*np.deg2rad([10.0, 0.0, 20.0, 0.0]))
            assert answer["brdf"] == pytest.approx(float(expected), rel=1e-12)
    with serving(stores[1], port=upstream):  # the table of the store before: what the cache has, or no answer
        first = float(brdfdb.open(stores[0])["tile"].lookup(*one_point))
        assert tables[0].lookup(*one_point) == pytest.approx(first, rel=1e-12)
        with pytest.raises(UnknownRevisionError, match=r"^tile has no revision 'r000001-"):
            tables[0].lookup(*ANGLES)


def test_a_dataset_is_of_one_store(proxy: str, upstream: int, stores: tuple[Path, Path]) -> None:
    pytest.importorskip("aiohttp")
    for root in stores:
        with serving(root, port=upstream):
            for there in (brdfdb.open(proxy).dataset("tile"), brdfdb.open(proxy).dataset("tile", "r000001")):
                assert there.load().identical(brdfdb.open(root).dataset("tile").load())
    with serving(stores[0], port=upstream):
        cached = brdfdb.open(proxy).dataset("tile")
        direct = brdfdb.open(f"http://127.0.0.1:{upstream}").dataset("tile")
    with serving(stores[1], port=upstream):  # what was opened before: the same table, or no answer
        assert cached.load().identical(brdfdb.open(stores[0]).dataset("tile").load())
        with pytest.raises(StoreError, match=r"^tile r000001 of http.* was removed or replaced while it was read"):
            direct["brdf"].load()


def test_a_cache_that_mixes_two_stores(proxy: str, upstream: int, stores: tuple[Path, Path], tmp_path: Path) -> None:
    pytest.importorskip("aiohttp")
    with serving(stores[0], port=upstream):
        brdfdb.open(proxy).dataset("tile").load()
    cached = (tmp_path / "nginx" / "cache").rglob("*")
    (chunk,) = (path for path in cached if b"/brdf/c/0/0/0" in path.read_bytes())
    content = chunk.read_bytes()
    first, second = ((root / "materials/tile/r000001/brdf/c/0/0/0").read_bytes() for root in stores)
    assert content.endswith(first)
    padded = (second + bytes(len(first)))[: len(first)]
    chunk.write_bytes(content.replace(first, padded))
    with (
        serving(stores[0], port=upstream),
        pytest.raises(StoreError, match=r"brdf/c/0/0/0 differs from its manifest"),
    ):
        brdfdb.open(proxy).dataset("tile")["brdf"].load()
