"""The command line `brdfdb`: one subcommand a job. Whatever is heavy is imported by the job that needs it."""

from __future__ import annotations

import argparse
import io
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from brdfdb.errors import ParameterError

# Exit codes: an error in one sentence; an audit that found a new violation; Ctrl-C
FAILED, VIOLATED, INTERRUPTED = 2, 1, 130
# Threads or processes; pixels across a picture, and rays across a pixel: a picture of more takes tens of gigabytes
MOST_JOBS, MOST_WIDTH, MOST_ACROSS = 1024, 4096, 16
_LONGEST = 1000  # characters of an error: what a recipe gives may be a megabyte


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter shows ? in its place
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(arguments, argparse.Namespace(arguments=arguments))
    run: Callable[[argparse.Namespace], int] = options.run
    try:
        code = run(options)
        sys.stdout.flush()  # a reader that left shows here, not at exit
        return code
    except KeyboardInterrupt:
        print("brdfdb: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if not _is_users(error):
            raise
        from brdfdb_pipelines.terminal import plain

        sentence = plain(_sentence(error))
        if len(sentence) > _LONGEST:  # its middle is what the user gave
            sentence = f"{sentence[: _LONGEST // 2]} ... {sentence[-_LONGEST // 2 :]}"
        print(f"brdfdb: {sentence}", file=sys.stderr)
        return FAILED


def _is_users(error: Exception) -> bool:
    """Whether an error is about what the user gave, not about this program."""
    from brdfdb.errors import StoreError, UnknownMaterialError

    return isinstance(
        error, StoreError | UnknownMaterialError | ValueError | OSError | MemoryError | ModuleNotFoundError
    )


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="brdfdb",
        description="Spectral BRDF tables from published surface parameters: build, audit, chart, export, look up, "
        "serve.",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(
        name: str, run: Callable[[argparse.Namespace], int], text: str, among: Any = commands, store: bool = True
    ) -> argparse.ArgumentParser:
        sub: argparse.ArgumentParser = among.add_parser(name, help=text, description=text)
        sub.set_defaults(run=run)
        if store:
            sub.add_argument(
                "--store",
                type=Path,
                default=Path(os.environ.get("BRDFDB_STORE", "brdf-store")),
                metavar="DIR",
                help="directory of the store (default: $BRDFDB_STORE or %(default)s)",
            )
        return sub

    build = command("build", _build, "Tabulate what is missing of the materials of a recipe into the store.")
    build.add_argument("recipe", type=Path, nargs="?", help="a TOML file; by default every material of the papers")
    build.add_argument(
        "--jobs",
        type=_up_to(MOST_JOBS),
        default=len(os.sched_getaffinity(0)),
        metavar="N",
        help="threads or processes (default: %(default)s)",
    )
    where = build.add_mutually_exclusive_group()
    where.add_argument("--processes", action="store_true", help="work in processes, not in threads of this one")
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="work on the dask cluster of this scheduler, such as tcp://10.0.0.1:8786; its workers see DIR, too",
    )
    build.add_argument(
        "--memory",
        type=_bytes,
        metavar="SIZE",
        help="of all tasks together, such as 500MB (default: that of the machine)",
    )
    build.add_argument("--json", action="store_true", help="print progress as JSON, an object a line")

    audit = command(
        "audit", _audit, "Audit what tables and models conserve, where they jump or err; exit 1 on a violation."
    )
    audit.add_argument("names", nargs="*", metavar="NAME", help="materials (default: all)")
    audit.add_argument(
        "--report",
        type=Path,
        metavar="FILE",
        help="JSON report, which ends in .json (default: DIR/audit.json, or DIR/audit-part.json with names)",
    )
    audit.add_argument(
        "--jobs",
        type=_up_to(MOST_JOBS),
        default=len(os.sched_getaffinity(0)),
        metavar="N",
        help="processes (default: %(default)s)",
    )
    audit.add_argument(
        "--allow",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="materials whose models may reflect more than they receive: accepted, and shown as such",
    )
    audit.add_argument("--no-figures", action="store_true", help="neither stability atlas nor gallery, as with names")

    chart = command(
        "chart", _chart, "Chart the cost of every form of a material or family against its error: pictures, JSON."
    )
    chart.add_argument(
        "names",
        nargs="+",
        metavar="NAME",
        help="built-in materials, or materials and families of a recipe or the store",
    )
    chart.add_argument(
        "--out",
        type=Path,
        default=Path("brdf-chart"),
        metavar="DIR",
        help="directory to write to (default: %(default)s)",
    )
    chart.add_argument(
        "--recipe", type=Path, metavar="FILE", help="a TOML file that defines materials, families and wavelengths"
    )
    chart.add_argument(
        "--tolerance",
        type=float,
        action="append",
        metavar="X",
        help="of a planned table, more than once for more of them (default: 0.1, 0.01 and, of grey materials, 0.001)",
    )

    choose = command(
        "choose",
        _choose,
        "Choose the cheapest form of each material that a scene cannot tell from the truth.",
        store=False,
    )
    choose.add_argument("scene", metavar="SCENE", help="a .toml file, or a scene that comes with the program")
    choose.add_argument(
        "--out", type=Path, default=Path("brdf-choice"), metavar="DIR", help="directory (default: %(default)s)"
    )
    choose.add_argument(
        "--width",
        type=_up_to(MOST_WIDTH),
        default=128,
        metavar="N",
        help="pixels across the picture; choices are checked at four times as many other places (default: %(default)s)",
    )
    choose.add_argument(
        "--weigh",
        choices=("time", "bytes", "both"),
        default="time",
        help="what is to be small; both is their product (default: %(default)s)",
    )
    choose.add_argument("--build", type=Path, metavar="STORE", help="publish the chosen tables in this store")

    text = "Write slices of tables as image files."
    # a command a format: argparse takes no NAME after an option that follows another positional argument
    formats = commands.add_parser("export", help=text, description=text).add_subparsers(required=True, metavar="FORMAT")
    exr = command("exr", _export, "Write slices of tables as OpenEXR files.", formats)
    exr.add_argument("names", nargs="*", metavar="NAME", help="materials")
    exr.add_argument("--all", action="store_true", help="every material of the store")
    exr.add_argument(
        "--out", type=Path, default=Path("brdf-exr"), metavar="DIR", help="directory to write to (default: %(default)s)"
    )
    exr.add_argument("--half", action="store_true", help="16-bit floats, to look at; default 32-bit, for data")

    lookup = command("lookup", _lookup, "Print f_r [1/sr] of a material, or a family, at one pair of directions.")
    lookup.add_argument("name", metavar="NAME")
    for angle in ("theta_i", "phi_i", "theta_r", "phi_r"):
        lookup.add_argument(angle, type=float, metavar=angle.upper(), help="degrees")
    lookup.add_argument("--wavelength-nm", type=float, nargs="+", metavar="NM", help="default: all of the table")
    lookup.add_argument(
        "--set", action="append", default=[], metavar="X=VALUE", help="a parameter of a family, as recipes write it"
    )
    lookup.add_argument("--json", action="store_true", help="print JSON")
    lookup.add_argument("--with-error", action="store_true", help="print the error that the table states, too")

    render = command(
        "render", _render, "Render a scene with the models of its materials, as PNG and spectral EXR.", store=False
    )
    render.add_argument("scene", metavar="SCENE", help="a .toml file, or a scene that comes with the program")
    render.add_argument(
        "--out", type=Path, default=Path("brdf-scenes"), metavar="DIR", help="directory (default: %(default)s)"
    )
    # no defaults: what is recorded has the pixels of its file
    render.add_argument("--width", type=_up_to(MOST_WIDTH), metavar="N", help="pixels (default: 256)")
    render.add_argument(
        "--across", type=_up_to(MOST_ACROSS), metavar="N", help="rays across a pixel, and down (default: 1)"
    )

    listing = command("list", _list, "List the materials and families of the store, or the built-in presets.")
    listing.add_argument("--presets", action="store_true", help="the built-in materials that recipes can name")

    show = command("show", _show, "Show parameters, sources, grid, albedo and files of a material, or a family.")
    show.add_argument("name", metavar="NAME")

    history = command("history", _history, "List the revisions of a material.")
    history.add_argument("name", metavar="NAME")

    rollback = command("rollback", _rollback, "Make another revision of a material current, after verifying it.")
    rollback.add_argument("name", metavar="NAME")
    rollback.add_argument("revision", metavar="REVISION", help="such as r000001; `brdfdb history NAME` lists them")

    verify = command(
        "verify",
        _verify,
        "Verify tables: sizes, sha256, each chunk with its crc32c, dimensions and attributes; families and snapshots. "
        "Say which command repairs what is wrong.",
    )
    verify.add_argument("names", nargs="*", metavar="NAME", help="materials and families (default: all)")

    gc = command(
        "gc",
        _gc,
        "Remove builds that were broken off and could be resumed, revisions that are neither current nor kept, and "
        "what crashes left behind. Nothing that a snapshot names, and nothing of a material that a build is at work "
        "on. Readers may be running: tables "
        "that they hold stay, a revision that is removed while it is read is never read as data.",
    )
    gc.add_argument(
        "--keep",
        type=_positive,
        default=2,
        metavar="N",
        help="revisions of each material that stay: the current one and the newest others (default: %(default)s)",
    )

    gc.add_argument(
        "--damaged",
        action="store_true",
        help="read all other revisions that stay, and remove those that are damaged and neither current nor in a "
        "snapshot",
    )

    snapshot = command(
        "snapshot",
        _snapshot,
        "Name the current revisions of all materials and families of the store, for good; without a name, list the "
        "snapshots.",
    )
    snapshot.add_argument("name", nargs="?", metavar="NAME", help="lower-case letters, digits and single hyphens")
    snapshot.add_argument("--remove", action="store_true", help="remove the snapshot; the revisions stay until gc")

    for reader in (listing, show, lookup):
        _pinning(reader)

    serve = command("serve", _serve, "Answer lookups over HTTP.")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    serve.add_argument("--port", type=int, default=8000, help="port (default: %(default)s)")
    serve.add_argument(
        "--workers", type=_up_to(MOST_JOBS), default=1, metavar="N", help="processes (default: %(default)s)"
    )
    _pinning(serve)
    return parser


def _pinning(command: argparse.ArgumentParser) -> None:
    command.add_argument("--snapshot", metavar="NAME", help="read the store as this snapshot names it")


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not at least 1")
    return value


def _up_to(most: int) -> Callable[[str], int]:
    """Return a parser of whole numbers from 1 to `most`."""

    def number(text: str) -> int:
        value = _positive(text)
        if value > most:
            raise argparse.ArgumentTypeError(f"{value} is more than {most}")
        return value

    return number


def _bytes(text: str) -> int:
    units = {"": 1, "B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
    number = text.rstrip("BkMGT")
    try:
        return int(float(number) * units[text[len(number) :]])
    except (KeyError, ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of bytes, such as 500MB or 2GB") from None


def _build(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import build

    try:
        build.run(
            options.recipe,
            options.store,
            jobs=options.jobs,
            processes=options.processes,
            scheduler=options.scheduler,
            memory=options.memory,
            as_json=options.json,
        )
    except KeyboardInterrupt:
        print(
            "brdfdb: interrupted; what was published before stays, and every block that is whole; "
            f"to resume: {shlex.join(['brdfdb', *options.arguments])}",
            file=sys.stderr,
        )
        return INTERRUPTED
    return 0


def _history(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import maintain

    maintain.history(options.store, options.name)
    return 0


def _rollback(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import maintain

    maintain.rollback(options.store, options.name, options.revision)
    return 0


def _verify(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import maintain

    return FAILED if maintain.verify(options.store, options.names) else 0


def _gc(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import maintain

    maintain.collect(options.store, options.keep, damaged=options.damaged)
    return 0


def _snapshot(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import maintain

    if options.remove and options.name is None:
        raise ParameterError("snapshot", "--remove needs the NAME of a snapshot")
    if options.remove:
        maintain.remove_snapshot(options.store, options.name)
    elif options.name is not None:
        maintain.snapshot(options.store, options.name)
    else:
        maintain.list_snapshots(options.store)
    return 0


def _audit(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import audit

    default = options.store / ("audit-part.json" if options.names else "audit.json")
    try:
        report = audit.run(
            options.store,
            options.names,
            options.report or default,
            jobs=options.jobs,
            figures=not (options.names or options.no_figures),
            allow=options.allow,
        )
    except KeyboardInterrupt:
        print("brdfdb: interrupted; no report was written, an earlier one is as it was", file=sys.stderr)
        return INTERRUPTED
    return VIOLATED if report.violations else 0


def _chart(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import chart

    chart.run(options.names, options.out, store=options.store, recipe_path=options.recipe, tolerances=options.tolerance)
    return 0


def _choose(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import choose

    try:
        choose.run(options.scene, options.out, width=options.width, weigh=options.weigh, store=options.build)
    except KeyboardInterrupt:
        if options.build is None:
            raise
        print("brdfdb: interrupted; what was published before stays", file=sys.stderr)
        return INTERRUPTED
    return 0


def _export(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import export

    if bool(options.names) == options.all:
        raise ParameterError("export", "name materials, or give --all")
    export.run_exr(options.store, options.names, options.out, half=options.half)
    return 0


def _lookup(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import inspect

    angles = (options.theta_i, options.phi_i, options.theta_r, options.phi_r)
    inspect.lookup(
        options.store,
        options.name,
        angles,
        options.wavelength_nm,
        settings=options.set,
        as_json=options.json,
        with_error=options.with_error,
        snapshot=options.snapshot,
    )
    return 0


def _render(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import render

    render.run(options.scene, options.out, width=options.width, across=options.across)
    return 0


def _list(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import inspect

    if options.presets:
        inspect.list_presets()
    else:
        inspect.list_store(options.store, snapshot=options.snapshot)
    return 0


def _show(options: argparse.Namespace) -> int:
    from brdfdb_pipelines import inspect

    inspect.show(options.store, options.name, snapshot=options.snapshot)
    return 0


def _serve(options: argparse.Namespace) -> int:
    from brdfdb_api.server import serve

    serve(options.store, options.host, options.port, options.workers, options.snapshot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
