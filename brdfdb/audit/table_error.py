"""The difference of a table from its model: its size at fresh directions, its stated size, and maps of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from pydantic import Field

from brdfdb.audit.finding import LAST, Cell, Finding, NotJudged, Sentence, Subject, Verdict, Word
from brdfdb.audit.nodes import Nodes
from brdfdb.audit.pairs import SEED, ComparedPairs, representative_nm
from brdfdb.audit.statement import Disagreement, contradictions, disagreements
from brdfdb.figure import Map, Panel, number, rows
from brdfdb.geometry import radians, spherical_angles, unit_vector
from brdfdb.materials import Source
from brdfdb.notebook import error_in_words
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.albedo import wavelengths_of
from brdfdb.tables.table import Table

# Tolerance of the specular part, which is stored as float32: measured 6e-8
SPECULAR_TOLERANCE = 1e-6
_STEP_DEG = 3.0  # step of the maps
_LAST_DEG = 89.0
# smaller errors are drawn as LEAST, because zero has no logarithm; all maps share one scale
LEAST = 1e-6
_MOST = 1.0
# Azimuth [degree] of viewers at negative theta_r
_PLANES = {"in the plane of incidence": 0.0, "across the plane of incidence": 90.0}
DIRECTIONS = 3000  # number of directions at which changed models are evaluated
MUCH_BETTER = 0.5  # largest mean error with the change, as a share of the mean error without it
_TURNS_DEG = range(15, 180, 15)  # angles below half a turn, because a lobe with two axes repeats after half a turn
_SCALE = 0.01  # smallest difference of a scale from 1 that is reported

Directions = tuple[Floats, Floats]


class TableError(Finding):
    """The difference of the table from the model: maps over planes of incidence, and the stated error under test."""

    key = "table_error"
    order = 6
    explanation = (
        "|table − model|, divided by the model, or by a thousandth of the Lambertian BRDF of the same albedo if this "
        "is larger. 99 of 100 values are below the number shown. The error measured at fresh directions comes first, "
        "then the stated error of the table. Two samples differ by chance. The stated mean, median, 95th and 99th "
        "percentile and maximum of each band of theta_i and each wavelength are compared with the fresh ones. A stated "
        "number violates if a correct table would differ as much with a probability below 10⁻⁹."
    )

    stated_p99: float | None = Field(description="null: the table states no error, and need not state one")
    fresh_p99: float | None = Field(description="null: not finite")
    specular: float | None = Field(
        description="largest difference of the stored specular part from the model's; null: none, or not finite"
    )
    directions: int
    contradictions: list[str] = Field(description="a sentence on each contradiction within the stated error")
    disagreements: int = Field(description="number of stated errors that fresh directions contradict")
    worst: list[Disagreement] = Field(description="the worst of these for each statistic")
    bias: float | None = Field(
        description="signed: integral of (table - model) cos theta_r over that of the model, mean of all directions at "
        "the worst wavelength; null: not finite"
    )
    likeness: str = Field(description="changed model with which the table agrees much better; empty: none")
    maps: list[Map] = Field(description="relative error over theta_i and theta_r, negative back towards the light")
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Compare the error of a table with its stated error."""
        if subject.source is None:
            needs = "the error of a table is measured against its source"
            measured = subject.table.metadata.measured
            if measured is not None and measured.simulation is not None:
                errors = "; ".join(measured.simulation.errors_in_words())
                return NotJudged(reason=f"{needs}; {subject.without}; {errors}")
            return subject.not_judged(needs)
        return table_error_of(subject.smooth, subject.source, subject.pairs, subject.findings[Nodes.key].verdict)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on the error, and on each fault of the stated error."""
        fresh = "its error (p99) is not finite"
        if self.fresh_p99 is not None:
            fresh = f"99 of 100 fresh values are within {error_in_words(self.fresh_p99)}"
        stated = "states none" if self.stated_p99 is None else f"states {error_in_words(self.stated_p99)}"
        bias = "" if self.bias is None else f", on average off by {number(100.0 * self.bias, 2)} % of the model"
        mirror = ""
        if self.specular is not None:
            mirror = f"; the specular part is off by up to {number(self.specular)}"
        wrong = [f"its stated error contradicts itself: {sentence}" for sentence in self.contradictions]
        if self.worst:
            worst = "; ".join(disagreement.text for disagreement in self.worst)
            wrong.append(f"{self.disagreements} numbers of its stated error disagree with fresh directions: {worst}")
        if self.likeness:
            wrong.append(f"the table agrees with {self.likeness}")
        return [self.sentence(self.verdict, "; ".join([f"{fresh}{bias}; the table {stated}{mirror}", *wrong]))]

    def cells(self) -> list[Cell]:
        """Return the error at fresh directions, and the stated one."""
        word: Word = "unknown" if self.stated_p99 is None and self.verdict == "passes" else self.verdict
        stated = "" if self.stated_p99 is None else f", {error_in_words(self.stated_p99)} stated"
        if self.fresh_p99 is None:
            return [Cell(word, f"not finite{stated}", LAST)]
        measured = error_in_words(self.fresh_p99)
        more = self.stated_p99 is not None and self.fresh_p99 > self.stated_p99 and f", {measured} stated" != stated
        chance = ", within chance" if more and self.verdict == "passes" else ""
        return [Cell(word, f"{measured} measured{stated}{chance}", self.fresh_p99)]

    def figures(self) -> list[Panel | Map]:
        """Return the maps of the error over planes of incidence."""
        return list(self.maps)


def table_error_of(table: Table, source: Source, pairs: ComparedPairs, nodes: Word = "passes") -> TableError:
    """Return the error of a table compared with its stated error, and maps of it at the middle wavelength.

    `nodes` is the verdict on its nodes. If it or the error violates, the fault of the table is searched for.
    """
    with np.errstate(invalid="ignore"):  # values that are not finite
        fresh = error_measurement.compare(pairs.table, pairs.model, pairs.drawn, SEED).overall.p99
    contradicting: list[str] = []
    disagreeing: list[Disagreement] = []
    if table.error is not None:
        contradicting = contradictions(table.error, wavelengths_of(table))
        disagreeing = [] if contradicting else disagreements(table.error, pairs, table.wavelength_nm)
    specular = _specular_error(table, source)
    mirrors = specular is None or specular <= SPECULAR_TOLERANCE  # False for nan
    good = mirrors and not contradicting and not disagreeing
    floor = error_measurement.floor_of(pairs.model, pairs.drawn)
    middle = floor[[floor.size // 2]]
    return TableError(
        stated_p99=None if table.error is None else table.error.overall.p99,
        fresh_p99=fresh if np.isfinite(fresh) else None,
        specular=None if specular is None or not np.isfinite(specular) else specular,
        directions=int(np.count_nonzero(pairs.drawn.above)),
        contradictions=contradicting,
        disagreements=len(disagreeing),
        worst=list({disagreement.statistic: disagreement for disagreement in reversed(disagreeing)}.values())[::-1],
        bias=bias_of(pairs),
        likeness="" if good and nodes == "passes" else likeness_of(table, source, pairs),
        maps=[_map(table, source, middle, *plane) for plane in _PLANES.items()],
        verdict="passes" if good else "violates",
    )


def _specular_error(table: Table, source: Source) -> float | None:
    """Return the largest difference [1] of the stored specular part from that of the source, or None."""
    if table.specular is None or not source.has_specular:
        return None
    nodes = table.axes_deg["theta_i"] if table.specular_theta_deg is None else table.specular_theta_deg
    truth = source.specular_reflectance(radians(nodes), table.wavelength_nm)
    return float(f"{np.max(np.abs(table.specular.reshape(truth.shape) - truth)):.3g}")


def _map(table: Table, source: Source, floor: Floats, title: str, delta_phi_deg: float) -> Map:
    wavelength = representative_nm(table)
    theta_i_deg = np.append(np.arange(0.0, _LAST_DEG, _STEP_DEG), _LAST_DEG)
    theta_r_deg = np.concatenate([-theta_i_deg[:0:-1], theta_i_deg])
    # A viewer at -theta is on the other side of the normal. Negative angles are back towards the light
    wi = unit_vector(radians(theta_i_deg), 0.0)[:, np.newaxis]
    wr = unit_vector(-radians(theta_r_deg), radians(delta_phi_deg))
    wi, wr = (np.reshape(w, (-1, 3)) for w in np.broadcast_arrays(wi, wr))
    values = table.lookup_vectors(wi, wr, wavelength)
    truth = error_measurement.model_values(source, None if wavelength is None else np.array([wavelength]), wi, wr)[:, 0]
    with np.errstate(invalid="ignore"):
        error = error_measurement.relative(values, truth, floor).reshape(theta_i_deg.size, -1)
    return Map(
        title=f"Error {title}" if wavelength is None else f"Error {title}, {wavelength:g} nm",
        x_label="theta_r [degrees], negative back towards the light",
        y_label="theta_i [degrees]",
        value_label=f"abs(table - model) / model, no less than {LEAST:g}",
        x=theta_r_deg.tolist(),
        y=theta_i_deg.tolist(),
        values=rows(np.maximum(error, LEAST), 2),
        log=True,
        low=LEAST,
        high=_MOST,
    )


def bias_of(pairs: ComparedPairs) -> float | None:
    """Return the signed mean error [1] at the wavelength where it is largest; positive if the table is too bright."""
    weight = pairs.drawn.weight
    whole = weight @ pairs.model
    with np.errstate(invalid="ignore"):
        signed = np.divide(weight @ (pairs.table - pairs.model), whole, out=np.zeros_like(whole), where=whole > 0.0)
    largest = float(signed[np.argmax(np.abs(signed))])
    return float(f"{largest:.3g}") if np.isfinite(largest) else None


def likeness_of(table: Table, source: Source, pairs: ComparedPairs) -> str:
    """Return, in words, the changed model with which a table agrees at least twice as well; empty if there is none."""
    chosen = np.flatnonzero(pairs.drawn.above)[:: max(len(pairs.drawn.wi) // DIRECTIONS, 1)]
    middle = pairs.table.shape[1] // 2
    wavelength = representative_nm(table)
    at = None if wavelength is None else np.array([wavelength])
    values = pairs.table[chosen, middle]
    truth = pairs.model[chosen, middle]
    weight = pairs.drawn.weight[chosen]
    if not np.isfinite(values).all():
        return ""
    light, viewer = pairs.drawn.wi[chosen], pairs.drawn.wr[chosen]
    errors = {"": weight @ np.abs(values - truth)}
    scale = float(weight @ values / (weight @ truth)) if weight @ truth > 0.0 else 1.0
    if abs(scale - 1.0) > _SCALE:
        errors[f"the model times {scale:.3g}"] = weight @ np.abs(values - scale * truth)
    for name, changed in _changes(source.anisotropic):
        model = error_measurement.model_values(source, at, *changed(light, viewer))[:, 0]
        errors[name] = weight @ np.abs(values - model)
    best = min(errors, key=lambda name: errors[name])
    return best if errors[best] < MUCH_BETTER * errors[""] else ""


def _changes(anisotropic: bool) -> Iterator[tuple[str, Callable[[Floats, Floats], Directions]]]:
    yield "the model with light and viewer exchanged", lambda wi, wr: (wr, wi)
    yield "the model seen from the other side, delta_phi of 180 degrees for 0", lambda wi, wr: (wi, _turned(wr, 180.0))
    yield "the model with theta counted from the horizon", lambda wi, wr: (_upended(wi), _upended(wr))
    if not anisotropic:
        return
    yield "the model in a mirror, -phi for phi", lambda wi, wr: (_mirrored(wi), _mirrored(wr))
    for angle in _TURNS_DEG:
        yield (
            f"the model turned by {angle} degrees",
            lambda wi, wr, by=float(angle): (_turned(wi, by), _turned(wr, by)),  # type: ignore[misc]
        )


def _turned(w: Floats, degrees: float) -> Floats:
    """Return unit vectors turned about the normal."""
    cos, sin = np.cos(radians(degrees)), np.sin(radians(degrees))
    return np.stack([cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]], axis=-1)


def _mirrored(w: Floats) -> Floats:
    return np.asarray(w * np.array([1.0, -1.0, 1.0]))


def _upended(w: Floats) -> Floats:
    """Return unit vectors with the complements of their polar angles."""
    theta, phi = spherical_angles(w)
    return unit_vector(np.clip(np.pi / 2.0 - theta, 0.0, np.pi / 2.0 - 1e-9), phi)
