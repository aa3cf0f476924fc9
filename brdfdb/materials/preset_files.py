"""Libraries of presets: the materials of the papers, and those that are computed.

The papers' materials are published parameters, each with the table, figure or section it comes from. Each paper has a
TOML file, and each material a table in it. `brdfdb.materials.written_parameters` states the units.

The computed ones are substances with finishes, in the model of He et al. 1991. Each file of ``libraries/`` lists
substances with the entry of their n and k, finishes with sigma_0 and tau, and the libraries that are made of them.
Nothing in such a library was measured as a surface.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.errors import ParameterError
from brdfdb.materials.material import Material
from brdfdb.materials.provenance import Text, Words

PAPERS = "papers"  # name of the library that is meant where none is named


def libraries() -> dict[str, str]:
    """Return the title of each library of presets by its name, that of the papers first."""
    return {PAPERS: "Materials that the papers print", **titles()}


def presets(library: str = PAPERS) -> dict[str, Material]:
    """Return all materials of a library by name, in the order of its files.

    The files are read and checked once per process. The dict is a copy.

    Parameters
    ----------
    library : str, optional
        A name of `libraries`. The default, ``"papers"``, has the materials that the papers print. ``"metals"`` and
        ``"metals-infrared"`` have computed surfaces of metals, semiconductors and dielectrics.

    Returns
    -------
    dict of str to Material
        Names are unique across all libraries.

    Raises
    ------
    ParameterError
        If there is no such library.

    Examples
    --------
    >>> presets(library="metals")["gold-satin"].refractive_index
    'main/Au/Babar'
    """
    if library == PAPERS:
        return dict(_of_papers())
    if library not in titles():
        known = libraries()
        raise ParameterError("library", f"{library!r} is not one of {', '.join(known)}", library, tuple(known))
    return {entry.material.name: entry.material for entry in entries(library)}


@cache
def _of_papers() -> dict[str, Material]:
    materials: dict[str, Material] = {}
    files = (file for file in resources.files("brdfdb.materials").iterdir() if file.name.endswith(".toml"))
    for file in sorted(files, key=lambda file: file.name):
        for name, table in tomllib.loads(file.read_text(encoding="utf-8")).items():
            if name in materials:
                raise ParameterError(file.name, f"the material {name!r} is in another file too")
            materials[name] = Material.from_table(name, table)
    return materials


# Computed libraries

COMPUTED = "Computed, not measured"

_STRICT = ConfigDict(frozen=True, extra="forbid")

Kind = Literal["metal", "semiconductor", "dielectric"]
Interval = tuple[float, float]


class Wavelengths(BaseModel):
    """Equally spaced wavelengths [nm], both ends included."""

    model_config = _STRICT

    start: float
    stop: float
    step: float

    def within(self, low: float, high: float) -> tuple[float, ...]:
        """Return the wavelengths [nm] in a closed interval."""
        count = round((self.stop - self.start) / self.step)
        nodes = (self.start + number * self.step for number in range(count + 1))
        return tuple(node for node in nodes if low <= node <= high)


class Library(BaseModel):
    """A library: the kinds of substances in it, the last part of the names of its materials, and its wavelengths.

    A material whose entry covers fewer wavelengths is stated for those alone; a substance whose entry does not cover
    `least_nm` is left out.
    """

    model_config = _STRICT

    title: Text
    kinds: tuple[Kind, ...] = Field(min_length=1)
    suffix: str = ""
    wavelengths_nm: Wavelengths
    least_nm: Interval


class Traits(BaseModel):
    """Statements on a kind of substances: its finishes, and a note."""

    model_config = _STRICT

    finishes: tuple[str, ...] = Field(min_length=1)
    note: Words = ""


class Finish(BaseModel):
    """One finish: roughness and correlation length [um], and their origin."""

    model_config = _STRICT

    title: Text
    sigma_0_um: float
    tau_um: float
    source: Text


class Substance(BaseModel):
    """One substance: the entry of its n and k, the range [nm] that the entry covers, and who measured it."""

    model_config = _STRICT

    symbol: Text
    title: Text
    kind: Kind
    refractive_index: str
    covers_nm: Interval
    citation: Text
    note: Words = ""


class _File(BaseModel):
    model_config = _STRICT

    model: str
    libraries: dict[str, Library]
    kinds: dict[Kind, Traits]
    finishes: dict[str, Finish]
    substances: dict[str, Substance]


class Entry(NamedTuple):
    """One material of a library, with the substance and the finish that it is made of."""

    material: Material
    substance: Substance
    finish: Finish


@cache
def files() -> tuple[_File, ...]:
    """Return the content of all files of libraries, checked."""
    folder = resources.files("brdfdb.materials") / "libraries"
    paths = sorted((path for path in folder.iterdir() if path.name.endswith(".toml")), key=lambda path: path.name)
    return tuple(_File.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))) for path in paths)


def titles() -> dict[str, str]:
    """Return the title of each computed library by its name."""
    return {name: library.title for file in files() for name, library in file.libraries.items()}


@cache
def entries(name: str) -> tuple[Entry, ...]:
    """Return the materials of a computed library in the order of its file: substances, each with all finishes."""
    for file in files():
        if name in file.libraries:
            return tuple(_entries(file, file.libraries[name]))
    raise ParameterError("library", f"{name!r} is not one of {', '.join(titles())}", name, tuple(titles()))


def _entries(file: _File, library: Library) -> list[Entry]:
    low, high = library.least_nm
    made = []
    for slug, substance in file.substances.items():
        if substance.kind not in library.kinds or substance.covers_nm[0] > low or substance.covers_nm[1] < high:
            continue
        traits = file.kinds[substance.kind]
        for name in traits.finishes:
            finish = file.finishes[name]
            parts = (slug, name, library.suffix) if library.suffix else (slug, name)
            table = {"model": file.model, **_table(library, traits, substance, finish)}
            made.append(Entry(Material.from_table("-".join(parts), table), substance, finish))
    return made


def _table(library: Library, traits: Traits, substance: Substance, finish: Finish) -> dict[str, Any]:
    """Return a material as a TOML table would have it, without its model."""
    every = library.wavelengths_nm.within(0.0, float("inf"))
    covered = library.wavelengths_nm.within(*substance.covers_nm)
    who = substance.citation.partition(":")[0].partition(",")[0]
    text = {
        "title": ", ".join([substance.title, finish.title, *filter(None, [library.suffix]), "computed"]),
        "source": f"{COMPUTED}: the model of He et al. 1991 with n and k of {who} ({substance.refractive_index})",
        "note": " ".join(note.strip() for note in (substance.note, traits.note) if note),
        "refractive_index": substance.refractive_index,
    }
    parameters = {"sigma_0_um": finish.sigma_0_um, "tau_um": finish.tau_um, "a": 0.0}
    sources = {
        "sigma_0_um": finish.source,
        "tau_um": finish.source,
        "a": "chosen: no light returns from below the surface",
        "refractive_index": substance.citation,
    }
    stated = {} if covered == every else {"wavelengths_nm": list(covered)}
    return {**text, **stated, "parameters": parameters, "sources": sources}
