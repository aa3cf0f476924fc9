"""Columns of texts: what the names of other programs mean, and the layout of a text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r", "delta_phi")
_LIGHT = (
    "i",
    "in",
    "inc",
    "incident",
    "incoming",
    "source",
    "src",
    "light",
    "solar",
    "sun",
    "ill",
    "illumination",
    "s",
)
_VIEWER = (
    *("r", "o", "out", "outgoing", "refl", "reflected", "scat", "scatter", "scattered"),
    *("v", "view", "viewing", "viewer", "det", "detector", "rec", "receiver", "obs", "observer"),
)
_POLAR, _AZIMUTH = ("theta", "zenith", "z", "za", "polar", "th"), ("phi", "azimuth", "a", "az", "aa", "azi", "ph")
_RELATIVE = ("delta_phi", "dphi", "deltaphi", "phi_d", "phid", "raa", "relaz", "relative_azimuth", "rel_azimuth")
_OTHERS = {"aoi": "theta_i", "angle_of_incidence": "theta_i", "incidence_angle": "theta_i", "incidence": "theta_i"}
_QUANTITIES = {
    "f_r": ("brdf", "f_r", "fr", "bsdf", "value", "values"),
    "reflectance_factor": ("brf", "rf", "hcrf", "bcrf", "reflectance_factor", "r_factor"),
    "f_r_cos": ("dsf", "ccbrdf", "brdf_cos", "f_r_cos", "fr_cos", "brdfcos"),
}
QUANTITIES = tuple(_QUANTITIES)
_UNCERTAINTY = (
    "uncertainty",
    "u",
    "unc",
    "ubrdf",
    "u_brdf",
    "brdf_unc",
    "std",
    "stdev",
    "brdf_std",
    "standard_deviation",
)
_WAVELENGTH = ("wavelength", "wavelength_nm", "lambda", "wl", "wvl", "wave")
_COLOURS = (("R", "G", "B"), ("r", "g", "b"), ("X", "Y", "Z"))  # x, y, z are positions
_OF_FACTORS = re.compile(r"\b(?:BRF|HCRF|reflectance factors?)\b", re.IGNORECASE)
_NUMBER_NM = re.compile(r"(?P<word>[a-z_]*?)[_@]?(?P<number>\d+(?:\.\d+)?)_?(?P<unit>nm|um|µm|μm)?$")
_PERCENT = re.compile(r"%|(?:^|[\W_])(?:percent|pct)(?:$|[\W_])", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[(](.*?)[\])]")
_KNOWN_UNITS = (
    "",
    "-",
    "1",
    "1/sr",
    "/sr",
    "sr-1",
    "sr^-1",
    "sr**-1",
    "sr⁻¹",
    "sr^{-1}",
    "per sr",
    "nm",
    "um",
    "µm",
    "μm",
)
_COMMENT = re.compile(r"^\s*(?:#|%|//|!)+\s?")


@dataclass(frozen=True)
class Layout:
    """The layout of a text.

    Attributes
    ----------
    delimiter : str or None
        The character between fields; None: any white space.
    line : int
        Line of the names of the columns; 0 if it has none.
    names : tuple of str
        Names of the columns.
    titles : tuple of str
        Lines before the numbers that are not the names.
    """

    delimiter: str | None
    line: int
    names: tuple[str, ...]
    titles: tuple[str, ...]

    @property
    def names_factors(self) -> bool:
        """True if a line before the numbers speaks of reflectance factors."""
        return any(_OF_FACTORS.search(line) for line in self.titles)


def fields_of(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line."""
    return [field.strip().strip('"') for field in line.strip("\r\n").split(delimiter)]


def number_of(text: str, delimiter: str | None) -> float | None:
    """Return the number in a field, nan of an empty one; None if it is neither."""
    if not text or text.lower() in ("na", "n/a", "null", "none", "-", "--"):
        return float("nan")
    try:
        return float(text.replace(",", ".") if delimiter == ";" else text)
    except ValueError:
        return None


def layout_of(lines: Iterable[tuple[int, str]]) -> tuple[Layout, int] | None:
    """Return the layout of a text, and the number of the line with the first row; None if there is no row.

    Parameters
    ----------
    lines : iterable of (int, str)
        The first lines of the text, with their numbers.

    Notes
    -----
    The first line of numbers alone, four at least, is the first row. The last line before it with as many fields has
    the names, also behind a sign of a comment.
    """
    before: list[tuple[int, str]] = []
    for number, line in lines:
        delimiter = next((sign for sign in "\t;," if sign in line), None)
        fields = fields_of(line, delimiter)
        numbers = [number_of(field, delimiter) for field in fields]
        if len(fields) < 4 or None in numbers or all(value != value for value in numbers):
            before.append((number, _COMMENT.sub("", line.rstrip("\r\n"))))
            continue
        count = len(fields)
        for known in (True, False):  # without a known name, the line before the first row may have names
            for at, text in list(reversed(before))[: None if known else 1]:
                names = _names(text, delimiter, count)
                if names and (not known or any(role_of(name) for name in names)):
                    titles = tuple(line for other, line in before if other != at and line.strip())
                    return Layout(delimiter, at, names, titles), number
        titles = tuple(line for _, line in before if line.strip())
        return Layout(delimiter, 0, tuple(str(1 + column) for column in range(len(fields))), titles), number
    return None


def _names(text: str, delimiter: str | None, count: int) -> tuple[str, ...]:
    """Return the names in a line if it has as many as there are columns, with the delimiter of rows or another one."""
    for sign in dict.fromkeys((delimiter, None, ",", "\t")):
        names = fields_of(text, sign)
        if len(names) == count and all(names):
            return tuple(names)
    return ()


def role_of(name: str) -> str:
    """Return what a column is by its name: one of `ANGLES`, "values", "uncertainty", "wavelength"; "" if unknown."""
    plain = plain_name(name)
    if plain in _RELATIVE:
        return "delta_phi"
    if plain in _OTHERS:
        return _OTHERS[plain]
    if plain in _UNCERTAINTY:
        return "uncertainty"
    if plain in _WAVELENGTH:
        return "wavelength"
    if wavelength_of(name) is not None or any(plain in names for names in _QUANTITIES.values()):
        return "values"
    for side, words in (("i", _LIGHT), ("r", _VIEWER)):
        for kind, angles in (("theta", _POLAR), ("phi", _AZIMUTH)):
            if any(plain in (f"{a}_{w}", f"{a}{w}", f"{w}_{a}", f"{w}{a}") for a in angles for w in words):
                return f"{kind}_{side}"
    return ""


def roles_of(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns of each role, by the names of all columns."""
    roles: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        roles.setdefault(role_of(name), []).append(number)
    plain = [plain_name(name) for name in names]
    if {"theta_i", "theta_s"} <= set(plain):  # theta_s is of the scattered light then, else of the sun
        for angle in ("theta", "phi"):
            if f"{angle}_s" in plain:
                at = plain.index(f"{angle}_s")
                roles[f"{angle}_i"] = [column for column in roles.get(f"{angle}_i", []) if column != at]
                roles[f"{angle}_r"] = [at]
    bare = [_BRACKETS.sub("", name).strip() for name in names]
    for colour in _COLOURS:
        if "values" not in roles and set(colour) <= set(bare):
            roles["values"] = [bare.index(channel) for channel in colour]
    return {role: columns for role, columns in roles.items() if role and columns}


def plain_name(name: str) -> str:
    """Return a name in lower case, without units in brackets and with _ for all other signs."""
    text = name.strip().lower().replace("θ", "theta").replace("φ", "phi").replace("ϕ", "phi").replace("δ", "delta_")
    text = re.sub(r"[\[(].*?[\])]", "", text)
    text = re.sub(r"[^a-z0-9.µμ]+", "_", text).strip("_")
    return re.sub(r"_(?:deg|degrees?|rad|radians?|percent|pct)$", "", text)


def angle_unit(name: str) -> str:
    """Return the unit of angles that a name gives: "deg", "rad", or "" if it gives none."""
    if re.search(r"[\W_]rad", name.lower()):
        return "rad"
    return "deg" if "deg" in name.lower() or "°" in name else ""


def in_percent(name: str) -> bool:
    """Return True if a name says that its numbers are percent."""
    return _PERCENT.search(name) is not None


def unknown_unit(name: str) -> str:
    """Return the unit in brackets of a name of values if it is none that is known, else an empty text."""
    units = [unit.strip() for unit in _BRACKETS.findall(name)]
    return next((unit for unit in units if unit.lower() not in _KNOWN_UNITS and not in_percent(unit)), "")


def wavelength_of(name: str) -> float | None:
    """Return the wavelength [nm] that a name gives, such as 550nm or BRF_1.6um; None if it gives none."""
    match = _NUMBER_NM.fullmatch(plain_name(name))
    if match is None:
        return None
    word, number, unit = match["word"], float(match["number"]), match["unit"]
    if word and not any(word.rstrip("_") in (*names, "r", "reflectance") for names in _QUANTITIES.values()):
        return None
    if unit is None:
        return number if number >= 100.0 else None
    return number if unit == "nm" else 1e3 * number


def quantity_of(names: Iterable[str]) -> str:
    """Return the quantity that names of columns of values give: one of `QUANTITIES`, or "" if they give none."""
    for name in names:
        plain = plain_name(name)
        match = _NUMBER_NM.fullmatch(plain)
        word = match["word"].rstrip("_") if match else plain
        for quantity, words in _QUANTITIES.items():
            if word in words:
                return quantity
    return ""
