"""Units of f_r and of its uncertainty in names of columns: powers of ten, percent, 1/sr and 1/msr."""

from __future__ import annotations

import math
import re

from brdfdb.formats._columns import BRACKETS, role_of, wavelength_of

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
_LENGTH = re.compile(r"\d+(?:\.\d+)? ?(?:nm|um|µm|μm)|nm|um|µm|μm")


def units_in(name: str) -> list[str]:
    """Return the texts in brackets in a name of values, without those that are quantities, angles or wavelengths."""
    units = []
    for match in BRACKETS.finditer(name):
        unit = match[1].strip()
        of_cosine = re.search(r"cos(?:ine)?\W*$", name[: match.start()], re.IGNORECASE)
        of_wavelength = _LENGTH.fullmatch(unit) and wavelength_of(name) is not None
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
