"""The pages of the materials: parameters with sources, the table and its error, the verdict, and files."""

from __future__ import annotations

import itertools
from pathlib import Path

import brdfdb
from _site import audit, material_files
from _site.files import remove_others, write_page
from _site.markup import WIDE, Card, cards, chip, code, plain, raw, table, toctree
from _site.papers import PAPERS, Paper, cited
from brdfdb.audit import MaterialAudit
from brdfdb.audit.answers import AS_PUBLISHED, CONSERVES_ENERGY
from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import Sentence
from brdfdb.figure import number
from brdfdb.geometry import degrees
from brdfdb.materials import Material
from brdfdb.materials.provenance import Assumption
from brdfdb.store.reader import Store
from brdfdb.tables.table import Table
from brdfdb_pipelines import terminal


def write(docs: Path, root: Path) -> None:
    """Write ``gallery/materials``: a page a material, with its files, and an index by paper."""
    folder = docs / "gallery" / "materials"
    store = brdfdb.open(root)
    assert isinstance(store, Store)
    found = audit.read(root)
    materials = brdfdb.presets()
    material_files.write(folder / "files", store, materials.values())
    for name, material in materials.items():
        page = _page(material, store[name], found.materials[name], found.plots[name])
        write_page(folder / f"{name}.md", page)
    write_page(folder / "index.md", _index(materials, found.materials))
    remove_others(folder, {"index.md", *(f"{name}.md" for name in materials)})


def _index(materials: dict[str, Material], audits: dict[str, MaterialAudit]) -> str:
    parts = [
        WIDE,
        "# Materials\n",
        f"The {len(materials)} materials of the three papers. Each page has the picture, the parameters and where they "
        "are printed, the table with its stated error, the verdict of the audit, and files.\n",
    ]
    for paper in PAPERS.values():
        listed = [material for material in materials.values() if _paper(material) is paper]
        if listed:
            parts += [f"## {plain(paper.short)}\n", f"{paper.title}.\n"]
            parts.append(cards(_card(material, audits[material.name]) for material in listed))
    return "\n".join([*parts, toctree(materials)])


def _paper(material: Material) -> Paper:
    """Return the paper that prints the parameters of a material."""
    first, *_ = material.source.replace(",", " ").split()
    return next((paper for paper in PAPERS.values() if paper.short.startswith(first)), PAPERS[""])


def _card(material: Material, judged: MaterialAudit) -> Card:
    size = f'width="{material_files.SIZE}" height="{material_files.SIZE}"'
    picture = f'<img class="dark-light" src="../../_images/{material.name}.png" alt="" loading="lazy" {size}>'
    grey = "" if material.spectral else ", grey"
    text = f"{material.spec.title}{grey}. As the paper says: {judged.as_published.text}. "
    text += f"Energy: {judged.conserves_energy.text}"
    return Card(f"{material.name}.html", material.title, text, picture)


def _page(material: Material, stored: Table, judged: MaterialAudit, plots: list[audit.Plot]) -> str:
    """Return the page of a material."""
    energy = judged.of(Energy).model or judged.of(Energy).table
    spec = material.spec
    largest = f"It reflects at most {number(energy.max_albedo, 4)} of the light up to {energy.theta_i_deg[-1]:g}°, at "
    largest += f"{energy.max_at_theta_i_deg:g}°"
    if energy.grazing is not None and energy.max_albedo is not None:
        largest += f"; {energy.grazing.in_words(energy.max_albedo, '°')}"
    name = material.name
    parts = [
        WIDE,
        f"# {plain(material.title)}\n",
        raw(f'<p class="under"><code>{name}</code> {largest}.</p>'),
        raw(_answers(judged)),
        material_files.pictures(name, material.title),
        f"Model: {{py:obj}}`{spec.title} <brdfdb.models.{spec.name}>`, {plain(spec.equation)}, of "
        f"{cited(spec.reference)}.",
        f"Source: {plain(material.source)}.\n",
        "## Parameters\n",
        _parameters(material),
        f"{plain(material.note)}\n" if material.note else "",
        *itertools.starmap(_assumption, material.assumed.items()),
        f"**Known excess**: {plain(material.known_excess.citation)}\n" if material.known_excess else "",
        ":::{dropdown} As a recipe writes it",
        code(material_files.definition(name), "toml"),
        ":::\n",
        "## Table\n",
        _table(stored),
        "## Audit\n",
        "\n".join(f"* {_sentence(sentence)}" for sentence in judged.sentences),
        raw(audit.drawn(plots)),
        "## Files\n",
        material_files.links(name),
        code(
            f'import brdfdb\n\ntable = brdfdb.open()["{name}"]  # in the folder of the store\n'
            f"table.lookup(0.5, 0.0, 0.5, 3.14159)  # f_r [1/sr] at 28.6 degrees, in the mirror direction",
            "python",
        ),
    ]
    return "\n".join(parts)


def _answers(judged: MaterialAudit) -> str:
    """Return the two questions of the audit with their answers, as HTML."""
    both = {AS_PUBLISHED: judged.as_published, CONSERVES_ENERGY: judged.conserves_energy}
    return "\n".join(
        f'<p class="under">{question[0].upper()}{question[1:]} {chip(answer.word, answer.text)}</p>'
        for question, answer in both.items()
    )


def _sentence(sentence: Sentence) -> str:
    said = sentence.model_dump()
    quote = f" “{plain(said['quote'])}” ({plain(said['where'])})" if said["quote"] else ""
    return f"**{plain(said['title'])}: {said['word']}.** {plain(said['text'])}.{quote}"


def _parameters(material: Material) -> str:
    """Return the table of parameters: value, unit, and where each is printed."""
    rows = []
    for parameter in material.spec.parameters:
        value = material.parameters[parameter.name]
        shown = str(value).lower() if isinstance(value, bool) else f"{value:.6g}"
        if parameter.unit == "rad":
            shown += f" ({float(degrees(value)):.6g}°)"
        rows.append((f"`{parameter.name}`", shown, parameter.unit or "1", _origin(material, parameter.name)))
    if material.refractive_index:
        entry = f"`{material.refractive_index}` of refractiveindex.info"
        rows.append(("`n`, `k`", entry, "1", _origin(material, "refractive_index")))
    if material.wavelengths_nm:
        at = ", ".join(f"{wavelength:g}" for wavelength in material.wavelengths_nm)
        rows.append(("wavelengths", at, "nm", _origin(material, "wavelengths_nm")))
    return table(("parameter", "value", "unit", "source"), rows)


def _origin(material: Material, name: str) -> str:
    if name in material.assumed:
        return "**assumed**, see below"
    return plain(material.sources.get(name, material.source))


def _assumption(name: str, assumed: Assumption) -> str:
    """Return why a value was chosen, with the largest albedo of it and of its alternatives."""
    lines = [f"**Assumed: `{name}`.** {plain(assumed.why)}"]
    if assumed.max_albedo is not None:
        lines.append(f"The largest albedo is {assumed.max_albedo:.3f}.")
    for other in assumed.alternatives:
        values = ", ".join(f"`{written} = {value}`" for written, value in other.parameters.items())
        excess = ", above 1" if other.max_albedo > 1.0 else ""
        lines.append(f"With {values} it would be {other.max_albedo:.3f}{excess}.")
    return " ".join(lines) + "\n"


def _formula(stored: Table) -> str:
    """Return the error of the formula of a table against the highest rung of its surface."""
    error = stored.metadata.formula_error
    if error is None:
        return "not measured"
    if error.against != "measured":
        return plain(error.in_words())
    return f"**{terminal.error(error.p99)} of f_r** at 99 % of the directions, {plain(error.in_words())}"


def _table(stored: Table) -> str:
    """Return the axes of a table and its stated error."""
    rows = [
        (f"`{axis}`", f"{nodes.size} nodes, {nodes[0]:g} to {nodes[-1]:g} degrees")
        for axis, nodes in stored.axes_deg.items()
    ]
    at = stored.wavelength_nm
    if at is None:
        rows.append(("wavelength", "none: the table is grey"))
    else:
        span = f"{at.size} nodes, {at[0]:g} to {at[-1]:g} nm" if at.size > 1 else f"{at[0]:g} nm only"
        rows.append(("wavelength", span))
    if stored.spectra is not None:
        rows.append(("coefficients", f"{stored.spectra.shape[0]} for each spectrum"))
    metadata = stored.metadata
    rows.append(("values", f"{stored.values.size}, with {metadata.bits} of 23 bits of the mantissa"))
    rows.append((r"f\_r", f"`{metadata.reconstruction}`"))
    formula = f"{metadata.model_title}, {metadata.model_equation}"
    rows.append(("formula", plain(formula)))
    error = stored.error
    assert error is not None
    overall = error.overall
    stated = f"{terminal.error(overall.p99)} of f_r at 99 % of {error.directions} directions"
    rows.append(("error of the table", f"**{stated}** (median {overall.median:.2g}, largest {overall.max:.2g})"))
    largest = "" if error.worst is None else f" The largest: {plain(error.worst.why)}."
    rows.append(("error of the formula", _formula(stored)))
    parts = [table(("axis or quantity", "stored"), rows), f"{largest}\n"]
    bands = [f"{low:g} to {high:g}" for low, high in itertools.pairwise(error.theta_i_deg)]
    worst = [f"{max(row):.2g}" for row in error.p99]
    parts.append("Stated error by band of theta\\_i, in degrees, at the worst wavelength:\n")
    parts.append(table(bands, [worst]))
    if metadata.reason:
        parts.append(f"Why the planner chose this grid: {plain(metadata.reason)}.\n")
    return "\n".join(parts)
