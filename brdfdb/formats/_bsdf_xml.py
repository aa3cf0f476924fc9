"""The XML files that Radiance and WINDOW share: a frame around blocks of numbers, one a channel and side."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from brdfdb.errors import FileFormatError
from brdfdb.formats._input import head_of, opened_text
from brdfdb.formats._record import lines, of_lines, one_line
from brdfdb.place import path_of

# Names of the sides in these files are those of WINDOW, whose front is outdoors. Radiance's front is the back
FRONT_OF_RADIANCE = "Reflection Back"
SIDES = {"back": FRONT_OF_RADIANCE, "front": "Reflection Front"}
VISIBLE = "Visible"
_MOST_BYTES, _PIECE = 1 << 29, 1 << 20  # size of a file that is read [byte], and of what is parsed at a time
_NAMESPACE = "http://windows.lbl.gov"
_HEAD = f"""<?xml version="1.0" encoding="UTF-8"?>
<WindowElement xmlns="{_NAMESPACE}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
<WindowElementType>System</WindowElementType>
<FileType>BSDF</FileType>
<Optical>
<Layer>
"""
_TAIL = "</Layer>\n</Optical>\n</WindowElement>\n"


@dataclass(frozen=True)
class BsdfBlock:
    """Numbers of one channel and one side."""

    wavelength: str  #: "Visible", "Solar", or a channel of a colour, such as "CIE-X"
    side: str  #: "Reflection Back", and so on
    basis: str  #: name of the angle basis: of the columns, in a matrix
    row_basis: str  #: name of the basis of the rows; empty of a tree
    numbers: str  #: the numbers as text
    kind: str = "BTDF"  #: type of the data; the schema of WINDOW knows BTDF alone, for reflection, too


@dataclass(frozen=True)
class BsdfFile:
    """Content of a BSDF file."""

    name: str  #: name of the material
    structure: str  #: "TensorTree3", "TensorTree4", "Columns" or "Rows"
    definition: ElementTree.Element  #: definition of the data, with the angle bases
    record: Mapping[str, Any]  #: our record; empty of files of other programs
    blocks: Mapping[str, BsdfBlock]  #: blocks of the side, by wavelength


def text_of(
    name: str,
    title: str,
    material: Iterable[str],
    definition: Iterable[str],
    blocks: Iterable[BsdfBlock],
    record: dict[str, Any],
) -> Iterable[str]:
    """Yield the text of a file in pieces.

    `material` and `definition` are lines of XML on the material and on the structure of the data. The record goes into
    the comments of the definition.
    """
    yield _HEAD
    product = f"<ProductName>{escape(one_line(title))}</ProductName>\n" if title else ""
    yield f"<Material>\n<Name>{escape(one_line(name))}</Name>\n{product}<Manufacturer>brdfdb</Manufacturer>\n"
    yield "".join(f"{line}\n" for line in (*material, "</Material>", "<DataDefinition>", *definition))
    yield f"<Comments>\n{escape(chr(10).join(lines(record)))}\n</Comments>\n</DataDefinition>\n"
    for block in blocks:
        yield from _text_of_block(block)
    yield _TAIL


def _text_of_block(block: BsdfBlock) -> Iterable[str]:
    rows = [
        "<WavelengthData>",
        "<LayerNumber>System</LayerNumber>",
        f'<Wavelength unit="Integral">{block.wavelength}</Wavelength>',
        "<SourceSpectrum>Equal energy</SourceSpectrum>",
        f"<DetectorSpectrum>{_DETECTORS.get(block.wavelength, 'None')}</DetectorSpectrum>",
        "<WavelengthDataBlock>",
        f"<WavelengthDataDirection>{block.side}</WavelengthDataDirection>",
    ]
    if block.row_basis:
        rows += [
            f"<ColumnAngleBasis>{block.basis}</ColumnAngleBasis>",
            f"<RowAngleBasis>{block.row_basis}</RowAngleBasis>",
        ]
    else:
        rows += [f"<AngleBasis>{block.basis}</AngleBasis>"]
    yield "\n".join([*rows, f"<ScatteringDataType>{block.kind}</ScatteringDataType>", "<ScatteringData>\n"])
    yield block.numbers
    yield "\n</ScatteringData>\n</WavelengthDataBlock>\n</WavelengthData>\n"


_DETECTORS = {
    VISIBLE: "ASTM E308 1931 Y.dsp",
    "CIE-X": "ASTM E308 1931 X.dsp",
    "CIE-Z": "ASTM E308 1931 Z.dsp",
    "CIE-u": "CIE 1976 u'",
    "CIE-v": "CIE 1976 v'",
}


def is_window_element(head: bytes) -> bool:
    """Return True if the first bytes of a file are those of such a file."""
    return b"<WindowElement" in head


def read(path: str | os.PathLike[str], side: str = FRONT_OF_RADIANCE) -> BsdfFile:
    """Return what a file says of a side: by default of the one that is Radiance's front.

    Raises
    ------
    FileFormatError
        If the file is not XML of this kind, or has no numbers for that side.
    OSError
        If it cannot be read.
    """
    path = path_of(path)
    try:
        root = _root(path)
    except FileFormatError:
        raise
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FileFormatError(f"{path}: it is not XML: {error}") from None
    layer = root.find("{*}Optical/{*}Layer")
    definition = root.find("{*}Optical/{*}Layer/{*}DataDefinition")
    if layer is None or definition is None:
        raise FileFormatError(f"{path}: it has no DataDefinition in Optical, Layer")
    blocks: dict[str, BsdfBlock] = {}
    for entry in layer.findall("{*}WavelengthData"):
        for part in entry.findall("{*}WavelengthDataBlock"):
            if _text(part, "WavelengthDataDirection").lower() == side.lower():
                wavelength = _text(entry, "Wavelength")
                if wavelength.lower() in blocks:
                    text = f"the block {wavelength} of {side} stands twice; write a file for each measurement"
                    raise FileFormatError(f"{path}: field WavelengthData: {text}")
                basis = _text(part, "AngleBasis") or _text(part, "ColumnAngleBasis")
                numbers = _text(part, "ScatteringData")
                blocks[wavelength.lower()] = BsdfBlock(wavelength, side, basis, _text(part, "RowAngleBasis"), numbers)
    if VISIBLE.lower() not in blocks:
        of_radiance = ", which is Radiance's front" if side == FRONT_OF_RADIANCE else ""
        known = {
            (_text(entry, "Wavelength").lower(), _text(part, "WavelengthDataDirection").lower())
            for entry in layer.findall("{*}WavelengthData")
            for part in entry.findall("{*}WavelengthDataBlock")
        }
        other = [name for name, words in SIDES.items() if (VISIBLE.lower(), words.lower()) in known]
        hint = f"; --side {other[0]} reads {SIDES[other[0]]}" if other else ""
        raise FileFormatError(f"{path}: field WavelengthData: it has no {VISIBLE} block of {side}{of_radiance}{hint}")
    return BsdfFile(
        _text(layer, "Material/{*}Name") or path.stem,
        _text(definition, "IncidentDataStructure"),
        definition,
        of_lines(_text(definition, "Comments").splitlines()),
        blocks,
    )


def _root(path: Path) -> ElementTree.Element:
    """Return the root of a document, which is parsed in pieces: the first one that is no XML ends it."""
    parser = ElementTree.XMLParser()
    end = ""
    with opened_text(path, _MOST_BYTES) as file:
        if not is_window_element(head_of(path)):
            raise FileFormatError(f"{path}: line 1: it does not begin with a WindowElement")
        while piece := file.read(_PIECE):
            seen = end + (piece if end else piece.lstrip())
            if "<!DOCTYPE" in seen or "<!ENTITY" in seen:  # entities may grow without limit
                raise FileFormatError(f"{path}: it declares a document type, which these files do not have")
            parser.feed(seen[len(end) :])
            end = piece[-len("<!DOCTYPE") :]
    root: ElementTree.Element = parser.close()
    return root


def _text(parent: ElementTree.Element, name: str) -> str:
    """Return the text of a child, without the space around it; empty where there is no such child."""
    return (parent.findtext(f"{{*}}{name}") or "").strip()
