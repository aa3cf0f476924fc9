"""The text of Zemax (Radiant) BSDF files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._angular_grid import Sink
from brdfdb.formats._words import Words
from brdfdb.parameters import Floats

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
    values : array (C, rotations, incidences, azimuths, radials) [1/sr]
        f_r.
    """

    comments: tuple[str, ...]
    symmetry: str
    content: str
    scatter: str
    angles: tuple[NDArray[np.float64], ...]
    tis: NDArray[np.float64]
    values: Floats


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
    words = Words(path)
    entries = {"Source": "", "Symmetry": "", "SpectralContent": "", "ScatterType": ""}
    angles: dict[str, NDArray[np.float64]] = {}
    for word in words:
        if word in entries:
            entries[word] = words.next(word)
        elif word in LISTS:
            angles[word] = words.numbers(words.count(word), word)
            if not angles[word].size or np.any(np.diff(angles[word]) <= 0.0):
                raise words.error(word, "the angles do not increase, or there are none")
        elif any(word in parts for parts in _PARTS.values()):
            break
    content = entries["SpectralContent"]
    if entries["Symmetry"] not in _SYMMETRIES or content not in _PARTS:
        raise FileFormatError(f"{path}: its Symmetry or SpectralContent is not that of a Zemax BSDF file")
    angles.setdefault("SampleRotation", np.zeros(1))
    missing = [name for name in LISTS if name not in angles]
    if missing:
        raise FileFormatError(f"{path}: {', '.join(missing)} is missing")
    lists = tuple(angles[name] for name in LISTS)
    parts = len(_PARTS[content])
    blocks = parts * lists[0].size * lists[1].size
    if blocks > path.stat().st_size:
        raise FileFormatError(f"{path}: its lists of angles need {blocks} blocks of values, more than the file has")
    rows, tis = [], np.empty(blocks)
    for number in range(blocks):
        for word in words:
            if word == "TIS":
                break
        tis[number] = words.numbers(1, "TIS")[0]
        rows.append(words.numbers(lists[2].size * lists[3].size, f"block {number + 1} of {blocks}"))
        if np.any(np.abs(rows[-1]) > _LARGEST):
            raise words.error("TIS", f"a value is beyond {_LARGEST:g}, the largest one of 32 bits")
    shape = (parts, *(nodes.size for nodes in lists))
    values = np.concatenate(rows, dtype=np.float32, casting="same_kind").reshape(shape)
    return Text(
        tuple(words.comments),
        entries["Symmetry"],
        content,
        entries["ScatterType"],
        lists,
        tis.reshape(shape[:3]),
        values,
    )
