"""The intervals of a fit that can be believed: correlated residuals, nuisance numbers, and models that are wrong."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.fitting.document import Estimate
from brdfdb.fitting.estimates import estimates_of, nuisance_estimates
from brdfdb.fitting.nuisance import COSINES, NUISANCE, UNDISTURBED, Nuisance, NuisanceKind, keeps_order
from brdfdb.fitting.residuals import Kind, Residual
from brdfdb.fitting.search import FittedSurface, at_point, refitted, with_noise
from brdfdb.fitting.uncertainty import NORMAL_95, GroupSpread, spread_of, sums_by
from brdfdb.parameters import Floats

#: level of the test of a kind of nuisance numbers: residuals that are independent noise show it this often
FALSE_POSITIVES = 0.005
WRONG = "The model does not describe the samples"
#: level of the same test by the spread of incidences, which errors that an incidence shares pass this often
_IN_GROUPS = {"tilt": 0.02, "drift": 0.05, "dark": 0.02}
_FEWEST = 3  # incidences; fewer are cut into blocks of neighbouring viewers
_BLOCKS = 8  # these blocks, in all
_MOST = 60  # groups of incidences that are left out in turn
_FLIPS = 399  # random signs of a test
_SEED = 44  # of these signs
CORRELATED = 0.05  # level of the two tests for correlated residuals
_LEAST_SHARE = 1e-4  # share of a number below which the shape of the aperture does not matter
_WRONG_PATTERN = 0.2  # correlation of neighbours above which the model, not the noise, is said to be wrong
_FAR = 1.5  # how many times as wide an interval is over other residuals, where the fit depends on them
_EXPLAINED = 0.5  # share of the pattern of residuals that may remain with nuisance numbers that are proposed
_CREDIBLE = 0.2  # distance from none, in the unit cube, of numbers that are proposed: 2 degrees of tilt, 32 % of drift
#: times at which the lamp may have been calibrated, the first sample at 0 and the last at 1. A lamp that warms up
#: changes faster at first than a parabola, by a tenth of the whole
_CALIBRATIONS = (-0.15, 1.15)
_SUSPECTED = 0.05  # level of the same test from which on intervals reach over the fit with them
_TELLING = 20_000  # values that tell forms of nuisance numbers from each other, which saves most of the time
_ALIKE = 6.0  # rise of the deviance below which another form of nuisance numbers is as good
_WORDS = {
    "tilt": "a tilt of the sample",
    "drift": "a drift of the lamp over the order of the rows",
    "dark": "a dark level",
}
_OVER_ANGLES = ("a gain that changes with theta_i", "a gain that changes with theta_r")
_DEVIANCE = attrgetter("deviance")
_WORSE = attrgetter("worse")


class Judgement(NamedTuple):
    """Intervals of a fit, its nuisance numbers, the kinds of nuisance that are proposed, and sentences."""

    estimates: list[Estimate]
    nuisance: list[Estimate]
    proposed: list[NuisanceKind]
    sentences: list[str]


def groups_of(fitted: FittedSurface) -> NDArray[np.int64]:
    """Return the number of the group of each sample that counts: its incidence.

    If there are less than three incidences, groups are blocks of neighbouring viewers; if there are more than 60,
    neighbouring incidences make a group.
    """
    samples, rows = fitted.samples, fitted.rows
    groups = np.unique(samples.incidence[rows], return_inverse=True)[1]
    count = int(groups.max()) + 1
    if count >= _FEWEST:
        return groups if count <= _MOST else groups * _MOST // count
    parts = -(-_BLOCKS // count)
    blocks = np.empty(len(rows), dtype=np.int64)
    for group in range(count):
        of_group = np.flatnonzero(groups == group)
        order = of_group[np.lexsort((samples.theta_r[rows[of_group]], np.round(samples.phi_r[rows[of_group]], 6)))]
        for number, part in enumerate(np.array_split(order, parts)):
            blocks[part] = group * parts + number
    return np.unique(blocks, return_inverse=True)[1]


def _spread(fitted: FittedSurface) -> GroupSpread:
    return spread_of(fitted.problem, fitted.point, groups_of(fitted))


class CorrelationTest(NamedTuple):
    """p-values of residuals that are independent: by the sums of groups, and by pairs of neighbours."""

    by_group: float
    by_neighbour: float

    @property
    def correlated(self) -> bool:
        """True if independent residuals look like that in less than one of ten cases."""
        return min(self) < CORRELATED


def correlation_test(fitted: FittedSurface) -> CorrelationTest:
    """Test whether residuals are independent, by random signs: they change no residual's size (Fisher 1935).

    The statistics are the sum over groups of the squared mean residual, and the correlation of neighbours about it.
    """
    r = np.where(fitted.problem.residual.used, fitted.clipped, 0.0)
    if len(r) < 3 or not np.any(r):
        return CorrelationTest(1.0, 1.0)
    groups = groups_of(fitted)
    sums, counts = sums_by(groups), np.maximum(np.bincount(groups), 1)[:, np.newaxis]

    def statistics(residuals: Floats) -> tuple[float, float]:
        total = sums(residuals)
        within = residuals - (total / counts)[groups]  # without what an incidence shares, such as a gain
        return float(np.sum(total**2 / counts)), float(np.sum(within * within[fitted.nearest]))

    rng = np.random.default_rng(_SEED)
    flips = max(min(_FLIPS, int(4e7 / r.size)), 39)
    # the same sign for all channels of a sample: channels of a reading share their errors
    drawn = np.array([statistics(r * rng.choice([-1.0, 1.0], (len(r), 1))) for _ in range(flips)])
    above = (1.0 + np.sum(drawn >= np.array(statistics(r)), axis=0)) / (flips + 1.0)
    return CorrelationTest(*above.tolist())


class NuisanceTest(NamedTuple):
    """The most likely form of a kind of nuisance numbers, and its p-values: of independent noise, and by incidences."""

    kind: NuisanceKind
    form: tuple[int, int]
    independent: float
    by_group: float
    deviance: float

    @property
    def seen(self) -> bool:
        """True if residuals show the pattern of the kind."""
        return self.independent < FALSE_POSITIVES and self.by_group < _IN_GROUPS[self.kind]


def nuisance_test(fitted: FittedSurface, kind: NuisanceKind) -> NuisanceTest:
    """Test whether residuals show nuisance numbers of a kind: a score test, with a Bonferroni bound over its forms.

    The second p-value takes the step to each number with its jackknife over incidences (Hotelling's T^2, or the largest
    of Student's t where incidences are few).
    """
    from scipy.stats import chi2, f, t

    best = NuisanceTest(kind, COSINES[kind][0], 1.0, 1.0, 0.0)
    groups = groups_of(fitted)
    for form in COSINES[kind]:
        nuisance = fitted.nuisance.with_kind(fitted.samples, kind, form)
        tried = at_point(fitted, nuisance)
        spread = spread_of(tried.problem, tried.point, groups)
        of_kind = [index for index, one in enumerate(nuisance.numbers, len(fitted.surface.shape)) if one.kind == kind]
        rows = [index for index in of_kind if spread.determined[index]]
        if not rows:
            continue
        step, block = spread.step[rows], np.ix_(rows, rows)
        deviance = float(step @ np.linalg.pinv(spread.covariance[block]) @ step)
        if deviance <= best.deviance:
            continue
        size, rest = len(rows), max(spread.groups - 1, 1)
        free = max(spread.groups - size, 1)
        several = float(step @ np.linalg.pinv(spread.resampled[block]) @ step)
        by_group = [
            f.sf(several * free / (size * rest), size, free),
            size * 2.0 * t.sf(max(spread.ratio(index) for index in rows), rest),
        ]
        if kind == "drift":  # incidences are few, and a lamp that changes evenly is clearer by itself
            evenly = spread_of(tried.problem, tried.point, groups, leave=of_kind[1:])
            by_group.append(4.0 * t.sf(evenly.ratio(of_kind[0]), rest))
        independent = min(len(COSINES[kind]) * float(chi2.sf(deviance, size)), 1.0)
        best = NuisanceTest(kind, form, independent, float(min(by_group)), deviance)
    return best


def with_nuisance(fitted: FittedSurface, kinds: Sequence[NuisanceKind]) -> FittedSurface:
    """Return a fit with nuisance numbers of these kinds, each in its most likely form, the clearest first."""
    remaining = list(kinds)
    while remaining:
        clearest = max((nuisance_test(fitted, kind) for kind in remaining), key=_DEVIANCE)
        fitted = _with_kind(fitted, clearest)
        remaining.remove(clearest.kind)
    return fitted


def _with_kind(fitted: FittedSurface, test: NuisanceTest) -> FittedSurface:
    nuisance = fitted.nuisance.with_kind(fitted.samples, test.kind, test.form)
    return _settled(refitted(at_point(fitted, nuisance)))


def _settled(fitted: FittedSurface) -> FittedSurface:
    return with_noise(fitted) if fitted.residual.kind == "noise" else fitted


def _testable(fitted: FittedSurface) -> list[NuisanceKind]:
    """Return the kinds of nuisance numbers that a fit may be tested for; none of simulated samples."""
    if "simulation" in fitted.samples.record:
        return []
    order = keeps_order(fitted.samples)
    return [kind for kind in NUISANCE if kind not in fitted.nuisance.kinds and (kind != "drift" or order)]


def _proposed(test: NuisanceTest, fitted: FittedSurface) -> str:
    """Return the sentence that proposes a kind of nuisance numbers, which a fit has."""
    values, kind = fitted.nuisance.values(fitted.point.nuisance), test.kind
    sizes = ", ".join(
        f"{one.name} {values[one.name]:.2g}{'' if one.unit == '1' else f' {one.unit}'}"
        for one in fitted.nuisance.numbers
        if one.kind == kind
    )
    order = " If the rows are in the order of measurement," if kind == "drift" else ""
    return (
        f"The residuals have the pattern of {_WORDS[kind]} ({sizes}).{order} --nuisance {kind} fits it; until then "
        "the intervals reach over the fits with and without it."
    )


def _explains(disturbed: FittedSurface, plain: FittedSurface, test: CorrelationTest) -> bool:
    """Return True if nuisance numbers of a credible size take away the pattern of residuals; `test` is with them."""
    credible = np.all(np.abs(disturbed.point.nuisance - 0.5) < _CREDIBLE)
    return bool(credible) and (not test.correlated or disturbed.pattern < _EXPLAINED * plain.pattern)


def judged(fitted: FittedSurface) -> Judgement:
    """Return the intervals of a fit, with all that makes them wider, and sentences on it.

    Where residuals are correlated, standard errors and intervals are those of incidences left out in turn, if these are
    wider. Where residuals show nuisance numbers, intervals reach over those of the fit with them; these are proposed if
    they explain the pattern, and no other error explains it better. Where neighbours are still correlated, the model
    does not describe the samples, and intervals reach over the fits with other residuals.
    """
    test = correlation_test(fitted)
    spread = _spread(fitted) if test.correlated or fitted.nuisance.kinds else None
    estimates = estimates_of(fitted, profiles=True, spread=spread)
    nuisance = nuisance_estimates(fitted, spread)
    sentences: list[str] = []
    if spread is not None and test.correlated:
        by_gains = test.by_group <= test.by_neighbour
        what = "samples of an incidence, as by a gain of each," if by_gains else "neighbouring samples"
        incidences = np.unique(fitted.samples.incidence[fitted.rows]).size
        groups = "incidences" if spread.groups == incidences else "blocks of viewers"
        sentences.append(
            f"The residuals of {what} are correlated (p = {min(test):.2g}): standard errors and intervals are those of "
            f"{spread.groups} {groups} left out in turn."
        )
    last, shown, explained = fitted, dict[NuisanceKind, str](), False
    while tests := [one for kind in _testable(last) if (one := nuisance_test(last, kind)).independent < _SUSPECTED]:
        clearest = max([one for one in tests if one.seen] or tests, key=_DEVIANCE)
        disturbed = _with_kind(last, clearest)
        after = correlation_test(disturbed)
        if clearest.seen:
            shown[clearest.kind], explained = _proposed(clearest, disturbed), _explains(disturbed, fitted, after)
        elif not _explains(disturbed, last, after):
            break
        elif clearest.independent < FALSE_POSITIVES:
            sentences.append(
                f"What samples share may also be {_WORDS[clearest.kind]}; the incidences are too few to tell. The "
                "intervals reach over both."
            )
        last, test = disturbed, after
        estimates = _over(estimates, estimates_of(last, profiles=False, spread=_spread(last)))
        if not clearest.seen:
            break
    for reference in _CALIBRATIONS if "drift" in last.nuisance.kinds else ():
        moved = estimates_of(refitted(last, nuisance=replace(last.nuisance, reference=reference)), profiles=False)
        estimates = [_about(one, [there]) for one, there in zip(estimates, moved, strict=True)]
    rivals = _rivals(last, _others(last, (*fitted.nuisance.kinds, *shown)))
    for rival in rivals:
        estimates = _over(estimates, estimates_of(rival.fitted, profiles=False))
    better = any(rival.worse < -_ALIKE for rival in rivals)
    proposed = list(shown) if explained and not better else []
    sentences += [shown[kind] for kind in proposed]
    named = [rival.words for rival in rivals if rival.words]
    if named:
        kinds = " and ".join(_WORDS[kind] for kind in (*fitted.nuisance.kinds, *shown))
        than = "better than" if better else "as well as"
        over = "fits with, without and in place of it" if fitted.nuisance.kinds else "both"
        sentences.append(
            f"{named[0].capitalize()} explains the residuals {than} {kinds}: the intervals reach over {over}."
        )
    # what is fitted may not be the error that there is, and a lamp may warm up by another course
    if fitted.nuisance.kinds and (named or "drift" in fitted.nuisance.kinds):
        estimates = _over(estimates, judged(_settled(refitted(fitted, nuisance=UNDISTURBED))).estimates)
    if test.by_neighbour < CORRELATED:
        estimates = _over_residuals(last, estimates, sentences)
    wider = any(one.method == "several fits" for one in estimates)
    if wider and not any("intervals reach over" in sentence for sentence in sentences):
        other = "fits with other errors of the measurement, which the samples cannot tell from these"
        sentences.append(f"The intervals reach over {other}.")
    estimates = _over_level(fitted, _over_aperture(fitted, estimates, sentences), sentences)
    return Judgement(estimates, nuisance, proposed, sentences)


class Rival(NamedTuple):
    """A fit with other nuisance numbers, what they are, and its deviance less that of the fit that it stands for."""

    words: str
    fitted: FittedSurface
    worse: float


def _rivals(fitted: FittedSurface, others: Sequence[tuple[str, Nuisance]]) -> list[Rival]:
    """Return fits with other nuisance numbers that samples cannot tell from a fit, the best first; many samples can."""
    if fitted.problem.residual.count > _TELLING:
        return []
    least, scale = fitted.point.cost, fitted.problem.scale
    fits = [(words, refitted(fitted, nuisance=nuisance)) for words, nuisance in others]
    rivals = [Rival(*fit, 2.0 * (fit[1].cost_at(scale) - least) / fitted.covariance.noise) for fit in fits]
    return sorted((rival for rival in rivals if rival.worse < _ALIKE), key=_WORSE)


def _others(fitted: FittedSurface, clear: Collection[NuisanceKind]) -> list[tuple[str, Nuisance]]:
    """Return what may stand in the place of a kind: another form, or, in words, a kind or a gain over an angle.

    Only kinds that are `clear` may be others. A dark level of f_r itself is no form beside a uniform f_r.
    """
    nuisance = fitted.nuisance
    others: list[tuple[str, Nuisance]] = []
    for kind in nuisance.kinds:
        rest = [other for other in nuisance.kinds if other != kind]
        forms = [form for form in COSINES[kind] if form != nuisance.forms[kind]]
        if kind == "dark" and _uniform(fitted):
            forms = [form for form in forms if any(form)]
        others += [("", replace(nuisance, forms={**nuisance.forms, kind: form})) for form in forms]
        if kind in clear:
            others += [(_WORDS[other], nuisance.of_kinds([*rest, other])) for other in _testable(fitted)]
        if kind in clear and "drift" not in rest:
            over = [replace(nuisance.of_kinds([*rest, "drift"]), order=1.0 - cosine) for cosine in nuisance.cosines.T]
            others += zip(_OVER_ANGLES, over, strict=True)
    return others


def _uniform(fitted: FittedSurface) -> dict[str, tuple[float, float]]:
    """Return the names and the ranges of coefficients of a uniform f_r."""
    terms, every = fitted.surface.terms, fitted.surface.coefficients
    return {one.label: (one.low, one.high) for one in every if one.name == terms[one.term].spec.uniform}


def _over_level(fitted: FittedSurface, estimates: list[Estimate], sentences: list[str]) -> list[Estimate]:
    """Return intervals over a level of f_r itself, if it is asked for and no other is seen; adds a sentence on it."""
    uniform = _uniform(fitted)
    if not uniform or "simulation" in fitted.samples.record:
        return estimates
    names = " and ".join(uniform)
    text = f"A signal that is the same in all f_r, such as stray light, cannot be told from {names}"
    rest = [kind for kind in fitted.nuisance.kinds if kind != "dark"]
    if "dark" not in fitted.nuisance.kinds or not _rivals(fitted, [("", fitted.nuisance.of_kinds(rest))]):
        sentences.append(f"{text}: intervals do not reach over it.")
        return estimates
    sentences.append(f"{text}, and no other dark level is seen: the samples set no limit to {names}.")
    return [_reaching(one, *uniform.get(one.name, (one.low, one.high))) for one in estimates]


def _reaching(one: Estimate, low: float, high: float) -> Estimate:
    """Return an estimate whose interval reaches at least from `low` to `high`."""
    if low >= one.low and high <= one.high:
        return one
    return one.model_copy(update={"low": min(one.low, low), "high": max(one.high, high), "method": "several fits"})


def _over(estimates: list[Estimate], others: list[Estimate]) -> list[Estimate]:
    """Return estimates whose intervals reach over those of another fit."""
    return [_reaching(one, other.low, other.high) for one, other in zip(estimates, others, strict=True)]


def _about(one: Estimate, others: Sequence[Estimate]) -> Estimate:
    """Return an estimate whose interval reaches over the values of others, and beyond them by its half widths.

    It does not reach beyond all their intervals.
    """
    if not others:
        return one
    low = min(other.value for other in others) - (one.value - one.low)
    high = max(other.value for other in others) + (one.high - one.value)
    least, most = min(other.low for other in others), max(other.high for other in others)
    return _reaching(one, max(low, least), min(high, most))


def _over_residuals(fitted: FittedSurface, estimates: list[Estimate], sentences: list[str]) -> list[Estimate]:
    """Return intervals that reach over fits with other residuals; a sentence is added where they differ."""
    kinds: tuple[Kind, ...] = ("noise", "cosine")
    others: dict[Kind, list[Estimate]] = {}
    for kind in kinds:
        with suppress(ParameterError):  # no sample that the residual can use
            if kind != fitted.residual.kind:
                other = _settled(refitted(fitted, Residual(fitted.samples, kind)))
                others[kind] = estimates_of(other, profiles=False)
    wider = [
        _about(one, [other for other in of_others if _apart(one, other)])
        for one, *of_others in zip(estimates, *others.values(), strict=True)
    ]
    parts = []
    if fitted.pattern > _WRONG_PATTERN:
        parts.append(f"{WRONG}: residuals of neighbours are correlated by {fitted.pattern:.2f}.")
    for index, (one, new) in enumerate(zip(estimates, wider, strict=True)):
        if new.high - new.low > _FAR * (one.high - one.low):
            values = (f"{of_kind[index].value:.3g} with --residual {kind}" for kind, of_kind in others.items())
            there = " and ".join(values)
            parts.append(f"The numbers depend on which samples weigh most: {one.name} is {one.value:.3g}, and {there}.")
            break
    if wider != estimates:
        parts.append("The intervals reach over fits with other residuals.")
    sentences += [" ".join(parts)] if parts else []
    return wider


def _apart(one: Estimate, other: Estimate) -> bool:
    """Return True if two fits give a number that noise does not explain."""
    return other.standard_error is None or abs(one.value - other.value) > NORMAL_95 * other.standard_error


def _over_aperture(fitted: FittedSurface, estimates: list[Estimate], sentences: list[str]) -> list[Estimate]:
    """Return intervals that are wider by what the disk of the aperture leaves out of narrow lobes; adds a sentence.

    One disk stands for light and receiver together, and for a receiver that is no disk, such as a blurred pixel. It has
    their variance v along an axis. Its fourth moment along an axis is 2 v^2, and that of a Gaussian blur 3 v^2. A lobe
    of f_r has a variance of 2 alpha^2 in directions, and a blur of v instead of a disk lowers its peak by (v / 2
    alpha^2)^2 / 3; half of that square is taken.
    """
    surface = fitted.surface
    instrument = fitted.samples.instrument
    if instrument.source_solid_angle_sr is None or instrument.receiver_solid_angle_sr is None:
        return estimates
    variance = 0.25 * fitted.view.half_angle**2
    shares: dict[str, float] = {}
    for number, term in enumerate(surface.terms):
        width = term.widths([surface.arguments(number, surface.numbers(fitted.point.x)[number], 0)])
        if width is None or variance == 0.0:
            continue
        share = min(0.5 * (variance / (2.0 * float(width[0]) ** 2)) ** 2, 1.0)
        names = [*(term.spec.lobe_axes or ()), *(one.name for one in surface.coefficients if one.term == number)]
        shares |= {f"{term.label}{name}": share for name in names if name != term.spec.uniform}
    if max(shares.values(), default=0.0) < _LEAST_SHARE:
        return estimates
    sentences.append(
        f"The lobe is narrow, and one disk stands for the apertures of light and receiver: intervals reach "
        f"{100.0 * max(shares.values()):.2g} % farther."
    )
    reaches = [shares.get(one.name, 0.0) * abs(one.value) for one in estimates]
    return [_reaching(one, one.low - reach, one.high + reach) for one, reach in zip(estimates, reaches, strict=True)]
