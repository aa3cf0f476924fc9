"""Columns of texts: what the names of other programs mean, and the layout of a text."""

from __future__ import annotations

import csv
import itertools
import math
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
_POLAR = ("theta", "zenith", "z", "za", "polar", "th")
_AZIMUTH = ("phi", "azimuth", "a", "az", "aa", "azi", "ph")
_RELATIVE = ("delta_phi", "dphi", "deltaphi", "phi_d", "phid", "raa", "relaz", "relative_azimuth", "rel_azimuth")
_OTHERS = {"aoi": "theta_i", "angle_of_incidence": "theta_i", "incidence_angle": "theta_i", "incidence": "theta_i"}
_QUANTITIES = {
    "f_r": ("brdf", "f_r", "fr", "bsdf", "value", "values"),
    "reflectance_factor": ("brf", "rf", "hcrf", "bcrf", "reflectance_factor", "r_factor"),
    "f_r_cos": ("dsf", "ccbrdf", "brdf_cos", "f_r_cos", "fr_cos", "brdfcos"),
    "f_r_cos_i": ("f_r_cos_i",),
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
_WAVELENGTH = ("wavelength", "lambda", "wl", "wvl", "wave")
_LENGTHS = {"nm": 1.0, "nanomet": 1.0, "um": 1e3, "µm": 1e3, "μm": 1e3, "micro": 1e3, "m": 1e9}  # in nm
_LENGTH = re.compile(r"(?:^|[\W_\d])(nm|um|µm|μm|m|(?:nano|micro)met(?:er|re)s?|microns?)(?=$|[\W_])", re.IGNORECASE)
ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0, "mrad": 1e-3}  # in rad
_ANGLE_WORDS = {
    "deg": ("deg", "degs", "degree", "degrees", "°", "º", "\ufffd"),  # the last is ° of other encodings
    "rad": ("rad", "rads", "radian", "radians"),
    "mrad": ("mrad", "mrads", "milliradian", "milliradians"),
}
_OTHER_ANGLES = ("gon", "grad", "arcmin", "arcsec", "turn")  # units of angles that are refused
AZIMUTHS = ("phi", "azimuth", "azi", "az", "azimuth_angle")  # of a viewer relative to the light, if there is no other
_COLOURS = (("R", "G", "B"), ("r", "g", "b"), ("X", "Y", "Z"))  # x, y, z are positions
_OF_FACTORS = re.compile(r"\b(?:BRF|HCRF|reflectance factors?)\b", re.IGNORECASE)
_OF_PERCENT = re.compile(
    r"\b(?:BRDF|BRF|HCRF|BCRF|DSF|f_r|reflectance factors?|values)\b[\s,:;=(\[]*(?:(?:is|are|given|in) )*"
    r"(?:%|(?:percent|pct)\b)",
    re.IGNORECASE,
)
_OF_UNCERTAINTY = re.compile(r"uncertaint|error|deviation|\bstd\b", re.IGNORECASE)
_NUMBER_NM = re.compile(r"(?P<word>[a-z_]*?)[_@]?(?P<number>\d+(?:\.\d+)?)_?(?P<unit>nm|um|µm|μm)?$")
BRACKETS = re.compile(r"[\[(](.*?)[\])]")
_OF_NO_COSINE = re.compile(r"(?<!cos)(?<!cos )(?<!cosine)(?<!cosine )[\[(].*?[\])]", re.IGNORECASE)
_NM_IN_BRACKETS = re.compile(r"[\[(]\s*(\d+(?:\.\d+)? ?(?:nm|um|µm|μm))\s*[\])]")
_OF_COSINE = re.compile(r"(?P<word>.+?)_?cos(?:ine)?(?:_(?P<angle>.+))?")
INDEX = "index"  # name of a first column whose header is empty
UNKNOWN_COSINE = "?"  # quantity of f_r times the cosine of an angle that is not known
_FEWEST_NAMES = 3  # fields of a line of names that are no numbers: those of the angles
_COMMENT = re.compile(r"^\s*(?:#|%|//|!)+\s?")
PERCENT = re.compile(r"%|(?:^|[\W_])(?:percent|pct)(?:$|[\W_])", re.IGNORECASE)
_DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺−", "0123456789-+-")
_PREFIX = {"": 1.0, "m": 1e3, "u": 1e6, "µ": 1e6, "μ": 1e6}  # of 1/sr: 1 per msr is 1000 per sr
_UNIT = re.compile(
    r"(?:[x×·*] ?)?(?:10 ?(?:(?:\^|\*\*) ?\{?(?P<power>[-+]?\d+)\}?|(?P<superscript>[-+]\d+))"
    r"|(?P<number>\d+(?:\.\d+)?(?:[eE][-+]?\d+)?))?"
    r" ?[x×·*]? ?(?P<percent>%|(?i:percent|pct)\b)? ?"
    r"(?:(?:1 ?)?/ ?(?P<over>[muµμ]?)(?i:sr)|(?i:per) (?P<per>[muµμ]?)(?i:sr)"
    r"|(?P<raised>[muµμ]?)(?i:sr) ?(?:\^|\*\*)? ?\{?\(?-1\)?\}?)?"
)
_LOGARITHM = re.compile(r"\bd[bB]\b|(?:^|[\W_])(?:log|ln|lg)(?:10|2)?(?=$|[\W_])", re.IGNORECASE)
_WAVELENGTH_TEXT = re.compile(r"\d+(?:\.\d+)? ?(?:nm|um|µm|μm)|nm|um|µm|μm")


@dataclass(frozen=True)
class TextLayout:
    """The layout of a text.

    Attributes
    ----------
    delimiter : str or None
        The character between fields; None: any white space.
    line : int
        Line of the names of the columns; that of the first row if it has none.
    names : tuple of str
        Names of the columns; their numbers, from 1, if it has none.
    titles : tuple of str
        Lines before the numbers that are not the names.
    first : int
        Line of the first row.
    units : tuple of str
        Units in a line of their own below the names, one a column; () if there is none.
    damaged : str
        A sentence on an earlier line that looks like a row but has fields that are not numbers; else empty.
    """

    delimiter: str | None
    line: int
    names: tuple[str, ...]
    titles: tuple[str, ...]
    first: int
    units: tuple[str, ...] = ()
    damaged: str = ""

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the columns with the units of the line below them in brackets."""
        pairs = itertools.zip_longest(self.names, self.units, fillvalue="")
        return tuple(f"{name} [{unit.strip('[]()')}]" if unit else name for name, unit in pairs)

    @property
    def names_percent(self) -> bool:
        """True if a line before the numbers says that values are percent."""
        return any(_OF_PERCENT.search(line) and not _OF_UNCERTAINTY.search(line) for line in self.titles)

    @property
    def names_factors(self) -> bool:
        """True if a line before the numbers speaks of reflectance factors."""
        return any(_OF_FACTORS.search(line) for line in self.titles)


def fields_of(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line; those in quotation marks may hold the delimiter."""
    line = line.strip("\r\n")
    if delimiter is not None and '"' in line:
        try:
            return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
        except csv.Error:  # a field is too long
            pass
    return [field.strip().strip('"') for field in line.split(delimiter)]


def number_of(text: str) -> float | None:
    """Return the number in a field, with a decimal point or comma, nan of an empty one; None if it is neither."""
    if not text or text.lower() in ("na", "n/a", "null", "none", "-", "--"):
        return float("nan")
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def layout_of(lines: Iterable[tuple[int, str]]) -> TextLayout | None:
    """Return the layout of a text by its first lines, with their numbers; None if there is no row.

    The first line of numbers alone is the first row: four at least, or three below the names of two polar angles. The
    last line before it with as many fields, three of them no numbers, has the names, also behind a sign of a comment.
    """
    before: list[_Line] = []
    for number, line in lines:
        delimiter = next((sign for sign in _delimiters(line) if _is_row(fields_of(line, sign), sign, before)), "")
        if delimiter == "":
            text = comment_of(line)
            before.append(_Line(number, text, comment=text != line.rstrip("\r\n")))
            continue
        count = len(fields_of(line, delimiter))
        at, names = _names(before, delimiter, count)
        rows_of_units = [above for above in before if above.number > at and _are_units(above.text, delimiter, count)]
        units = _split(rows_of_units[-1].text, delimiter, count) if rows_of_units else ()
        before = [above for above in before if above not in rows_of_units]
        titles = tuple(above.text for above in before if above.number != at and above.text.strip())
        between = [above for above in before if above.number > at and not above.comment]
        between = (
            between if at else [earlier for earlier in between[-1:] if len(fields_of(earlier.text, delimiter)) == count]
        )
        damaged = next((fault for earlier in between if (fault := _fault(earlier, delimiter, names))), "")
        return TextLayout(delimiter, at or number, names, titles, number, units, damaged)
    return None


def comment_of(line: str) -> str:
    """Return a line without the sign of a comment and its end."""
    return _COMMENT.sub("", line.rstrip("\r\n"))


def header_of(text: str, layout: TextLayout) -> tuple[str, ...]:
    """Return the names of columns in a line with as many as a layout has, three of them known; else none."""
    names = _split(text, layout.delimiter, len(layout.names))
    known = sum(name in layout.names or bool(role_of(name)) for name in names if number_of(name) is None)
    return names if known >= _FEWEST_NAMES else ()


@dataclass(frozen=True)
class _Line:
    """A line before the first row, without the sign of a comment."""

    number: int
    text: str
    comment: bool


def _delimiters(line: str) -> list[str | None]:
    """Return the delimiters that a line may have, the likely ones first: a comma may be that of decimals."""
    signs: list[str | None] = [sign for sign in "\t;," if sign in line]
    return signs if signs and "," not in signs else [*signs, None]


def _is_row(fields: Sequence[str], delimiter: str | None, before: Sequence[_Line]) -> bool:
    """Return True if fields are the numbers of a row, and not all empty."""
    numbers = [number_of(field) for field in fields]
    if len(numbers) < 3 or None in numbers or not any(value == value for value in numbers):
        return False
    return len(numbers) > 3 or {"theta_i", "theta_r"} <= set(roles_of(_names(before, delimiter, 3)[1]))


def _names(before: Sequence[_Line], delimiter: str | None, count: int) -> tuple[int, tuple[str, ...]]:
    """Return the line and the names of columns; without names, line 0 and numbers from 1.

    They are in the last line with as many names, one of which is known, or else in the last line that is no row.
    """
    numbered = tuple(str(1 + column) for column in range(count))
    for line in reversed(before):
        names = _split(line.text, delimiter, count)
        words = [name for name in names if number_of(name) is None]
        if len(words) >= _FEWEST_NAMES and any(role_of(name) for name in words):
            return line.number, names
    for line in reversed(before):
        names = () if _are_units(line.text, delimiter, count) else _split(line.text, delimiter, count)
        if sum(number_of(name) is None for name in names) >= _FEWEST_NAMES:
            return line.number, names
        if line.text.strip() and (line.comment or not _fault(line, delimiter, numbered)):
            break
    return 0, numbered


def _are_units(text: str, delimiter: str | None, count: int) -> bool:
    """Return True if a line has as many fields as there are columns, and two of them or more are units of angles."""
    units = [unit.strip("[]()").lower() for unit in _split(text, delimiter, count)]
    return sum(any(unit in words for words in _ANGLE_WORDS.values()) or unit in _OTHER_ANGLES for unit in units) >= 2


def _split(text: str, delimiter: str | None, count: int) -> tuple[str, ...]:
    """Return the names in a line if it has as many as there are columns, with the delimiter of rows or another one.

    The first may be empty: pandas writes the numbers of rows into such a column.
    """
    for sign in dict.fromkeys((delimiter, None, ",", ";", "\t")):
        first, *others = fields_of(text, sign)
        if len(others) == count - 1 and all(others) and (first or len(others) >= _FEWEST_NAMES):
            return (first or INDEX, *others)
    return ()


def _fault(line: _Line, delimiter: str | None, names: Sequence[str]) -> str:
    """Return a sentence on a line that is a row of numbers except for some fields; empty for other lines."""
    fields = fields_of(line.text, delimiter)
    numbers = [number_of(field) for field in fields]
    known = sum(value is not None and value == value for value in numbers)
    if len(fields) == len(names) and known >= 2:
        for field, name, value in zip(fields, names, numbers, strict=True):
            if value is None:
                return f"line {line.number}, field {name}: {field[:40]!r} is not a number"
    if len(fields) != len(names) and len(fields) >= 3 and None not in numbers and known:
        return f"line {line.number} has {len(fields)} fields, but the first valid row has {len(names)}"
    return ""


def role_of(name: str) -> str:
    """Return what a column is by its name: one of `ANGLES`, "values", "uncertainty", "wavelength"; "" if unknown."""
    plain = plain_name(name)
    if plain in AZIMUTHS:  # "phi" is not "ph" and "i"
        return ""
    if plain in _RELATIVE:
        return "delta_phi"
    if plain in _OTHERS:
        return _OTHERS[plain]
    if plain in _UNCERTAINTY:
        return "uncertainty"
    if plain in _WAVELENGTH or (plain.rpartition("_")[0] in _WAVELENGTH and length_unit(name) is not None):
        return "wavelength"
    if wavelength_of(name) is not None or _is_quantity(plain):
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
    bare = [BRACKETS.sub("", name).strip() for name in names]
    for colour in _COLOURS:
        if "values" not in roles and set(colour) <= set(bare):
            roles["values"] = [bare.index(channel) for channel in colour]
    azimuths = [column for column, text in enumerate(plain) if text in AZIMUTHS]
    if len(azimuths) == 1 and not {"phi_i", "phi_r", "delta_phi"} & set(roles):
        roles["delta_phi"] = azimuths
    return {role: columns for role, columns in roles.items() if role and columns}


def plain_name(name: str) -> str:
    """Return a name in lower case, without units in brackets and with _ for all other signs."""
    text = name.strip().lower().replace("θ", "theta").replace("φ", "phi").replace("ϕ", "phi").replace("δ", "delta_")
    text = re.sub(r"[\[(].*?[\])]", "", text)
    text = re.sub(r"[^a-z0-9.µμ]+", "_", text).strip("_")
    return re.sub(r"_(?:deg|degrees?|m?rad|radians?|percent|pct)$", "", text)


def angle_unit(name: str) -> str:
    """Return the unit of angles that a name gives: one of `ANGLE_UNITS`, the text in its brackets, or "" if none."""
    for unit in (text.strip() for text in BRACKETS.findall(name)):
        if unit:
            return next((key for key, words in _ANGLE_WORDS.items() if unit.lower().rstrip(".") in words), unit)
    if match := re.search(r"[\W_](m?rad)", name.lower()):
        return match[1]
    return "deg" if "deg" in name.lower() or "°" in name else ""


def length_unit(name: str) -> float | None:
    """Return the unit [nm] of wavelengths that a name gives, such as 1000 of lambda_um; None if it gives none."""
    match = _LENGTH.search(name)
    return None if match is None else next(nm for unit, nm in _LENGTHS.items() if match[1].lower().startswith(unit))


def wavelength_of(name: str) -> float | None:
    """Return the wavelength [nm] that a name gives, such as 550nm or BRF_1.6um; None if it gives none.

    A quantity may have it in brackets, with its unit: BRF (550 nm).
    """
    match = _NUMBER_NM.fullmatch(plain_name(name))
    if match is None:
        inner = _NM_IN_BRACKETS.search(name)
        return wavelength_of(inner[1]) if inner and _is_quantity(plain_name(name)) else None
    word = match["word"]
    number = float(match["number"])
    unit = match["unit"]
    if word and not (_is_quantity(word.rstrip("_")) or word.rstrip("_") in ("r", "reflectance")):
        return None
    if unit is None:
        return number if number >= 100.0 else None
    return number if unit == "nm" else 1e3 * number


def _is_quantity(plain: str) -> bool:
    """Return True if a plain name is that of a quantity, also times a cosine."""
    return any(plain in words for words in _QUANTITIES.values()) or _cosine_in(plain) is not None


def _cosine_in(plain: str) -> str | None:
    """Return the angle in the name of f_r times a cosine, such as theta_i, "" if it gives none; None of other names."""
    match = _OF_COSINE.fullmatch(plain)
    return (match["angle"] or "") if match and match["word"] in _QUANTITIES["f_r"] else None


def quantity_of(name: str, columns: Sequence[str]) -> str:
    """Return the quantity that the name of a column of values gives: one of `QUANTITIES`, or "" if it gives none.

    It is `UNKNOWN_COSINE` if f_r is multiplied by the cosine of an angle that is neither that of the light nor that of
    the viewer. The names of all columns tell whether theta_s is the one or the other.
    """
    plain = plain_name(name)
    match = _NUMBER_NM.fullmatch(plain)
    word = match["word"].rstrip("_") if match else plain
    angle = _cosine_in(plain_name(re.sub(r"[\[\](){}]", " ", _OF_NO_COSINE.sub("", name))))
    if angle:
        roles = roles_of(columns)
        for role, quantity in (("theta_r", "f_r_cos"), ("theta_i", "f_r_cos_i")):
            if {angle, f"theta_{angle}"} & {plain_name(columns[column]) for column in roles.get(role, ())}:
                return quantity
        if angle in ("s", "theta_s"):
            return UNKNOWN_COSINE
        of_viewer = role_of(angle) == "theta_r" or angle in _VIEWER
        of_light = role_of(angle) == "theta_i"
        return "f_r_cos" if of_viewer else "f_r_cos_i" if of_light or angle in _LIGHT else UNKNOWN_COSINE
    return next((quantity for quantity, words in _QUANTITIES.items() if word in words), "")


def units_in(name: str) -> list[str]:
    """Return the texts in brackets in a name of values, without those that are quantities, angles or wavelengths."""
    units = []
    for match in BRACKETS.finditer(name):
        unit = match[1].strip()
        of_cosine = re.search(r"cos(?:ine)?\W*$", name[: match.start()], re.IGNORECASE)
        of_wavelength = _WAVELENGTH_TEXT.fullmatch(unit) and wavelength_of(name) is not None
        if unit and not (of_cosine or of_wavelength or role_of(unit)):
            units.append(unit)
    return units


def factor_of(unit: str) -> float | None:
    """Return the factor that makes 1/sr of numbers with a unit, such as 10^-3 sr^-1 or %; None if it is not known."""
    if unit == "-":
        return 1.0
    match = _UNIT.fullmatch(unit.translate(_DIGITS))
    if match is None:
        return None
    prefix = next((match[name] for name in ("over", "per", "raised") if match[name] is not None), None)
    number = float(match["number"] or 1.0)
    if power := match["power"] or match["superscript"]:
        number = 10.0 ** int(power)
    of_ten = number > 0.0 and math.isclose(number, 10.0 ** round(math.log10(number)), rel_tol=1e-12)
    alone = prefix is None and not match["percent"]
    if not of_ten or (alone and number != 1.0) or (match["number"] or "").lower().startswith("10e"):
        return None  # 1000 alone may be a factor of the numbers or of the unit, and 10e-3 is written for 1e-3
    return number * _PREFIX[prefix or ""] * (0.01 if match["percent"] else 1.0)


def scale_of(name: str) -> tuple[float, str]:
    """Return the factor that makes 1/sr of numbers with a name, and the first unit in it that is not known, or ""."""
    scale = 0.01 if PERCENT.search(BRACKETS.sub(" ", name)) else 1.0
    unknown = ""
    for unit in units_in(name):
        factor = factor_of(unit)
        if factor is None and PERCENT.search(unit):
            factor = 0.01
        if factor is None:
            unknown = unknown or unit
        scale *= factor or 1.0
    return scale, unknown


def is_logarithm(name: str) -> bool:
    """Return True if a name says that its numbers are decibels or other logarithms."""
    return _LOGARITHM.search(name) is not None
