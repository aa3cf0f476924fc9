"""Output of the command line: progress bars on stderr, tables on stdout, numbers and the machine in words."""

from __future__ import annotations

import os
import platform
import sys
import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.cells import cell_len
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from brdfdb.notebook import error_in_words

if TYPE_CHECKING:
    from brdfdb.materials import Source

_LONGEST = 1000  # characters of a sentence: what a recipe gives may be a megabyte
_FOLDED = 8  # width of a column of text below which a table is wider than the terminal instead
_NARROW = 16  # width of a column of text below which a less important column is left out, if there is one
_MANY = 200  # rows that rich lays out in a tenth of a second; longer tables are printed plainly


def plain(text: str) -> str:
    """Return a text with its control characters written as escapes, so that a terminal shows and does not obey them."""
    return "".join(
        letter if letter == "\n" or unicodedata.category(letter)[0] != "C" else letter.encode("unicode_escape").decode()
        for letter in text
    )


def say(sentence: str) -> None:
    """Print one line to stderr, of a bounded length."""
    line = plain(sentence).replace("\n", " ")
    if len(line) > _LONGEST:  # its middle is what the user gave
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
    print(f"brdfdb: {line}", file=sys.stderr)


def say_without_glints(where: str, *sources: Source) -> None:
    """Print a line for each source with glints that an output leaves out; `where` names it, such as "the picture"."""
    for source in {id(source): source for source in sources}.values():
        glints = getattr(source, "glints", None)
        if glints is not None:
            say(f"{source.name}: {glints.left_out(where)}")


def progress(counted: bool = True, text: str = "", transient: bool = False) -> Progress:
    """Return a progress bar on stderr.

    `counted` adds the number of steps, `text` another column. A `transient` bar leaves nothing behind and is not
    written to files: for tasks that may end with a sentence of their own.
    """
    console = Console(stderr=True)
    count = [MofNCompleteColumn()] if counted else []
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        *count,
        TextColumn("{task.percentage:>3.0f}%"),
        *([TextColumn(text)] if text else []),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=transient,
        disable=transient and not console.is_terminal,
    )


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    numbers: Sequence[str] = (),
    less: Sequence[str] = (),
) -> None:
    """Print rows under column headings; the columns in `numbers` are set right.

    When the output is not a terminal, lines are as long as needed, so that programs read everything. On a narrow
    terminal the columns in `less` are left out, the first of them first, and a line names them.
    """
    title = plain(title)
    rows = [[plain(cell) for cell in row] for row in rows]
    console = Console(markup=False, emoji=False, highlight=False)  # a name may hold [brackets] and :colons:
    dropped = _too_many(columns, rows, numbers, less, console.width) if console.is_terminal else []
    if dropped:
        kept = [column not in dropped for column in columns]
        rows = [[cell for cell, keep in zip(row, kept, strict=True) if keep] for row in rows]
        columns = [column for column in columns if column not in dropped]
    if len(rows) > _MANY:
        _print_plainly(title, columns, rows, numbers)
        return
    table = Table(header_style="bold", box=None, pad_edge=False)
    for column in columns:
        number = column in numbers
        whole = number or column == columns[0]  # names and numbers are never cut: other columns take more lines
        table.add_column(column, justify="right" if number else "left", overflow="fold", no_wrap=whole)
    for row in rows:
        table.add_row(*row)
    if not console.is_terminal:
        console.width = 10_000
        console.width = console.measure(table).maximum
    elif _least_width(columns, rows, numbers) > console.width:  # names and numbers alone are wider than the terminal
        _print_plainly(title, columns, rows, numbers)
        return
    console.print(title, style="bold", soft_wrap=True)
    console.print(table)
    if dropped:
        print(f"columns left out on this narrow terminal: {', '.join(dropped)}")


def _too_many(
    columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[str], less: Sequence[str], width: int
) -> list[str]:
    """Return the columns of `less` that a table of a width [1] has no room for."""
    dropped: list[str] = []
    left = dict(zip(columns, zip(*rows, strict=True), strict=True)) if rows else {}
    for column in less:
        if not left or _least_width([*left], [*zip(*left.values(), strict=True)], numbers, _NARROW) <= width:
            break
        del left[column]
        dropped.append(column)
    return dropped


def _least_width(
    columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[str], folded: int = _FOLDED
) -> int:
    """Return the width [1] of a table whose names and numbers are whole, and whose other columns are folded."""
    widths = [max(map(cell_len, cells)) for cells in zip(columns, *rows, strict=True)]
    whole = [column in (columns[0], *numbers) for column in columns]
    return sum(width if keep else min(width, folded) for width, keep in zip(widths, whole, strict=True)) + 2 * (
        len(columns) - 1
    )


def _print_plainly(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[str]) -> None:
    """Print a long table without styles, in a fraction of the time."""
    widths = [max(map(cell_len, cells)) for cells in zip(columns, *rows, strict=True)]
    lines = [title]
    for row in (columns, *rows):
        cells = []
        for column, cell, width in zip(columns, row, widths, strict=True):
            fill = " " * (width - cell_len(cell))
            cells.append(fill + cell if column in numbers else cell + fill)
        lines.append("  ".join(cells).rstrip())
    print("\n".join(lines))


def size(count: float) -> str:
    """Return a number of bytes as text with a unit."""
    return _in_thousands(count, (" B", " kB", " MB", " GB"))


def error(p99: float | None) -> str:
    """Return a relative error [1] as text in percent, or as a factor."""
    return error_in_words(p99)


def count(value: float) -> str:
    """Return a number as text of three digits, thousands with a k."""
    return _in_thousands(value, ("", "k", "M", "G"))


def _in_thousands(value: float, units: Sequence[str]) -> str:
    """Return a number as text of three digits, in the first unit of which it is less than a thousand, or the last."""
    for unit in units[:-1]:
        if value < 999.5:
            return f"{value:.3g}{unit}"
        value /= 1000.0
    return f"{value:.3g}{units[-1]}"


def machine() -> str:
    """Return the machine that times were measured on, in words."""
    return f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
