"""What tests of the HTTP layer share: materials, quick to tabulate, a client without a network, and a server."""

from __future__ import annotations

import asyncio
import io
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import uvicorn

from brdfdb.materials import Material
from brdfdb.store.publication import publish_dataset
from brdfdb.store.reader import Store
from brdfdb.tables.error_measurement import measure
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import tabulate
from brdfdb_api import server
from brdfdb_api.http.app import create_app
from brdfdb_api.log import flush
from brdfdb_api.settings import Settings

PROBLEM = "application/problem+json"
NPY = "application/x-npy"

# Of the value plus the median; 2.7e-14 is the worst measured, on the flanks of copper: degrees round the angles
AGREEMENT = 3e-14

THETA = [0, 30, 60, 85]
GREY = Grid({"theta_i": THETA, "theta_r": THETA, "delta_phi": [0, 90, 180]})
TURNED = Grid({"theta_i": THETA, "phi_i": [0, 45, 90], "theta_r": THETA, "phi_r": np.arange(0, 361, 45)})
VISIBLE_NM = np.arange(400.0, 701.0, 20.0)

server.LAST_S = 0.0  # of services in this process: nobody asks them once their test is over


def publish(root: Path, name: str, model: str, grid: Grid = GREY, *, error: bool = False, **entries: Any) -> str:
    """Tabulate a material and publish it; returns its revision. What is neither of these names is a parameter."""
    beside = {key: entries.pop(key) for key in ("refractive_index",) if key in entries}
    about = {"title": f"Test {name}", "model": model, "source": f"no paper, {name}", **beside, "parameters": entries}
    material = Material.from_table(name, about)
    layout = Layout(material, grid, VISIBLE_NM if material.spectral else None)
    dataset = tabulate(layout)
    if error:
        found = measure(layout, lambda rows: dataset["brdf"].values[rows], count=64)
        dataset = dataset.assign_attrs(error=found.model_dump())
    return publish_dataset(root, name, dataset)[0]


class Client:
    """Send requests to an application, each in an event loop of its own."""

    def __init__(self, app: Any) -> None:
        self.app = app

    def request(self, method: str, url: str, **request: Any) -> httpx.Response:
        async def send() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
                return await client.request(method, url, **request)

        answer = asyncio.run(send())
        flush()  # the log, before other tests read what is written to standard error
        return answer

    def get(self, url: str, **request: Any) -> httpx.Response:
        return self.request("GET", url, **request)

    def post(self, url: str, **request: Any) -> httpx.Response:
        return self.request("POST", url, **request)

    def problem(self, method: str, url: str, status: int, **request: Any) -> dict[str, Any]:
        """Send a request that must end in a problem with `status`."""
        response = self.request(method, url, **request)
        assert (response.status_code, response.headers["content-type"]) == (status, PROBLEM), response.text
        problem: dict[str, Any] = response.json()
        assert problem["status"] == status
        assert problem["type"] == "about:blank"
        assert problem["title"]
        assert problem["detail"]
        assert "Traceback" not in response.text
        return problem


def client_of(root: Path, **settings: Any) -> Client:
    """A client of an application that serves a store."""
    return Client(create_app(Settings(store=root, **settings)))


@contextmanager
def serving(root: Path, port: int = 0, **settings: Any) -> Iterator[str]:
    """The address of a service in a thread of this process, at any free port or the one that is given."""
    app = create_app(Settings(store=root, log_level="error", **settings))
    with socket.create_server(("127.0.0.1", port)) as listener:
        config = uvicorn.Config(app, http="httptools", log_level="error", timeout_graceful_shutdown=1, lifespan="off")
        service = server.DrainingServer(config)
        thread = threading.Thread(target=service.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            service.should_exit = True
            thread.join()


@contextmanager
def serving_command(
    root: Path, *options: str, stderr: Any = subprocess.DEVNULL, **environment: str
) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The process of `brdfdb serve` on a free port, and this port; Ctrl-C ends it, and it must end well."""
    command = [sys.executable, "-m", "brdfdb_pipelines.cli", "serve", "--store", str(root), "--port", "0", *options]
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("BRDFDB_")}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=stderr, text=True, env={**inherited, **environment}
    ) as process:
        assert process.stdout is not None
        try:
            yield process, int(process.stdout.readline().rsplit(":", 1)[1].strip(" /\n"))
        finally:
            process.send_signal(signal.SIGINT)
    assert process.returncode == 0


def read_npy(content: bytes) -> np.ndarray:
    return np.load(io.BytesIO(content), allow_pickle=False)


def npy(array: Any) -> bytes:
    """The bytes of a .npy file."""
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def pinned_of(store: Store, name: str, revision: str = "r000001") -> str:
    """The name of a revision with its digest, as addresses have it."""
    return f"{revision}-{store.located(name, revision)[1][:16]}"


def degrees(store: Store, name: str, *angles_deg: Any, **keywords: Any) -> Any:
    """What Python looks up at angles in degrees."""
    return store[name].lookup(*np.deg2rad(np.broadcast_arrays(*angles_deg)), **keywords)


def angles(count: int = 400) -> list[np.ndarray]:
    """Light and viewer [rad] everywhere, also below the horizon, and every other viewer near the mirror direction."""
    rng = np.random.default_rng(7)
    theta_i, theta_r = rng.uniform(0.0, 1.7, (2, count))
    phi_i, phi_r = rng.uniform(-9.0, 9.0, (2, count))
    theta_r[::2], phi_r[::2] = np.abs(theta_i[::2] + rng.normal(0.0, 0.05, count // 2)), phi_i[::2] + np.pi
    return [theta_i, phi_i, theta_r, phi_r]


def same(found: Any, expected: Any, tolerance: float = AGREEMENT) -> None:
    assert (np.shape(found), np.result_type(found)) == (np.shape(expected), np.result_type(expected))
    np.testing.assert_array_equal(np.equal(found, 0.0), np.equal(expected, 0.0))
    atol = tolerance * np.nanmedian(np.abs(expected)) if np.size(expected) else 0.0
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=atol)
