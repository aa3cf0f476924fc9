"""Programs of others read an edition: S3, web servers, DuckDB, pandas, zarr in Python and in JavaScript, xarray."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import shutil
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr

import brdfdb
from brdfdb.errors import ParameterError, StoreError
from brdfdb.store.edition.objects import ChangedRootError, objects_at
from brdfdb.store.edition.publishing import publish_edition
from brdfdb.store.edition.reader import Edition
from brdfdb.store.edition.verification import damages
from brdfdb.store.reader import Store
from tests.api.connections import wait_until
from tests.api.proxies import FOLDER, free_port, program
from tests.pipelines.command import Captured, run
from tests.store.edition.an_edition import STACKED, answers

Published = tuple[Store, Path]
NODE = Path(os.environ.get("BRDFDB_NODE", "node_modules/.bin")).parent
FORMULA = 3e-6  # of the printed formula in float64 against float32; as in tests/tables/test_xarray_view.py


@pytest.fixture(scope="module")
def s3() -> Iterator[dict[str, Any]]:
    """The options of obstore for an S3 server on loopback with the bucket `lab`."""
    server = pytest.importorskip("moto.server").ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server.start()
    endpoint = "http://{}:{}".format(*server.get_host_and_port())
    urllib.request.urlopen(urllib.request.Request(f"{endpoint}/lab", method="PUT")).close()
    yield {"endpoint": endpoint, "region": "us-east-1", "access_key_id": "key", "secret_access_key": "secret"}
    server.stop()


def test_an_edition_in_a_bucket(published: Published, s3: dict[str, Any]) -> None:
    store, place = published
    first = publish_edition(store.root, "s3://lab/edition", storage_options=s3)
    assert publish_edition(store.root, "s3://lab/edition", storage_options=s3) == first
    edition = brdfdb.open("s3://lab/edition", storage_options=s3)
    assert isinstance(edition, Edition)
    assert edition.digest == Edition(place).digest
    assert answers(edition, store) == {}
    assert list(damages(edition)) == []
    assert list(pickle.loads(pickle.dumps(edition))) == list(store)
    options = {"engine": "brdfdb", "material": "copper", "storage_options": s3}
    with xr.open_dataset("s3://lab/edition", **options) as dataset:
        assert dataset.load().identical(store.dataset("copper").load())
    with pytest.raises(StoreError, match=r"^no edition at s3://lab/nothing; "):
        brdfdb.open("s3://lab/nothing", storage_options=s3)


def test_a_bucket_that_does_not_exist_is_named_before_work(published: Published, s3: dict[str, Any]) -> None:
    place, sentence = "s3://no-such-bucket/edition", r"^s3://no-such-bucket: there is no such bucket$"
    with pytest.raises(StoreError, match=sentence):
        brdfdb.open(place, storage_options=s3)
    advanced: list[None] = []
    with pytest.raises(StoreError, match=sentence):
        publish_edition(published[0].root, place, storage_options=s3, advance=lambda: advanced.append(None))
    assert advanced == []
    with pytest.raises(StoreError, match=sentence):
        objects_at(place, s3).put({"key": b""})


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"allow_http": True},
        {"AWS_ALLOW_HTTP": "true", "timeout": "9s"},
        {"client_options": {"timeout": "9s"}},
        {"client_options": {"allow_http": True}, "retry_config": {"max_retries": 1}},
    ],
    ids=str,
)
@pytest.mark.parametrize("name", ["endpoint", "endpoint_url", "aws_endpoint", "AWS_ENDPOINT_URL"])
def test_options_of_the_client_and_names_of_the_endpoint(
    name: str, changed: dict[str, Any], s3: dict[str, Any]
) -> None:
    others = {key: value for key, value in s3.items() if key != "endpoint"}
    for options in ({name: s3["endpoint"], **others}, {"config": {name: s3["endpoint"], **others}}):
        objects = objects_at("s3://lab/options", {**options, **changed})
        objects.put({"key": b"1"})
        assert objects.get("key") == b"1"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"nonsense": "1"}, "nonsense: Configuration key: 'nonsense' is not valid for store 'S3'."),
        ({"region": 3}, "region: 'int' object is not an instance of 'str'"),
        ({"skip_signature": "maybe"}, 'skip_signature: Generic Config error: failed to parse "maybe" as boolean'),
        ({"timeout": "long"}, 'timeout: Generic Config error: failed to parse "long" as Duration'),
        ({"client_options": {"nonsense": 1}}, "client_options: Invalid key: nonsense."),
        ({"client_options": 1}, "client_options: 'int' object is not a mapping"),
        ({"aws_timeout_of": "1"}, "aws_timeout_of: Configuration key: 'aws_timeout_of' is not valid for store 'S3'."),
    ],
    ids=str,
)
def test_an_option_that_is_wrong_is_named(options: dict[str, Any], sentence: str, s3: dict[str, Any]) -> None:
    with pytest.raises(ParameterError) as raised:
        objects_at("s3://lab/options", {**s3, **options})
    assert str(raised.value) == f"storage_options: {sentence}"


@pytest.mark.parametrize(
    ("place", "address"),
    [
        ("s3://lab/x", "PUT http://169.254.169.254/latest/api/token"),
        ("gs://lab/x", "GET http://169.254.169.254/computeMetadata/v1/instance/service-accounts/default/token"),
    ],
)
@pytest.mark.usefixtures("s3")
def test_missing_credentials_are_said(place: str, address: str) -> None:
    objects: Any = objects_at(place)

    def refuses(*_: object) -> None:
        raise objects._obstore.exceptions.GenericError(f"Generic error: Error performing {address} in 4 ms - 403")

    objects._obstore = SimpleNamespace(get=refuses, exceptions=objects._obstore.exceptions)
    with pytest.raises(StoreError, match=r"lab/x: no credentials were found; set (AWS|GOOGLE)_.*_SKIP_SIGNATURE=true"):
        objects.versioned("edition.json")


def test_the_answer_of_a_bucket_is_a_sentence(s3: dict[str, Any]) -> None:
    objects = objects_at("s3://lab/answer", s3)
    objects.put({"key": b"1"})
    with pytest.raises(StoreError, match=r"cannot be read: [^<>]*416[^<>]*: InvalidRange$"):
        objects.get("key", 9, 3)


def test_commands_find_a_bucket_by_variables_of_the_environment(
    published: Published, s3: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    names = {"endpoint": "AWS_ENDPOINT_URL", "region": "AWS_REGION"}
    for key, value in s3.items():
        monkeypatch.setenv(names.get(key, f"AWS_{key.upper()}"), value)
    assert run("publish", "s3://lab/by-command", "--store", published[0].root) == 0
    assert run("verify", "--store", "s3://lab/by-command") == 0
    assert run("lookup", "white", "30", "0", "50", "120", "--store", "s3://lab/by-command") == 0
    assert run("lookup", "white", "30", "0", "50", "120", "--store", published[0].root) == 0
    *_, there, here = capsys.readouterr().out.splitlines()
    assert there == here


def test_of_two_publishers_to_a_bucket_one_is_told(s3: dict[str, Any]) -> None:
    objects = objects_at("s3://lab/raced", s3)
    for turn in range(2):  # no root yet, and one to be replaced
        before = objects.versioned("edition.json")
        objects.swap("edition.json", b"first %d" % turn, before)
        with pytest.raises(ChangedRootError, match=r"^another edition was published at s3://lab/raced meanwhile"):
            objects.swap("edition.json", b"second", before)
        assert objects.get("edition.json") == b"first %d" % turn


def test_a_forked_process_is_told_that_it_cannot_reach_a_bucket(s3: dict[str, Any], published: Published) -> None:
    publish_edition(published[0].root, "s3://lab/forked", storage_options=s3)
    text = (
        "import os, sys, json, brdfdb, signal; from brdfdb.errors import StoreError\n"
        "edition = brdfdb.open('s3://lab/forked', storage_options=json.loads(sys.argv[1]))\n"
        "if (child := os.fork()) == 0:\n"
        "    signal.alarm(60)\n"
        "    try: edition['white']\n"
        "    except StoreError as error: print(error)\n"
        "else: os.waitpid(child, 0)\n"
    )
    command = [sys.executable, "-W", "ignore", "-c", text, json.dumps(s3)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "s3://lab/forked cannot be reached from a process made by fork; start it by spawn\n"


@contextlib.contextmanager
def _running(command: list[str], port: int) -> Iterator[None]:
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:

        def listens() -> bool:
            with socket.socket() as client:
                return client.connect_ex(("127.0.0.1", port)) == 0

        try:
            wait_until(listens)
            yield
        finally:
            process.send_signal(signal.SIGTERM)


@pytest.fixture(params=["python", "nginx"])
def web(request: pytest.FixtureRequest, published: Published, tmp_path: Path) -> Iterator[str]:
    """The address of the edition behind a web server: that of Python, without ranges, and nginx as documented."""
    port = free_port()
    if request.param == "python":
        command = [sys.executable, "-m", "http.server", str(port), "--bind", "127.0.0.1", "-d", str(published[1])]
    else:
        text = (FOLDER / "edition.conf").read_text(encoding="utf-8")
        for old, new in {"listen 80": f"listen 127.0.0.1:{port}", "/srv/edition": str(published[1])}.items():
            assert old in text
            text = text.replace(old, new)
        kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        folders = " ".join(f"{kind}_temp_path {tmp_path}/{kind};" for kind in kinds)
        log = f"log_format asked '$request_uri $http_range'; access_log {tmp_path}/access.log asked;"
        (tmp_path / "nginx.conf").write_text(
            f"daemon off; master_process off; user root; pid {tmp_path}/pid; error_log {tmp_path}/error.log;\n"
            f"events {{}}\nhttp {{ {folders} {log}\n{text}\n}}\n",
            encoding="utf-8",
        )
        command = [program("nginx"), "-p", str(tmp_path), "-c", str(tmp_path / "nginx.conf")]
        command += ["-e", str(tmp_path / "error.log")]
    with _running(command, port):
        yield f"http://127.0.0.1:{port}/ed" if request.param == "nginx" else f"http://127.0.0.1:{port}"


def test_an_edition_behind_a_web_server(web: str, published: Published, tmp_path: Path) -> None:
    store, _ = published
    edition = brdfdb.open(web)
    for name in (*STACKED[:2], STACKED[0]):
        edition[name].lookup(0.1, 0.0, 0.2, 0.0)
    log = tmp_path / "access.log"
    if log.exists():
        asked = log.read_text().splitlines()
        assert [line.split("/")[2] for line in asked] == ["edition.json -", "index", "groups", "groups", "groups"]
        headers = [urllib.request.urlopen(web + line.split()[0].removeprefix("/ed")).headers for line in asked]
        assert [each["Cache-Control"] for each in headers] == ["no-cache", *["public, max-age=31536000, immutable"] * 4]
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"{web}/.edition.json.lock")
    assert isinstance(edition, Edition)
    assert answers(edition, store) == {}
    assert list(damages(edition)) == []


def test_pandas_and_duckdb_read_the_catalogue(web: str, published: Published) -> None:
    pandas, duckdb = pytest.importorskip("pandas"), pytest.importorskip("duckdb")
    store, place = published
    edition = Edition(place)
    (file,) = (place / "catalogue").iterdir()
    frame = pandas.read_parquet(file)
    assert list(frame["name"]) == list(store)
    for row in frame.to_dict("records"):
        summary = store.summary(row["name"])
        assert (row["title"], row["model"], row["revision"]) == tuple(
            summary[key] for key in ("title", "model", "revision")
        )
        assert row["manifest_sha256"] == store[row["name"]].digest
        assert row["group"] == edition.revision(row["name"]).group
    query = "select name from '{}' where measured or model = 'lambert' order by name"
    assert duckdb.sql(query.format(file)).fetchall() == [
        (name,) for name in store if name == "measured-clay" or store.summary(name)["model"] == "lambert"
    ]
    assert pandas.read_parquet(f"{web}/catalogue/{file.name}").equals(frame)  # DuckDB's own extension is downloaded


def _rebuilt(arrays: dict[str, np.ndarray], dims: dict[str, Any], attributes: dict[str, Any], place: int) -> np.ndarray:
    """Return f_r [1/sr] of a member by the formula that a group prints, without brdfdb."""

    def of(name: str, otherwise: Any = 0.0) -> Any:
        if name not in arrays:
            return otherwise
        values = np.asarray(arrays[name], dtype=np.float64)
        return values[place] if "material" in dims[name] else values

    how = attributes.get("interpolation", {})
    axes = [name for name in dims["parts"] if name not in ("material", "part", "wavelength")]
    values = of("parts")
    if "spectra" in arrays:
        values = values @ of("spectra")
    if how.get("logarithm"):
        values = np.maximum(np.exp(values) - of("offset", how.get("offset", 0.0)), 0.0)
    grid = dict(zip(axes, np.meshgrid(*(np.radians(arrays[axis]) for axis in axes), indexing="ij"), strict=True))
    if "theta_i" in grid:
        mu = np.cos(grid["theta_i"]) * np.cos(grid["theta_r"])
    else:
        h, d = grid["theta_h"], grid["theta_d"]
        mu = (np.cos(h) * np.cos(d)) ** 2 - (np.sin(h) * np.sin(d) * np.cos(grid["phi_d"])) ** 2
    mu = np.maximum(mu, 1e-30) ** how.get("power", 0.0)
    uniform = of("uniform")
    trailing = values.ndim - mu.ndim
    return np.asarray(uniform + values / mu.reshape(mu.shape + (1,) * trailing))


def _compare(
    arrays: dict[str, np.ndarray], dims: dict[str, Any], attributes: Any, names: list[str], store: Store
) -> None:
    for place, name in enumerate(names):
        expected = store.dataset(name)["brdf"].to_numpy().astype(np.float64)
        if "brdf" in arrays:
            found = np.asarray(arrays["brdf"])
            found = found[place] if "material" in dims["brdf"] else found
            np.testing.assert_array_equal(found, expected.astype(np.float32))
        elif "mixture" not in arrays:
            found = _rebuilt(arrays, dims, attributes, place)
            known = expected > 1e-3 * np.nanmax(expected)
            np.testing.assert_allclose(found[known], expected[known], rtol=1e-4)


def test_zarr_and_xarray_read_the_numbers(published: Published) -> None:
    store, place = published
    edition = Edition(place)
    for entry in edition.index["groups"]:
        at, names = place / "groups" / entry["digest"], entry["names"]
        if names == ["of-others"]:
            continue
        group = zarr.open_group(at, mode="r")
        arrays: dict[str, Any] = {name: np.asarray(array[...]) for name, array in group.arrays()}
        dims: dict[str, Any] = {name: array.metadata.dimension_names or () for name, array in group.arrays()}
        if len(names) > 1:
            assert list(arrays["material"]) == names
        _compare(arrays, dims, dict(group.attrs), names, store)
        with xr.open_zarr(at, chunks=None) as dataset:
            for name, values in arrays.items():
                np.testing.assert_array_equal(dataset[name].values, values)


READER = """
import * as zarr from "zarrita";
const store = await zarr.withConsolidatedMetadata(new zarr.FetchStore(process.argv[2]), { format: "v3" });
const group = await zarr.open.v3(store, { kind: "group" });
const found = { attributes: group.attrs, arrays: {} };
for (const { path, kind } of store.contents()) {
  if (kind !== "array" || path === "/extrapolated") continue;
  const array = await zarr.open.v3(group.resolve(path), { kind: "array" });
  const read = await zarr.get(array);  // a number, if the array has no dimensions
  const { shape, dimensionNames: dims } = array;
  found.arrays[path.slice(1)] = { data: Array.from(read.data ?? [read]), shape, dims: dims ?? [] };
}
console.log(JSON.stringify(found, (_, value) => (Number.isNaN(value) ? null : value)));
"""


@pytest.mark.parametrize("web", ["nginx"], indirect=True)  # zarrita takes wrong bytes of a server without ranges
def test_zarr_in_javascript_reads_the_numbers(web: str, published: Published, tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None or not (NODE / "zarrita").is_dir():
        pytest.skip("zarrita is not installed; BRDFDB_NODE names the folder of the programs of npm")
    store, place = published
    (tmp_path / "read.mjs").write_text(READER, encoding="utf-8")
    (tmp_path / "node_modules").symlink_to(NODE.resolve())
    for entry in Edition(place).index["groups"]:
        names = entry["names"]
        if names == ["of-others"]:
            continue
        command = [node, "read.mjs", f"{web}/groups/{entry['digest']}"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        arrays: dict[str, Any] = {}
        for name, array in found["arrays"].items():
            kind = object if name == "material" else np.float64
            arrays[name] = np.array(array["data"], dtype=kind).reshape(array["shape"])
        dims = {name: array["dims"] for name, array in found["arrays"].items()}
        if len(names) > 1:
            assert list(arrays["material"]) == names
        _compare(arrays, dims, found["attributes"], names, store)
