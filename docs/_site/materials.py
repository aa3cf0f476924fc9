"""The pages of the materials: parameters with sources, the table and its error, the verdict, and files."""

from __future__ import annotations

import itertools
import re
import tomllib
import zipfile
from collections.abc import Iterable
from functools import cache
from importlib import resources
from pathlib import Path

from matplotlib import pyplot, rc_context
from matplotlib.image import imsave

import brdfdb
from _site import audit
from _site.markup import WIDE, Card, cards, chip, code, plain, raw, remove_others, table, toctree, write_page
from _site.papers import PAPERS, Paper, cited
from brdfdb.audit import MaterialAudit
from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import Sentence
from brdfdb.audit.report import AS_PUBLISHED, CONSERVES_ENERGY
from brdfdb.figure import number
from brdfdb.formats import EXPORTERS
from brdfdb.geometry import degrees
from brdfdb.materials import Material
from brdfdb.materials.provenance import Assumption
from brdfdb.microgeometry.model_errors import NO_MAP, surface_error_of
from brdfdb.scenes.lit_sphere import lit_sphere
from brdfdb.store.reader import Store
from brdfdb.tables.table import Table
from brdfdb_pipelines import terminal

_SIZE = 192  # pixels across a picture
_KIND = "half_difference"  # of slices: the smallest of the three kinds


def write(docs: Path, root: Path) -> None:
    """Write ``gallery/materials``: a page a material, with its files, and an index by paper."""
    folder = docs / "gallery" / "materials"
    store = brdfdb.open(root)
    assert isinstance(store, Store)
    found = audit.read(root)
    materials = brdfdb.presets()
    _write_files(folder / "files", store, materials.values())
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
    size = f'width="{_SIZE}" height="{_SIZE}"'
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
        _pictures(name, material.title),
        f"Model: {{py:obj}}`{spec.title} <brdfdb.models.{spec.name}>`, {plain(spec.equation)}, of "
        f"{cited(spec.reference)}.",
        f"Source: {plain(material.source)}.\n",
        "## Parameters\n",
        _parameters(material),
        f"{plain(material.note)}\n" if material.note else "",
        *itertools.starmap(_assumption, material.assumed.items()),
        f"**Known excess**: {plain(material.known_excess.citation)}\n" if material.known_excess else "",
        ":::{dropdown} As a recipe writes it",
        code(_definition(name), "toml"),
        ":::\n",
        "## Table\n",
        _table(stored),
        "## Audit\n",
        "\n".join(f"* {_sentence(sentence)}" for sentence in judged.sentences),
        raw(audit.drawn(plots)),
        "## Files\n",
        _links(name),
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
    surface = surface_error_of(metadata.model, metadata.parameters)
    rows.append(("against a surface", NO_MAP if surface is None else plain(surface.sentence)))
    parts = [table(("axis or quantity", "stored"), rows), f"{largest}\n"]
    bands = [f"{low:g} to {high:g}" for low, high in itertools.pairwise(error.theta_i_deg)]
    worst = [f"{max(row):.2g}" for row in error.p99]
    parts.append("Stated error by band of theta\\_i, in degrees, at the worst wavelength:\n")
    parts.append(table(bands, [worst]))
    if metadata.reason:
        parts.append(f"Why the planner chose this grid: {plain(metadata.reason)}.\n")
    return "\n".join(parts)


def _write_files(folder: Path, store: Store, materials: Iterable[Material]) -> None:
    """Write the files of all materials; a file that is newer than its table stays."""
    folder.mkdir(parents=True, exist_ok=True)
    for material in materials:
        name = material.name
        group = store.path(name)
        write_page(folder / f"{name}.toml", _recipe(name))
        built = (group / "zarr.json").stat().st_mtime
        archive, image, ball, plot = (folder / f"{name}{suffix}" for suffix in (".zarr.zip", ".exr", ".png", ".svg"))
        if not _newer(archive, built):
            _zip(group, archive)
        if not _newer(image, built):
            EXPORTERS["exr"].write(store[name], image, kind=_KIND)
        if not _newer(ball, built):
            imsave(ball, lit_sphere(store[name], _SIZE), metadata={"Software": ""})
        if not _newer(plot, built):
            with rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
                canvas = store[name].plot.lobe().get_figure()
                canvas.savefig(plot, metadata={"Date": None})
                pyplot.close(canvas)


def _newer(path: Path, built: float) -> bool:
    return path.exists() and path.stat().st_mtime > built


def _links(name: str) -> str:
    """Return the list of files on the page of a material."""
    return "\n".join(
        [
            f"* {{download}}`The table <files/{name}.zarr.zip>` as one zip of a zarr group: "
            '`xarray.open_zarr(zarr.storage.ZipStore(path, mode="r"))`',
            f"* {{download}}`A slice <files/{name}.exr>` over half and difference angles as OpenEXR, a channel a "
            f"wavelength; `brdfdb export exr {name}` writes all slices",
            f"* {{download}}`The plot of the lobe <files/{name}.svg>`; `brdfdb plot {name}` draws others",
            f"* {{download}}`A recipe <files/{name}.toml>` that builds this material alone: "
            f"`brdfdb build {name}.toml --store my-store`",
            "",
        ]
    )


def _pictures(name: str, title: str) -> str:
    """Return the sphere and the lobe of a material for its page."""
    sphere = f"{title}: a sphere under the same light as those of all pages"
    lobe = f"f_r of {title} in the plane of incidence, as a polar plot"
    return "\n".join([_image(f"{name}.png", sphere, "dark-light"), _image(f"{name}.svg", lobe, "lobe")])


def _image(file: str, text: str, kind: str) -> str:
    return f":::{{image}} files/{file}\n:alt: {text}\n:class: {kind}\n:::\n"


def _recipe(name: str) -> str:
    """Return a recipe that builds one material as the default recipe does."""
    default = resources.files("brdfdb_pipelines").joinpath("recipes/default.toml").read_text(encoding="utf-8")
    fields = tomllib.loads(default)
    wavelengths = re.findall(r"^wavelengths_nm = .*$", default, flags=re.MULTILINE)
    lines = [f'title = "{name}, as the default recipe builds it"', f'materials = ["{name}"]', *wavelengths]
    return "\n".join([*lines, f"tolerance = {fields['tolerance']}", f'forms = "{fields["forms"]}"', ""])


@cache
def _definitions() -> dict[str, str]:
    """Return the text of every material in the files of the presets."""
    texts: dict[str, str] = {}
    for file in resources.files("brdfdb.materials").iterdir():
        if file.name.endswith(".toml"):
            for block in re.split(r"\n(?=\[[a-z0-9-]+\]\n)", file.read_text(encoding="utf-8"))[1:]:
                name = block[1 : block.index("]")]
                texts[name] = re.split(r"\n\n(?=#)", block)[0]
    return texts


def _definition(name: str) -> str:
    """Return the definition of a material for a recipe, under a name of its own."""
    return re.sub(rf"^\[{name}", f"[define.my-{name}", _definitions()[name], flags=re.MULTILINE)


def _zip(group: Path, archive: Path) -> None:
    """Write the files of a table as one zip without compression: its chunks are compressed already."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as whole:
        for path in sorted(path for path in group.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(group).as_posix(), (1980, 1, 1, 0, 0, 0))
            whole.writestr(entry, path.read_bytes())
