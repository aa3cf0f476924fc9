"""The command `brdfdb show`."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from brdfdb.store import open_tables
from brdfdb_pipelines.commands._arguments import add_snapshot, add_tables

if TYPE_CHECKING:
    from brdfdb.materials import Material
    from brdfdb.store.family import Family
    from brdfdb.store.summary_words import Audited
    from brdfdb.tables.grids import Axis
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.stated_error import Error, FormulaError, Overall, WorstPair
    from brdfdb.tables.table import Table

HELP = "Show parameters, sources, grid, errors, albedo and files of a material or a family."

_VALUE_WIDTH = 9  # width of the numbers of parameters; longer values are spectra in words
_LABEL = 22  # width of the labels of errors
ALBEDO_ANGLES_DEG = (0.0, 30.0, 60.0, 80.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material and the store."""
    parser.add_argument("name", metavar="NAME")
    add_tables(parser)
    add_snapshot(parser)


def run(options: argparse.Namespace) -> int:
    """Print what the store, or a snapshot of it, states about a material or a family."""
    from brdfdb.store.summary_words import last_audit

    root: Path | str = options.store
    store = open_tables(root, snapshot=options.snapshot)
    if options.name not in store and options.name in store.families():
        _print_family(store.family(options.name))
    else:
        table = store[options.name]
        audited = last_audit(root).get((table.name, table.revision))
        _print_material(table, store.place_of(options.name), store.summary(options.name)["bytes"], audited)
    return 0


def _print_material(table: Table, place: str, stored: int, audited: Audited | None) -> None:
    from brdfdb.microgeometry.model_errors import NO_MAP, surface_error_of
    from brdfdb_pipelines import terminal

    metadata = table.metadata
    print(terminal.plain("\n".join([f"{table.name}: {metadata.title or 'no title'}", *_origin(metadata)])))
    if metadata.gaps:
        print(terminal.plain(f"  incomplete  the table {metadata.gaps}"))
    _print_grid(table)
    truth = "its formula" if metadata.model is not None else "its source" if metadata.measured is None else "the data"
    if metadata.polarisation is not None:
        print(f"  polarised   {metadata.polarisation.in_words}")
    _print_error(table.error, truth, measured=metadata.measured is not None)
    if metadata.measured is None:
        _print_formula_error(metadata.formula_error)
        surface = surface_error_of(metadata.model, metadata.parameters)
        print(f"  surface     {NO_MAP if surface is None else surface.sentence}")
    _print_answers(audited, metadata)
    source = _source_of(table)
    _print_validity(source, table.wavelength_nm)
    _print_albedo(table, source)
    print(f"  files       {place} (zarr v3, {terminal.size(stored)})")


def _print_family(family: Family) -> None:
    from brdfdb_pipelines import terminal

    record = family.record
    print(terminal.plain(f"{record.name}: {record.title}"))
    print(f"  model       {record.model}")
    print(f"  tables      {len(record.members)}, {record.members[0]} to {record.members[-1]}")
    print("  parameters")
    for written, values in record.axes.items():
        print(f"    {written:<16}{len(values)} values, {values[0]:g} to {values[-1]:g}")
    how = record.interpolation
    what = "f_r" if how.offset is None else f"logarithms of f_r + {how.offset:.3g}/sr"
    along = ", ".join({0: f"ln {x}", 1: x}.get(power, f"{x}^{power}") for x, power in how.powers.items())
    print(f"  between     {how.method} in {what} along {along}")
    print(f"  measured    {how.reason}")
    _print_error(family.error, "the model")
    at = ", ".join(f"{x} {value:g}" for x, value in record.worst.parameters.items())
    print(f"  worst       {terminal.error(record.worst.p99)} at {at}, among {record.points} sets of parameters")
    if record.specular_error is not None:
        print(f"  specular    within {record.specular_error:.3g} of the model's reflectance")


def _origin(metadata: TableMetadata) -> list[str]:
    """Return lines on the model, its parameters and where they come from, as far as a table states them."""
    lines = []
    if metadata.model is not None:
        named = ", ".join(part for part in (metadata.model_title or metadata.model, metadata.model_equation) if part)
        reference = f" [{metadata.model_reference}]" if metadata.model_reference else ""
        lines.append(f"  model       {named}{reference}")
    if metadata.parameters:
        lines.append("  parameters")
    for parameter, value in metadata.parameters.items():
        note = metadata.parameter_sources.get(parameter, "")
        if parameter in metadata.assumed:
            note = f"assumed; see {'the note' if metadata.assumed[parameter] is None else 'below'}"
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        note = f"; {note}" if note and len(text) >= _VALUE_WIDTH else note
        lines.append(f"    {parameter:<16}{text:<{_VALUE_WIDTH}}{note}".rstrip())
    if metadata.source is not None:
        lines.append(f"  source      {metadata.source}")
    if metadata.uncited:
        lines.append("  source      not recorded; an audit cannot judge the table")
    if metadata.measured is not None:
        lines += [f"  {'measured' if not n else '':<12}{line}" for n, line in enumerate(metadata.measured.in_words())]
    if metadata.refractive_index:
        lines.append(f"  n, k        {metadata.refractive_index} of refractiveindex.info")
    if metadata.note:
        lines.append(f"  note        {metadata.note}")
    for parameter, assumption in metadata.assumed.items():
        if assumption is None:
            continue
        lines.append(f"  assumed     {parameter}: {assumption.why}")
        if assumption.max_albedo is not None:
            lines.append(f"    {'largest albedo':<16}{assumption.max_albedo:.3f} as tabulated")
        for other in assumption.alternatives:
            values = ", ".join(f"{name} = {value}" for name, value in other.parameters.items())
            excess = ", above 1" if other.max_albedo > 1.0 else ""
            lines.append(f"    {'':<16}{other.max_albedo:.3f} with {values}{excess}")
    if metadata.known_excess is not None:
        lines.append(f"  excess      {metadata.known_excess.citation}")
    return lines


def _print_grid(table: Table) -> None:
    """Print the axes, the number and precision of the stored values, and how f_r is reconstructed from them."""
    from brdfdb_pipelines import terminal

    metadata = table.metadata
    wavelength = table.wavelength_nm
    print("  grid")
    for axis, nodes in table.axes_deg.items():
        print(f"    {axis:<16}{nodes.size} nodes, {nodes[0]:g} to {nodes[-1]:g} degrees")
    if wavelength is None:
        print(f"    {'wavelength':<16}none, the table is grey")
    elif wavelength.size == 1:
        print(f"    {'wavelength':<16}{wavelength[0]:g} nm only")
    else:
        print(f"    {'wavelength':<16}{wavelength.size} nodes, {wavelength[0]:g} to {wavelength[-1]:g} nm")
    if table.spectra is not None:
        print(f"    {'parts':<16}{table.spectra.shape[0]}; each spectrum is a weighted sum of them")
    bits = metadata.bits
    stored = f"stored with {'all 23' if bits == 23 else f'{bits} of 23'} bits of the mantissa"
    print(f"    {'values':<16}{table.values.size}, {stored}")
    how = table.interpolation
    what = "f_r" if how.power == 0.0 else f"f_r (cos theta_i cos theta_r)^{how.power:g}"
    if table.uniform is not None:
        what = what.replace("f_r", "(f_r - uniform)", 1)
    if how.logarithm:
        what = f"the logarithm of {what} + {how.offset:.3g}"
    print(f"    {'interpolation':<16}{how.method}, of {what}")
    if metadata.reason:
        print(terminal.plain(f"    {'reason':<16}{metadata.reason}"))
    if metadata.reconstruction:
        print(terminal.plain(f"  f_r         {metadata.reconstruction}"))


def _print_error(error: Error | None, truth: str, *, measured: bool = False) -> None:
    """Print the stated error: overall, and by bands and places at the wavelength where it is largest."""
    from brdfdb.tables.places import RINGS_DEG
    from brdfdb_pipelines import terminal

    if error is None:
        print("  error       not measured")
        return
    overall = error.overall
    print(f"  error       {terminal.error(overall.p99)} of f_r relative to {truth}, {_spread(overall, error)}")
    _print_worst(error.worst)
    edges = error.theta_i_deg
    rows = [("99 % of f_r", error.p99), ("reflected light", error.l1)]
    notes = ["99 % of f_r: 99 % of the values differ by at most this; reflected light: l1; x 35: a factor of 35"]
    if error.places is not None:
        rows.append(("near the light", error.places.alongside))
        notes.append("near the light: theta_r within 10° of theta_i, delta_phi within 90°; 98 % of the values")
    if error.between is not None:
        between = error.between.bands  # a mixture has the same error in all bands
        rows.append(("between wavelengths", between if len(between) > 1 else between * (len(edges) - 1)))
        notes.append("between wavelengths: at any wavelength between those of the table; 98 % of the values")
    print(_headings("theta_i", edges))
    for label, bands in rows:
        print(_errors(label, bands, measured=measured))
    if error.places is not None:
        print(_headings("theta next to 90°", RINGS_DEG))
        print(_errors("one direction grazing", error.places.one_grazing, measured=measured))
        print(_errors("both grazing", error.places.both_grazing, measured=measured))
        notes.append(
            "grazing: theta_i or theta_r is in the range; if both are grazing, the larger one; 98 % of the values"
        )
    for note in notes:
        print(f"    {note}")


def _headings(label: str, edges: Sequence[float]) -> str:
    return f"    {label:<{_LABEL}}" + "".join(f"{f'{a:g}-{b:g}°':>9}" for a, b in itertools.pairwise(edges))


def _errors(label: str, bands: list[list[float]], *, measured: bool) -> str:
    """Return a row of errors at their worst wavelengths, in percent or as factors.

    A measured table has an error of 0 where nothing was measured: a dash stands for it.
    """
    from brdfdb_pipelines import terminal

    worst = [max(row) for row in bands]
    words = ["-" if measured and largest == 0.0 else terminal.error(largest) for largest in worst]
    cells = [text.replace("a factor of ", "x ").replace(" %", "%") for text in words]
    return f"    {label:<{_LABEL}}" + "".join(f"{cell:>9}" for cell in cells)


def _spread(overall: Overall, error: Error | FormulaError) -> str:
    """Return what the percentile is of, and other statistics of the same errors."""
    from brdfdb_pipelines import terminal

    return (
        f"at 99 % of {error.directions} directions (median {terminal.error(overall.median)}, largest "
        f"{terminal.error(overall.max)}; {terminal.error(overall.l1)} of the reflected light (l1))"
    )


def _print_worst(worst: WorstPair | None) -> None:
    """Print where the largest error was met, and why it is large there."""
    if worst is None:
        return
    at = f"theta_i {worst.theta_i_deg:g}°, theta_r {worst.theta_r_deg:g}°, delta_phi {worst.delta_phi_deg:g}°"
    at += "" if worst.wavelength_nm is None else f", {worst.wavelength_nm:g} nm"
    print(f"    largest     at {at}: {worst.why}")


def _print_formula_error(error: FormulaError | None) -> None:
    """Print the error of the formula of a table against the highest rung of its surface."""
    from brdfdb_pipelines import terminal

    if error is None:
        print("  formula     error not measured; `brdfdb build` measures it")
    elif error.against != "measured" or error.overall is None:
        print(f"  formula     {error.in_words()}")
    else:
        print(f"  formula     {terminal.error(error.p99)} of f_r {error.in_words()}, {_spread(error.overall, error)}")
        _print_worst(error.worst)


def _print_answers(audited: Audited | None, metadata: TableMetadata) -> None:
    """Print the answers of the last audit of this revision to its two questions."""
    from brdfdb.materials import presets
    from brdfdb.store.summary_words import NOT_AUDITED

    of_paper = metadata.material in presets() and metadata.source_record
    says = "the paper says" if of_paper else "its model says"
    whose = "does the published model"
    if metadata.measured is not None:
        says = "the data say"
        whose = "do the data"
    both = (NOT_AUDITED, NOT_AUDITED) if audited is None else audited
    print(f"  audit       is it what {says}? {both[0]}")
    print(f"              {whose} conserve energy? {both[1]}")


def _source_of(table: Table) -> Material | None:
    """Return the material of a table, with the n and k of the table: their entry takes half a second to load."""
    from brdfdb.materials import Material

    if not isinstance(table.source, Material):
        return None
    return table.source if table.n is None or table.k is None else table.source.changed({"n": table.n, "k": table.k})


def _print_validity(material: Material | None, wavelength_nm: Axis | None) -> None:
    """Print whether a material is within the limits that its paper states, and each limit that it does not meet."""
    from brdfdb.materials.stated_limits import in_words, limits_of
    from brdfdb_pipelines import terminal

    if material is None:
        return
    limits = limits_of(material, wavelength_nm)
    print(f"  validity    {in_words([limit.standing for limit in limits])}")
    for limit in limits:
        if limit.standing in ("at the edge", "outside"):
            standing = "at the edge" if limit.standing == "at the edge" else "not met"
            print(terminal.plain(f"    {standing:<16}{limit.quantity}: {limit.value} ({limit.valid}); {limit.where}"))


def _print_albedo(table: Table, material: Material | None) -> None:
    """Print the directional albedo [1] of the table at a few angles, at the first, middle and last wavelength."""
    import numpy as np

    from brdfdb.geometry import radians
    from brdfdb.tables.albedo import directional_albedo

    albedo = directional_albedo(table, np.array(ALBEDO_ANGLES_DEG), source=material)
    diffuse = albedo.mean
    wavelength = table.wavelength_nm
    guessed = np.zeros(diffuse.shape) if albedo.guessed is None else albedo.mean_of(albedo.guessed)
    width = 16 if guessed.any() else 9
    columns = sorted({0, diffuse.shape[1] // 2, diffuse.shape[1] - 1})
    print(
        "  albedo, as tabulated "
        + "".join(f"{f'{angle:g}°':>{width}}" for angle in ALBEDO_ANGLES_DEG)
        + f"  (theta_i; with the specular part{'' if table.glints is None else ' and the glints'})"
    )
    largest = table.metadata.largest_albedo
    if largest is not None:
        known = table.metadata.known_excess if largest.above_1 else None
        cited = "" if known is None else f": {known.citation}"
        label, whose = "above 1" if largest.above_1 else "largest", "model" if largest.of == "source" else "table"
        print(f"    {label:<12}the {whose} reflects {largest.in_words()}{cited}")
    for w in columns:
        at = None if wavelength is None else float(wavelength[w])
        specular = table.specular_reflectance(radians(ALBEDO_ANGLES_DEG), at)
        cells = [
            f"{'at most ' if most else ''}{value:.4f}"
            for value, most in zip(diffuse[:, w] + specular, guessed[:, w] > 0.0, strict=True)
        ]
        print(f"    {'grey' if at is None else f'{at:g} nm':<10}" + "".join(f"{cell:>{width}}" for cell in cells))
    if guessed.any():
        print("    at most: the power of a glint that one sample shows, or between measured lights, is an upper bound")
