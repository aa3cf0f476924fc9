"""The commands of the program: one module each, under the name of the command.

A module whose name begins with an underscore is no command. One underscore at its end is left out of the name of the
command, for words that Python keeps for itself. Importing a command loads nothing heavy, because
``brdfdb --help`` imports all of them: what a command needs is imported when it runs.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from typing import Protocol, cast


class Command(Protocol):
    """The interface of a module of this package.

    Attributes
    ----------
    HELP : str
        The sentence that ``brdfdb --help`` and the help of the command show.
    """

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
