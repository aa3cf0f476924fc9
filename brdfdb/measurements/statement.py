"""Statement on samples: what they cover and integrate to, whether they are reciprocal, and what looks wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from brdfdb.errors import counted
from brdfdb.geometry import degrees
from brdfdb.measurements.conventions import NODES, numbers_of, remedy
from brdfdb.measurements.exchanges import exchanged_rows
from brdfdb.measurements.hypotheses import doubts
from brdfdb.measurements.incidences import BAND_DEG, PEAK, Incidence, incidences_of
from brdfdb.measurements.mueller import frame_doubt, polarised_sentences
from brdfdb.measurements.samples import Samples, notes_of, percent
from brdfdb.measurements.symmetry import are_bright, asymmetries
from brdfdb.parameters import Floats

_SAME_DEG = 0.01  # directions closer than this count as the same
_ALL_COVERED = 0.999  # share of the disk from which on the rest is not spoken of
_CLAIM = 0.05  # relative difference of a header from its own values that is stated
_JUDGED = 1.0 - _CLAIM  # share of the disk from which on viewers tell an albedo well enough for it
_SHOWN = 6  # incidences in sentences
_MISSING = np.array([-1.0, -99.0, -999.0, -9999.0])  # numbers that files write for values that are missing
_FILLED = np.array([9.99, 99.99, 999.99, 99999.0, 1e20, 9.96921e36])  # the same above 0; the last two are of netCDF
_MANY = 3  # equal values that may be marks
_ABOVE_FLOOR = 5.0  # of the smallest value that is none of many marks to them
_FAR = 10.0  # times the largest other value is where a number is a mark
_FEWEST = 5  # values of a channel


@dataclass(frozen=True)
class Claim:
    """A total integrated scatter that a header states for a channel, and what its own values integrate to [1].

    With `at_least` viewers surround too little for an albedo: `integrated` is the integral over what they surround.
    `known` is False if values cannot judge the claim: it is above such an integral, or the lobe is narrower than the
    steps.
    """

    theta_i_deg: float
    channel: str
    claimed: float
    integrated: float
    at_least: bool
    known: bool

    @property
    def relative(self) -> float:
        """Relative difference of the claim from the integral [1]."""
        return self.claimed / self.integrated - 1.0


@dataclass(frozen=True)
class SampleStatement:
    """Statement on samples: the angles that they cover, the values that they hold, and what contradicts."""

    name: str
    channels: tuple[str, ...]
    samples: int  #: number of directions
    nodes: bool  #: True if the directions are nodes of a grid
    lights: int  #: number of directions of the light
    theta_i_deg: tuple[float, float]  #: smallest and largest polar angle of the light
    theta_r_deg: tuple[float, float]  #: smallest and largest polar angle of the viewer
    turned: bool  #: True if the light comes from several azimuths
    one_side: bool  #: True if viewers are on one side of the plane of incidence; integrals mirror it to the other
    holes: int  #: number of values that are missing
    negative: int  #: number of values below 0
    zeros: int  #: number of values that are exactly 0 while others are not: many files write 0 for a hole
    constant: bool  #: True if f_r of each channel is the same at all directions
    largest: float  #: largest value [1/sr]
    largest_at_deg: tuple[float, float, float]  #: theta_i, theta_r and the difference of the azimuths there
    uncertainty: float | None  #: median of the standard uncertainties over the absolute values [1]; None: not stated
    wavelength_nm: tuple[float, float] | None  #: smallest and largest wavelength; None: not stated
    in_bands: bool  #: True if directions are scattered, and `incidences` are bands of theta_i at any azimuth
    incidences: tuple[Incidence, ...]  #: directions of the light with viewers enough
    reciprocity: ExchangedPairs | None  #: None if no sample is the swap of another
    claims: tuple[Claim, ...]  #: claims of the header that can be compared
    notes: tuple[str, ...]  #: sentences on what the reader did to the file
    hints: tuple[str, ...]  #: sentences on what looks wrong, with the option that mends it
    untold: tuple[str, ...]  #: a sentence on what the file may mean and its samples cannot tell

    @property
    def sentences(self) -> tuple[str, ...]:
        """The statement in sentences."""
        return (
            *self._on_angles(),
            *self._on_values(),
            *self._on_albedo(),
            *self._on_pairs(),
            *self._on_claims(),
            *self.notes,
            *self.untold,
            *self.hints,
        )

    def document(self) -> dict[str, Any]:
        """Return the statement as JSON."""
        largest = self.largest if np.isfinite(self.largest) else None
        return {**asdict(self), "largest": largest, "sentences": list(self.sentences)}

    def _on_angles(self) -> list[str]:
        lights = counted(self.lights, "direction") + " of the light"
        channels = counted(len(self.channels), "channel")
        low, high = self.theta_i_deg
        samples = counted(self.samples, "node" if self.nodes else "sample")
        around = "from several azimuths" if self.turned else "from one azimuth"
        text = f"{samples} of {channels}: {lights}, {around}, theta_i {low:.4g} to {high:.4g} degrees"
        text += f"; theta_r {self.theta_r_deg[0]:.4g} to {self.theta_r_deg[1]:.4g} degrees."
        side = ["All viewers are on one side of the plane of incidence; the other is assumed to be its mirror image."]
        return [text, *(side if self.one_side and self.incidences else [])]

    def _on_values(self) -> list[str]:
        theta_i, theta_r, turn = self.largest_at_deg
        where = f"theta_i {theta_i:.4g}, theta_r {theta_r:.4g} and an azimuth of {turn:.4g} degrees from the light"
        counts = f"{counted(self.holes, 'hole')}, {counted(self.negative, 'negative value')}"
        lines = [f"{counts}; the largest value is {self.largest:.4g} /sr at {where}."]
        if self.wavelength_nm is not None:
            low, high = self.wavelength_nm
            lines.append(f"Wavelengths: {low:.9g} to {high:.9g} nm." if high > low else f"Wavelength: {low:.9g} nm.")
        elif self.channels == ("grey",):
            lines.append("No wavelength is stated; --wavelength-nm states one.")
        if self.uncertainty is not None:
            lines.append(f"Standard uncertainties are stated: {percent(self.uncertainty)} of f_r in the median.")
        if self.constant:
            of_channel = "f_r of each channel" if len(self.channels) > 1 else "f_r"
            lines.append(f"{of_channel} is the same at all directions: the samples do not show its shape.")
        if self.zeros:
            lines.append(f"{counted(self.zeros, 'value')} of exactly 0: integrals and pairs treat them as holes.")
        return lines

    def _on_albedo(self) -> list[str]:
        if not self.incidences:
            return ["No albedo: no direction of the light has viewers around the hemisphere."]
        numbers = np.unique(np.linspace(0, len(self.incidences) - 1, _SHOWN).astype(int))
        lines = []
        for some in (self.incidences[number] for number in numbers):
            azimuth = f", phi_i {some.phi_i_deg:.4g}" if self.turned and not self.in_bands else ""
            text = f"Albedo at theta_i {some.theta_i_deg:.4g}{azimuth}: {_shown(self.channels, some.albedo)}"
            if some.covered < _ALL_COVERED:
                inside = _shown(self.channels, some.measured)
                text += f"; viewers surround {100.0 * some.covered:.3g} % of the hemisphere, with {inside}"
            if some.peak > PEAK:
                text += f"; unknown: one viewer contributes {percent(some.peak)} of it"
                text += ", because the lobe is narrower than the steps"
            lines.append(f"{text}.")
        if self.in_bands:
            lines.append(
                f"Directions are scattered: these are lights within {BAND_DEG:g} degree, as if azimuths did not matter."
            )
        if len(numbers) < len(self.incidences):
            lines.append(f"{len(self.incidences)} directions of the light are integrated in all.")
        return lines

    def _on_pairs(self) -> list[str]:
        if self.reciprocity is None:
            return ["Reciprocity: no sample is the swap of another."]
        pairs = self.reciprocity
        return [
            f"Reciprocity: {counted(pairs.pairs, 'pair')} of {'nodes' if self.nodes else 'samples'} "
            f"with light and viewer exchanged; asymmetry |f - f'| / (|f| + |f'|) of these: "
            f"median {100.0 * pairs.median:.3g} %, largest {100.0 * pairs.largest:.3g} %."
        ]

    @property
    def wrong_claims(self) -> tuple[Claim, ...]:
        """The claims of the header that its own values contradict."""
        return tuple(claim for claim in self.claims if claim.known and abs(claim.relative) > _CLAIM)

    def _on_claims(self) -> list[str]:
        lines = []
        for claim in self.wrong_claims:
            size = f"{percent(abs(claim.relative))} {'low' if claim.relative < 0.0 else 'high'}"
            of_channel = f" ({claim.channel})" if len(self.channels) > 1 else ""
            text = f"The header claims {claim.claimed:.4g} at theta_i {claim.theta_i_deg:.4g}{of_channel}"
            least = "at least " if claim.at_least else ""
            lines.append(f"{text}, and its own values integrate to {least}{claim.integrated:.4g}: the claim is {size}.")
        if agree := sum(claim.known for claim in self.claims) - len(self.wrong_claims):
            lines.append(
                f"{counted(agree, 'claim')} of the header {'agrees' if agree == 1 else 'agree'} with its values."
            )
        if open_ones := sum(not claim.known for claim in self.claims):
            why = "viewers surround too little of the hemisphere, or steps are wider than the lobe"
            lines.append(f"{counted(open_ones, 'claim')} of the header cannot be judged: {why}.")
        return lines


def statement(samples: Samples, progress: Callable[[float], None] | None = None) -> SampleStatement:
    """Return what samples cover, what they integrate to, and what looks wrong.

    The record of the samples may hold ``tis``, the total integrated scatter that a header claims, with the channels
    last, over ``theta_i_deg`` before. `progress` is called with the share [1] that is done. MissingExtraError if SciPy,
    which triangulates, is not installed.

    Notes
    -----
    The viewers of a direction of the light are points of the unit disk, whose areas are projected solid angles. On the
    Delaunay triangles of the points f_r is linear. Between them and the rim of the disk it is that of the point closest
    to the rim. Zeros are taken for holes where less than half of the values are 0.
    """
    theta_i = degrees(samples.theta_i)
    theta_r = degrees(samples.theta_r)
    delta = degrees(samples.phi_r - samples.phi_i) % 360.0
    known = samples.known
    in_plane = (np.abs(delta % 180.0 - 90.0) > 89.99) | (theta_r == 0.0)
    one_side = not samples.turned and any(np.all(in_plane | side) for side in (delta < 180.0, delta > 180.0))
    zeros = samples.values == 0.0
    zeros = zeros if 0 < zeros.sum() < 0.5 * zeros.size else np.zeros_like(zeros)
    full = replace(samples, values=np.where(zeros, np.nan, samples.values)) if zeros.any() else samples
    integrated, in_bands = incidences_of(full, delta, progress, one_side=one_side)
    judged = doubts(samples, integrated, one_side=one_side)
    at = samples.wavelength_nm
    uncertainty = None
    if samples.uncertainty is not None:
        stated = np.isfinite(samples.uncertainty) & known & (samples.values != 0.0)
        relative = samples.uncertainty[stated] / np.abs(samples.values[stated])
        uncertainty = float(np.median(relative)) if stated.any() else None
    peak = np.unravel_index(int(np.argmax(np.where(known, samples.values, -np.inf))), samples.values.shape)[0]
    return SampleStatement(
        name=samples.name,
        channels=samples.channels,
        samples=len(samples),
        nodes=bool(samples.record.get(NODES)),
        lights=int(samples.incidence.max()) + 1,
        theta_i_deg=_ends(theta_i),
        theta_r_deg=_ends(theta_r),
        turned=samples.turned,
        one_side=one_side,
        holes=int(np.sum(~known)),
        negative=int(np.sum(samples.values < 0.0)),
        zeros=int(np.sum(zeros)),
        constant=is_constant(samples),
        largest=float(np.nanmax(samples.values)) if known.any() else np.nan,
        largest_at_deg=(float(theta_i[peak]), float(theta_r[peak]), float(delta[peak])),
        uncertainty=uncertainty,
        wavelength_nm=None if at is None else _ends(at),
        in_bands=in_bands,
        incidences=integrated,
        reciprocity=reciprocity_of(full, one_side),
        claims=_claims(samples, integrated),
        notes=(*notes_of(samples.record), *polarised_sentences(samples)),
        hints=(*frame_doubt(samples), *missing(samples), *judged.hints),
        untold=judged.untold,
    )


def _ends(numbers: Floats) -> tuple[float, float]:
    """Return the smallest and the largest of numbers."""
    return float(numbers.min()), float(numbers.max())


def _claims(samples: Samples, incidences: Sequence[Incidence]) -> tuple[Claim, ...]:
    """Return the total integrated scatter of the header beside the integrals of the values."""
    at = np.asarray(samples.record.get("theta_i_deg", []), dtype=np.float64).reshape(-1)
    try:
        tis = np.asarray(samples.record.get("tis", []), dtype=np.float64).reshape(-1, at.size, len(samples.channels))
    except ValueError:
        return ()
    claims: list[Claim] = []
    for incidence in incidences:
        if not at.size or len(tis) != 1 or (nearest := int(np.argmin(np.abs(at - incidence.theta_i_deg)))) < 0:
            continue
        if abs(at[nearest] - incidence.theta_i_deg) < _SAME_DEG:
            at_least = incidence.covered < _JUDGED
            values = incidence.measured if at_least else incidence.albedo
            for channel, claimed, value in zip(samples.channels, tis[0, nearest].tolist(), values, strict=True):
                known = incidence.peak <= PEAK and (not at_least or claimed < (1.0 - _CLAIM) * value)
                if value > 0.0:
                    claims.append(Claim(incidence.theta_i_deg, channel, claimed, value, at_least, known))
    return tuple(claims)


def _shown(channels: tuple[str, ...], values: tuple[float, ...]) -> str:
    """Return values of channels as text: all of up to three, else the smallest and the largest."""
    if len(channels) == 1:
        return _digits(values[0])
    low, high = int(np.argmin(values)), int(np.argmax(values))
    some = range(len(channels)) if len(channels) <= 3 else (low, high)
    return (", " if len(channels) <= 3 else " to ").join(f"{_digits(values[at])} ({channels[at]})" for at in some)


def _digits(value: float) -> str:
    """Return a number with four digits behind the point, and no more than four that count."""
    return f"{value:.4f}" if 1e-3 <= abs(value) < 1.0 or value == 0.0 else f"{value:.4g}"


@dataclass(frozen=True)
class ExchangedPairs:
    """Asymmetry abs(a - b) / (abs(a) + abs(b)) [1] of samples that are each other's swap of light and viewer."""

    pairs: int
    median: float
    largest: float


def reciprocity_of(samples: Samples, one_side: bool) -> ExchangedPairs | None:
    """Return the asymmetry of samples that are each other's swap; None without any."""
    first, second = exchanged_rows(samples, one_side)
    a = samples.values[first]
    b = samples.values[second]
    level = float(np.nanmedian(np.abs(samples.values))) if samples.known.any() else 0.0
    pairs = int(np.sum(are_bright(a, b, level).any(axis=1)))
    if not pairs:
        return None
    asymmetry = asymmetries(a, b, level)
    return ExchangedPairs(pairs, float(np.median(asymmetry)), float(asymmetry.max()))


def missing(samples: Samples) -> tuple[str, ...]:
    """Return whether negative values, or the largest, look like marks of missing ones, in a sentence."""
    known = samples.values[samples.known]
    scale = np.pi if samples.record.get("quantity") == "reflectance_factor" else 1.0
    low = float(known.min(initial=0.0))
    if low >= 0.0:
        return _missing_above(known, scale) or _floor(samples)
    if not np.any(known > 0.0):
        return ("Sign? No value is above 0, but f_r is never negative: these values cannot be tabulated or fitted.",)
    number = low * scale
    marks = np.isclose(known, low, rtol=1e-9, atol=0.0)
    count = int(marks.sum())
    others = known[~marks]
    if not others.size or (count == 1 and not np.isclose(number, _MISSING).any()):
        return ()
    far = low < -float(np.abs(others).max()) and low < 10.0 * min(float(others.min()), 0.0)
    return (_marks(count, number),) if far or np.isclose(number, _MISSING).any() else ()


def _marks(count: int, number: float) -> str:
    """Return a sentence on values that look like marks of missing ones."""
    verb, they = ("is", "does it") if count == 1 else ("are", "do they")
    return f"{counted(count, 'value')} {verb} {number:.4g}: {they} mean missing?"


def _missing_above(known: Floats, scale: float) -> tuple[str, ...]:
    """Return whether the largest values look like marks of missing ones: nines that are far above the others."""
    high = float(known.max(initial=0.0))
    marks = np.isclose(known, high, rtol=1e-9, atol=0.0)
    count = int(marks.sum())
    others = known[~marks]
    nines = np.isclose(high * scale, -_MISSING).any() or np.isclose(high * scale, _FILLED, rtol=1e-6).any()
    if not others.size or not nines or high <= _FAR * float(others.max()):
        return ()
    return (_marks(count, high * scale),)


def _floor(samples: Samples) -> tuple[str, ...]:
    """Return whether the smallest values look like marks of missing ones: one number many times, far below others."""
    quantity = str(samples.record.get("quantity", "f_r"))
    numbers = numbers_of(quantity, samples.values, samples.theta_i, samples.theta_r)[samples.known]
    numbers = numbers[np.isfinite(numbers) & (numbers > 0.0)]
    marks = np.isclose(numbers, numbers.min(initial=np.inf), rtol=1e-6, atol=0.0)
    others = numbers[~marks]
    if not _MANY <= marks.sum() < numbers.size / 2 or others.min() < _ABOVE_FLOOR * numbers.min():
        return ()
    number = f"{numbers.min():.6g}"
    text = f"{marks.sum()} values are {number}, and no other is below {others.min():.4g}"
    how = remedy(samples.record, f"--missing {number} reads them as holes")
    return (f"Holes? {text}: if they mean missing, {how}.",)


def is_constant(samples: Samples) -> bool:
    """Return True if f_r of each channel with a few values is the same at all directions."""
    seen = samples.known.sum(axis=0) >= _FEWEST
    values = np.where(samples.known, samples.values, np.nan)[:, seen]
    return bool(seen.any() and np.all(np.nanmin(values, axis=0) == np.nanmax(values, axis=0)))
