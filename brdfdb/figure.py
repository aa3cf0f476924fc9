"""Documents: their base, and figures as data with the statements of a paper about them; pixels as a PNG file."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field

Numbers = list[float | None]
Role = Literal["ours", "printed", "textbook", "truth", "other"]

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class DocumentPart(BaseModel):
    """A document or a part of one: immutable, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Curve(DocumentPart):
    """One line of a panel."""

    label: str
    x: list[float]
    y: Numbers = Field(description="null: a gap")
    role: Role = Field(
        default="other", description="kind of the form that is drawn; curves of the same role look the same"
    )
    dots: bool = Field(default=False, description="true: points, such as samples, that no line joins")


class Panel(DocumentPart):
    """Curves over common axes. In a polar panel x is the angle from the normal, -90 to 90 degrees, and y the radius."""

    kind: Literal["curves", "polar"] = "curves"
    title: str = ""
    x_label: str
    y_label: str
    curves: list[Curve]
    log_x: bool = False
    log_y: bool = False


class Map(DocumentPart):
    """Values over two axes, shown as colours."""

    kind: Literal["map"] = "map"
    title: str = ""
    x_label: str
    y_label: str
    value_label: str
    x: list[float]
    y: list[float]
    values: list[Numbers] = Field(description="[y][x]; null: none")
    log_x: bool = False
    log_y: bool = False
    log: bool = Field(default=False, description="true: colours show logarithms")
    low: float | None = Field(default=None, description="value of the darkest colour; null: the smallest value")
    high: float | None = Field(default=None, description="value of the brightest colour; null: the largest value")


class Picture(DocumentPart):
    """A rendered image."""

    kind: Literal["picture"] = "picture"
    title: str = ""
    radiance: list[Numbers] = Field(description="[row][column] from the top, linear, 1 is white; null: background")


class Statement(DocumentPart):
    """A sentence about a figure, and the result of the comparison with the computed figure."""

    says: str = Field(description="statement of the paper on its figure, or a known fact of the form")
    where: str = Field(description="place of the statement")
    seen: str = Field(description="result of the computation, with its numbers")
    holds: bool
    threshold_from: str | None = Field(
        default=None, description="the basis of the threshold, in the form 'BASIS: reason', or null where none is given"
    )


class Figure(DocumentPart):
    """Panels with a caption, and the statements that they are compared with."""

    key: str = Field(description="unique, of lower-case letters, digits and hyphens")
    paper: str = Field(description="key in references.bib")
    title: str
    caption: str = Field(description="content of the figure, with the parameters")
    panels: list[Panel | Map | Picture]
    statements: list[Statement]


def curve_of(label: str, x: ArrayLike, y: ArrayLike, role: Role = "other", *, dots: bool = False) -> Curve:
    """Return the curve of a panel through arrays; y has five digits, and gaps where it is not finite."""
    return Curve(label=label, x=np.asarray(x, dtype=np.float64).tolist(), y=numbers(y), role=role, dots=dots)


def numbers(values: ArrayLike, digits: int = 5) -> Numbers:
    """Return a list of numbers with that many significant digits; numbers that are not finite become None."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in flat.tolist()]


def rows(values: ArrayLike, digits: int = 5) -> list[Numbers]:
    """Return `numbers` of each row of an array (rows, columns)."""
    return [numbers(row, digits) for row in np.asarray(values)]


def listed(values: Iterable[float], form: str = ".3g") -> str:
    """Return numbers as part of a sentence: "1, 2 and 3"."""
    *most, last = (format(float(value), form) for value in values)
    return f"{', '.join(most)} and {last}" if most else last


def number(value: float | None, digits: int = 3) -> str:
    """Return a number as text: 0.0123, 1.2·10⁻⁹; a dash for None."""
    if value is None:
        return "–"
    value += 0.0  # -0 is 0
    if not math.isfinite(value):
        return "not finite"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.1e}".split("e")
        return f"{mantissa.removesuffix('.0')}·10{superscript(int(exponent))}".replace("-", "−")
    return f"{value:.{digits}g}".replace("-", "−")


def superscript(exponent: int) -> str:
    """Return an integer in raised digits."""
    return str(exponent).translate(_SUPERSCRIPT)


def png_of(pixels: NDArray[np.uint8], level: int) -> bytes:
    """Return a PNG file of pixels (rows, columns, 4): red, green, blue in sRGB, and opacity.

    Parameters
    ----------
    pixels : uint8 array (rows, columns, 4)
        The pixels, the top row first.
    level : int
        Effort of the compression, from 1 to 9. 1 is fast, 9 makes small files.
    """
    rows, columns, _ = pixels.shape
    lines = np.pad(pixels.reshape(rows, -1), ((0, 0), (1, 0)))  # each row begins with its filter: none
    header = struct.pack(">2I5B", columns, rows, 8, 6, 0, 0, 0)
    chunks = (
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), level)), (b"IEND", b""))
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)
