"""The text of Zemax (Radiant) BSDF files."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._angular_grid import Sink
from brdfdb.formats._input import lines_of

LISTS = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
TITLE = "BSDF Data Interchange file"
_SYMMETRIES = ("PlaneSymmetrical", "Asymmetrical", "ASymmetrical", "ASymmetrical4D", "Asymmetrical4D")
_PARTS = {"Monochrome": ("Monochrome",), "XYZ": ("TristimulusX", "TristimulusY", "TristimulusZ")}

_LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True, eq=False)
class Text:
    """Content of a Zemax file.

    Attributes
    ----------
    comments : tuple of str
        The comments.
    symmetry, content, scatter : str
        Values of the entries Symmetry, SpectralContent and ScatterType.
    angles : tuple of array [degree]
        The four lists: rotations of the sample, angles of incidence, azimuths and radial angles.
    tis : array (C, rotations, incidences)
        Total integrated scatter.
    values : float32 array (C, rotations, incidences, azimuths, radials) [1/sr]
        f_r.
    """

    comments: tuple[str, ...]
    symmetry: str
    content: str
    scatter: str
    angles: tuple[NDArray[np.float64], ...]
    tis: NDArray[np.float64]
    values: NDArray[np.float32]


def write(stream: Sink, text: Text) -> None:
    """Write a file."""
    head = [f"# {comment}" for comment in (TITLE, *text.comments)]
    head += ["Source Measured", f"Symmetry {text.symmetry}", f"SpectralContent {text.content}"]
    head += [f"ScatterType {text.scatter}"]
    for name, nodes in zip(LISTS, text.angles, strict=True):
        head += [f"{name} {nodes.size}", " ".join(f"{node:.10g}" for node in nodes)]
    stream.write("\n".join([*head, "", ""]).encode())
    line = " ".join(["%.5g"] * text.angles[3].size)
    rows = "\n".join([line] * text.angles[2].size)
    for part, every_tis, planes in zip(_PARTS[text.content], text.tis, text.values, strict=True):
        stream.write(f"{part}\nDataBegin\n".encode())
        for tis, plane in zip(every_tis.reshape(-1), planes.reshape(-1, *planes.shape[2:]), strict=True):
            stream.write(f"TIS {tis:.6g}\n{rows % tuple(plane.reshape(-1).tolist())}\n".encode())
        stream.write(b"DataEnd\n")


def parsed(path: Path) -> Text:
    """Return what a file says.

    Raises
    ------
    FileFormatError
        If it is not such a file, or damaged.
    OSError
        If it cannot be read.
    """
    comments: list[str] = []
    words = _words(path, comments)
    entries = {"Source": "", "Symmetry": "", "SpectralContent": "", "ScatterType": ""}
    angles: dict[str, NDArray[np.float64]] = {}
    for word in words:
        if word in entries:
            entries[word] = next(words, "")
        elif word in LISTS:
            count = _numbers(path, words, 1, word)[0]
            if not 1.0 <= count <= path.stat().st_size or count != int(count):
                raise FileFormatError(f"{path}: {word} is a list of {count:g} angles, and the file holds no such list")
            angles[word] = _numbers(path, words, int(count), word)
        elif any(word in parts for parts in _PARTS.values()):
            break
    content = entries["SpectralContent"]
    if entries["Symmetry"] not in _SYMMETRIES or content not in _PARTS:
        raise FileFormatError(f"{path}: its Symmetry or SpectralContent is not that of a Zemax BSDF file")
    angles.setdefault("SampleRotation", np.zeros(1))
    lists = tuple(angles.get(name, np.empty(0)) for name in LISTS)
    if not all(nodes.size and np.all(np.diff(nodes) > 0.0) for nodes in lists):
        raise FileFormatError(f"{path}: one of {', '.join(LISTS)} is missing or does not increase")
    parts = len(_PARTS[content])
    blocks = parts * lists[0].size * lists[1].size
    if blocks > path.stat().st_size:
        raise FileFormatError(f"{path}: its lists of angles need {blocks} blocks of values, more than the file has")
    rows, tis = [], np.empty(blocks)
    for number in range(blocks):
        for word in words:
            if word == "TIS":
                break
        tis[number] = _numbers(path, words, 1, "TIS")[0]
        rows.append(_numbers(path, words, lists[2].size * lists[3].size, "TIS"))
        if np.any(np.abs(rows[-1]) > _LARGEST):
            raise FileFormatError(f"{path}: a value is beyond {_LARGEST:g}, the largest one of 32 bits")
    shape = (parts, *(nodes.size for nodes in lists))
    values = np.concatenate(rows, dtype=np.float32, casting="same_kind").reshape(shape)
    return Text(
        tuple(comments),
        entries["Symmetry"],
        content,
        entries["ScatterType"],
        lists,
        tis.reshape(shape[:3]),
        values,
    )


def _words(path: Path, comments: list[str]) -> Iterator[str]:
    """Give the words of a file that are not in comments, which are collected."""
    for line in lines_of(path):
        if line.lstrip().startswith("#"):
            comments.append(line.lstrip()[1:].strip())
        else:
            yield from line.split()


def _numbers(path: Path, words: Iterator[str], count: int, name: str) -> NDArray[np.float64]:
    """Return the next numbers of a file."""
    if count > path.stat().st_size:
        raise FileFormatError(f"{path}: {count} numbers of {name} are more than the file has")
    try:
        numbers = np.array(list(itertools.islice(words, count)), dtype=np.float64)
    except FileFormatError:  # of a line
        raise
    except ValueError:
        raise FileFormatError(f"{path}: a number of {name} cannot be read") from None
    if numbers.size < count or not np.all(np.isfinite(numbers)):
        raise FileFormatError(f"{path}: a number of {name} is missing or not finite")
    return numbers
