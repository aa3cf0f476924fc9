"""Memory and disk space of a build, estimated before it starts."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from brdfdb.errors import ParameterError
from brdfdb.tables.layout import Layout
from brdfdb_pipelines import terminal

_TASK = 20_000_000  # memory of any task [byte]: the interpreter, and the directions of the error measurement
# Memory of the planner's layouts [byte], in all and per wavelength. Measured peaks: copper at 41 wavelengths 119 MB for
# a tolerance of 0.01 and 377 MB for 0.001; grey foam 49 MB for 0.0001
_PLAN, _PLAN_WAVELENGTH = 10_000_000, 3_000_000
_FINE, _FINE_TIMES = 0.005, 4
_SLAB = 1 << 17  # directions that a block evaluates at once, or one row of the grid if that is more
# Memory of intermediates per direction of a slab [byte]; measured: 22 to 36 over light and viewer, 237 over half
# vectors
_PLAIN, _HALF = 40, 250
_SPECTRUM = 45  # memory per wavelength and direction [byte] where all wavelengths are held at once; measured: 35 to 44
_VALUE = 16  # memory per value of a block [byte]: float32, the copy of the codec, the encoded bytes and their copy
# Memory of the error measurement [byte]: five rows of the table and their copies, 60 to 80 per value of a row, and
# per wavelength the values at the drawn directions
_ROW, _DRAW = 80, 1_500_000


def plan_bytes(wavelengths: int, tolerance: float) -> int:
    """Return the memory [byte] that the planner takes for a material at a number of wavelengths."""
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


def machine_memory() -> int | None:
    """Return the memory [byte] of this machine; None where the system does not tell."""
    if not hasattr(os, "sysconf"):
        return None
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_memory(what: str, need: int, memory: int | None) -> None:
    """Raise ParameterError if a task needs more memory [byte] than is allowed; None allows any."""
    if memory is not None and need > memory:
        raise ParameterError(
            "memory", f"{what} takes about {terminal.size(need)}, more than the {terminal.size(memory)} allowed", memory
        )


def check_disk(need: int, directory: Path) -> None:
    """Raise ParameterError if the file system of a directory has less than `need` [byte] free; it need not exist."""
    free = free_bytes(directory)
    if need > free:
        raise ParameterError(
            "disk", f"the tables take up to {terminal.size(need)}, {directory} has {terminal.size(free)} free"
        )


def free_bytes(directory: Path) -> int:
    """Return the space [byte] that is free on the file system of a directory, which need not exist."""
    there = next(path for path in (directory, *directory.absolute().parents) if path.exists())
    return shutil.disk_usage(there).free


def stored_bytes(directories: Sequence[Path]) -> int:
    """Return the size [byte] of all files below some directories, which need not exist."""
    return sum(
        os.lstat(os.path.join(folder, file)).st_size
        for directory in directories
        for folder, _, files in os.walk(directory)
        for file in files
    )
