"""`brdfdb serve`: a socket, one or more worker processes, and an end that lets requests finish."""

from __future__ import annotations

import contextlib
import os
import socket
import tempfile
from pathlib import Path

import brdfdb

GRACE_S = 10  # for requests that are being answered when the server is told to stop


def serve(store_dir: Path, host: str, port: int, workers: int = 1) -> None:
    """Serve a store over HTTP until interrupted.

    Parameters
    ----------
    store_dir : Path
        Directory that ``brdfdb build --store`` wrote.
    host : str
        Name or address to listen on.
    port : int
        0 to 65535; 0 takes any free port.
    workers : int
        Processes that answer, each with tables of its own in memory.

    Raises
    ------
    brdfdb.store.StoreError
        If there is no store at `store_dir`.
    ValueError
        If the port is out of range, or a variable ``BRDFDB_*`` has a value that is not allowed.
    OSError
        If `host` is not an address of this machine or the port is taken.
    """
    import uvicorn
    from uvicorn.supervisors import Multiprocess

    from brdfdb_api.protocol import BoundedProtocol
    from brdfdb_api.settings import Settings

    if not 0 <= port <= 65535:
        raise ValueError(f"port: {port} is outside [0, 65535]")
    os.environ["BRDFDB_STORE"] = str(store_dir)  # workers read it
    Settings.from_environment()
    brdfdb.open(store_dir)
    config = uvicorn.Config(
        "brdfdb_api:create_app",
        factory=True,
        http=BoundedProtocol,
        host=host,
        port=port,
        workers=workers,
        access_log=False,
        log_level="warning",
        timeout_graceful_shutdown=GRACE_S,
    )
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(_listening(host, port))
        port = listener.getsockname()[1]
        print(f"serving {store_dir} at http://{f'[{host}]' if ':' in host else host}:{port}/", flush=True)
        stack.enter_context(contextlib.suppress(KeyboardInterrupt))
        if workers == 1:
            uvicorn.Server(config).run(sockets=[listener])
        else:
            # where workers count, so that any of them can tell what all did
            counts = stack.enter_context(tempfile.TemporaryDirectory(prefix="brdfdb-metrics-"))
            os.environ["PROMETHEUS_MULTIPROC_DIR"] = counts
            Multiprocess(config, sockets=[listener]).run()


def _listening(host: str, port: int) -> socket.socket:
    """A socket that listens; OSError, in one sentence, where that is not possible."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends small answers at once (TCP_NODELAY) only on a socket that names its protocol: else each takes 40 ms.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(1024)
    except OSError as error:
        listener.close()
        raise OSError(f"cannot listen on {host}, port {port}: {error.strerror}") from error
    return listener
