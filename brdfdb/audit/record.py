"""All that a table states of itself, compared leaf by leaf with its record and with a new measurement."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from brdfdb.audit.finding import STRICT, Cell, Finding, Sentence, Subject, Verdict
from brdfdb.audit.statement import contradictions
from brdfdb.errors import counted
from brdfdb.materials import FunctionRecord, Material, Source, exact_material, libraries, presets
from brdfdb.tables.albedo import LARGEST_TOLERANCE, AlbedoAt, albedo_of, wavelengths_of
from brdfdb.tables.error_measurement import SEED, directions_of_a_band, draw
from brdfdb.tables.layout import digest
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.places import BANDS_DEG
from brdfdb.tables.planner import first_reason
from brdfdb.tables.statements import MEASURED, first_numbers
from brdfdb.tables.table import Table, TableSource
from brdfdb.tables.tabulation import metadata_of, rounded

_SAME = 1e-9  # relative difference of numbers that are equal but for rounding
# Measured numbers have three digits, of which the last may differ
_NOTHING = 1e-9  # measured errors below this are those of float64 sums
_SAME_PLACE = 0.011  # difference of places, which have two decimals
_PASSES = 0.015  # relative difference of angles to 90 degrees that are found to a thousandth, and have three digits
_TIE = 1e-9  # difference of albedos [1] that are equally large
_ROUNDING = "it is rounding"  # reason for the place of the largest error if all errors are rounding
_SHOWN = 3  # differences that a sentence names
_OF_SOURCE = ("title", "material", "source", "source_record", "measured", "reason")  # attributes that no array decides
_DISTINCT = 64  # of so many distinct values some have the last of the stored bits, but for a chance of 2^-64


class Unchecked(NamedTuple):
    """Leaves that no audit can check: where they stand, their path with * for any number or name, and why."""

    where: str
    leaf: str
    why: str


_NO_DATA = "the store does not hold the data"
_NO_FUNCTION = "the store does not hold the function, but an audit accepts it as an argument"
UNCHECKED = (
    Unchecked("pointer and manifest", "created", "there is no other record of the time"),
    Unchecked("pointer", "last", "revisions with higher numbers may have been removed, and leave no trace"),
    Unchecked("table", "reason", "it also has the sizes of other kinds of tables; only its first clause is compared"),
    Unchecked("table", "error.worst.*", "if all errors are due to rounding, the place of the largest is arbitrary"),
    Unchecked("table of a function", "error.*", f"{_NO_FUNCTION}; it must not contradict itself"),
    Unchecked("table of a function", "largest_albedo.*", f"{_NO_FUNCTION}; the albedo is near that of the lookups"),
    Unchecked("table of a function", "source_record.function.*", "only the author of the function knows"),
    Unchecked("table of measured data", "error.*", f"{_NO_DATA}; it must not contradict itself"),
    Unchecked("table of measured data", "measured.*", _NO_DATA),
    Unchecked("table of measured data", "source_record.function.*", "the import took it from the data"),
)


class Difference(BaseModel):
    """A leaf of the attributes of a table that is not what it must be."""

    model_config = STRICT

    leaf: str = Field(description="path in the attributes, with dots; numbers count elements of lists from 0")
    stated: str = Field(description="what the table states, as JSON has it; empty: nothing")
    expected: str = Field(description="what its record, or a new measurement, gives; empty: nothing")

    @property
    def text(self) -> str:
        """The difference in words."""
        return f"{self.leaf} is {self.stated or 'not stated'}, where {self.expected or 'nothing'} is right"


class Record(Finding):
    """The attributes of a table, compared with what its record and a new measurement give."""

    key = "record"
    order = 9
    explanation = (
        "The metadata of a table are computed again, as in a build. Title, parameters and citations follow from the "
        "record of the source, which a digest protects. The stated error (also in places and between wavelengths), the "
        "error of the formula and the largest albedo are measured at the same directions. All numbers must agree to "
        "rounding, and all texts exactly. A material that has the name of a preset must have its parameters; one that "
        "cites the same place as presets do must have the parameters of one of them. For tables of functions and of "
        "measured data, only metadata that follow from the arrays are compared."
    )

    compared: int = Field(description="number of leaves of the attributes that were compared")
    wrong: int = Field(description="number of them that differ")
    worst: list[Difference] = Field(description="the first of these")
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Compare the attributes of a table; a table without a record is not judged."""
        if subject.unrecorded:
            return subject.not_judged("statements are compared with the record of the source")
        return record_of(subject.table, expected_of(subject), subject.source)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the number of leaves, or on those that differ."""
        text = f"all {self.compared} compared numbers and words agree with its record and with a new measurement"
        if self.wrong:
            named = "; ".join(difference.text for difference in self.worst[:_SHOWN])
            text = f"{counted(self.wrong, 'statement')} of {self.compared} wrong: {named}"
        return [self.sentence(self.verdict, text)]

    def cells(self) -> list[Cell]:
        """Return the number of wrong statements."""
        return [Cell(self.verdict, f"{self.wrong} wrong" if self.wrong else "all good", self.wrong)]


def record_of(table: Table, expected: Mapping[str, Any], source: Source | None) -> Record:
    """Return how the attributes of a table differ from those `expected`, and from the presets."""
    albedo_at = albedo_of(table, source)
    stated = {key: table.attrs[key] for key in expected if key in table.attrs and key not in table.metadata.strange}
    wrong = [
        difference
        for key, value in stated.items()
        for difference in differences(value, expected[key], key, measured=key in MEASURED)
        if not _tied(table, albedo_at, difference, value, expected[key])
    ]
    wrong += [
        Difference(leaf=key, stated=f"not valid ({why})", expected="a valid value")
        for key, why in table.metadata.strange.items()
    ]
    if table.error is not None:
        sentences = contradictions(table.error, wavelengths_of(table))
        wrong += [
            Difference(leaf="error", stated=why, expected="a statement without contradictions") for why in sentences
        ]
    wrong += [
        *_of_request(table.metadata),
        *_of_presets(table),
        *_of_reason(table),
        *_of_bits(table),
        *_of_function(table),
    ]
    named = table.metadata.material
    if named is not None and named != table.name:
        wrong.append(Difference(leaf="material", stated=_written(named), expected=repr(table.name)))
    if table.metadata.source_record is not None and table.source is None:
        wrong.append(Difference(leaf="source_record", stated="no source", expected="a material or a function"))
    compared = sum(1 for value in stated.values() for _ in leaves(value))
    return Record(compared=compared, wrong=len(wrong), worst=wrong[:10], verdict="violates" if wrong else "passes")


def expected_of(subject: Subject) -> dict[str, Any]:
    """Return the attributes that a table must have, as far as they can be made again."""
    table = subject.table
    if subject.restated is not None:
        expected = _plain(subject.restated.attributes())
        absent = dict.fromkeys(key for key in TableMetadata.model_fields if key in table.attrs)
        request = {key: table.attrs[key] for key in ("request", "request_sha256") if key in table.attrs}
        return {**absent, **expected, **request}
    source = TableSource(table)
    layout = table.laid_out(source)
    known = metadata_of(layout).attributes()
    numbers = first_numbers(layout, lambda rows: table.values[rows])
    expected = {key: value for key, value in known.items() if key not in _OF_SOURCE}
    expected = _plain(expected) | {key: value.model_dump(mode="json") for key, value in numbers.items()}
    if table.error is not None:
        pairs = draw(source, table.wavelength_nm, directions_of_a_band(table.wavelength_nm), SEED)
        directions = int(np.count_nonzero(pairs.above))
        of_build = {"theta_i_deg": BANDS_DEG.tolist(), "directions": directions, "seed": SEED}
        expected["error"] = {**table.attrs["error"], **of_build}
    if isinstance(record := table.source, FunctionRecord):
        largest = table.metadata.largest_albedo
        if largest is not None and largest.of == "source":
            del expected["largest_albedo"]  # that of the function, as a user has it
        expected |= {"title": record.title, "material": record.name, "source": record.provenance}
    return expected


def _plain(expected: dict[str, Any]) -> dict[str, Any]:
    """Return attributes in which the offset of logarithms is 0 where there are none."""
    how = expected["interpolation"]
    return expected if how["logarithm"] else {**expected, "interpolation": {**how, "offset": 0.0}}


def leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield each leaf of a document with its path; empty lists and objects are leaves, too."""
    if isinstance(value, Mapping) and value:
        for key, part in value.items():
            yield from leaves(part, (*path, str(key)))
    elif isinstance(value, list | tuple) and value:
        for number, part in enumerate(value):
            yield from leaves(part, (*path, str(number)))
    else:
        yield path, value


def differences(stated: Any, expected: Any, leaf: str, *, measured: bool) -> Iterator[Difference]:
    """Yield the leaves of two documents that differ; `measured` numbers may differ in their third digit."""
    one, other = dict(leaves(stated)), dict(leaves(expected))
    for path in {**one, **other}:
        a, b = one.get(path), other.get(path)
        if not _same(a, b, _allowed(a, b, path) if measured else _SAME):
            yield Difference(leaf=".".join(filter(None, (leaf, *path))), stated=_written(a), expected=_written(b))


def _allowed(stated: Any, expected: Any, path: tuple[str, ...]) -> float:
    """Return the largest relative difference of two measured numbers, or of places [degree, nm] that were met."""
    words = [part for part in path if not part.isdigit()]
    numbers = [abs(value) for value in (stated, expected) if isinstance(value, float)]
    largest = max(numbers, default=0.0)
    if largest == 0.0 or not math.isfinite(largest):
        return _SAME
    if words and words[-1].startswith("passes_1"):  # three digits of the distance to 90 degrees
        return _SAME + _PASSES * abs(90.0 - largest) / largest
    if words and words[-1].endswith(("_deg", "_nm")):
        return _SAME_PLACE / largest if "worst" in words else _SAME
    return (_NOTHING + 1.5 * 10.0 ** (math.floor(math.log10(largest)) - 2)) / largest


def _same(stated: Any, expected: Any, allowed: float) -> bool:
    numbers = [value for value in (stated, expected) if isinstance(value, int | float) and not isinstance(value, bool)]
    if len(numbers) < 2:
        return type(stated) is type(expected) and bool(stated == expected)
    off = abs(stated - expected)
    largest = max(map(abs, numbers))
    return bool(off <= allowed * largest) or stated == expected or all(map(math.isnan, numbers))


def _written(value: Any) -> str:
    return "" if value is None else repr(value)


def _tied(table: Table, albedo_at: AlbedoAt, difference: Difference, stated: Any, expected: Any) -> bool:
    """Return True if a place is one of several with equally large values, among which rounding decides."""
    path = difference.leaf.split(".")
    if "worst" in path and path[-1] != "why":
        return _is_rounding(stated) and _is_rounding(expected)
    if path[:3] == ["error", "between", "wavelength_nm"]:
        nodes = table.wavelength_nm
        within = nodes is not None and nodes[0] <= float(difference.stated or 0.0) <= nodes[-1]
        return _is_rounding(stated) and _is_rounding(expected) and within
    if path in (["largest_albedo", "theta_i_deg"], ["largest_albedo", "wavelength_nm"]):
        return bool(abs(_albedo(table, albedo_at, stated) - _albedo(table, albedo_at, expected)) <= _TIE)
    return False


def _albedo(table: Table, albedo_at: AlbedoAt, place: Mapping[str, Any]) -> float:
    """Return the directional albedo [1] at the place of a largest one; nan where there is no such place."""
    at, nm = place["theta_i_deg"], place["wavelength_nm"]
    nodes = [None] if table.wavelength_nm is None else table.wavelength_nm.tolist()
    if not (isinstance(at, float) and 0.0 <= at <= 90.0 and nm in nodes):
        return math.nan
    return float(albedo_at(np.array([at]), LARGEST_TOLERANCE)[0, nodes.index(nm)])


def _is_rounding(error: Any) -> bool:
    """Return whether the largest of a stated error is rounding, which any place has."""
    return isinstance(error, Mapping) and (error.get("worst") or {}).get("why") == _ROUNDING


def _of_request(metadata: TableMetadata) -> Iterator[Difference]:
    """Yield the digest of the request if it is another one, and what the request says other than the attributes."""
    request = metadata.request if metadata.measured is not None else metadata.whole_request  # of data there is a file
    expected = None if metadata.request is None or request is None else digest(request)
    if metadata.request_sha256 != expected:
        yield Difference(leaf="request_sha256", stated=_written(metadata.request_sha256), expected=_written(expected))
    known = metadata.measured
    if (
        known is not None
        and (file := (metadata.request or {}).get("file_sha256", known.file_sha256)) != known.file_sha256
    ):
        yield Difference(leaf="measured.file_sha256", stated=_written(known.file_sha256), expected=_written(file))


def _of_presets(table: Table) -> Iterator[Difference]:
    """Yield how a material differs from the preset of its name, or from all those that cite the same."""
    material = table.source
    if not isinstance(material, Material):
        return
    known = {name: preset for library in libraries() for name, preset in presets(library).items()}
    same_name = known.get(material.name)
    cited = [preset for preset in known.values() if preset.source == material.source]
    if same_name is not None:
        one = min((same_name, exact_material(same_name)), key=lambda other: other.model != material.model)
        stated, expected = (either.document()["material"] for either in (material, one))
        yield from differences(stated, expected, "source_record.material", measured=False)
    elif cited and not any(_numbers(material) in (_numbers(other), _numbers(exact_material(other))) for other in cited):
        none = "one of these parameters, which no preset takes from there,"
        yield Difference(leaf="source_record.material.source", stated=_written(material.source), expected=none)


def _numbers(material: Material) -> tuple[Any, ...]:
    return material.model, material.file_parameters(), material.refractive_index


def _of_reason(table: Table) -> Iterator[Difference]:
    """Yield what the reason for a layout says of its table if it is not so."""
    request = table.metadata.request or {}
    tolerance = request.get("tolerance")
    reason = table.metadata.reason
    if isinstance(tolerance, float) and isinstance(table.source, Material):
        expected = first_reason(table, tolerance)
        if "takes" in reason and expected not in reason:
            yield Difference(leaf="reason", stated=_written(reason), expected=_written(expected))


def _of_function(table: Table) -> Iterator[Difference]:
    """Yield the largest albedo that a table states of its function, if its lookups have another, beyond its error."""
    stated = table.metadata.largest_albedo
    if stated is None or stated.albedo is None or table.error is None or not isinstance(table.source, FunctionRecord):
        return
    place = {"theta_i_deg": stated.theta_i_deg, "wavelength_nm": stated.wavelength_nm}
    looked_up = _albedo(table, albedo_of(table, None), place)
    if not abs(stated.albedo - looked_up) <= max(map(max, table.error.p99)) * stated.albedo + stated.tolerance:
        yield Difference(leaf="largest_albedo.albedo", stated=_written(stated.albedo), expected=f"{looked_up:.4g}")
    grazing = stated.grazing
    if grazing is not None and grazing.max_albedo is not None and grazing.max_albedo < stated.albedo - stated.tolerance:
        expected = f"at least {stated.albedo:.4g}"
        yield Difference(
            leaf="largest_albedo.grazing.max_albedo", stated=_written(grazing.max_albedo), expected=expected
        )


def _of_bits(table: Table) -> Iterator[Difference]:
    """Yield the stated number of bits if the stored values have another."""
    bits = table.metadata.bits
    values = table.values
    stored = np.array_equal(rounded(values, bits), values, equal_nan=True)
    fewer = bits > 1 and np.array_equal(rounded(values, bits - 1), values, equal_nan=True)
    if not stored or (fewer and np.unique(values).size > _DISTINCT):
        yield Difference(leaf="bits", stated=_written(bits), expected="another number, that of the stored values,")
