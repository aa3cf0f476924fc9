"""The command line `brdfdb`: it finds the commands, runs one, and turns errors into sentences and exit codes."""

from __future__ import annotations

import argparse
import atexit
import contextlib
import difflib
import errno
import gc
import io
import os
import platform
import shlex
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator, Sequence
from typing import Any

from brdfdb.errors import BrdfdbError, UnknownMaterialError, missing_extra
from brdfdb_pipelines.commands import BUG, INTERRUPTED, REFUSED, TERMINATED, VIOLATED, commands
from brdfdb_pipelines.commands._arguments import place

# Errors of the operating system that concern the machine, also where they name no file
_MACHINE = {
    *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO),
    *(errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE),
}
# Commands that evaluate no model, or a single value: compiled kernels would take longer to load
_WITHOUT_KERNELS = {"gc", "history", "list", "lookup", "publish", "rollback", "snapshot", "verify"}
_TELL = {"audit", "build", "serve"}  # commands with their own message on the compilation of kernels
# Allocations between two garbage collections. A command allocates modules and tables that live until its end; with
# Python's 700, collections take up to a tenth of its time
_ALLOCATIONS = 50_000
_MODELS = "files of models"  # begins the names under which parsers keep --models
_EPILOG = f"""\
exit codes:
  0    done
  {VIOLATED}    a new violation (audit, import), an unjudged table (audit), or an inaccurate file (export --strict)
  {REFUSED}    refused or impossible; stderr has the reason: bad input, a damaged store, a full disk, a missing extra
  {BUG}   a bug of brdfdb; stderr names the file with the traceback
  {INTERRUPTED}  interrupted by Ctrl-C
  {TERMINATED}  ended by SIGTERM, in the same way as by Ctrl-C
"""


class _Parser(argparse.ArgumentParser):
    """A parser with the options of every command, which answers a misspelt command or choice with the closest one."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        group = self.add_argument_group("options of every command")
        # A default, or the same name in the parser of a command, would replace the value given before the command
        group.add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help="also print the traceback of an error"
        )
        group.add_argument(
            "--models",
            action="append",
            type=place,
            dest=f"{_MODELS} of {self.prog}",
            default=argparse.SUPPRESS,
            metavar="FILE",
            help="a Python file with your own models; may be repeated (default: $BRDFDB_MODELS)",
        )

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        choices = [str(choice) for choice in action.choices]
        near = difflib.get_close_matches(str(value), choices, n=1)
        hint = f"did you mean {near[0]}?" if near else f"choose from {', '.join(choices)}"
        more = "" if near else getattr(action, "hint", "")
        raise argparse.ArgumentError(action, f"invalid choice: {value!r}; {hint}{more}")


class _Version(argparse.Action):
    """Print the version; only this option reads the metadata of the distribution."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        import brdfdb

        print(f"brdfdb {brdfdb.__version__}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter shows ? in its place
    if arguments is None:
        atexit.register(gc.freeze)  # at exit Python would search all modules for garbage: a fifth of a short command
        gc.set_threshold(_ALLOCATIONS)
        arguments = sys.argv[1:]
        if _command(arguments) in _WITHOUT_KERNELS and "BRDFDB_MODELS" not in os.environ:
            os.environ.setdefault("NUMBA_DISABLE_JIT", "1")
    options = _parser(arguments).parse_args(arguments, argparse.Namespace(arguments=arguments))
    with _sigterm_as_ctrl_c() as received:
        code = _run(options, arguments)
    return TERMINATED if received and code == INTERRUPTED else code


def _command(arguments: Sequence[str]) -> str:
    """Return the name of the command among the arguments; empty if there is none."""
    return next((text for text in arguments if not text.startswith("-")), "")


@contextlib.contextmanager
def _sigterm_as_ctrl_c() -> Iterator[list[int]]:
    """Treat SIGTERM like Ctrl-C, so that no incomplete file remains; yield the list of received signals."""
    received: list[int] = []

    def stop(number: int, _: object) -> None:
        received.append(number)
        raise KeyboardInterrupt

    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:  # a caller has its own
        yield received
        return
    signal.signal(signal.SIGTERM, stop)
    try:
        yield received
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _run(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Run the command and return its exit code; errors become sentences."""
    try:
        files = [file for name, files in vars(options).items() if name.startswith(_MODELS) for file in files]
        if files:  # before or after the command
            from brdfdb.models import MODELS

            MODELS.add_files(files)
        with _telling_of_compilation(_command(arguments)):
            code: int = options.run(options)
        sys.stdout.flush()  # if the reader of the output has closed it, the error occurs here and not at exit
        return code
    except KeyboardInterrupt:
        print("brdfdb: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if "debug" in options:
            traceback.print_exc()
        sentence = _refusal(error)
        from brdfdb_pipelines.terminal import say

        if sentence is None:
            say(_bug(error, arguments))
            return BUG
        say(sentence)
        return REFUSED


def _telling_of_compilation(command: str) -> contextlib.AbstractContextManager[None]:
    """Print a message when a command starts to compile kernels, which takes seconds."""
    if command in _WITHOUT_KERNELS | _TELL:
        return contextlib.nullcontext()
    from brdfdb._numba import when_compiling
    from brdfdb_pipelines.terminal import say

    return when_compiling(lambda: say("compiling kernels, once after an installation"))


def _parser(arguments: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser of the commands that the arguments name, with the names of all others; None: of all."""
    parser = _Parser(
        prog="brdfdb",
        description="Build, audit, chart, export, look up and serve BRDF tables of published surface parameters.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, command in commands().items():
        first_sentence = command.HELP.partition(". ")[0].rstrip(".")
        subparser = subparsers.add_parser(name, help=f"{first_sentence}.", description=command.HELP)
        if arguments is None or name in arguments:  # some of these functions import a part of the library
            command.add_arguments(subparser)
        subparser.set_defaults(run=command.run)
    return parser


def _refusal(error: Exception) -> str | None:
    """Return the sentence of an error that the user can act on; None for a bug of this program."""
    match error:
        case UnknownMaterialError(kind="material"):
            from brdfdb.materials import libraries, presets

            library = next((library for library in libraries() if error.name in presets(library)), None)
            if library is None:
                return str(error)
            return f"{error}; it is a preset of the library {library}, and not built in this store"
        case BrdfdbError():
            return str(error)
        case OSError(filename=str() | bytes() | os.PathLike() as file):
            return f"{os.fsdecode(file)}: {error.strerror}"
        case OSError(errno=number) if number in _MACHINE:
            return str(error.strerror)
        case MemoryError():
            return str(error) or "out of memory"
        case ModuleNotFoundError(name=str() as module):
            missing = missing_extra(module)
            return None if missing is None else str(missing)
        case _:
            return None


def _bug(error: Exception, arguments: Sequence[str]) -> str:
    """Write the traceback of a bug to a file and return the sentence that says where it is."""
    import brdfdb

    text = "".join(traceback.format_exception(error))
    head = f"brdfdb {brdfdb.__version__}, Python {platform.python_version()}, {platform.platform()}"
    what = "this is a bug of brdfdb; please report it"
    try:
        descriptor, path = tempfile.mkstemp(prefix="brdfdb-", suffix=".txt", text=True)
        with open(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(f"{head}\n{shlex.join(['brdfdb', *arguments])}\n{text}")
    except OSError:
        print(text, end="", file=sys.stderr)
        return f"{what}; its traceback is printed above ({type(error).__name__})"
    return f"{what}; its traceback is in {path} ({type(error).__name__}: {error})"


if __name__ == "__main__":
    sys.exit(main())
