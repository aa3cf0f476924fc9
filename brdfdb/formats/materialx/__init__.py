"""MaterialX: the OpenPBR or Standard Surface that comes closest to a table, as a document that states its error.

The file holds the parameters of a surface, which are fitted to the table. Renderers evaluate the surface, so nothing is
interpolated. Its shapes are those of GGX and Oren-Nayar. Other lobes are represented by these shapes, and the file
states the error.

The surface can be anisotropic. Spectral tables become linear sRGB. The specular part is left out, unless the surface is
smooth.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from brdfdb.errors import FileFormatError
from brdfdb.formats._channels import RGB, channels_of, has_spectrum
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._record import document_of, frame_remark, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.formats.materialx._surface import OPEN_PBR, STANDARD, MaterialXSurface
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.tables.table import Table

suffix = ".mtlx"
media_type = "application/mtlx+xml"
summary = "surfaces of MaterialX whose parameters are fitted to tables"
tools = "MaterialX and the programs with it: USD, Maya, Houdini, Blender, Arnold, RenderMan"
kinds = (OPEN_PBR, STANDARD)
options = (
    replace(
        TOLERANCE, help="largest relative error of 99 % of the values against the table; the closest surface is written"
    ),
)

VERSION = "1.39"
HOLDS = "parameters of a surface; f_r [1/sr] as the GLSL of MaterialX 1.39 evaluates it, linear sRGB under D65"
_FITTED = "a surface of MaterialX that was fitted to the table, by cube roots of f_r; the error tells how near it is"
_SMOOTH = "its facets mirror: a roughness of 0 is a Dirac delta in MaterialX, which is no part of f_r"
_LARGEST = 1 << 22  # bytes of a document that are read
_MOST = 1000.0  # largest number of a parameter, far above those that mean anything
_NOT_EVALUATED = "this input is not evaluated here"

# Names of the parameters: of `MaterialXSurface`, OpenPBR and Standard MaterialXSurface, and the type
_INPUTS = (
    ("base_weight", "base_weight", "base", "float"),
    ("base_color", "base_color", "base_color", "color3"),
    ("base_diffuse_roughness", "base_diffuse_roughness", "diffuse_roughness", "float"),
    ("base_metalness", "base_metalness", "metalness", "float"),
    ("specular_weight", "specular_weight", "specular", "float"),
    ("specular_color", "specular_color", "specular_color", "color3"),
    ("specular_roughness", "specular_roughness", "specular_roughness", "float"),
    ("specular_ior", "specular_ior", "specular_IOR", "float"),
    ("specular_anisotropy", "specular_roughness_anisotropy", "specular_anisotropy", "float"),
)
_DEFAULTS = {
    STANDARD: MaterialXSurface(STANDARD, (0.8,), specular_roughness=0.2),
    OPEN_PBR: MaterialXSurface(OPEN_PBR, (0.8,)),
}
_ROTATION = "specular_rotation"  # of a standard surface [turn]
_TANGENT = "geometry_tangent"  # of OpenPBR, which has no rotation


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    kind: str = OPEN_PBR,
    tolerance: float = 0.02,
    verdict: str | None = None,
) -> Written:
    """Write the surface of MaterialX that comes closest to a table.

    GGX has other tails than a Gaussian, and its facets are bright at grazing: p99, which is relative to each value of
    f_r, is far beyond a few hundredths for most materials with a highlight. l1 is the share of the light that is in a
    wrong place. The x axis of the table is the tangent of the geometry. The record is the `doc` of the material.
    """
    from brdfdb.formats._stated_error import Comparison
    from brdfdb.formats.materialx._fit import fitted

    channels = channels_of(table, "rgb" if has_spectrum(table) else "grey")
    surface = _rounded(fitted(kind, table, channels))
    error = Comparison(table, channels).error_of(surface.brdf)
    left_out = (_SMOOTH,) if surface.smooth else specular_remark(table)
    remarks = (_FITTED, *channels.remarks, *left_out, *frame_remark(table, "the tangent of the geometry"))
    document = record(table, error, verdict, holds=HOLDS, remarks=remarks, tolerance=tolerance)
    text = _document(table.name, surface, json.dumps(document))
    with whole(path) as (temporary,):
        temporary.write_text(text, encoding="utf-8")
    return Written((path_of(path),), error, tolerance, remarks)


def recognises(head: bytes) -> bool:
    """Return True if the first bytes of a file are those of a MaterialX document."""
    return b"<materialx" in head


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of the first OpenPBR or Standard Surface of a MaterialX document, as its GLSL evaluates it.

    Inputs that are not evaluated are refused: a texture, a coat, fuzz, transmission, a subsurface or a thin film.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    with path.open("rb") as file:
        text = file.read(_LARGEST + 1)
    if len(text) > _LARGEST:
        raise FileFormatError(
            f"{path}: it has more than {_LARGEST >> 20} MiB, too many for a document with one surface"
        )
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise FileFormatError(f"{path}: it is not XML: {error}") from None
    node = next((child for child in root if child.tag in kinds), None)
    if root.tag != "materialx" or node is None:
        raise FileFormatError(f"{path}: the document has no node {' or '.join(kinds)}")
    surface = _surface(path, node)
    material = root.find("surfacematerial")
    document = document_of("" if material is None else material.get("doc", ""))
    name = document.get("name") or node.get("name") or path.stem
    surface = replace(surface, base_color=_colors(surface.base_color), specular_color=_colors(surface.specular_color))
    grey = all(len(set(color)) == 1 for color in (surface.base_color, surface.specular_color))
    if grey:
        surface = replace(surface, base_color=surface.base_color[:1], specular_color=surface.specular_color[:1])
    return FileTable(str(name), ("grey",) if grey else RGB, None, surface.brdf, document)


def _rounded(surface: MaterialXSurface) -> MaterialXSurface:
    """Return a surface with the digits of single precision, which a file has and shaders compute with."""

    def digits(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(digits(part) for part in value)
        return float(f"{value:.6g}") if isinstance(value, float) else value

    return MaterialXSurface(**{name: digits(value) for name, value in asdict(surface).items()})


def _colors(color: tuple[float, ...]) -> tuple[float, ...]:
    """Return red, green and blue of a colour, which may be one number."""
    return color if len(color) == len(RGB) else color[:1] * len(RGB)


def _document(name: str, surface: MaterialXSurface, doc: str) -> str:
    """Return the text of a document with one surface and one material."""
    root = ElementTree.Element("materialx", version=VERSION, colorspace="lin_rec709")
    shader = f"SR_{_identifier(name)}"
    turned = surface.quarter_turn and surface.kind == OPEN_PBR
    if turned:
        for node in ("normal", "tangent"):
            space = ElementTree.SubElement(root, node, name=f"{shader}_{node}", type="vector3")
            _input(space, "space", "string", "world")
        turn = ElementTree.SubElement(root, "rotate3d", name=f"{shader}_y", type="vector3")
        ElementTree.SubElement(turn, "input", name="in", type="vector3", nodename=f"{shader}_tangent")
        _input(turn, "amount", "float", "90")
        ElementTree.SubElement(turn, "input", name="axis", type="vector3", nodename=f"{shader}_normal")
    element = ElementTree.SubElement(root, surface.kind, name=shader, type="surfaceshader")
    for ours, open_pbr, standard, kind in _INPUTS:
        value = getattr(surface, ours)
        words = ", ".join(f"{part:.6g}" for part in (_colors(value) if kind == "color3" else (value,)))
        _input(element, open_pbr if surface.kind == OPEN_PBR else standard, kind, words)
    if turned:
        ElementTree.SubElement(element, "input", name=_TANGENT, type="vector3", nodename=f"{shader}_y")
    elif surface.quarter_turn:
        _input(element, _ROTATION, "float", "0.25")
    material = ElementTree.SubElement(root, "surfacematerial", name=f"M_{_identifier(name)}", type="material", doc=doc)
    ElementTree.SubElement(material, "input", name="surfaceshader", type="surfaceshader", nodename=shader)
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _input(parent: ElementTree.Element, name: str, kind: str, value: str) -> None:
    ElementTree.SubElement(parent, "input", name=name, type=kind, value=value)


def _identifier(name: str) -> str:
    """Return a name that has only letters, digits and _, as MaterialX needs it."""
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)


def _surface(path: Path, node: ElementTree.Element) -> MaterialXSurface:
    """Return the surface of a node."""
    column = 1 if node.tag == OPEN_PBR else 2
    names = {entry[column]: (entry[0], entry[3]) for entry in _INPUTS}
    values: dict[str, Any] = {}
    for element in node.iterfind("input"):
        name = element.get("name", "")
        text = element.get("value", "")
        if name == _TANGENT and element.get("nodename", "") == f"{node.get('name')}_y":
            values["quarter_turn"] = True
        elif name == _ROTATION and _numbers(text) in ((0.0,), (0.25,)):
            values["quarter_turn"] = _numbers(text) == (0.25,)
        elif name in names:
            ours, kind = names[name]
            numbers = _numbers(text)
            if len(numbers) != (3 if kind == "color3" else 1) or "nodename" in element.attrib:
                raise FileFormatError(
                    f"{path}: input {name}: {text!r:.60} is not a {kind} of numbers in [0, {_MOST:g}]"
                )
            values[ours] = numbers if kind == "color3" else numbers[0]
        else:
            raise FileFormatError(f"{path}: input {name}: {_NOT_EVALUATED}")
    return replace(_DEFAULTS[node.tag], **values)


def _numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a text; empty if it has others, or one out of range."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(0.0 <= number <= _MOST for number in numbers) else ()
