"""The contact sheet of a store: a lit sphere of each material, with its name, by paper."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import brdfdb
from brdfdb.errors import WriteError, counted
from brdfdb.formats._written import whole
from brdfdb.materials import presets
from brdfdb.scenes.image import write_channels
from brdfdb.scenes.lit_sphere import WHITE, linear_sphere, lit_sphere
from brdfdb.spectra import VISIBLE_FROM_NM, VISIBLE_TO_NM, colour_science, picture_wavelengths
from brdfdb.store.files import write_file
from brdfdb.tables.table_base import BaseTable
from brdfdb_pipelines import terminal

Array = NDArray[np.float64]

# Lengths in pixels
WIDTH, _MARGIN, _CELL, SPHERE, _LABEL = 1400, 40, 132, 116, 66
_SIZE = 12.2  # of a name
_HEADER, _SECTION, _BETWEEN, _CAPTION = 104, 46, 12, 96
_DPI = 100
_PLATE, _INK, _MUTED, _LINE = "#14171c", "#eef1f4", "#9aa4b0", "#2b3139"
_SPACING = 1.3  # between lines of text, in its size
_LETTERS = 17  # of a line of a name
_SOURCE, _SOURCE_LETTERS = 32, 18  # height of the lines with a source, in pixels, and letters of a line
OTHERS = "Other sources"
_DARK = 0.01  # largest albedo [1] of a sphere that looks black


Align = Literal["left", "center", "right"]
CAPTION = (
    "Spheres with the values of the tables, all under the same light and at the same exposure: a white Lambertian "
    f"sphere has {100.0 * WHITE:g} % of the screen's white where it is\nbrightest. Brighter light is clipped. A "
    f"material whose source states no colour, or whose wavelengths do not reach from {VISIBLE_FROM_NM:g} to "
    f"{VISIBLE_TO_NM:g} nm, is grey, and says so."
)


def run(root: Path | str, names: Sequence[str], out: Path, jobs: int) -> None:
    """Write the contact sheet of materials of a store, by default of all, as PNG or EXR, and print its size.

    An EXR is in linear light, and light brighter than white is not clipped. WriteError if the file cannot be written.
    """
    store = brdfdb.open(root)
    tables = {name: store[name] for name in names or store}
    if not out.parent.is_dir():  # before the time is spent
        raise WriteError(f"cannot write {out}: there is no directory {out.parent}")
    linear = out.suffix.lower() == ".exr"
    with terminal.progress() as bar, ThreadPoolExecutor(jobs) as pool:
        task = bar.add_task("rendering", total=len(tables))

        def picture(table: BaseTable) -> Array:
            sphere = (linear_sphere if linear else lit_sphere)(table, SPHERE)
            bar.advance(task)
            return sphere

        spheres = dict(zip(tables, pool.map(picture, tables.values()), strict=True))
    image = sheet(sections(tables), spheres, linear)
    if linear:
        with whole(out) as (temporary,):
            write_channels(temporary, {}, {name: image[..., index] for index, name in enumerate("RGB")})
    else:
        encoded = io.BytesIO()
        imsave(encoded, np.round(255.0 * image).astype(np.uint8), format="png", pil_kwargs={"optimize": True})
        write_file(out, encoded.getvalue(), out.parent)
    print(f"{out}: {counted(len(tables), 'material')}, {image.shape[1]} x {image.shape[0]} pixels")
    for line in remarks(tables.values()):
        print(line)


def sections(tables: Mapping[str, BaseTable]) -> dict[str, list[BaseTable]]:
    """Return tables by their paper, which is the text of their source before the first comma, in the paper's order.

    Sources of one table each stand together under `OTHERS`, if there are several and they are not papers of presets.
    """
    order = {name: number for number, name in enumerate(presets())}
    papers: dict[str, list[BaseTable]] = {}
    for name in sorted(tables, key=lambda name: (order.get(name, len(order)), name)):
        papers.setdefault(_paper(tables[name].metadata.source), []).append(tables[name])
    known = {_paper(preset.source) for preset in presets().values()}
    single = [paper for paper, members in papers.items() if len(members) == 1 and paper not in known]
    if len(single) > 1:
        papers[OTHERS] = [table for paper in single for table in papers.pop(paper)]
    return papers


def _paper(source: str | None) -> str:
    return (source or "Other materials").partition(",")[0]


def sheet(papers: Mapping[str, Sequence[BaseTable]], spheres: Mapping[str, Array], linear: bool = False) -> Array:
    """Return the contact sheet as sRGB (height, width, 3), with or without its transfer curve, as the spheres have."""
    columns = (WIDTH - 2 * _MARGIN) // _CELL
    rows = [-(-len(tables) // columns) for tables in papers.values()]
    cells = [SPHERE + _LABEL + (_SOURCE if paper == OTHERS else 0) for paper in papers]
    heights = [count * cell for count, cell in zip(rows, cells, strict=True)]
    height = _HEADER + _CAPTION + sum(_SECTION + tall + _BETWEEN for tall in heights)
    page = _Page(height)
    count = sum(map(len, papers.values()))
    page.write(_MARGIN, 36, f"{count} materials" if count > 1 else "1 material", 30, _INK)
    page.write(WIDTH - _MARGIN, 50, "brdfdb", 20, _MUTED, align="right")
    top = _HEADER
    corners = {}
    for (paper, tables), cell, tall in zip(papers.items(), cells, heights, strict=True):
        page.write(_MARGIN, top, paper, 16, _MUTED)
        page.rule(top + 26)
        top += _SECTION
        for number, table in enumerate(tables):
            row, column = divmod(number, columns)
            left, upper = _MARGIN + column * _CELL, top + row * cell
            corners[table.name] = (upper, left + (_CELL - SPHERE) // 2)
            name = wrapped(table.name)
            page.write(left + _CELL / 2, upper + SPHERE + 7, name, _SIZE, _INK, align="center")
            below = upper + SPHERE + 7 + _SIZE * _SPACING * len(name.splitlines())
            source = [shortened(_paper(table.metadata.source))] if paper == OTHERS else []
            words = "\n".join(filter(None, [colour_known(table), *source]))
            page.write(left + _CELL / 2, below, words, _SIZE - 1.0, _MUTED, align="center")
        top += tall + _BETWEEN
    page.write(_MARGIN, top + 16, CAPTION, 13.5, _MUTED)
    image = page.drawn()
    if linear:
        image = np.asarray(colour_science().cctf_decoding(image, function="sRGB"))
    for name, (upper, left) in corners.items():
        part = image[upper : upper + SPHERE, left : left + SPHERE]
        colour = spheres[name][..., :3]
        coverage = spheres[name][..., 3:]
        part += coverage * (colour - part)
    return image


def colour_known(table: BaseTable) -> str:
    """Return words for a table without a colour: grey, with its wavelengths; empty for a table with a colour.

    A table so dark that its sphere is black has the bound of its albedo in place of "grey".
    """
    stored = table.wavelength_nm
    largest = table.metadata.largest_albedo
    if stored is not None and picture_wavelengths(stored) is not None:
        return ""
    dark = largest is not None and largest.albedo is not None and largest.albedo < _DARK
    word = f"albedo < {_DARK:g}" if dark else "grey"
    if stored is None:
        return word
    return f"{stored[0]:g} nm, {word}" if stored.size == 1 else f"{stored[0]:g}-{stored[-1]:g} nm, {word}"


def remarks(tables: Iterable[BaseTable]) -> list[str]:
    """Return a sentence for each table with several wavelengths that make no colour."""
    lines = []
    for table in tables:
        stored = table.wavelength_nm
        if stored is None or stored.size == 1 or picture_wavelengths(stored) is not None:
            continue
        lines.append(
            f"{table.name}: grey, at {stored[0]:g} nm: a colour needs wavelengths from {VISIBLE_FROM_NM:g} to "
            f"{VISIBLE_TO_NM:g} nm, and the table has {stored[0]:g} to {stored[-1]:g} nm"
        )
    return lines


def shortened(source: str) -> str:
    """Return a source in two lines at most, which fit under a sphere."""
    return textwrap.fill(source, _SOURCE_LETTERS, max_lines=2, placeholder="…")


def wrapped(name: str) -> str:
    """Return a name in lines, broken after hyphens."""
    lines = [""]
    for word in name.replace("-", "- ").split():
        if lines[-1] and len(lines[-1]) + len(word) > _LETTERS:
            lines.append("")
        lines[-1] += word
    return "\n".join(lines)


class _Page:
    """A dark page with text, in pixels from the upper left corner."""

    def __init__(self, height: int) -> None:
        self._height = height
        self._figure = Figure(figsize=(WIDTH / _DPI, height / _DPI), dpi=_DPI, facecolor=_PLATE)

    def write(self, x: float, y: float, text: str, size: float, colour: str, align: Align = "left") -> None:
        """Write lines of text of a size in pixels; y is the upper end of the first."""
        for number, line in enumerate(text.splitlines()):
            self._figure.text(
                x / WIDTH,
                1.0 - (y + size * (1.0 + _SPACING * number)) / self._height,
                line,
                ha=align,
                va="baseline",
                color=colour,
                fontsize=size * 72.0 / _DPI,
                parse_math=False,
                fontfamily="DejaVu Sans",
            )

    def rule(self, y: float) -> None:
        """Draw a line across the page."""
        ends = [_MARGIN / WIDTH, 1.0 - _MARGIN / WIDTH]
        level = 1.0 - y / self._height
        self._figure.add_artist(Line2D(ends, [level, level], color=_LINE, linewidth=1.0))

    def drawn(self) -> Array:
        """Return the page as sRGB in [0, 1], of shape (height, width, 3)."""
        pixels = io.BytesIO()
        self._figure.savefig(pixels, format="rgba", dpi=_DPI, facecolor=_PLATE)
        image = np.frombuffer(pixels.getvalue(), dtype=np.uint8).reshape(self._height, WIDTH, 4)
        return image[..., :3] / 255.0
