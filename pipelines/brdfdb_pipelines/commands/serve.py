"""The command `brdfdb serve`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import MOST_JOBS, add_snapshot, add_tables, whole_number

HELP = "Serve lookups over HTTP."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the store, the address and the number of processes."""
    add_tables(parser)
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    parser.add_argument(
        "--port", type=int, default=8000, help="port to listen on; 0: any free port (default: %(default)s)"
    )
    parser.add_argument(
        "--workers",
        type=whole_number(MOST_JOBS),
        default=1,
        metavar="N",
        help="number of processes (default: %(default)s)",
    )
    add_snapshot(parser)


def run(options: argparse.Namespace) -> int:
    """Serve the store until a signal."""
    from brdfdb_api.server import serve

    serve(options.store, options.host, options.port, options.workers, options.snapshot)
    return 0
