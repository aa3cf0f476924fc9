"""The commands of the program, one module each under the name of the command, and their exit codes.

Modules whose names begin with an underscore are not commands. A final underscore is left out of the name of a command:
`import` is a reserved word. A command imports what it needs when it runs, because ``brdfdb --help`` imports all
commands.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from typing import Protocol, cast

VIOLATED = 1  # a new violation, a table that cannot be judged, or a file that is less accurate than asked for
REFUSED = 2  # bad input, a damaged store, or a machine that lacks something: one sentence on stderr
BUG = 70  # an error of this program (EX_SOFTWARE of sysexits.h); its traceback is in a file
INTERRUPTED = 130  # Ctrl-C: 128 + SIGINT
TERMINATED = 143  # told to end, as batch systems and containers do: 128 + SIGTERM


class Command(Protocol):
    """The interface of a module of this package; `HELP` is the sentence that ``brdfdb --help`` shows."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the arguments of the command to its parser."""

    def run(self, options: argparse.Namespace) -> int:
        """Run the command with its parsed arguments and return the exit code."""


def commands() -> dict[str, Command]:
    """Return the modules of all commands by name, in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
    modules = {name: cast(Command, importlib.import_module(f"{__name__}.{name}")) for name in names}
    return {name.removesuffix("_"): module for name, module in modules.items()}
