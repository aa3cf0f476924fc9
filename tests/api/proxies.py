"""nginx and Caddy as the documentation configures them, at free ports, with the changes that a test names."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.api.connections import wait_until

FOLDER = Path(__file__).parents[2] / "docs" / "reference" / "proxies"
_SYSTEM_FOLDERS = "/usr/sbin:/usr/local/sbin"
_TEMPORARY = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
_NGINX = """\
daemon off;
master_process off;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{}}
http {{
  access_log off;
  {temporary}
  include {folder}/brdfdb.conf;
}}
"""


def program(name: str) -> str:
    """Return the path of a program; skip the test where it is not installed."""
    found = shutil.which(name, path=f"{os.environ.get('PATH', '')}:{_SYSTEM_FOLDERS}")
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def free_port() -> int:
    """Return a port that nothing listens on."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


def configuration(name: str, changes: Mapping[str, str]) -> str:
    """Return a file of the documentation with changes; the file must contain each text that is replaced."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


@contextmanager
def nginx(folder: Path, upstream: int, changes: Mapping[str, str] = {}) -> Iterator[int]:
    """The port of an nginx before a service."""
    binary, port = program("nginx"), free_port()
    places = {"listen 80": f"listen 127.0.0.1:{port}", "127.0.0.1:8000": f"127.0.0.1:{upstream}"}
    text = configuration("nginx.conf", places | {"/var/cache/nginx/brdfdb": str(folder / "cache")} | dict(changes))
    (folder / "brdfdb.conf").write_text(text, encoding="utf-8")
    temporary = " ".join(f"{name}_temp_path {folder}/{name};" for name in _TEMPORARY)
    (folder / "nginx.conf").write_text(_NGINX.format(folder=folder, temporary=temporary), encoding="utf-8")
    command = [binary, "-p", str(folder), "-c", str(folder / "nginx.conf"), "-e", str(folder / "error.log")]
    with _running(command, port, {}):
        yield port


@contextmanager
def caddy(folder: Path, upstream: int, changes: Mapping[str, str] = {}) -> Iterator[int]:
    """The port of a Caddy before a service."""
    binary, port = program("caddy"), free_port()
    places = {":80 {": f":{port} {{\n\tbind 127.0.0.1", "127.0.0.1:8000": f"127.0.0.1:{upstream}"}
    text = configuration("Caddyfile", places | dict(changes))
    (folder / "Caddyfile").write_text(text.replace("{\n", "{\n\tadmin off\n", 1), encoding="utf-8")
    command = [binary, "run", "--config", str(folder / "Caddyfile"), "--adapter", "caddyfile"]
    with _running(command, port, {"XDG_CONFIG_HOME": str(folder), "XDG_DATA_HOME": str(folder), "HOME": str(folder)}):
        yield port


@contextmanager
def _running(command: list[str], port: int, environment: Mapping[str, str]) -> Iterator[None]:
    """Run a proxy until the end of the block, which begins when the proxy listens."""
    log = Path(command[-1] if "-e" in command else os.devnull)
    with subprocess.Popen(command, env={**os.environ, **environment}, stderr=subprocess.DEVNULL) as process:

        def listens() -> bool:
            assert process.poll() is None, log.read_text()
            with socket.socket() as client:
                return client.connect_ex(("127.0.0.1", port)) == 0

        try:
            wait_until(listens)
            yield
        finally:
            process.send_signal(signal.SIGTERM)
