"""Hypotheses on what the numbers of a file mean, scored by the samples: reciprocity, lobes, poles, albedo and ranges.

A hypothesis differs from the reading in one word of a `Convention`. It is compared with the reading by what the samples
show, with the noise that they have themselves. One that is clearly better is a doubt, with both numbers and the option
that states it. What the samples cannot tell apart is said to be so, and never named.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import counted
from brdfdb.geometry import degrees
from brdfdb.measurements.conventions import FACTORS, FROM_LIGHT, LOGARITHMS, QUANTITIES, RELATIVE, f_r_of, remedy
from brdfdb.measurements.exchanges import SwappedPairs, exact_pairs, exchanged_rows, ordered_pairs
from brdfdb.measurements.incidences import PEAK, Incidence, bands, lights
from brdfdb.measurements.samples import Samples, percent
from brdfdb.parameters import Floats

Rows = NDArray[np.intp]

_CERTAIN = 7.0  # log likelihood ratio, 1000 to 1, from which on a hypothesis is named
_MOST = 60_000  # samples that are looked at, evenly among all
_SAME_DEG = 0.01  # directions closer than this are the same
_GRAZING_DEG = 85.0  # polar angles above which stray light and the spot decide
_FEWEST_PAIRS = 6
_FLOOR = 0.002  # relative difference of pairs that rounding makes
_SLOPE = 0.2  # by which the exponent of a cosine may differ from 1
_LEVER = 0.02  # difference of ln cos of a pair that tells cosines apart
_STEEP = 0.7  # difference of ln f_r of neighbours between which nothing is interpolated
_APART_DEG = 25.0  # of neighbours between which nothing is interpolated
_UNSURE = 0.3  # error of the exponent above which pairs do not tell cosines
_BETTER = 1.5  # times the deviation of pairs that another quantity leaves is that of the reading, at least
_FAR_BETTER = (8.0, 4.0)  # the same from which on a cosine is named; the second if exact pairs agree to their noise
_ROUNDING = 0.01  # deviation of ln f_r of pairs that steps of viewers leave, besides the noise
_ALBEDO = (2e-4, 1.05)  # of surfaces: the blackest coatings reflect more than the first
_OFF_LOBE_DEG = 30.0  # from the mirror direction, where f_r of a few viewers may stand for the albedo
_FEW = 1.5  # pi times their median from which on the unit is doubted
_MIRRORED = np.array([-1.0, -1.0, 1.0])  # of unit vectors, that makes the mirror direction
_LITHOGRAPHY_NM = 13.5  # extreme ultraviolet that is measured
_SHEEN = 10.0  # times the albedo is the largest value of a surface that is dark everywhere
_DARK = 1e-3  # albedo of a surface below which another factor is not proposed
# f_r of a lobe over the median from which on there is one, and below which there is none
_LOBE = 2.0
_NARROW = 1.4  # the first, if it is seen to narrow in azimuth at oblique lights
_LEVEL = 1.25
_STRONG = 10.0  # of lobes without a diffuse part
_THIN = 0.1  # share of the ring below which lobes are thin at all lights
_FALLEN = 0.85  # share of a lobe that f_r falls below between it and the horizon
_ABOUT_DEG = 15.0  # angles to the mirror direction and to the light within which lobes are looked for
_TILTED_DEG = (20.0, 75.0)  # polar angles of lights that tell the sides apart
_FEWEST = 5  # viewers of a light
_GROWTH = 0.6  # exponent of 1/cos^2 with which the height of a mirror lobe grows at least; of round lobes it is 0
_NOISY = 2.0  # times the noise, that the exponent of sheets exceeds it by
_POLE = 0.35  # standard deviation of ln f_r at the normal that noise does not make
_GAP = 1.6  # steps of azimuths beside the largest value from which on that may be the flank of a lobe in a hole
_VISIBLE = 0.3  # range of ln f_r on a ring of viewers from which on there is a lobe
_TREND = 0.13  # change of the width of lobes, of the ring, between lights 60 degrees apart that is clear
_PEAKED = 0.33  # share of the ring that lobes have at the light where they are narrowest
_SYSTEMATIC = 0.02  # error of that change that the steps of viewers make
_PATH = 0.4  # share of the change of theta_i that lobes follow in theta_r
_CLEARER = 0.6  # width of lobes on the ring that passes them over that on another ring, at most
_FADING = 0.2  # the same of lobes that fall
_STEEP_DEG = 35.0  # polar angle of lights that have the highest mirror lobes
_NO_LOBE = "no lobe is seen in the mirror direction or at the light"
_SHOWN = 6  # azimuths of lobes in a sentence
_FROM = {"light": "the light", "mirror": "the mirror direction", "absolute": "a direction of the surface"}


@dataclass(frozen=True)
class Doubts:
    """Sentences on hypotheses that fit better than the reading, and on what the samples cannot tell."""

    hints: tuple[str, ...] = ()
    untold: tuple[str, ...] = ()


class _Finding(NamedTuple):
    """A sentence on a hypothesis, empty if none is better, and what the samples cannot tell, in words."""

    hint: str = ""
    untold: str = ""


@dataclass(frozen=True)
class _View:
    """Samples as hypotheses look at them: angles [degree] (N,), and ln f_r, nan in holes.

    `delta` are azimuths from light to viewer, and `lights` the rows of each direction of the light.
    """

    theta_i: Floats
    theta_r: Floats
    delta: Floats
    phi_i: Floats
    log_f: Floats
    lights: list[Rows]
    relative: bool
    noise: float  #: standard deviation of ln f_r of neighbours

    @property
    def turn(self) -> Floats:
        """Angles [degree] between the azimuths of light and viewer, 0 to 180, (N,)."""
        return np.asarray(np.minimum(self.delta, 360.0 - self.delta))

    @property
    def by_light(self) -> list[tuple[float, Rows]]:
        """Mean theta_i [degree] and rows of each direction of the light."""
        return [(float(np.mean(self.theta_i[rows])), rows) for rows in self.lights]


def doubts(samples: Samples, incidences: Sequence[Incidence], *, one_side: bool) -> Doubts:
    """Return which hypotheses on the numbers of a file are clearly better than the reading, and what cannot be told.

    `incidences` are the albedos of the samples as they were read. With `one_side` the viewers are on one side of the
    plane of incidence.
    """
    if not samples.known.any():
        return Doubts(("The samples have no values.",))
    some = samples
    if len(samples) > _MOST:
        some = samples.selected(np.arange(0, len(samples), -(-len(samples) // _MOST)))
    view = _view_of(some)
    stages: Sequence[Callable[[], list[_Finding]]] = (  # each rests on the numbers that those before it judge
        lambda: [_logarithms(samples)],
        lambda: [_radians(samples, view)],
        lambda: [_exchanged(samples, view), _elevations(samples, view)],
        lambda: [
            _azimuths(samples, view),
            _cosines(some, view, one_side),
            _scale(samples, incidences),
            _coverage(some, one_side),
        ],
    )
    findings = [_wavelengths(samples)]
    for stage in stages:
        findings += (found := stage())
        if any(finding.hint for finding in found):
            break
    hints = tuple(finding.hint for finding in findings if finding.hint)
    untold = [finding.untold for finding in findings if finding.untold]
    return Doubts(hints, (f"The samples cannot tell: {'; '.join(untold)}.",) if untold else ())


def _view_of(samples: Samples) -> _View:
    """Return samples as hypotheses look at them; f_r is the mean of channels, each relative to its median."""
    values = np.where(samples.known, samples.values, np.nan)
    known = np.isfinite(values)
    level = np.array(
        [np.median(np.abs(column[seen])) if seen.any() else 1.0 for column, seen in zip(values.T, known.T, strict=True)]
    )
    level = np.where(level > 0.0, level, 1.0)
    mean = np.where(known, values / level, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    theta_r = degrees(samples.theta_r)
    delta = degrees(samples.phi_r - samples.phi_i) % 360.0
    log_f = np.log(mean, out=np.full(len(mean), np.nan), where=mean > 0.0)
    of_light = lights(samples, _FEWEST) or bands(samples)
    return _View(
        degrees(samples.theta_i),
        theta_r,
        delta,
        degrees(samples.phi_i) % 360.0,
        log_f,
        of_light,
        samples.record.get("azimuths") == RELATIVE,
        min(_noise(log_f, of_light, *axes) for axes in ((theta_r, delta), (delta, theta_r))),
    )


def _noise(log_f: Floats, of_light: Sequence[Rows], along: Floats, fixed: Floats) -> float:
    """Return the noise of ln f_r by its second differences along one angle at fixed others; inf without three in a row.

    Where f_r is curved it is too large, and half of the differences may be so.
    """
    seconds = [np.empty(0)]
    for rows in of_light:
        rows = rows[np.isfinite(log_f[rows])]
        order = rows[np.lexsort((along[rows], np.rint(fixed[rows])))]
        same = np.rint(fixed[order[2:]]) == np.rint(fixed[order[:-2]])
        seconds.append(np.abs(np.diff(log_f[order], 2))[same])
    every = np.concatenate(seconds)
    return float(np.median(every)) / 1.65 if every.size else np.inf  # 1, -2, 1: sqrt(6), and 0.6745 of the median


# Ranges


def _logarithms(samples: Samples) -> _Finding:
    """Return a sentence if most values are below 0, as logarithms are, and f_r of them could be that of a surface."""
    known = samples.values[samples.known]
    below = float(np.mean(known < 0.0))
    if below <= 0.5 or samples.record.get("quantity") in LOGARITHMS:
        return _Finding()
    likely = []
    for quantity in LOGARITHMS:
        of_median = float(np.pi * np.median(f_r_of(quantity, known[:, np.newaxis], known, known)))
        if _ALBEDO[0] < of_median < _ALBEDO[1]:
            likely.append(f"--quantity {quantity} (pi times the median of f_r is {of_median:.2g} then)")
    if not likely or np.ptp(known) == 0.0:
        return _Finding()
    end = ", which the samples cannot tell apart" if len(likely) > 1 else ""
    text = f"Logarithms? {percent(below)} of the values are below 0, as f_r never is: {' or '.join(likely)}{end}."
    return _Finding(text)


def _radians(samples: Samples, view: _View) -> _Finding:
    """Return a sentence if angles that were taken as degrees would fill the hemisphere as radians."""
    largest = max(float(view.theta_i.max()), float(view.theta_r.max()))
    turned = max(float((degrees(samples.phi_r) % 360.0).max()), float(view.phi_i.max()))
    in_plane = view.relative and bool(np.all((view.delta == 0.0) | (view.delta == 180.0)))
    as_degrees = np.rad2deg(np.unique(np.concatenate([view.theta_i, view.theta_r]))) * 2.0
    in_plane = in_plane and float(np.mean(np.abs(as_degrees - np.rint(as_degrees)) < 0.02)) > 0.8  # halves of degrees
    in_range = 0.3 < largest <= 0.5 * np.pi + 1e-3 and (turned <= 2.0 * np.pi + 1e-3 or in_plane)
    several = np.unique(view.theta_r).size > 2 and view.theta_i.max() > 0.1
    if not (in_range and several and (turned > 0.3 or largest > 1.0)) or samples.record.get("angles") == "radians":
        return _Finding()
    text = f"Angles? As degrees all directions are within {largest:.3g} degrees of the normal"
    how = remedy(samples.record, "--angles rad")
    return _Finding(f"{text}; as radians they reach {np.rad2deg(largest):.3g} degrees: {how}.")


def _exchanged(samples: Samples, view: _View) -> _Finding:
    """Return a sentence if polar angles look like azimuths, and azimuths like polar angles."""
    turns = degrees(samples.phi_r) % 360.0
    if turns.max() > 90.0 + _SAME_DEG or view.phi_i.max() > 90.0 + _SAME_DEG or "exchanged" in samples.record:
        return _Finding()
    below = int(samples.record.get("below_the_horizon", 0))
    viewers = np.unique(np.rint(turns / _SAME_DEG)).size
    likely = viewers >= _FEWEST if view.relative else np.ptp(view.theta_i) < _SAME_DEG and np.ptp(view.phi_i) > 1.0
    upright = not (view.theta_r if view.relative else view.theta_i).any()
    if not likely or not (below or upright or _poles_contradict(view)):
        return _Finding()
    text = f"Angles? No azimuth exceeds {turns.max():.3g} degrees, and "
    if below:
        text += f"{counted(below, 'polar angle')} of {len(samples) + below} are below the horizon"
    else:
        text += "viewers at the normal differ with their azimuth" if view.relative else "lights have one theta"
    return _Finding(f"{text}: theta and phi may be exchanged: {remedy(samples.record, '--angles exchanged')}.")


def _wavelengths(samples: Samples) -> _Finding:
    """Return a sentence if wavelengths are not those of light, and are so in another unit."""
    at = samples.wavelength_nm
    if at is None or np.any(np.abs(at - _LITHOGRAPHY_NM) < 0.1):
        return _Finding()
    text = f"Wavelengths? {at.min():.4g} to {at.max():.4g} nm" if at.size > 1 else f"Wavelengths? {at[0]:.4g} nm"
    if at.max() < 100.0:
        how = remedy(samples.record, "--wavelength-unit um")
        return _Finding(f"{text} is extreme ultraviolet; if the file has micrometres: {how}.")
    for unit, factor in (("nm", 1e-9), ("um", 1e-6)):  # of numbers that a format has in metres
        if at.min() * factor >= 100.0 and at.max() * factor <= 1e5:
            how = remedy(samples.record, f"--wavelength-unit {unit}")
            return _Finding(f"{text} is no light; as {unit} it is {at.min() * factor:.4g} nm: {how}.")
    return _Finding()


def _scale(samples: Samples, incidences: Sequence[Incidence]) -> _Finding:
    """Return which factors bring an albedo that is impossible into the range of surfaces; albedo is their evidence."""
    sound = [max(some.albedo) for some in incidences if some.peak <= PEAK]
    lobes = (
        np.sum(samples.w_i * turned * samples.w_r, axis=1) for turned in (_MIRRORED, 1.0)
    )  # azimuths may be turned
    off_lobe = samples.values[np.maximum(*lobes) < np.cos(np.radians(_OFF_LOBE_DEG))]
    off_lobe = off_lobe[np.isfinite(off_lobe)]
    if not sound and off_lobe.size < _FEWEST:
        return _Finding(untold="a factor of all values, such as pi")
    albedo = float(np.median(sound)) if sound else float(np.pi * np.median(off_lobe))
    how = "the values integrate to" if sound else "pi times the median of f_r off lobes is"
    if albedo > (_ALBEDO[1] if sound else _FEW):
        likely = {name: albedo / factor for name, factor in FACTORS.items() if _DARK < albedo / factor <= _ALBEDO[1]}
        reasons = [f"{QUANTITIES[name]}, which make {value:.3g} (--quantity {name})" for name, value in likely.items()]
        may = f" The values may be {', or '.join(reasons)}." if reasons else ""
        apart = " The samples cannot tell these apart." if len(reasons) > 1 else ""
        return _Finding(f"Units? An albedo above 1: {how} {albedo:.4g}.{may}{apart}")
    bright = float(samples.values[samples.known].max())  # scatter of polished mirrors is dark off its peak alone
    if 0.0 <= albedo < _ALBEDO[0] and bright <= _SHEEN * albedo:
        text = f"Units? Too dark: {how} {albedo:.2g}, and the blackest coatings reflect more."
        return _Finding(f"{text} A thousand times is {1e3 * albedo:.2g}.")
    return _Finding(untold="a factor of all values, such as pi")


# Poles: f_r at the normal does not depend on the azimuth


def _poles_contradict(view: _View) -> bool:
    """Return True if viewers at the normal, where all azimuths are the same direction, differ for most lights."""
    votes = []
    at_normal = (view.theta_r < _SAME_DEG) & np.isfinite(view.log_f)
    for rows in view.lights:
        at = rows[at_normal[rows]]
        if np.unique(np.rint(view.delta[at])).size > 2:
            votes.append(float(np.std(view.log_f[at])) > _POLE)
    return bool(votes) and 2 * sum(votes) > len(votes)


class _Trend(NamedTuple):
    """Change of the width of lobes in azimuth between lights 60 degrees apart [1], and its error.

    `steady` is True if most lights agree, `narrowest` is the smallest width: that of a wave, as on rough surfaces, is a
    half of the ring.
    """

    slope: float
    error: float
    steady: bool
    narrowest: float

    @property
    def sign(self) -> int:
        """Return 1 if lobes widen, -1 if they narrow, 0 if that is not clear."""
        clear = self.steady and self.narrowest < _PEAKED and abs(self.slope) > max(_TREND, 3.0 * self.error)
        return int(np.sign(self.slope)) if clear else 0


def _widths(view: _View, *, flipped: bool = False, within_deg: float = 3.0) -> _Trend | None:
    """Return how the width of lobes in azimuth changes with theta_i, on the ring of viewers that passes the lobe.

    Around the normal all azimuths are near each other: a lobe spans more of the ring theta_r = theta_i, the closer the
    light is to the normal. It spans less if theta counts from the surface. The width is the mean of ln f_r on the ring,
    0 at its smallest value and 1 at its largest. With `flipped` the ring is theta_r = 90 degrees - theta_i. None if the
    rings of fewer than three lights show a lobe beyond the noise, and no hole beside it.
    """
    widths = []
    for theta_i, rows in view.by_light:
        apart = np.abs(view.theta_r[rows] - (90.0 - theta_i if flipped else theta_i))
        at = rows[(apart < apart.min() + 0.05) & np.isfinite(view.log_f[rows])]
        turns, first = np.unique(np.rint(view.delta[at]), return_index=True)
        if apart.min() > within_deg or turns.size < 7 or np.ptp(turns) < 150.0:
            continue
        ring = view.log_f[at[first]]
        low, high = np.percentile(ring, [5.0, 100.0])
        places = np.rint(view.turn[at[first]])
        place, known = places[np.argmax(ring)], np.unique(places)
        gaps = np.diff([-known[0], *known, 360.0 - known[-1]])[np.searchsorted(known, place) :][:2]
        whole = gaps.max() < _GAP * np.median(np.diff(known))
        if whole and high - low > max(_VISIBLE, 8.0 * view.noise):
            widths.append((theta_i, (float(np.mean(ring)) - low) / (high - low), view.noise / (high - low), place))
    if len(widths) < 3:
        return None
    of_lights, width, noise, place = np.array(widths).T
    if np.ptp(of_lights) < 20.0:
        return None
    x = (of_lights - of_lights.mean()) / 60.0
    slope = float(np.sum(x * width) / np.sum(x**2))
    first, second = np.nonzero(x[:, np.newaxis] < x - 1e-3)
    agree = np.sign((width[second] - width[first]) * (x[second] - x[first])) == np.sign(slope)
    error = 0.4 * float(np.median(noise) / np.sqrt(np.sum(x**2))) + _SYSTEMATIC  # of a mean, whose ends are one value
    steady = np.mean(agree) > 0.7 and np.ptp(place) < 90.0  # the same lobe in all rings
    return _Trend(slope, error, bool(steady), float(width.min()))


def _elevations(samples: Samples, view: _View) -> _Finding:
    """Return a sentence if polar angles count from the surface, by the widths of lobes in azimuth and their place."""
    path = _path(view)
    trend, other = (_widths(view, flipped=flipped) for flipped in (False, True))
    sign, place = (one.sign if one else 0 for one in (trend, other))
    clearer = trend and other and sign == 0 and place != 0 and other.narrowest < _CLEARER * trend.narrowest
    flipped = path.slope < -_PATH or (path.slope < _PATH and clearer)
    if flipped and place:
        word, angle = ("elevation_i", "theta_i") if place > 0 else ("elevation_r", "theta_r")
        text = f"Angles? By place and width of the lobes {angle} counts from the surface, and the other from the normal"
        return _Finding(f"{text}: {remedy(samples.record, f'--angles {word}')}.")
    if flipped:
        return _Finding(untold="which polar angle counts from the surface (lobes move to the normal as theta_i grows)")
    if sign > 0:
        text = "Angles? Lobes become wider in azimuth as theta_i grows; those of surfaces are widest near the normal"
        return _Finding(
            f"{text}. The angles may count from the surface: {remedy(samples.record, '--angles elevation')}."
        )
    if path.slope > _PATH and path.growth < -_FADING:
        latter = remedy(samples.record, "--angles elevation reads the latter")
        text = "whether lobes fade as theta_i grows, or polar angles count from the surface"
        return _Finding(untold=f"{text} ({latter})")
    return _Finding(
        untold="" if trend else "whether polar angles count from the surface (no rings of viewers pass a lobe)"
    )


class _Path(NamedTuple):
    """Change of theta_r of lobes with theta_i [1], and exponent of 1/cos^2 theta_i of their height; 0: not known."""

    slope: float = 0.0
    growth: float = 0.0


def _path(view: _View, turn: float = 180.0, fewest: int = 3) -> _Path:
    """Return how lobes about an azimuth [degree] move and grow with theta_i; those of surfaces move to the horizon."""
    about = (np.abs(view.turn - turn) <= 20.0) & np.isfinite(view.log_f)
    lobes = []
    for theta_i, rows in view.by_light:
        at = rows[about[rows]]
        if len(at) >= _FEWEST and np.ptp(view.log_f[at]) > max(0.5, 8.0 * view.noise):
            best = at[np.argmax(view.log_f[at])]
            lobes.append((theta_i, view.theta_r[best], view.log_f[best]))
    if len(lobes) < fewest or np.ptp([theta_i for theta_i, *_ in lobes]) < 20.0:
        return _Path()
    theta_i, theta_r, height = np.array(lobes).T
    lever = -2.0 * np.log(np.cos(np.radians(np.minimum(theta_i, _GRAZING_DEG))))
    return _Path(float(np.polyfit(theta_i, theta_r, 1)[0]), float(np.polyfit(lever, height, 1)[0]))


# Lobes: they lie in the mirror direction


def _azimuths(samples: Samples, view: _View) -> _Finding:
    """Return a sentence if lobes lie at the light and none in the mirror direction, or turn with the light."""
    if turned := _turning(samples, view):
        return _Finding(turned)
    trend = _widths(view) or _widths(view, within_deg=5.1)
    every = _lobes_at_light(view, trend)
    of_lights = [one for one in every if one.seen]
    oblique = [one for one in of_lights if one.theta_i >= _STEEP_DEG]
    judged = oblique if len(oblique) > 1 else of_lights  # mirror lobes over a diffuse part rise at oblique lights
    in_plane, mirrored = "plane" in samples.record, any(one.mirrored for one in every)
    path, peaks = _path(view, 0.0, fewest=2 if in_plane else 3), [one for one in of_lights if one.alone]
    # Bowls towards the light do not move, and hot spots of the moon grow by 1/cos theta_i alone
    rises = path.slope > _PATH and path.growth > _GROWTH + _NOISY * view.noise and _alike(view)
    if 2 * sum(one.alone for one in judged) <= len(judged):
        peaks = [one for one in of_lights if in_plane and rises and not mirrored and one.height > 0.0]
        if not _grows(peaks, narrows=False):
            return _Finding(untold="" if mirrored else f"from where azimuths count ({_NO_LOBE})")
    other, direction = ("light", "light") if samples.record.get("azimuth") else ("forward", "forward direction")
    scattered = np.ptp(view.theta_i[view.lights[0]]) > _SAME_DEG
    rim = trend is None and view.theta_r.max() > 89.9 and view.theta_r.min() > 4.9  # viewers at 90 degrees, none near 0
    if scattered or rim or path.slope < -_PATH:
        return _Finding(untold="whether polar angles count from the surface, and from where azimuths count")
    otherwise = "sides are exchanged" if in_plane else f"azimuths count from the {direction}"
    if (in_plane and not rises) or not _grows(peaks, narrows=trend is not None and trend.slope < 0.0):
        latter = remedy(samples.record, f"--azimuth {other} reads the latter")
        return _Finding(
            untold=f"whether the surface is retro-reflective or {otherwise} (the lobe lies at the light, none in the "
            f"mirror direction; {latter})"
        )
    if in_plane:
        how = remedy(samples.record, f"--azimuth {other} puts it on the mirror side")
        text = "Sides? The lobe is on the side of the light, where it grows with theta_i as mirror lobes do"
        return _Finding(f"{text}; {how}.")
    return _Finding(
        "Azimuths? The lobe lies at delta_phi = 0, towards the light, and none lies in the mirror direction; it grows "
        f"with theta_i as mirror lobes do. If the file counts azimuths from the {direction}, "
        f"{remedy(samples.record, f'import it with --azimuth {other}')}."
    )


def _alike(view: _View) -> bool:
    """Return True if the viewers next to lights are as far from them for all lights, so that steps make no growth."""
    apart = [float(np.abs(view.theta_r[rows] - theta_i).min()) for theta_i, rows in view.by_light]
    return bool(np.ptp(apart) < 1.0)


def _grows(peaks: Sequence[_AtLight], *, narrows: bool) -> bool:
    """Return True if lobes grow as mirror lobes do, by 1/cos theta_i.

    Those of a retro-reflective sheet that fades with the cosine grow by the sine of an elevation, which widths, or the
    heights at three lights, exclude.
    """
    theta_i = np.radians([one.theta_i for one in peaks])
    height = np.log([one.height for one in peaks])
    lever, fading = -2.0 * np.log(np.cos(theta_i)), np.log(np.sin(theta_i))
    first, second = np.triu_indices(len(lever), 1)
    apart = np.abs(lever[second] - lever[first]) > 0.1
    steps = (height[second] - height[first])[apart] / (lever[second] - lever[first])[apart]
    if not steps.size or np.median(steps) < _GROWTH:
        return False
    return narrows or bool(np.corrcoef(height, lever)[0, 1] > np.corrcoef(height, fading)[0, 1] - 1e-9)


class _AtLight(NamedTuple):
    """Lobes of a light [degree]: viewers near it, a lobe there alone, its height [1/sr], a lobe that is mirrored."""

    theta_i: float
    seen: bool
    alone: bool
    height: float
    mirrored: bool


def _lobes_at_light(view: _View, trend: _Trend | None) -> list[_AtLight]:
    """Return what tilted lights show about their own direction and that of the mirror.

    A lobe at the light is alone if f_r about the mirror direction is as elsewhere, and if it narrows in azimuth at
    oblique lights, as the rise of rough surfaces does not, or f_r falls between it and the horizon.
    """
    seen = np.isfinite(view.log_f) & (view.theta_i >= _TILTED_DEG[0]) & (view.theta_i <= _TILTED_DEG[1])
    level = np.abs(view.theta_r - view.theta_i) <= _ABOUT_DEG
    beside = view.turn <= _ABOUT_DEG
    at_light = seen & level & beside
    at_mirror = seen & level & (view.turn >= 180.0 - _ABOUT_DEG)
    behind = seen & (view.theta_r > view.theta_i + _ABOUT_DEG) & (view.turn <= 5.0)
    f_r = np.where(np.isfinite(view.log_f), np.exp(view.log_f), 0.0)
    narrow = trend is not None and trend.sign < 0 and trend.slope < -0.15
    contrast = (_NARROW if narrow else _LOBE) * np.exp(3.0 * min(view.noise, 1.0))
    shown = []
    for theta_i, rows in view.by_light:
        if not seen[rows].any():
            continue
        every = float(np.median(f_r[rows][seen[rows]]))
        lobe, mirror, beyond = (f_r[rows].max(where=of[rows], initial=0.0) for of in (at_light, at_mirror, behind))
        others = f_r[rows][seen[rows] & ~beside[rows]]  # scans in the plane have half of their viewers beside the lobe
        middle = min(every, float(np.median(others))) if others.size >= _FEWEST else every
        falls = (trend is None or trend.narrowest < _THIN) and beyond < _FALLEN * lobe
        alone = lobe > _STRONG * max(middle, mirror)
        alone |= mirror <= _LEVEL * every and (narrow or falls) and lobe > contrast * max(middle, mirror)
        of_light = int(at_light[rows].sum()) > 1  # one viewer may be that of a hot spot
        shown.append(_AtLight(theta_i, of_light, of_light and bool(alone), lobe - middle, mirror > _LOBE * every))
    return shown


def _turning(samples: Samples, view: _View) -> str:
    """Return a sentence if lobes turn with the azimuth of the light, or lie beside the plane of incidence."""
    lobes = _azimuths_of_lobes(view)
    if len(lobes) < 2:
        return ""
    phi_i, delta, beside = lobes.T
    read = np.exp(1j * np.radians(delta))
    middle = np.mean(read)
    if len(lobes) > 3 and np.unique(np.rint(phi_i)).size > 2 and abs(middle) < 0.75:
        from_light = samples.record.get(FROM_LIGHT) == "light"
        other = np.mean(read * np.exp(1j * np.radians(-phi_i if from_light else phi_i)))
        word = "absolute" if from_light else "light" if other.real < 0.0 else "mirror"
        if abs(other) > 0.9 and (abs(other.imag) < 0.5 or from_light):
            text = f"Azimuths? Lobes of {len(lobes)} lights turn with the light, and stay at one azimuth"
            return (
                f"{text} if those of viewers count from {_FROM[word]}: {remedy(samples.record, f'--azimuth {word}')}."
            )
    if 3 * beside.sum() < 2 * len(lobes):
        return ""
    text = f"Azimuths? Lobes of {len(lobes)} lights lie beside the plane of incidence, "
    if abs(middle) > 0.95:
        at = float(np.degrees(np.angle(middle)) % 360.0)
        return (
            f"{text}{at:.0f} degrees from the light, where 180 is usual. Azimuths may have an offset: correct the file."
        )
    shown = ", ".join(f"{angle:.0f}" for angle in delta[:_SHOWN])
    return f"{text}at {shown} degrees from it. Azimuths of lights may be wrong, or those of viewers be absolute."


def _azimuths_of_lobes(view: _View) -> Floats:
    """Return phi_i and the azimuth from there of the lobe of each tilted light [degree], (L, 3).

    The last number is 1 if f_r at the mirrored azimuth and in the plane of incidence is less than half of the lobe.
    """
    lobes = []
    for theta_i, rows in view.by_light:
        known = rows[np.isfinite(view.log_f[rows]) & (view.theta_r[rows] > 5.0)]
        if not known.size or not _TILTED_DEG[0] <= theta_i <= _TILTED_DEG[1]:
            continue
        best = known[np.argmax(view.log_f[known])]
        lower = view.log_f[best] - np.log(_LOBE) - 3.0 * min(view.noise, 1.0)
        if lower > np.median(view.log_f[known]):
            ring = known[np.abs(view.theta_r[known] - view.theta_r[best]) < 5.0]
            mirrored = np.abs(view.turn[ring] - view.turn[best]) < 1.0
            mirrored &= np.abs(view.delta[ring] - view.delta[best]) > 1.0
            others = ring[mirrored | (np.abs(view.turn[ring] - 90.0) > 80.0)]
            beside = others.size > 0 and view.log_f[others].max() < lower
            lobes.append((view.phi_i[best], view.delta[best], beside))
    return np.array(lobes, dtype=np.float64).reshape(-1, 3)


# Reciprocity: f_r is the same with light and viewer exchanged


def _cosines(samples: Samples, view: _View, one_side: bool) -> _Finding:
    """Return a sentence if pairs agree far better once values are divided by the cosine of light or viewer.

    Of f_r cos theta_i, ln(f / f') of a pair is its lever, of f_r cos theta_r it is minus the lever, and of f_r it is 0.
    Pairs of the same polar angles count as three at most. The likelihood is that of Laplace's distribution.
    """
    read = str(samples.record.get("quantity", "f_r"))
    pairs = exact_pairs(samples, one_side)
    if pairs is None or np.count_nonzero(pairs.lever > _LEVER) < _FEWEST_PAIRS:
        pairs = _near_pairs(view)
    if pairs is None or read in LOGARITHMS:
        return _Finding(untold="whether a cosine is in the values (too few samples with light and viewer exchanged)")
    found = _better_cosine(pairs, read, view)
    if not found.hint and not samples.turned:  # of an anisotropic surface only those in the plane are exchanged
        in_plane = samples.selected(np.abs((view.delta + 90.0) % 180.0 - 90.0) < _SAME_DEG)
        of_plane = exact_pairs(in_plane, one_side)
        best = _better_cosine(of_plane, read, view) if of_plane is not None else found
        return best if best.hint else found
    return found


def _better_cosine(pairs: SwappedPairs, read: str, view: _View) -> _Finding:
    """Return a sentence if pairs agree far better by another cosine than by the quantity that was read."""
    untold = _Finding(untold="whether a cosine is in the values (too few samples with light and viewer exchanged)")
    telling = pairs.lever > _LEVER
    if np.count_nonzero(telling) < _FEWEST_PAIRS:
        return untold
    number = np.unique(np.rint(pairs.lever[telling] * 1e4), return_inverse=True)[1].reshape(-1)
    of_group = [
        (pairs.lever[telling][number == one], pairs.change[telling][number == one]) for one in range(number.max() + 1)
    ]
    lever = np.array([np.mean(x) for x, _ in of_group])
    change = np.array([np.median(y) for _, y in of_group])
    size = sum(min(len(x), 3) for x, _ in of_group)
    spreads = [np.median(np.abs(y - np.median(y))) for _, y in of_group if len(y) > 2]
    noise = 1.5 * float(np.median(spreads)) if spreads else 0.0
    floor = _FLOOR + noise / np.sqrt(np.median([len(x) for x, _ in of_group]))
    order = np.argsort(change / lever)
    total = np.cumsum(lever[order])
    exponent = float((change / lever)[order][np.searchsorted(total, 0.5 * total[-1])])  # the median, weighted by lever
    spread = 1.5 * float(np.median(np.abs(change - exponent * lever))) + floor
    error = spread / float(np.sqrt(np.sum(lever**2)))
    if error > _UNSURE:
        return untold
    sign = round(float(np.clip(exponent, -1.0, 1.0)))
    quantity = {1: "f_r_cos_i", -1: "f_r_cos", 0: "f_r"}.get(sign + {"f_r_cos": -1, "f_r_cos_i": 1}.get(read, 0))
    if sign == 0 or quantity is None or abs(exponent - sign) > max(_SLOPE, 2.0 * error):
        return _Finding()
    before, after = (float(np.mean(np.abs(change - power * lever))) for power in (0, sign))
    if size * np.log((before + floor) / (after + floor)) < _CERTAIN or before < _BETTER * after:
        return _Finding()
    kind = "samples and interpolated swaps of them" if pairs.interpolated else "pairs"
    sizes = [pairs.asymmetry(power) for power in (0, sign)]
    numbers = [percent(value) if value >= 1e-4 else "less than 0.01 %" for value in sizes]  # as rounding in a file
    text = f"asymmetry of {len(pairs.lever)} {kind} has a median of {numbers[0]} as {QUANTITIES[read]}"
    text += f", and of {numbers[1]}"
    noise = min(noise, view.noise) if spreads else view.noise  # where f_r is curved each is too large
    reached = 0.0 if pairs.interpolated else min(before / _FAR_BETTER[1], 2.0 * noise + _ROUNDING)
    if after > max(before / _FAR_BETTER[0], reached):
        return _Finding(untold=f"what is wrong ({text}, beyond the noise, as {QUANTITIES[quantity]})")
    return _Finding(f"Reciprocity? The {text} if the values are {QUANTITIES[quantity]}: --quantity {quantity}.")


def _near_pairs(view: _View) -> SwappedPairs | None:
    """Return samples with what others are at their swap, interpolated in both polar angles along one azimuth.

    Only lights of one azimuth, and swaps between two of them less than 25 degrees apart, count. None if there are few.
    """
    by_theta = sorted(view.by_light, key=lambda light: light[0])
    if len(by_theta) < 3 or np.ptp(view.phi_i) > 1.0:
        return None
    theta_i = np.array([theta for theta, _ in by_theta])
    turn = view.turn
    levers, changes = [], []
    for of_turn in np.unique(np.rint(turn / 2.0)):
        curves = []
        for _, rows in by_theta:
            at = rows[(np.rint(turn[rows] / 2.0) == of_turn) & np.isfinite(view.log_f[rows])]
            at = at[np.unique(view.theta_r[at], return_index=True)[1]]
            curves.append((view.theta_r[at], view.log_f[at]))
        for number, (theta_r, log_f) in enumerate(curves):
            between = np.searchsorted(theta_i, theta_r) - 1
            for viewer, value, low in zip(theta_r, log_f, between, strict=True):
                if not 0 <= low < len(theta_i) - 1 or low in (number - 1, number) or viewer > _GRAZING_DEG:
                    continue
                first, second = (_on_curve(curves[k], theta_i[number]) for k in (low, low + 1))
                if first is None or second is None or abs(second - first) > _STEEP:
                    continue
                if theta_i[low + 1] - theta_i[low] > _APART_DEG:
                    continue
                share = (viewer - theta_i[low]) / (theta_i[low + 1] - theta_i[low])
                levers.append(np.log(np.cos(np.radians(theta_i[number])) / np.cos(np.radians(viewer))))
                changes.append(value - (first + share * (second - first)))
    if len(levers) < 2 * _FEWEST_PAIRS:
        return None
    return ordered_pairs(np.array(levers), np.array(changes), interpolated=True)


def _on_curve(curve: tuple[Floats, Floats], theta_r: float) -> float | None:
    """Return ln f_r at a polar angle [degree] between viewers of a light; None beyond them or where it is steep."""
    at = int(np.searchsorted(curve[0], theta_r))
    if at == 0 or at == len(curve[0]):
        return float(curve[1][0]) if len(curve[0]) and abs(curve[0][0] - theta_r) < _SAME_DEG else None
    if abs(curve[1][at] - curve[1][at - 1]) > _STEEP or curve[0][at] - curve[0][at - 1] > _APART_DEG:
        return None
    return float(np.interp(theta_r, *curve))


def _coverage(samples: Samples, one_side: bool) -> _Finding:
    """Return what stated uncertainties may be, if pairs scatter by a half or a third of them."""
    if samples.uncertainty is None or samples.record.get("coverage_factor"):
        return _Finding()
    first, second = exchanged_rows(samples, one_side)
    apart = np.abs(samples.values[first] - samples.values[second])
    stated = np.hypot(samples.uncertainty[first], samples.uncertainty[second])
    ratios = apart / np.where(stated > 0.0, stated, np.nan)
    ratios = ratios[np.isfinite(ratios)]
    if len(ratios) < 30:
        return _Finding()
    k = 0.6745 / max(float(np.median(ratios)), 1e-9)
    expanded = next((factor for factor in (2, 3) if abs(k / factor - 1.0) < 2.0 / np.sqrt(len(ratios)) + 0.05), 0)
    if not expanded:
        return _Finding()
    part = {2: "half", 3: "third"}[expanded]
    return _Finding(
        untold=f"whether uncertainties are expanded by k = {expanded}, as pairs scatter by a {part} "
        f"of them (--coverage-factor {expanded}), or have parts that pairs share"
    )
