"""Statement on samples: what they cover and integrate to, whether they are reciprocal, and what looks wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import counted
from brdfdb.geometry import degrees
from brdfdb.measurements._disk import averaged, integrals
from brdfdb.measurements._notes import notes_of
from brdfdb.measurements._swaps import Reciprocity, reciprocity_of
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

_FEWEST_VIEWERS = 12  # of an incidence that is integrated
_MOST_INCIDENCES = 400  # that are integrated, evenly among all
_BANDS_DEG = (10.0, 30.0, 50.0, 70.0)  # incidences of scattered directions, each with those within _BAND_DEG
_BAND_DEG = 1.0
_MOST_IN_BAND = 20_000
_SAME_DEG = 0.01  # directions of the light closer than this are one
_ALL_COVERED = 0.999  # share of the disk from which on the rest is not spoken of
_PEAK = 0.1  # share of one viewer in an albedo from which on it is not known
_CLAIM = 0.05  # relative difference of a header from its own values that is stated
_EXCESS = 1.02  # albedo above which the unit is doubted
_BLACK = 2e-4  # albedo below which the unit is doubted: the blackest coatings reflect more
_MISSING = np.array([-1.0, -99.0, -999.0, -9999.0])  # numbers that files write for values that are missing
_SHOWN = 6  # incidences in sentences


@dataclass(frozen=True)
class Incidence:
    """Albedo of one direction of the light: the integral of its samples.

    Attributes
    ----------
    theta_i_deg, phi_i_deg : float [degree]
        Direction of the light.
    viewers : int
        Directions of the viewer.
    covered : float [1]
        Share of the projected solid angle of the hemisphere that the viewers surround, of the channel with most holes.
    measured : tuple of float [1]
        Integral of f_r cos(theta_r) over what is covered, of each channel.
    albedo : tuple of float [1]
        The same over the hemisphere; beyond the viewers f_r is that of the nearest one.
    peak : float [1]
        Largest share of one viewer in the albedo of a channel. Above a tenth the lobe is narrower than the steps
        between viewers, and the albedo is not known.
    """

    theta_i_deg: float
    phi_i_deg: float
    viewers: int
    covered: float
    measured: tuple[float, ...]
    albedo: tuple[float, ...]
    peak: float


@dataclass(frozen=True)
class Claim:
    """A total integrated scatter that a header states, and what its own values integrate to.

    Attributes
    ----------
    theta_i_deg : float [degree]
        Polar angle of the light.
    channel : str
        Channel.
    claimed, integrated : float [1]
        Number of the header, and the albedo of its values.
    """

    theta_i_deg: float
    channel: str
    claimed: float
    integrated: float

    @property
    def relative(self) -> float:
        """Relative difference of the claim from the integral [1]."""
        return self.claimed / self.integrated - 1.0


@dataclass(frozen=True)
class Statement:
    """Statement on samples: the angles that they cover, the values that they hold, and what contradicts.

    Attributes
    ----------
    name : str
        Name of the samples.
    channels : tuple of str
        Names of the channels.
    samples : int
        Number of directions.
    lights : int
        Number of directions of the light.
    theta_i_deg, theta_r_deg : (float, float) [degree]
        Smallest and largest polar angle of the light and of the viewer.
    turned : bool
        True if the light comes from several azimuths.
    one_side : bool
        True if the viewers are on one side of the plane of incidence, so that integrals take the other for its mirror
        image.
    holes, negative, zeros : int
        Numbers of values that are missing, below 0, and exactly 0 beside others: many files write 0 for a hole.
    largest : float [1/sr]
        Largest value.
    largest_at_deg : (float, float, float) [degree]
        theta_i, theta_r and the difference of the azimuths there.
    in_bands : bool
        True if the directions are scattered, and `incidences` are bands of theta_i, as if azimuths did not matter.
    incidences : tuple of Incidence
        Directions of the light with viewers enough.
    reciprocity : Reciprocity or None
        None if no sample is the swap of another.
    claims : tuple of Claim
        Claims of the header that can be compared.
    notes : tuple of str
        What the reader did to the file, in sentences.
    hints : tuple of str
        What looks wrong, in sentences.
    """

    name: str
    channels: tuple[str, ...]
    samples: int
    lights: int
    theta_i_deg: tuple[float, float]
    theta_r_deg: tuple[float, float]
    turned: bool
    one_side: bool
    holes: int
    negative: int
    zeros: int
    largest: float
    largest_at_deg: tuple[float, float, float]
    in_bands: bool
    incidences: tuple[Incidence, ...]
    reciprocity: Reciprocity | None
    claims: tuple[Claim, ...]
    notes: tuple[str, ...]
    hints: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """The statement in sentences."""
        return (
            *_on_angles(self),
            *_on_values(self),
            *_on_albedo(self),
            *_on_pairs(self),
            *_on_claims(self),
            *self.notes,
            *self.hints,
        )

    def document(self) -> dict[str, Any]:
        """Return the statement as JSON."""
        largest = self.largest if np.isfinite(self.largest) else None
        return {**asdict(self), "largest": largest, "sentences": list(self.sentences)}


def statement(samples: Samples, progress: Callable[[float], None] | None = None) -> Statement:
    """Return what samples cover, what they integrate to, and what looks wrong.

    Parameters
    ----------
    samples : Samples
        Samples. Their record may hold ``tis``, the total integrated scatter that a header claims, with the channels
        last, over ``theta_i_deg`` before.
    progress : callable, optional
        Called with the share [1] that is done.

    Raises
    ------
    MissingExtraError
        If SciPy, which triangulates, is not installed.

    Notes
    -----
    The viewers of a direction of the light are points of the unit disk, whose areas are projected solid angles. On the
    Delaunay triangles of the points f_r is linear. Between them and the rim of the disk it is that of the point closest
    to the rim. Zeros are taken for holes where less than half of the values are 0.
    """
    theta_i, theta_r = degrees(samples.theta_i), degrees(samples.theta_r)
    delta = degrees(samples.phi_r - samples.phi_i) % 360.0
    known = samples.known
    one_side = not samples.turned and bool(np.all((delta < 180.01) | (delta > 359.99) | (theta_r == 0.0)))
    zeros = samples.values == 0.0
    zeros = zeros if 0 < zeros.sum() < 0.5 * zeros.size else np.zeros_like(zeros)
    full = replace(samples, values=np.where(zeros, np.nan, samples.values)) if zeros.any() else samples
    integrated: tuple[Incidence, ...] = ()
    in_bands = False
    for in_bands, groups in ((False, _lights(samples, theta_i)), (True, _bands(theta_i))):
        incidences = []
        for number, rows in enumerate(groups):
            incidences.append(_incidence(full, rows, delta, one_side, in_bands))
            if progress is not None:
                progress((number + 1) / len(groups))
        integrated = tuple(some for some in incidences if some is not None)
        if integrated:
            break
    peak = np.unravel_index(int(np.argmax(np.where(known, samples.values, -np.inf))), samples.values.shape)[0]
    return Statement(
        name=samples.name,
        channels=samples.channels,
        samples=len(samples),
        lights=int(samples.incidence.max()) + 1,
        theta_i_deg=(float(theta_i.min()), float(theta_i.max())),
        theta_r_deg=(float(theta_r.min()), float(theta_r.max())),
        turned=samples.turned,
        one_side=one_side,
        holes=int(np.sum(~known)),
        negative=int(np.sum(samples.values < 0.0)),
        zeros=int(np.sum(zeros)),
        largest=float(np.nanmax(samples.values)) if known.any() else np.nan,
        largest_at_deg=(float(theta_i[peak]), float(theta_r[peak]), float(delta[peak])),
        in_bands=in_bands and bool(integrated),
        incidences=integrated,
        reciprocity=reciprocity_of(full, one_side),
        claims=_claims(samples, integrated),
        notes=notes_of(samples.record),
        hints=(*_sentinels(samples), *_hints(samples, integrated)),
    )


def _lights(samples: Samples, theta_i: Floats) -> list[NDArray[np.intp]]:
    """Return the rows of each direction of the light that has viewers enough, by theta_i."""
    number = samples.incidence
    counts = np.bincount(number)
    enough = np.flatnonzero(counts >= _FEWEST_VIEWERS)
    if not enough.size:
        return []
    some = enough[np.unique(np.linspace(0, enough.size - 1, _MOST_INCIDENCES).astype(int))]
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(counts)
    groups = [order[ends[k] - counts[k] : ends[k]] for k in some]
    return sorted(groups, key=lambda rows: float(theta_i[rows[0]]))


def _bands(theta_i: Floats) -> list[NDArray[np.intp]]:
    """Return the rows of bands of theta_i, for directions of the light that are scattered."""
    bands = [np.flatnonzero(np.abs(theta_i - middle) <= _BAND_DEG) for middle in _BANDS_DEG]
    thinned = [rows[:: max(1, -(-rows.size // _MOST_IN_BAND))] for rows in bands]
    return [rows for rows in thinned if rows.size >= _FEWEST_VIEWERS]


def _incidence(
    samples: Samples, rows: NDArray[np.intp], delta: Floats, one_side: bool, in_bands: bool
) -> Incidence | None:
    """Return what the samples of one direction of the light integrate to; None if the viewers cover too little."""
    radius, turn = np.sin(samples.theta_r[rows]), np.deg2rad(delta[rows])
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    values = samples.values[rows]
    if one_side or in_bands:
        points = np.concatenate([points, points * np.array([1.0, -1.0])])
        values = np.concatenate([values, values])
    points, values = averaged(points, values)
    covered, peak, (measured, albedo) = 1.0, 0.0, np.zeros((2, len(samples.channels)))
    patterns, of_pattern = np.unique(np.isfinite(values), axis=1, return_inverse=True)
    for number, known in enumerate(patterns.T):
        channels = np.flatnonzero(of_pattern.reshape(-1) == number)
        part = integrals(points[known], values[np.ix_(known, channels)])
        if part is None:
            return None
        covered, peak = min(covered, part.covered), max(peak, part.peak)
        measured[channels], albedo[channels] = part.inside, part.whole
    theta_i, phi_i = degrees(samples.theta_i[rows]), degrees(samples.phi_i[rows]) % 360.0
    return Incidence(
        round(float(np.mean(theta_i)), 4),
        0.0 if in_bands else round(float(phi_i[0]), 4) % 360.0,
        len(rows),
        covered,
        tuple(measured.tolist()),
        tuple(albedo.tolist()),
        peak,
    )


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
            claims += [
                Claim(incidence.theta_i_deg, channel, float(claimed), albedo)
                for channel, claimed, albedo in zip(samples.channels, tis[0, nearest], incidence.albedo, strict=True)
                if albedo > 0.0 and incidence.peak <= _PEAK
            ]
    return tuple(claims)


def _hints(samples: Samples, incidences: Sequence[Incidence]) -> tuple[str, ...]:
    """Return what looks wrong with the unit of the values, in sentences."""
    if not samples.known.any():
        return ("There is no value at all.",)
    sound = [max(some.albedo) for some in incidences if some.peak <= _PEAK]
    if sound:
        albedo, how = float(np.median(sound)), "the values integrate to"
    else:
        albedo, how = float(np.pi * np.nanmedian(samples.values)), "pi times the median of f_r is"
    if albedo > _EXCESS:
        reasons = [f"reflectance factors, which make {albedo / np.pi:.3g} when they are divided by pi"]
        if albedo / 100.0 > _BLACK and albedo > 10.0:
            reasons = [
                f"percent, which make {albedo / 100.0:.3g}",
                f"reflectance factors in percent ({albedo / 314.16:.3g})",
            ]
        return (f"Units? An albedo above 1: {how} {albedo:.4g}. The values may be {', or '.join(reasons)}.",)
    if 0.0 <= albedo < _BLACK:
        text = f"Units? Too dark: {how} {albedo:.2g}, and the blackest coatings reflect more."
        return (f"{text} A thousand times is {1e3 * albedo:.2g}.",)
    return ()


def _sentinels(samples: Samples) -> tuple[str, ...]:
    """Return whether negative values look like marks of missing ones, in a sentence with the number of the file."""
    known = samples.values[samples.known]
    low = float(known.min(initial=0.0))
    if low >= 0.0:
        return ()
    number = low * (np.pi if samples.record.get("quantity") == "reflectance_factor" else 1.0)
    marks = np.isclose(known, low, rtol=1e-9, atol=0.0)
    count, others = int(marks.sum()), known[~marks]
    if not others.size or (count == 1 and not np.isclose(number, _MISSING).any()):
        return ()
    far = low < -float(np.abs(others).max()) and low < 10.0 * min(float(others.min()), 0.0)
    if far or np.isclose(number, _MISSING).any():
        verb, they = ("is", "does it") if count == 1 else ("are", "do they")
        return (f"{counted(count, 'value')} {verb} {number:.4g}: {they} mean missing?",)
    return ()


def _on_angles(known: Statement) -> list[str]:
    lights = counted(known.lights, "direction") + " of the light"
    channels = counted(len(known.channels), "channel")
    low, high = known.theta_i_deg
    around = "from several azimuths" if known.turned else "from one azimuth"
    text = (
        f"{counted(known.samples, 'sample')} of {channels}: {lights}, {around}, theta_i {low:.4g} to {high:.4g} degrees"
    )
    text += f"; theta_r {known.theta_r_deg[0]:.4g} to {known.theta_r_deg[1]:.4g} degrees."
    side = ["All viewers are on one side of the plane of incidence: the other is taken for its mirror image."]
    return [text, *(side if known.one_side and known.incidences else [])]


def _on_values(known: Statement) -> list[str]:
    theta_i, theta_r, turn = known.largest_at_deg
    where = f"theta_i {theta_i:.4g}, theta_r {theta_r:.4g} and an azimuth of {turn:.4g} degrees from the light"
    counts = f"{counted(known.holes, 'hole')}, {counted(known.negative, 'negative value')}"
    lines = [f"{counts}; the largest value is {known.largest:.4g} /sr at {where}."]
    if known.zeros:
        lines.append(f"{counted(known.zeros, 'value')} of exactly 0: integrals and pairs take them for holes.")
    return lines


def _on_albedo(known: Statement) -> list[str]:
    if not known.incidences:
        return ["No albedo: no direction of the light has viewers around the hemisphere."]
    numbers = np.unique(np.linspace(0, len(known.incidences) - 1, _SHOWN).astype(int))
    lines = []
    for some in (known.incidences[number] for number in numbers):
        azimuth = f", phi_i {some.phi_i_deg:.4g}" if known.turned and not known.in_bands else ""
        text = f"Albedo at theta_i {some.theta_i_deg:.4g}{azimuth}: {_shown(known.channels, some.albedo)}"
        if some.covered < _ALL_COVERED:
            inside = _shown(known.channels, some.measured)
            text += f"; viewers surround {100.0 * some.covered:.3g} % of the hemisphere, with {inside}"
        if some.peak > _PEAK:
            text += f"; unknown: one viewer makes {100.0 * some.peak:.2g} % of it, the lobe is narrower than the steps"
        lines.append(f"{text}.")
    if known.in_bands:
        lines.append(
            f"Directions are scattered: these are lights within {_BAND_DEG:g} degree, as if azimuths did not matter."
        )
    if len(numbers) < len(known.incidences):
        lines.append(f"{len(known.incidences)} directions of the light are integrated in all.")
    return lines


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


def _on_pairs(known: Statement) -> list[str]:
    if known.reciprocity is None:
        return ["Reciprocity: no sample is the swap of another."]
    pairs = known.reciprocity
    return [
        f"Reciprocity: {counted(pairs.pairs, 'pair')} of samples with light and viewer exchanged; median asymmetry "
        f"{100.0 * pairs.median:.3g} %, largest {100.0 * pairs.largest:.3g} %."
    ]


def _on_claims(known: Statement) -> list[str]:
    lines = []
    for claim in known.claims:
        if abs(claim.relative) > _CLAIM:
            size = f"{100.0 * abs(claim.relative):.0f} % {'low' if claim.relative < 0.0 else 'high'}"
            of_channel = f" ({claim.channel})" if len(known.channels) > 1 else ""
            text = f"The header claims {claim.claimed:.4g} at theta_i {claim.theta_i_deg:.4g}{of_channel}"
            lines.append(f"{text}, and its own values integrate to {claim.integrated:.4g}: the claim is {size}.")
    agree = len(known.claims) - len(lines)
    verb = "agrees" if agree == 1 else "agree"
    return [*lines, *([f"{counted(agree, 'claim')} of the header {verb} with its values."] if agree else [])]
