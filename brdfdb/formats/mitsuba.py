"""Mitsuba: the plugin of a material in Mitsuba 3, as XML to include in a scene, and as a dictionary.

The XML is a scene that holds the BSDF under the name of the material. Other scenes include the file and refer to that
name. The dictionary, for `mitsuba.load_dict`, is a JSON file beside it. Mitsuba knows the plugins after
``import brdfdb.mitsuba``.

A model that Mitsuba has as a plugin computes f_r with the parameters of the material, so nothing is interpolated. Other
materials, and all with ``--plugin table``, read the table when the scene is loaded: from the store that the property
``store`` of the plugin names, or else the environment variable BRDFDB_STORE.
"""

from __future__ import annotations

import json
import os
import re
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from brdfdb.formats._interface import FormatOption
from brdfdb.formats._record import U_AXIS, beside, frame_remark, record
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.materials import Material
    from brdfdb.tables.table import Table

suffix = ".xml"
media_type = "application/xml"
summary = "plugins of Mitsuba 3 with the parameters of materials, as XML and as dictionaries"
tools = "Mitsuba 3 with brdfdb.mitsuba"
kinds: tuple[str, ...] = ()
MODEL = "model"
TABLE = "table"
options = (
    FormatOption(
        "plugin", MODEL, "plugin of the model where Mitsuba has one, or the plugin of tables", choices=(MODEL, TABLE)
    ),
)

VERSION = "3.0.0"
HOLDS = "the parameters of a plugin of Mitsuba, whose f_r [1/sr] is times the cosine of the viewer in Mitsuba"
_DIGITS = 9  # of numbers of a spectrum: float32 has fewer


def write(table: Table, path: str | os.PathLike[str], *, plugin: str = MODEL, verdict: str | None = None) -> Written:
    """Write the plugin of a material for Mitsuba 3 as XML, and as a dictionary in a second file."""
    from brdfdb.materials import Material
    from brdfdb.models.mitsuba_plugins import OF_MITSUBA

    source = table.source
    document: dict[str, Any] = {"type": "brdfdb_table", "material": table.name}
    remarks: tuple[str, ...] = ()
    if plugin == MODEL and isinstance(source, Material) and source.model in OF_MITSUBA:
        document = _of_model(table, source)
    elif plugin == MODEL:
        remarks = ("Mitsuba has no plugin of its model, and reads the table from the store that BRDFDB_STORE names",)
    remarks = (*remarks, *frame_remark(table, U_AXIS))
    known = record(table, None, verdict, holds=HOLDS, remarks=remarks)
    text = _xml(table.name, document, known)
    dictionary = json.dumps({"id": table.name, **document}, indent=1)
    with whole(path, beside(path_of(path))) as (first, second):
        first.write_text(text, encoding="utf-8")
        second.write_text(dictionary + "\n", encoding="utf-8")
    return Written((path_of(path), beside(path_of(path))), remarks=remarks)


def recognises(head: bytes) -> bool:
    """Return True if the first bytes of a file are those of a scene: others have the suffix, too."""
    return b"<scene" in head


def _of_model(table: Table, material: Material) -> dict[str, Any]:
    """Return the plugin of a model as a dictionary. Angles are in degrees, wavelengths in nm."""
    from brdfdb.materials.spectrum import Spectrum
    from brdfdb.models.mitsuba_plugins import OF_MITSUBA

    name, has_forms = OF_MITSUBA[material.model]
    document: dict[str, Any] = {"type": name, **({"form": material.model} if has_forms else {})}
    for key, value in material.file_parameters().items():
        if isinstance(value, Spectrum):
            document[key] = _spectrum(value.wavelengths_nm, value.values)
        else:
            document[key] = value
    indices = material.refractive_indices(table.wavelength_nm)
    if indices is not None and table.wavelength_nm is not None:
        for key, values in zip(("n", "k"), indices, strict=True):
            document[key] = _spectrum(table.wavelength_nm, np.broadcast_to(values, table.wavelength_nm.shape))
        if table.wavelength_nm.size == 1:
            document["wavelength_nm"] = float(table.wavelength_nm[0])
    return document


def _spectrum(wavelengths_nm: Any, values: Any) -> float | dict[str, Any]:
    """Return a number, or a spectrum as Mitsuba writes it."""
    numbers = [float(f"{value:.{_DIGITS}g}") for value in values]
    if len(numbers) == 1:
        return numbers[0]
    pairs = [[float(nm), number] for nm, number in zip(wavelengths_nm, numbers, strict=True)]
    return {"type": "spectrum", "value": pairs}


def _xml(name: str, document: dict[str, Any], known: dict[str, Any]) -> str:
    scene = ElementTree.Element("scene", version=VERSION)
    comment = re.sub("(?<=-)-", r"\\u002d", json.dumps(known))  # XML allows no -- in comments
    scene.append(ElementTree.Comment(f" {comment} "))
    bsdf = ElementTree.SubElement(scene, "bsdf", type=document["type"], id=name)
    for key, value in document.items():
        if key == "type":
            continue
        if isinstance(value, dict):
            pairs = ", ".join(f"{nm:.10g}:{number:.{_DIGITS}g}" for nm, number in value["value"])
            ElementTree.SubElement(bsdf, "spectrum", name=key, value=pairs)
        else:
            kind = "boolean" if isinstance(value, bool) else "string" if isinstance(value, str) else "float"
            text = str(value).lower() if isinstance(value, bool) else value if isinstance(value, str) else repr(value)
            ElementTree.SubElement(bsdf, kind, name=key, value=text)
    ElementTree.indent(scene)
    return ElementTree.tostring(scene, encoding="unicode") + "\n"
