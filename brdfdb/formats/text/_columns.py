"""Columns of texts: what the names of other programs and laboratories mean, and the units in them."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import NamedTuple

from brdfdb.measurements.conventions import ANGLE_UNITS, NM_PER

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r", "delta_phi", "from_specular", "rotation")
UNKNOWN_COSINE = "?"  # quantity of f_r times the cosine of an angle that is not known
_CACHED = 4096  # names whose meaning is kept: those above rows are looked at for each line


def _table(text: str) -> dict[str, list[str]]:
    """Return the words behind each key of a table, a key a line."""
    return {key: words.split() for key, _, words in (line.partition(":") for line in text.strip().splitlines())}


def _keys(table: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return the key of each word of a table."""
    return {word: key for key, words in table.items() for word in words}


# Parts of names; those of an angle are one of polar or azimuth and one of light or viewer
_PARTS = _table("""
light: i in inc incident incoming incidence source src light lamp laser einfall solar sun ill illumination s
viewer: r o out outgoing refl reflected reflection scat scatter scattered scattering sc sca v view viewing viewer det \
detector detection rec receiver receiving obs observer observation collection exit emission emergence emergent streu \
detektor
polar: theta zenith z za polar th angle winkel
azimuth: phi azimuth a az aa azi ph azimut
uncertainty: uncertainty u unc std stdev stddev std_dev standard_deviation sigma error err standard_uncertainty \
std_error unsicherheit messunsicherheit incertitude ecart_type ubrdf dbrdf delta_brdf
""")
# Plain names, as of `plain_name`, by what a column is
_NAMES = _table("""
theta_i: aoi angle_of_incidence incidence_angle incidence aoi_theta_i grazing_angle glancing_angle einfallswinkel \
angle_d_incidence angle_incidence incident
theta_r: streuwinkel ausfallswinkel beobachtungswinkel detektorwinkel messwinkel reflexionswinkel angle_de_diffusion \
angle_d_observation angle_de_vue angle_de_reflexion angle_of_reflection angle_of_scatter aos detector_position \
detektorposition
rotation: rotation sample_rotation sample_azimuth sample_rot sample_phi rot rotation_of_sample sample_orientation \
rotation_angle sample_rotation_angle azimuth_of_sample probenrotation probendrehung drehwinkel turntable
delta_phi: delta_phi dphi deltaphi phi_d phid raa relaz relative_azimuth rel_azimuth phi_rel delta_azimuth delta_az \
dazimuth azimuth_difference relative_phi rel_phi phi_r_phi_i relativazimut azimut_relatif
wavelength: wavelength lambda wl wvl wave wave_length laser_wavelength wellenlange wellenlaenge wellenl_nge \
longueur_d_onde
""")
# Plain names of values by their quantity
_QUANTITIES = _table("""
f_r: brdf f_r fr bsdf value values mean_brdf brdf_mean average_brdf avg_brdf brdf_avg brdf_average brdf_value \
mittelwert_brdf brdf_mittelwert brdf_moyenne
reflectance_factor: brf rf hcrf bcrf reflectance_factor r_factor reflexionsfaktor
f_r_cos: dsf ccbrdf ccbsdf cc_brdf cc_bsdf brdf_cos f_r_cos fr_cos brdfcos ars cosine_corrected_brdf \
cosine_corrected_bsdf cos_corrected_brdf cos_corrected_bsdf brdf_cosine_corrected bsdf_cosine_corrected \
angle_resolved_scatter angle_resolved_scattering
f_r_cos_i: f_r_cos_i
""")
_QUANTITY_OF = _keys(_QUANTITIES)
_REFLECTANCES = ("r", "reflectance", "refl", "reflectivity", "reflexionsgrad", "reflectance_percent")
AZIMUTHS = (
    "phi",
    "azimuth",
    "azimut",
    "azi",
    "az",
    "azimuth_angle",
)  # of a viewer relative to the light, if there is no other
BARE_POLAR = ("theta", "angle", "zenith", "polar", "polar_angle", "winkel", "elevation", "altitude")  # of a viewer
_OF_S = ("theta_s", "thetas", "th_s", "polar_s", "zenith_s")  # of the sun, or of scattered light


def _roles_of_names() -> dict[str, str]:
    """Return the role of each plain name: of angles with their two parts in any order, and of `_NAMES`."""
    roles: dict[str, str] = {}
    for side, of_side in (("i", "light"), ("r", "viewer")):
        for kind, of_kind in (("theta", "polar"), ("phi", "azimuth")):
            for angle, word in product(_PARTS[of_kind], _PARTS[of_side]):
                for name in (f"{angle}_{word}", f"{angle}{word}", f"{word}_{angle}", f"{word}{angle}"):
                    roles.setdefault(name, f"{kind}_{side}")
    return roles | _keys(_NAMES) | dict.fromkeys(AZIMUTHS, "")  # "phi" is not "ph" and "i"


_ROLE_OF = _roles_of_names()

_OF_SPECULAR = re.compile(
    r"(?:angle|theta|scatter\w*|delta|degrees?)_(?:from|off|to|about|relative_to|rel_to|rel|wrt)_(?:the_)?spec(?:ular)?"
    r"|(?:from|off)_spec(?:ular)?(?:_angle)?|aspecular(?:_angle)?|(?:theta|angle)_(?:spec|aspec)(?:ular)?"
    r"|theta_(?:s|r|o)_(?:minus_)?theta_i|spec(?:ular)?_offset"
)
_SURFACE = re.compile(r"(?:^|_)(?:elevation|elev|altitude|grazing|glancing)(?=_|$)")  # angles that count from it
_WITH_UNCERTAINTY = "|".join(("brdf", "bsdf", "f_r", "fr", *_QUANTITIES["reflectance_factor"]))
_OF_UNCERTAINTY = re.compile(
    rf"(?:rel(?:ative)?_|expanded_|combined_|\d_?(?=sigma))?"
    rf"(?:(?:{'|'.join(_PARTS['uncertainty'])})(?:_(?:of_|in_)?(?:the_)?(?:{_WITH_UNCERTAINTY}))?"
    rf"|(?:{_WITH_UNCERTAINTY})_(?:rel(?:ative)?_)?(?:{'|'.join(_PARTS['uncertainty'])}))(?:_rel(?:ative)?)?"
)
_LENGTH = re.compile(r"(?:^|[\W_\d])(nm|um|µm|μm|m|(?:nano|micro)met(?:er|re)s?|microns?)(?=$|[\W_])", re.IGNORECASE)
_SPECTRAL = re.compile(
    r"(?:(?:photon|laser|optical)[\W_]*)?(?:wave[\W_]?number|energy|frequency|wellenzahl|energie|frequenz)s?"
    r"[\W_]*(?:(?P<cm>cm ?(?:\^? ?-1|\u207b\u00b9)|1 ?/ ?cm)|(?P<ev>eV)|(?P<thz>THz))\W*",
    re.IGNORECASE,
)
_NM_TIMES = {"cm": 1e7, "ev": 1239.841984, "thz": 299792.458}  # wavelengths [nm] times numbers in cm^-1, eV and THz
ANGLE_WORDS = _keys(
    {
        "deg": ("deg", "degs", "degree", "degrees", "°", "º", "\ufffd", "degré", "degrés"),  # \ufffd: ° of others
        "rad": ("rad", "rads", "radian", "radians"),
        "mrad": ("mrad", "mrads", "milliradian", "milliradians"),
    }
)
OTHER_ANGLES = ("gon", "grad", "arcmin", "arcsec", "turn")  # units of angles that are refused
_COLOURS = (("R", "G", "B"), ("r", "g", "b"), ("X", "Y", "Z"))  # x, y, z are positions
_NUMBER_NM = re.compile(r"(?P<word>[a-z_]*?)[_@]?(?P<number>\d+(?:\.\d+)?)_?(?P<unit>nm|um|µm|μm)?$")
_ELEMENT = re.compile(r"(?:m|mm|mueller|muller)_?([0-4])_?([0-4])")  # of a Mueller matrix
BRACKETS = re.compile(r"[\[(](.*?)[\])]")
_OF_NO_COSINE = re.compile(r"(?<!cos)(?<!cos )(?<!cosine)(?<!cosine )[\[(].*?[\])]", re.IGNORECASE)
_NM_IN_BRACKETS = re.compile(r"[\[(]\s*(\d+(?:\.\d+)? ?(?:nm|um|µm|μm))\s*[\])]")
_OF_COSINE = re.compile(r"(?P<word>.+?)_?cos(?:ine)?(?:_(?P<angle>.+))?")
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
_STATE = re.compile(  # of polarisation
    r"(?:(?P<base>.+?)[\s_-]*(?:[\s_-]|(?=[\[(]))[\[(]?(?P<state>ss|sp|ps|pp|s|p|TE|TM)(?:[\s_-]*pol(?:ari[sz](?:ed|ation))?\.?)?[\])]?"
    r"|(?P<before>ss|sp|ps|pp|s|p|TE|TM)(?:[\s_-]*pol(?:ari[sz](?:ed|ation))?\.?)?[\s_-]+(?P<after>[^\[(]+?))"
    r"(?P<unit>\s*[\[(][^\])]*[\])])?",
    re.IGNORECASE,
)
_PAIR = re.compile(r"(?<![A-Za-z])([sp])\s*(?:[-_>/→]|to)+\s*([sp])(?![A-Za-z])", re.IGNORECASE)  # s-p is sp
_LOGARITHM_OF = re.compile(
    r"(?:log_?10|log_?2|log|lg|ln)(?:[ _]*\((?P<inner>[^()]*(?:\([^()]*\))?[^()]*)\)(?:\W.*)?|[ _]+(?P<bare>.+))"
    r"|(?P<before>.+?)[ _]+dB",
    re.IGNORECASE,
)
_LOGARITHM = re.compile(r"(?:\b|_)d[bB]\b|(?:^|[\W_])(?:log|ln|lg)_?(?:10|2)?(?=$|[\W_])", re.IGNORECASE)
OF_SAMPLES = re.compile(
    r"(?:sample|samples|specimen|material|surface|coating|probe|probenname|muster|echantillon|materiau|filter|target|"
    r"sample_(?:name|id|no|number|nr)|material_(?:name|id)|specimen_id|name)"
)
_FACTOR = re.compile(  # of all numbers, such as BRDF/1000, BRDF x 100 and 1000*BRDF
    r"(?P<before>\d[\d.eE^+-]*\s*[*\u00d7\u00b7])?\s*(?P<base>.*?[\w)\]])[\s_]*"
    r"(?P<after>(?:[*\u00d7\u00b7/]|(?<=[\s_])[xX])\s*\d[\d.]*(?:[eE^]?[-+]?\d+)?)?"
)
_WAVELENGTH_TEXT = re.compile(r"\d+(?:\.\d+)? ?(?:nm|um|µm|μm)|nm|um|µm|μm")


@lru_cache(maxsize=_CACHED)
def role_of(name: str) -> str:
    """Return what a column is by its name: one of `ANGLES`, "values", "uncertainty", "wavelength"; "" if unknown."""
    name = _bracketed(name)
    plain = plain_name(name)
    if spectral_unit(name) is not None:
        return "wavelength"
    if plain in _ROLE_OF:
        return _ROLE_OF[plain]
    if _OF_SPECULAR.fullmatch(plain):
        return "from_specular"
    if _OF_UNCERTAINTY.fullmatch(plain):
        return "uncertainty"
    if plain.rpartition("_")[0] in _NAMES["wavelength"] and length_unit(name) is not None:
        return "wavelength"
    if wavelength_of(name) is not None or _is_quantity(plain) or state_of(name)[1]:
        return "values"
    if _is_quantity(plain_name(without_logarithm(name))):
        return "values"
    if of_surface(name):
        return role_of(_SURFACE.sub("_zenith", plain).strip("_")) or role_of(_SURFACE.sub("", plain).strip("_"))
    if angle_unit(name) in ANGLE_UNITS and len(plain) > 3 and plain in (*_PARTS["light"], *_PARTS["viewer"]):
        return "theta_i" if plain in _PARTS["light"] else "theta_r"
    shorter = re.sub(
        r"^(?:polar|zenith)_(?=angle_)|_(?:angle|winkel)s?$|_(?:theta|phi|th)_?[a-z]{0,3}$|_of(?:_the)?(?=_)", "", plain
    )
    return role_of(shorter) if shorter != plain and shorter not in AZIMUTHS else ""


def state_of(name: str) -> tuple[str, str]:
    """Return the name of a quantity without its polarisation, and that: s, p, ss, sp, ps, pp or "" if it has none.

    A name of two letters alone, such as sp or s-p, is f_r.
    """
    name = _PAIR.sub(r"\1\2", name.strip())
    if name.lower() in ("ss", "sp", "ps", "pp"):
        return "brdf", name.lower()
    if name in ("TE", "TM", "Rs", "Rp"):
        return ("brdf" if name[0] == "T" else "reflectance_factor"), {"TE": "s", "TM": "p"}.get(name, name[-1])
    match = _STATE.fullmatch(name)
    if match is None:
        return name, ""
    base, state = (match["base"] or match["after"] or "").strip(), (match["state"] or match["before"]).lower()
    if plain_name(base) not in _QUANTITY_OF:
        return name, ""
    unit = (match["unit"] or "").strip()
    return f"{base} {unit}".strip(), {"te": "s", "tm": "p"}.get(state, state)


def of_surface(name: str) -> bool:
    """Return True if a name is that of an angle from the surface: an elevation, altitude or grazing angle."""
    return _SURFACE.search(plain_name(name)) is not None


def roles_of(names: Sequence[str], given: Mapping[str, Sequence[int]] | None = None) -> dict[str, list[int]]:
    """Return the columns of each role, by the names of all columns; columns that the caller gives have no other."""
    given = given or {}
    taken = {column for columns in given.values() for column in columns}
    roles: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        if number not in taken:
            roles.setdefault(role_of(name), []).append(number)
    plain = [plain_name(name) for name in names]
    bare = [BRACKETS.sub("", name).strip() for name in names]
    for colour in _COLOURS:
        if "values" not in roles and set(colour) <= set(bare):
            roles["values"] = [bare.index(channel) for channel in colour]
    if "values" not in roles and "values" not in given:
        first = element_columns(plain).get((0, 0))
        reflectances = [n for n, text in enumerate(plain) if text in _REFLECTANCES and n not in taken]
        roles["values"] = reflectances if first is None else [first]
    of_s = any(plain[n] in _OF_S for n in roles.get("theta_i", ()))
    if of_s and not {"theta_r", "from_specular"} & {*given, *roles}:
        for angle in ("theta", "phi"):  # theta_s is of the scattered light then, else of the sun
            columns = roles.get(f"{angle}_i", [])
            moved = [n for n in columns if re.fullmatch(r"[a-z]+_s|(?:theta|phi)s", plain[n])]
            roles[f"{angle}_i"] = [n for n in columns if n not in moved]
            roles[f"{angle}_r"] = roles.get(f"{angle}_r", []) + moved
    known = {role: columns for role, columns in roles.items() if role and columns}
    free = set(range(len(names))) - taken - {column for columns in known.values() for column in columns}
    polar = [n for n in sorted(free) if plain[n] in BARE_POLAR]
    if len(polar) == 1 and "theta_r" not in known and "theta_r" not in given:
        known["theta_r"] = polar
    azimuths = [n for n in sorted(free) if plain[n] in AZIMUTHS]
    if len(azimuths) == 1 and not {"phi_i", "phi_r", "delta_phi"} & set(known):
        known["delta_phi"] = azimuths
    return known


def element_columns(plain: Sequence[str]) -> dict[tuple[int, int], int]:
    """Return the columns of Mueller elements, such as m00 or M11, by row and column from 0; {} without two of them."""
    matches = [(number, match) for number, name in enumerate(plain) if (match := _ELEMENT.fullmatch(name))]
    columns = {(int(match[1]), int(match[2])): number for number, match in matches}
    first = 0 if any(0 in place for place in columns) else 1
    shifted = {(row - first, column - first): number for (row, column), number in columns.items()}
    return shifted if len(shifted) > 1 and max(map(max, shifted)) < 4 else {}


def without_logarithm(name: str) -> str:
    """Return the name of the quantity in that of its logarithm, such as BRDF of log10(BRDF)."""
    match = _LOGARITHM_OF.fullmatch(name.strip())
    return name if match is None else match["inner"] or match["bare"] or match["before"]


@lru_cache(maxsize=_CACHED)
def plain_name(name: str) -> str:
    """Return a name in lower case, without accents and units in brackets, and with _ for all other signs."""
    text = name.strip().lower().replace("θ", "theta").replace("φ", "phi").replace("ϕ", "phi").replace("δ", "delta_")
    text = text.replace("λ", "lambda").replace("σ", "sigma").replace("ß", "ss").replace("ϑ", "theta")
    text = "".join(sign for sign in unicodedata.normalize("NFKD", text) if not unicodedata.combining(sign))
    text = re.sub(r"[\[(].*?[\])]", "", text)
    text = re.sub(r"[^a-z0-9.µμ]+|\.(?!\d)", "_", text).strip("_")
    text = re.sub(r"__+", "_", text)
    return re.sub(r"_(?:in_)?(?:deg|degrees?|grad|m?rad|radians?|percent|pct|1_sr|per_sr|sr_?1|sr)$", "", text)


@lru_cache(maxsize=_CACHED)
def _bracketed(name: str) -> str:
    """Return the name of a quantity with its factor in brackets, BRDF [/1000]; other names with decimal points."""
    name = re.sub(r"(?<=\d),(?=\d)", ".", name)
    match = _FACTOR.fullmatch(name.strip())
    if match is None or not (match["before"] or match["after"]) or not _is_quantity(plain_name(match["base"])):
        return name
    return f"{match['base']} [{match['before'] or match['after']}]"


def angle_unit(name: str) -> str:
    """Return the unit of angles that a name gives: one of `ANGLE_UNITS`, the text in its brackets, or "" if none."""
    for unit in (text.strip() for text in BRACKETS.findall(name)):
        if unit:
            return "deg" if unit == "Grad" else ANGLE_WORDS.get(unit.lower().rstrip("."), unit)  # "grad" is a gon
    if match := re.search(r"[\W_](m?rad)", name.lower()):
        return match[1]
    return "deg" if "deg" in name.lower() or "°" in name else ""


def length_unit(name: str) -> float | None:
    """Return the unit [nm] of wavelengths that a name gives, such as 1000 of lambda_um; None if it gives none."""
    match = _LENGTH.search(name)
    return None if match is None else NM_PER[match[1].lower()]


def spectral_unit(name: str) -> float | None:
    """Return the product of the wavelength [nm] and the number of wavenumbers, photon energies or frequencies."""
    match = _SPECTRAL.fullmatch(name.strip())
    return None if match is None else next(nm for unit, nm in _NM_TIMES.items() if match[unit])


def wavelength_of(name: str) -> float | None:
    """Return the wavelength [nm] that a name gives, such as 550nm or BRF_1.6um; None if it gives none.

    A quantity may have it in brackets, with its unit: BRF (550 nm).
    """
    name = _bracketed(name)
    match = _NUMBER_NM.fullmatch(plain_name(name))
    if match is None:
        inner = _NM_IN_BRACKETS.search(name)
        return wavelength_of(inner[1]) if inner and _is_quantity(plain_name(name)) else None
    word = match["word"].rstrip("_")
    number = float(match["number"])
    unknown = match["word"] and not (_is_quantity(word) or word in ("r", "reflectance"))
    if unknown or (match["unit"] is None and number < 100.0):
        return None
    return number * NM_PER[match["unit"] or "nm"]


def _is_quantity(plain: str) -> bool:
    """Return True if a plain name is that of a quantity, also times a cosine."""
    return plain in _QUANTITY_OF or _cosine_in(plain) is not None


def _cosine_in(plain: str) -> str | None:
    """Return the angle in the name of f_r times a cosine, such as theta_i, "" if it gives none; None of other names."""
    match = _OF_COSINE.fullmatch(plain)
    return (match["angle"] or "") if match and match["word"] in _QUANTITIES["f_r"] else None


def quantity_of(name: str, columns: Sequence[str]) -> str:
    """Return the quantity that the name of a column of values gives, such as f_r_cos, or "" if it gives none.

    It is `UNKNOWN_COSINE` if f_r is multiplied by the cosine of an angle that is neither that of the light nor that of
    the viewer. The names of all columns tell whether theta_s is the one or the other.
    """
    name = without_logarithm(state_of(_bracketed(name))[0])
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
        of_viewer = role_of(angle) == "theta_r" or angle in _PARTS["viewer"]
        of_light = role_of(angle) == "theta_i" or angle in _PARTS["light"]
        return "f_r_cos" if of_viewer else "f_r_cos_i" if of_light else UNKNOWN_COSINE
    bare = {BRACKETS.sub("", column).strip() for column in columns}
    if word in _REFLECTANCES and not any(set(colour) <= bare for colour in _COLOURS):
        return "reflectance_factor"
    return _QUANTITY_OF.get(word, "")


def units_in(name: str) -> list[str]:
    """Return the texts in brackets in a name of values, without those that are quantities, angles or wavelengths."""
    units = []
    name = _bracketed(name)
    for match in BRACKETS.finditer(name):
        unit = match[1].strip()
        of_cosine = re.search(r"cos(?:ine)?\W*$", name[: match.start()], re.IGNORECASE)
        of_wavelength = _WAVELENGTH_TEXT.fullmatch(unit) and wavelength_of(name) is not None
        if unit and not (of_cosine or of_wavelength or (role_of(unit) and unit.strip("*/\u00d7\u00b7") == unit)):
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
        factor = factor_of(unit) or (0.01 if PERCENT.search(unit) else None)
        unknown = unknown or ("" if factor else unit)
        scale *= factor or 1.0
    return scale, unknown


class ValueName(NamedTuple):
    """Meaning of the name of a column of values.

    `quantity` is as of `quantity_of`. `logarithm` is log10, ln, decibel, "log" of others, or "" if numbers are none:
    else `factor` makes 1/sr of them, and `unit` is the first that is not known, or "".
    """

    quantity: str
    logarithm: str
    factor: float
    unit: str
    wavelength_nm: float | None


def value_name(name: str, columns: Sequence[str]) -> ValueName:
    """Return what the name of a column of values says, among the names of all columns."""
    match = _LOGARITHM.search(name)
    word = match[0].strip(" _([.-*").lower() if match else ""
    logarithm = word and {"db": "decibel", "ln": "ln", "log_10": "log10", "lg": "log10"}.get(word, word)
    if logarithm not in ("", "decibel", "ln", "log10"):
        logarithm = "log"
    factor, unit = (1.0, "") if logarithm else scale_of(state_of(name)[0])
    return ValueName(quantity_of(name, columns), logarithm, factor, unit, wavelength_of(name))
