"""A small store with a table of each kind, and a web server of files that counts requests and fails as told."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.storage import MemoryStore

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.materials import presets
from brdfdb.measurements.measured_source import MeasuredSource
from brdfdb.store import codec
from brdfdb.store.edition.reader import Edition
from brdfdb.store.lock import Lock
from brdfdb.store.publication import publish, publish_dataset, publish_files, publish_layout
from brdfdb.store.reader import Store
from brdfdb.store.snapshots import create
from brdfdb_pipelines import cli
from tests.measurements.made_up import scattered
from tests.pipelines.recipes import anisotropic, isotropic, material
from tests.store.a_store import lambert
from tests.tables.test_polarisation import polarised, rough

THETA = "[0, 40, 80]"
RECIPE = "".join(
    (
        'materials = ["copper", "bronze", "shade"]\nwavelengths_nm = [450, 550, 650]\n',
        *(isotropic(THETA, "[0, 90, 180]", kind=kind) for kind in ("isotropic", "spectral")),
        anisotropic(),
        material("copper", "Copper", "he_torrance", "sigma_0_um = 0.1", "tau_um = 2.0"),
        material("bronze", "Bronze", "he_torrance", "sigma_0_um = 0.2", "tau_um = 2.0"),
        material("shade", "Shades", "lambert", "rho = [0.1, 0.2, 0.4, 0.8]", table="sweep"),
    )
)
STACKED = ("shade-001", "shade-002", "shade-003", "shade-004")
LONE = "clay-vase"  # in numbers of which f_r is rebuilt
ANGLES = np.random.default_rng(3).uniform(0.0, 1.5, (4, 50))


def make(root: Path) -> None:
    """Build a store with a family, a table in chunks, one in numbers, one of another program, measured, polarised."""
    (root.parent / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    assert cli.main(["build", str(root.parent / "recipe.toml"), "--store", str(root), "--jobs", "1"]) == 0
    publish(root, presets()[LONE], tolerance=0.2)
    publish(root, presets()["rendered-sphere-10deg"], tolerance=0.05)
    publish(root, presets()["scene-copper-sphere"], tolerance=0.2, wavelengths_nm=[450.0, 550.0, 650.0])
    samples = scattered(presets()["clay-vase"].brdf_at(None), 240, 0.03)
    publish(root, MeasuredSource.of_samples(samples, name="measured-clay"), tolerance=0.2)
    publish_layout(root, "polarised-copper", polarised(rough(), 0.2))
    most, codec._CHUNK_VALUES = codec._CHUNK_VALUES, 9
    publish_dataset(root, "in-chunks", lambert(0.3))
    codec._CHUNK_VALUES = most
    with Lock(root, "of-others"):
        publish_files(root, "of-others", _files_of_another_program())
    publish_dataset(root, "white", lambert(0.25))
    create(root, "first")
    publish_dataset(root, "white", lambert(0.5))


def _files_of_another_program() -> dict[str, bytes]:
    """Return a table as zarr writes it by default: gzip-less, one chunk, other codecs than those of the store."""
    files: dict[str, Any] = {}
    dataset = lambert(0.7)
    group = zarr.open_group(MemoryStore(files), mode="w", attributes={"title": "Theirs", "model": "lambert"})
    for name, variable in dataset.variables.items():
        group.create_array(str(name), data=variable.to_numpy(), dimension_names=tuple(map(str, variable.dims)))
    return {key: data.to_bytes() for key, data in files.items()}


def same(edition: Edition, store: Store, name: str) -> None:
    """Assert that the table of an edition is that of a store, bit for bit."""
    table, expected = edition[name], store[name]
    assert (table.digest, table.revision, table.attrs) == (expected.digest, expected.revision, expected.attrs)
    where = {} if table.wavelength_nm is None else {"wavelength_nm": float(table.wavelength_nm[0]) + 7.0}
    np.testing.assert_array_equal(table.lookup(*ANGLES, **where), expected.lookup(*ANGLES, **where))
    assert edition.revision(name).manifest == store.revision(name).manifest
    assert edition.revision(name).manifest_bytes == store.revision(name).manifest_bytes


def answers(edition: Edition, store: Store) -> dict[str, str]:
    """Return the error of each material that an edition refuses; all others must be those of the store."""
    refused = {}
    for name in store:
        try:
            same(edition, store, name)
        except (StoreError, UnknownMaterialError) as error:
            refused[name] = str(error)
    return refused


@dataclass
class FileServer:
    """Files by HTTP: what was asked, and what the next answers are in place of files."""

    root: Path
    ranges: bool = True
    asked: list[str] = field(default_factory=list)
    faults: list[int | str] = field(default_factory=list)  # a status, or "half", for the next requests
    url: str = ""

    def count(self, work: Callable[[], object]) -> int:
        """Return how many requests a function makes."""
        self.asked.clear()
        work()
        return len(self.asked)


@contextmanager
def served(root: Path, **options: Any) -> Iterator[FileServer]:
    """Serve the files below a directory at a free port."""
    server = FileServer(root, **options)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            server.asked.append(self.path)
            fault = server.faults.pop(0) if server.faults else None
            path = root / self.path.lstrip("/")
            status = fault if isinstance(fault, int) else 200 if path.is_file() else 404
            content = path.read_bytes() if status == 200 else b"no"
            wanted = self.headers.get("Range")
            if status == 200 and wanted and server.ranges:
                first, last = map(int, wanted.removeprefix("bytes=").split("-"))
                status, content = 206, content[first : last + 1]
            self.send_response(status)
            self.send_header("Content-Length", str(len(content)))
            if status == 301:
                self.send_header("Location", "https://elsewhere.example/edition.json")
            self.end_headers()
            self.wfile.write(content[: len(content) // 2] if fault == "half" else content)
            self.close_connection = fault == "half"

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listener:
        thread = threading.Thread(target=listener.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        server.url = f"http://127.0.0.1:{listener.server_port}"
        try:
            yield server
        finally:
            listener.shutdown()
            thread.join()
