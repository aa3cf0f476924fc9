"""Memory and disk that the tasks of a build take, estimated before they begin."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from brdfdb.errors import ParameterError
from brdfdb.tables.layout import Layout
from brdfdb_pipelines import terminal

_TASK = 20_000_000  # bytes of any task: the interpreter's own, and directions that errors are measured at
# Bytes of a planner's candidates, in all and for each wavelength: copper at 41 wavelengths peaks at 119 MB for a
# tolerance of 0.01, at 377 MB for 0.001; grey foam at 49 MB for 0.0001
_PLAN, _PLAN_WAVELENGTH = 10_000_000, 3_000_000
_FINE, _FINE_TIMES = 0.005, 4
_SLAB = 1 << 17  # directions that `tabulate.block` evaluates at once, or one row of the grid if that is more
# Bytes of intermediates for each direction of a slab, measured: 22 to 36 over light and viewer, 237 over half vectors
_PLAIN, _HALF = 40, 250
_SPECTRUM = 45  # bytes for each wavelength of a direction where all wavelengths are held at once, measured: 35 to 44
_VALUE = 16  # bytes for each value of a block: float32, the copy of the codec, the encoded bytes and theirs
# Bytes that measuring the error takes: five rows of the table and their copies, 60 to 80 for each value of a row,
# and for each wavelength the values at the directions that are drawn
_ROW, _DRAW = 80, 1_500_000


def plan_bytes(wavelengths: int, tolerance: float) -> int:
    """Return the memory [byte] that the planner takes for a material at so many wavelengths."""
    return (_PLAN + _PLAN_WAVELENGTH * wavelengths) * (1 if tolerance >= _FINE else _FINE_TIMES)


def task_bytes(layout: Layout) -> int:
    """Return the memory [byte] that one task of a table takes: a block, or measuring its error."""
    wavelengths = 1 if layout.wavelength_nm is None else layout.wavelength_nm.size
    directions = math.prod(layout.grid.shape[1:])
    slab = max(directions, min(_SLAB, directions * layout.block_rows))
    one_by_one = layout.plain and not layout.grid.half_difference
    spectrum = 0 if one_by_one else _SPECTRUM * wavelengths * slab
    row = math.prod(layout.shape[1:])
    block = slab * (_HALF if layout.grid.half_difference else _PLAIN) + spectrum + _VALUE * row * layout.block_rows
    return _TASK + max(block, _ROW * row + _DRAW * wavelengths)


def table_bytes(layout: Layout) -> int:
    """Return the largest size [byte] of the values of a table on the disk: rounded bits are zeros and compress."""
    return layout.size * (9 + layout.bits) // 8


def machine_memory() -> int:
    """Return the memory [byte] of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_memory(what: str, need: int, memory: int | None) -> None:
    """ValueError if a task needs more memory [byte] than is allowed; None allows any."""
    if memory is not None and need > memory:
        raise ParameterError(
            "memory", f"{what} takes about {terminal.size(need)}, more than the {terminal.size(memory)} allowed", memory
        )


def check_disk(need: int, directory: Path) -> None:
    """ValueError if the file system of a directory, which need not be there, has less than `need` [byte] free."""
    there = next(path for path in (directory, *directory.absolute().parents) if path.exists())
    free = shutil.disk_usage(there).free
    if need > free:
        raise ParameterError(
            "disk", f"the tables take up to {terminal.size(need)}, {directory} has {terminal.size(free)} free"
        )


def stored_bytes(directories: Sequence[Path]) -> int:
    """Return the size [byte] of all files below some directories, which need not be there."""
    return sum(
        os.lstat(os.path.join(folder, file)).st_size
        for directory in directories
        for folder, _, files in os.walk(directory)
        for file in files
    )
