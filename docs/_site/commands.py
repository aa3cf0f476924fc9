"""The help of every command, from the parsers of the command line."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

from _site.markup import code, write_page
from brdfdb_pipelines import cli

_WIDTH = 100  # characters a line


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated/commands.txt``, which ``reference/command-line.md`` includes."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("BRDFDB_")}
    with mock.patch.dict(os.environ, {**environment, "COLUMNS": str(_WIDTH), "NO_COLOR": "1"}, clear=True):
        parts = [f"## {parser.prog}\n\n{code(_help(parser), 'text')}" for parser in _parsers(cli._parser())]
    write_page(docs / "reference" / "generated" / "commands.txt", "\n".join(parts))


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield a parser and those of its commands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _parsers(command)


def _help(parser: argparse.ArgumentParser) -> str:
    """Return the help of a command; numbers of this machine's processors are in words."""
    for action in parser._actions:
        if action.dest == "jobs":
            action.default = "the number of processors"
    return parser.format_help()
