"""Zemax (Radiant) BSDF files: f_r about the specular direction as text, one value or CIE XYZ.

For each direction of the light, f_r in 1/sr is listed over the angle from the specular direction and the azimuth about
it. libbsdf interpolates linearly over each angle. The file also holds the total integrated scatter, which is the
albedo.

A file can hold anisotropic tables, but OpticStudio and libbsdf read only isotropic files. Spectral tables become CIE
XYZ, or its Y alone (``--colour``). The specular part is left out.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._angles import Specular
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen
from brdfdb.formats._channels import LUMINOUS, XYZ, channels_of
from brdfdb.formats._doubts import doubt_comments
from brdfdb.formats._input import Words
from brdfdb.formats._interface import TOLERANCE, FormatOption
from brdfdb.formats._nodes import rows_of_grid, without_holes
from brdfdb.formats._record import CONVENTION, lines, note, of_comments, of_lines, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import FileError
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.albedo import TableAlbedo
    from brdfdb.tables.table import Table

suffix = ".bsdf"
media_type = "text/plain"
summary = "Zemax and Radiant BSDF: angles about the specular direction, one value or CIE XYZ"
tools = "OpticStudio, libbsdf"
kinds = ()
options = (
    TOLERANCE,
    FormatOption(
        "colour", "auto", "CIE XYZ or Y alone; auto writes XYZ of spectral tables", choices=("auto", "xyz", "grey")
    ),
    SIZE,
)

_TIS_TOLERANCE = 1e-4  # absolute, of an albedo
_HOLDS = f"{CONVENTION}; the sample is turned by phi_i, and angles of incidence and TIS are those of the table"
_LISTS = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
_TITLE = "BSDF Data Interchange file"
_SYMMETRIES = ("PlaneSymmetrical", "Asymmetrical", "ASymmetrical", "ASymmetrical4D", "Asymmetrical4D")
_PARTS = {"Monochrome": ("Monochrome",), "XYZ": ("TristimulusX", "TristimulusY", "TristimulusZ")}

_RANGES_DEG = {  # of the lists
    "SampleRotation": (-360.0, 360.0),
    "AngleOfIncidence": (0.0, 90.0),
    "ScatterAzimuth": (-360.0, 360.0),
    "ScatterRadial": (0.0, 180.0),
}
signs = re.compile(rb"^(?:AngleOfIncidence|ScatterAzimuth|ScatterRadial|SpectralContent|ScatterType)\b", re.MULTILINE)

_LARGEST = float(np.finfo(np.float32).max)


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    colour: str = "auto",
    size: float = 16.0,
    verdict: str | None = None,
) -> Written:
    """Write a table as a Zemax BSDF file with the record in its comments.

    After Zemax's article on the format (1500005486801) and libbsdf's ``ZemaxBsdfReader.cpp``: polar angles from the
    specular direction, azimuths from there towards the normal, counter-clockwise from above. The error is that of
    linear interpolation over each angle, as libbsdf does it. TIS is the directional albedo of the table, without its
    specular part. Isotropic tables are PlaneSymmetrical, others ASymmetrical4D, of which OpticStudio's model and
    libbsdf read one rotation only.
    """
    from brdfdb.formats._stated_error import Comparison
    from brdfdb.tables.albedo import directional_albedo

    channels = channels_of(table, colour)
    system = Specular(table.anisotropic, mirrored=not table.anisotropic)
    remarks = (*channels.remarks, *specular_remark(table))
    albedo = directional_albedo(table, tolerance=_TIS_TOLERANCE)

    def write_all(sink: Sink, grid: AngularGrid, error: FileError) -> None:
        document = record(table, error, verdict, holds=_HOLDS, remarks=remarks, tolerance=tolerance)
        document["channels"] = list(channels.names)
        write_text(sink, _text(table, channels, albedo, grid, tuple(lines(document))))

    grid, error = chosen(Comparison(table, channels), [system], tolerance, size, write_all, as_text=True)
    with whole(path) as (file,), file.open("wb") as stream:
        write_all(stream, grid, error)
    return Written((path_of(path),), error, tolerance, remarks)


def _text(
    table: Table, channels: Channels, albedo: TableAlbedo, grid: AngularGrid, comments: tuple[str, ...]
) -> ZemaxText:
    """Return the content of the file of a grid."""
    angles = [np.rad2deg(axis) for axis in grid.nodes]
    values = grid.values
    if not table.anisotropic:
        angles.insert(1, np.zeros(1))
        values = values[:, np.newaxis]
    return ZemaxText(
        comments=comments,
        symmetry="ASymmetrical4D" if table.anisotropic else "PlaneSymmetrical",
        content="XYZ" if len(channels.names) == 3 else "Monochrome",
        scatter="BRDF",
        angles=(angles[1], angles[0], angles[3], angles[2]),
        tis=_albedo(table, channels, albedo, angles[0], angles[1]),
        values=values.transpose(4, 1, 0, 3, 2),
    )


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a Zemax BSDF file; those of an RGL file, with the same suffix, are binary."""
    if head.startswith(f"# {_TITLE}\n".encode()):
        return True
    lines_of_words = (line.split() for line in head.split(b"\n") if not line.lstrip().startswith(b"#"))
    first = next((words[0] for words in lines_of_words if words), b"")
    return first in (b"Source", b"Symmetry", b"SpectralContent")


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of a Zemax BSDF file as libbsdf sees it; an anisotropic one in the same way.

    The record has the total integrated scatter as "tis", with its angles of incidence as "theta_i_deg".
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    text = parsed(path)
    if text.scatter != "BRDF":
        raise FileFormatError(f"{path}: field ScatterType: {text.scatter!r:.40} is not read; allowed is BRDF")
    turns, incidences, azimuths, radials = (np.deg2rad(axis) for axis in text.angles)
    values = without_holes(text.values.transpose(2, 1, 4, 3, 0)).astype(np.float32)
    both_sides = text.symmetry == "PlaneSymmetrical"
    if both_sides and azimuths[-1] < np.pi:  # the interval around 180 degrees has its mirror image at the other end
        azimuths = np.append(azimuths, np.pi)
        values = np.concatenate([values, values[..., -1:, :]], axis=3)
    anisotropic = turns.size > 1
    nodes = (incidences, turns, radials, azimuths) if anisotropic else (incidences, radials, azimuths)
    grid = AngularGrid(Specular(anisotropic, both_sides), nodes, values if anisotropic else values[:, 0])
    document = of_lines(list(text.comments))
    document |= {"theta_i_deg": text.angles[1].tolist(), "tis": np.moveaxis(text.tis, 0, -1).tolist()}
    if "program" not in document:
        doubt_comments(text.comments, document)
    luminous = document.get("channels") == list(LUMINOUS)
    names = XYZ if text.content == "XYZ" else LUMINOUS if luminous else ("grey",)
    name = str(document.get("name") or path.name.partition(".")[0])
    instrument, wavelength_nm = of_comments(document)
    at = None
    if wavelength_nm is not None and names == ("grey",):
        names, at = (f"{wavelength_nm:g}nm",), np.array([wavelength_nm])
        note(document, f"The wavelength {wavelength_nm:g} nm was read from the comments of the file.")

    def rows() -> ListedRows:
        angles = [np.deg2rad(text.angles[axis]) for axis in (1, 0, 3, 2)]
        f_r = text.values.transpose(2, 1, 4, 3, 0)
        system = Specular(anisotropic=True, mirrored=False)
        sample = str(document.get("Sample", ""))
        return rows_of_grid(system, angles, f_r, name, names, at, document, instrument=instrument, provenance=sample)

    return FileTable(name, names, at, grid.evaluate, document, rows, listed=True)


def _albedo(
    table: Table,
    channels: Channels,
    known: TableAlbedo,
    theta_i_deg: NDArray[np.float64],
    phi_i_deg: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the directional albedo [1] of a table without its specular part, shape (C, phi_i, theta_i)."""
    at = table.wavelength_nm
    albedo = known.albedo
    if channels.wavelength_nm is not None and at is not None:
        nearest = np.abs(at[:, np.newaxis] - channels.wavelength_nm).argmin(axis=0)
        albedo = albedo[..., nearest]
    of_channels = channels.of_spectra(albedo[..., 0] if channels.wavelength_nm is None else albedo)
    over_theta = np.stack(
        [
            [np.interp(theta_i_deg, known.theta_i_deg, column) for column in of_channels[:, turn].T]
            for turn in range(of_channels.shape[1])
        ]
    )
    if over_theta.shape[0] == 1:
        return np.repeat(over_theta.transpose(1, 0, 2), phi_i_deg.size, axis=1)
    turn = known.phi_i_deg[-1]
    phi = phi_i_deg % max(turn, 180.0)  # it repeats itself after half a turn or a whole one
    phi = np.where(phi > turn, 180.0 - phi, phi)  # and, where a quarter is known, is its mirror image
    return np.stack(
        [
            [np.interp(phi, known.phi_i_deg, over_theta[:, c, t]) for t in range(theta_i_deg.size)]
            for c in range(over_theta.shape[1])
        ]
    ).transpose(0, 2, 1)


@dataclass(frozen=True, eq=False)
class ZemaxText:
    """Content of a Zemax file."""

    comments: tuple[str, ...]  #: the comments
    #: values of the entries Symmetry, SpectralContent and ScatterType
    symmetry: str
    content: str
    scatter: str
    #: the four lists: rotations of the sample, angles of incidence, azimuths and radial angles, [degree]
    angles: tuple[NDArray[np.float64], ...]
    tis: NDArray[np.float64]  #: total integrated scatter, (C, rotations, incidences)
    values: Floats  #: f_r, (C, rotations, incidences, azimuths, radials) [1/sr]


def write_text(stream: Sink, text: ZemaxText) -> None:
    """Write a file."""
    head = [f"# {comment}" for comment in (_TITLE, *text.comments)]
    head += ["Source Measured", f"Symmetry {text.symmetry}", f"SpectralContent {text.content}"]
    head += [f"ScatterType {text.scatter}"]
    for name, nodes in zip(_LISTS, text.angles, strict=True):
        head += [f"{name} {nodes.size}", " ".join(f"{node:.10g}" for node in nodes)]
    stream.write("\n".join([*head, "", ""]).encode())
    line = " ".join(["%.5g"] * text.angles[3].size)
    rows = "\n".join([line] * text.angles[2].size)
    for part, every_tis, planes in zip(_PARTS[text.content], text.tis, text.values, strict=True):
        stream.write(f"{part}\nDataBegin\n".encode())
        for tis, plane in zip(every_tis.reshape(-1), planes.reshape(-1, *planes.shape[2:]), strict=True):
            stream.write(f"TIS {tis:.6g}\n{rows % tuple(plane.reshape(-1).tolist())}\n".encode())
        stream.write(b"DataEnd\n")


def parsed(path: Path) -> ZemaxText:
    """Return the content of a file; FileFormatError if it is no Zemax BSDF file, or damaged."""
    words = Words(path)
    entries, angles, first = _header(words)
    content = entries["SpectralContent"]
    if entries["Symmetry"] not in _SYMMETRIES or content not in _PARTS:
        text = f"{entries['Symmetry']!r:.40} and {content!r:.40} are not those of a Zemax BSDF file"
        allowed = f"{', '.join(_SYMMETRIES)}, and {', '.join(_PARTS)}"
        raise FileFormatError(f"{path}: fields Symmetry and SpectralContent: {text}; allowed are {allowed}")
    angles.setdefault("SampleRotation", np.zeros(1))
    missing = [name for name in _LISTS if name not in angles]
    if missing:
        raise FileFormatError(f"{path}: field {', '.join(missing)}: the list is missing in the header")
    lists = tuple(angles[name] for name in _LISTS)
    parts = len(_PARTS[content])
    blocks = parts * lists[0].size * lists[1].size
    if blocks > path.stat().st_size:
        raise FileFormatError(f"{path}: its lists of angles need {blocks} blocks of values, more than the file has")
    rows = []
    tis = np.empty(blocks)
    size = f"ScatterAzimuth and ScatterRadial state {lists[2].size} x {lists[3].size} values"
    for number in range(blocks):
        where = f"block {number + 1} of {blocks}"
        at = number % (blocks // parts)
        if at == 0:
            part = _PARTS[content][number * parts // blocks]
            if number:
                words.expect("DataEnd", f"{where}: {size}")
                words.expect(part, where)
            elif first != part:
                raise words.error(where, f"{first!r:.40} stands where {part} is expected")
            words.expect("DataBegin", where)
        words.expect("TIS", f"{where}: {size}")
        tis[number] = words.numbers(1, "TIS")[0]
        rows.append(words.numbers(lists[2].size * lists[3].size, f"{where}: {size}"))
        if np.any(np.abs(rows[-1]) > _LARGEST):
            raise words.error("TIS", f"a value exceeds {_LARGEST:g}, the largest 32-bit float")
    words.expect("DataEnd", f"block {blocks} of {blocks}: {size}")
    words.end("DataEnd", "the last block")
    shape = (parts, *(nodes.size for nodes in lists))
    values = np.concatenate(rows, dtype=np.float32, casting="same_kind").reshape(shape)
    return ZemaxText(
        tuple(words.comments),
        entries["Symmetry"],
        content,
        entries["ScatterType"],
        lists,
        tis.reshape(shape[:3]),
        values,
    )


def _header(words: Words) -> tuple[dict[str, str], dict[str, NDArray[np.float64]], str]:
    """Return the entries and the lists of angles [degree] of a header, and the first word below it."""
    entries = {"Source": "", "Symmetry": "", "SpectralContent": "", "ScatterType": ""}
    angles: dict[str, NDArray[np.float64]] = {}
    name = ""
    line = 0  # of the last entry, whose value may have several words
    for word in words:
        if word in angles or entries.get(word):
            raise words.error(word, "it is stated twice; write a file for each header")
        if word in entries:
            name = word
            entries[word] = words.next(word)
            line = words.line
        elif word in _LISTS:
            name = word
            angles[word] = words.numbers(words.count(word), word)
            if not angles[word].size or np.any(np.diff(angles[word]) <= 0.0):
                raise words.error(word, "there are no angles, or they do not increase")
            low, high = _RANGES_DEG[word]
            if angles[word][0] < low or angles[word][-1] > high:
                text = f"{angles[word][0]:g} to {angles[word][-1]:g} degrees; allowed are {low:g} to {high:g}"
                raise words.error(word, text)
        elif any(word in parts for parts in _PARTS.values()):
            return entries, angles, word
        elif words.line != line and word[:1] in "+-.0123456789":
            raise words.error(name or "header", f"{word[:40]!r} is one number more than are stated")
        elif words.line != line:
            known = ", ".join((*entries, *_LISTS))
            raise words.error(word[:40], f"it is not an entry of a Zemax BSDF file, which are {known}")
    raise words.error(name or "header", f"the file ends before {' or '.join(parts[0] for parts in _PARTS.values())}")
