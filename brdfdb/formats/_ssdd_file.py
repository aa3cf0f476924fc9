"""The text of SSDD files: a header, and blocks of lists of angles with their values, in ASCII or binary."""

from __future__ import annotations

import math
import mmap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._input import MOST_TEXT, check_size
from brdfdb.parameters import Floats

VERSION = "0.3"
LISTS = ("PARAM0_LIST", "PARAM1_LIST", "PARAM2_LIST", "PARAM3_LIST")
_RANGES_DEG = ((0.0, 90.0), (-360.0, 360.0), (0.0, 180.0), (-360.0, 360.0))  # of the lists
_ROUNDING_DEG = 1e-3
_TYPES = ("brdf", "btdf", "specular_reflectance", "specular_transmittance")
_CHANNELS = {"monochrome": 1, "rgb": 3, "xyz": 3}
_LONGEST = 1 << 24  # bytes of a line of a header: a list of angles or wavelengths
_SPACES = b" \t\n\v\f\r"


@dataclass(frozen=True, eq=False)
class Block:
    """A block of data.

    Attributes
    ----------
    entries : mapping of str
        The entries before the values, by name.
    angles : tuple of array [degree]
        The lists of angles that are there, from PARAM0_LIST on; (0,) for one that is left out.
    values : float32 array (n0, n1, ..., C)
        Values over the lists, and last the channels.
    wavelength_nm : array (C,) [nm] or None
        Wavelengths of the channels; None if they are none.
    """

    entries: Mapping[str, str]
    angles: tuple[NDArray[np.float64], ...]
    values: NDArray[np.float32]
    wavelength_nm: NDArray[np.float64] | None


def header(software: str, comments: Sequence[str]) -> bytes:
    """Return the beginning of a file, with comments."""
    return "\n".join([f"VERSION {VERSION}", *(f"# {line}" for line in comments), f"SOFTWARE {software}", ""]).encode()


def block(entries: Mapping[str, str], values: Floats, binary: bool) -> bytes:
    """Return a block of entries, in their order, and values (n0, n1, ..., C), whose first index runs fastest.

    libbsdf looks for comments after each line, and so at the beginning of binary values too. There a "#" behind bytes
    that are white space would be taken for one: the first value is changed in its last digit then.
    """
    lines = [f"{name} {text}" for name, text in entries.items() if text]
    channels = values.shape[-1]
    rows = np.moveaxis(values, -1, 0).T.reshape(-1, channels).astype("<f4")
    if not binary:
        text = "%.7g" + " %.7g" * (channels - 1)
        data = "\n".join([text] * len(rows)) % tuple(rows.reshape(-1).tolist())
        return "\n".join(["", *lines, "DATA ascii", data, ""]).encode()
    while rows.reshape(-1)[:64].tobytes().lstrip(_SPACES).startswith(b"#"):
        rows[0, 0] = np.nextafter(rows[0, 0], np.float32(np.inf))
    return "\n".join(["", *lines, "DATA binary", ""]).encode() + rows.tobytes() + b"\n"


def parsed(path: Path) -> tuple[list[str], list[Block]]:
    """Return the comments and the blocks of a file.

    Raises
    ------
    FileFormatError
        If it is not an SSDD file, or damaged.
    OSError
        If it cannot be read.
    """
    check_size(path, MOST_TEXT)
    with path.open("rb") as file:
        if not file.read(1):
            return [], []
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    comments: list[str] = []
    blocks: list[Block] = []
    entries: dict[str, str] = {}
    at = 0
    while at < len(data):
        end = data.find(b"\n", at, at + _LONGEST)
        end = len(data) if end < 0 else end
        if data.find(b"\0", at, min(end, at + _LONGEST)) >= 0:
            raise FileFormatError(f"{path}: byte {at}: a line of its header has a zero byte")
        if end - at > _LONGEST:
            raise FileFormatError(f"{path}: byte {at}: a line of its header has more than {_LONGEST} bytes")
        line = data[at:end].decode("utf-8", "replace").strip()
        at = end + 1
        if line.startswith("#"):
            comments.append(line[1:].strip())
            continue
        name, _, text = line.partition(" ")
        if name == "DATA_TYPE":
            entries = {}
        if name:
            entries[name] = text.strip()
        if name == "DATA":
            values, at = _values(path, data, at, entries)
            blocks.append(values)
    return comments, blocks


def _values(path: Path, data: mmap.mmap, at: int, entries: Mapping[str, str]) -> tuple[Block, int]:
    """Return the block whose values begin at a byte, and the byte behind it."""
    if entries.get("DATA_TYPE") not in _TYPES or "PARAM0_LIST" not in entries:
        raise FileFormatError(f"{path}: a block of data has no DATA_TYPE of {', '.join(_TYPES)}, or no PARAM0_LIST")
    try:
        lists = {name: np.array([float(text) for text in entries.get(name, "0").split()]) for name in LISTS}
        model = entries.get("COLOR_MODEL", "")
        spectral = model == "spectrum"
        nm = np.array([float(text) for text in entries["WAVELENGTH_LIST"].split()]) if spectral else None
        channels = _CHANNELS[model] if nm is None else nm.size
    except (KeyError, ValueError):
        raise FileFormatError(f"{path}: COLOR_MODEL, or a list of angles or wavelengths, cannot be read") from None
    angles = tuple(lists.values())
    if not channels or not all(nodes.size and np.all(np.diff(nodes) > 0.0) for nodes in angles):
        raise FileFormatError(f"{path}: a list of angles is empty or does not increase")
    if nm is not None and not (channels and nm[0] > 0.0 and nm[-1] < np.inf and np.all(np.diff(nm) > 0.0)):
        raise FileFormatError(f"{path}: WAVELENGTH_LIST is not of positive numbers [nm] that increase")
    for (name, nodes), (low, high) in zip(lists.items(), _RANGES_DEG, strict=True):
        if not low <= nodes[0] <= nodes[-1] <= high + _ROUNDING_DEG:
            raise FileFormatError(
                f"{path}: {name} is from {nodes[0]:g} to {nodes[-1]:g} degrees; allowed is [{low:g}, {high:g}]"
            )
    if entries["DATA"] not in ("binary", "ascii"):
        raise FileFormatError(f"{path}: DATA is {entries['DATA']!r:.40}; allowed are binary and ascii")
    count = channels * math.prod(nodes.size for nodes in angles)
    if entries["DATA"] == "binary":
        end = at + 4 * count
        if end > len(data):
            raise FileFormatError(f"{path}: {len(data) - at} bytes of values, its lists of angles need {4 * count}")
        flat = np.frombuffer(data, "<f4", count, at)
    else:
        end = data.find(b"\nDATA_TYPE", at)
        end = len(data) if end < 0 else end
        lines = (line for line in data[at:end].split(b"\n") if not line.lstrip().startswith(b"#"))
        try:
            flat = np.array(b" ".join(lines).split(), np.float32)
        except ValueError:
            raise FileFormatError(f"{path}: a value is not a number") from None
        if flat.size != count:
            raise FileFormatError(f"{path}: {flat.size} values, its lists of angles need {count}")
    if not np.all(np.isfinite(flat)):
        raise FileFormatError(f"{path}: a value is not finite")
    shape = tuple(nodes.size for nodes in reversed(angles))
    values = np.moveaxis(flat.reshape(*shape, channels), -1, 0).T
    return Block(dict(entries), angles, np.ascontiguousarray(values), nm), end
