"""Arguments that several commands have, and the types of numbers on the command line."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path

from brdfdb.errors import ParameterError
from brdfdb.place import path_of, tables_place
from brdfdb.store import default_root

MOST_JOBS = 1024  # threads or processes
MOST_WIDTH = 4096  # pixels across a picture: a wider one takes tens of gigabytes

_UNITS = {"": 1, "B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


def place(text: str) -> Path:
    """Return the path that an option names: every place on the command line is read here."""
    try:
        return path_of(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(error.sentence) from None


def tables(text: str) -> Path | str:
    """Return the place of a store or of an edition that an option names."""
    try:
        return tables_place(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(error.sentence) from None


def numbers(text: str) -> list[float]:
    """Return numbers with commas between them."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number, or numbers with commas between them") from None


def add_store(parser: argparse._ActionsContainer) -> None:
    """Add the option --store DIR."""
    parser.add_argument(
        "--store",
        type=place,
        default=default_root(),
        metavar="DIR",
        help="directory of the store (default: $BRDFDB_STORE, or %(default)s)",
    )


def add_tables(parser: argparse.ArgumentParser) -> None:
    """Add the option --store PLACE of commands that read tables."""
    parser.add_argument(
        "--store",
        type=tables,
        default=default_root(),
        metavar="PLACE",
        help="directory of a store or of an edition, or the address of an edition: https://, s3:// or gs:// "
        "(default: $BRDFDB_STORE, or %(default)s)",
    )


def add_snapshot(parser: argparse.ArgumentParser) -> None:
    """Add the option --snapshot NAME."""
    parser.add_argument("--snapshot", metavar="NAME", help="read the revisions in this snapshot of the store")


def add_jobs(parser: argparse.ArgumentParser, workers: str) -> None:
    """Add the option --jobs N, a number of `workers`; the default is the number of processors."""
    parser.add_argument(
        "--jobs",
        type=whole_number(MOST_JOBS),
        default=processors(),
        metavar="N",
        help=f"{workers} (default: %(default)s)",
    )


def add_workers(parser: argparse.ArgumentParser, written: str, *, threads: bool = True) -> None:
    """Add --jobs, --processes where threads are the default, and --scheduler, whose workers must see `written` too."""
    add_jobs(parser, "number of threads or processes" if threads else "number of processes")
    where = parser.add_mutually_exclusive_group()
    if threads:
        where.add_argument("--processes", action="store_true", help="use processes instead of threads")
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help=f"use the dask cluster of this scheduler, such as tcp://10.0.0.1:8786; its workers must see {written} "
        "under the same path",
    )


def processors() -> int:
    """Return the number of processors that this process may use; of all, where the system does not tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share_cores() -> None:
    """Let linear algebra use one thread per worker; call this before numpy is imported.

    The workers use all cores. Additional threads of linear algebra wait for one another, and double the time.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def add_out(parser: argparse.ArgumentParser, directory: str) -> None:
    """Add the option --out DIR with its default."""
    parser.add_argument(
        "--out",
        type=place,
        default=directory,
        metavar="DIR",
        help="directory to write to (default: %(default)s)",
    )


def add_scene(parser: argparse.ArgumentParser) -> None:
    """Add the argument SCENE."""
    parser.add_argument("scene", metavar="SCENE", help="a .toml file, or the name of a packaged scene")


def whole_number(most: int | None = None) -> Callable[[str], int]:
    """Return a parser of whole numbers from 1 to `most`."""

    def number(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
        if value < 1:
            raise argparse.ArgumentTypeError(f"{value} is less than 1")
        if most is not None and value > most:
            raise argparse.ArgumentTypeError(f"{value} is more than {most}")
        return value

    return number


def picture_file(text: str) -> Path:
    """Return the path of an SVG or PNG to write; a directory and other suffixes are refused, before time is spent."""
    return _file_to_write(text, ".svg", ".png")


def sheet_file(text: str) -> Path:
    """Return the path of a PNG or EXR to write, as `picture_file` does."""
    return _file_to_write(text, ".png", ".exr")


def _file_to_write(text: str, *suffixes: str) -> Path:
    path = place(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is a directory; give the path of a file")
    if path.suffix.lower() not in suffixes:
        raise argparse.ArgumentTypeError(f"{text!r} does not end in {' or '.join(suffixes)}")
    return path


def byte_count(text: str) -> int:
    """Return a number of bytes [byte] from a text such as 500MB."""
    number = text.rstrip("BkMGT")
    try:
        return int(float(number) * _UNITS[text[len(number) :]])
    except (KeyError, ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of bytes, such as 500MB or 2GB") from None
