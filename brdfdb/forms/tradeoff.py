"""Speed against accuracy: error and cost of all forms of a material or of a family, and the front."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from brdfdb.figure import DocumentPart
from brdfdb.forms import catalogue, sampler_efficiency, timing
from brdfdb.forms.catalogue import SPECTRAL_TOLERANCES, Form, Kind, LeftOut, of_family
from brdfdb.forms.surface_rays import ChartedSurface, charted_surface
from brdfdb.materials import Material, Source, exact_material
from brdfdb.materials.provenance import Number
from brdfdb.materials.spectrum import Spectrum
from brdfdb.microgeometry.model_errors import SurfaceError, surface_error
from brdfdb.parameters import Floats
from brdfdb.store.family import Family, Sweep
from brdfdb.tables import error_measurement

DIRECTIONS = 1000  # directions per band of theta_i
SEED = 1992
BLOCK = 256  # directions of a call of medium size
SINGLES = 21  # rounds of calls with one direction, and with `BLOCK` directions
TIMED = timing.ROUNDS + 2 * SINGLES  # calls of `tick` during the timing
STEPS = 5 + TIMED  # calls of `tick` for a chart
SHARE = 0.99  # charted percentile
CONFIDENCE = 0.95  # of the interval of this percentile


class Cost(DocumentPart):
    """Time of an evaluation on one thread of the machine that made the chart."""

    ns: float = Field(description="median over all rounds of the time of a value of f_r: one direction, one wavelength")
    low: float = Field(description="lower quartile")
    high: float = Field(description="upper quartile")
    directions: int = Field(description="number of directions evaluated at once")


class ChartedForm(DocumentPart):
    """A form and its costs."""

    key: str
    title: str
    kind: Kind
    python: str = Field(description="name in Python")
    dtype: Literal["float64", "float32"]
    bytes: int = Field(description="size of the numbers that an evaluation reads")
    batch: Cost = Field(description="cost with 100 000 directions at once; slow forms get fewer")
    block: Cost = Field(description="cost with 256 directions at once")
    single: Cost = Field(description="cost with one direction")


class Saving(DocumentPart):
    """A ratio of times within rounds."""

    low: float = Field(description="lower quartile")
    times: float = Field(description="median")
    high: float = Field(description="upper quartile")


class ChartPoint(ChartedForm):
    """A form with its errors, which are relative to the truth, at the worst wavelength."""

    l1: float = Field(description="mean of abs(f_r - truth) over the mean of the truth, weighted with the cosine")
    p99: float = Field(description="99th percentile of abs(f_r - truth) / max(truth, floor)")
    p99_low: float = Field(description="lower end of the 95 % confidence interval of p99, an order statistic")
    p99_high: float | None = Field(description="upper end; null if there are too few directions")
    forward: float = Field(description="l1 for viewers within 45 degrees of the azimuth of the mirror direction")
    back: float = Field(description="l1 for viewers within 45 degrees of the azimuth of the light")
    grazing: float = Field(description="l1 where light or viewer is beyond 75 degrees")
    mixed: Cost = Field(
        description="cost with 64 materials in turn, 32 directions of each, read from memory and not from caches"
    )
    rung: str | None = Field(
        description="key of the cheapest rung of the truth as accurate in l1 and p99; null for the truth and its rungs"
    )
    saving: Saving | None = Field(description="time of that rung over the time of this form, in batches")


class SamplerWork(DocumentPart):
    """Noise and time of a Monte Carlo estimate."""

    variance: float = Field(description="variance of one sample over the square of the mean; median over rounds")
    ns: float = Field(description="time of one sample; median over rounds")
    low_ms: float = Field(description="time to a standard deviation of 1 %: lower quartile over rounds")
    ms: float = Field(description="median")
    high_ms: float = Field(description="upper quartile")


class ChartedSampler(DocumentPart):
    """A way to draw directions, for the model of the material at its middle wavelength, without the specular part."""

    key: str
    title: str
    albedo: SamplerWork = Field(description="work for the directional albedo of light from 60 degrees")
    sphere: SamplerWork = Field(
        description="work for the picture of a sphere under a sky and a lamp about 20 degrees wide"
    )


class Fronts(DocumentPart):
    """Keys of the points worth having, the most accurate (l1) first, each clearly cheaper than the one before.

    Models that are meant to differ are left out, and so are forms with a larger error than black.
    """

    batch: list[str]
    single: list[str]
    bytes: list[str]


class Chart(DocumentPart):
    """One material."""

    material: str
    title: str
    model: str
    parameters: dict[str, Number | Spectrum] = Field(description="angles in degrees, under names that end in _deg")
    wavelength_nm: list[float] | None
    directions: int = Field(description="number of directions at which errors are measured")
    truth: str = Field(description="key of the point that the others are compared with")
    points: list[ChartPoint]
    ladder: list[str] = Field(description="keys of the truth and of its rungs, the most accurate (l1) first")
    fronts: Fronts
    samplers: list[ChartedSampler]
    left_out: list[LeftOut] = Field(default=[], description="forms that cannot be made, such as a table too large")
    surface: ChartedSurface | None = Field(
        default=None, description="rays on the surface that suits the material; null: no map of errors for the truth"
    )


class FamilyCurve(ChartedForm):
    """A form along a family. Errors are those of a point, and bytes and costs are those of one member."""

    timed: str = Field(description="timed member: the one with this form that is nearest the middle of the family")
    l1: list[float | None] = Field(description="l1 of each member; null where there is no such form")
    p99: list[float | None]


class BetweenMembers(ChartedForm):
    """Lookups between the members of a family in a store, timed in its middle."""

    l1: float = Field(description="l1 that the family states, over all its parameters")
    p99: float


class FamilyDiagnostic(DocumentPart):
    """A number that shows the regime of the model of a member, at the middle wavelength."""

    symbol: str
    title: str
    values: list[float] = Field(description="value of each member")


class LeftOutOfMember(LeftOut):
    """A form that cannot be made of a member of a family."""

    member: str


class FamilyChart(DocumentPart):
    """A family: the forms worth having at each of its members."""

    family: str
    title: str
    model: str
    axes: dict[str, list[float]] = Field(description="values of each swept parameter, as in the record of a family")
    members: list[str] = Field(description="names of the materials; the last axis runs fastest")
    diagnostic: FamilyDiagnostic | None = Field(description="null unless the model names one")
    wavelength_nm: list[float] | None
    truth: str = Field(description="key of the curve that the others are compared with")
    curves: list[FamilyCurve]
    between: BetweenMembers | None = Field(description="null unless the family is in the store")
    fronts: list[list[str]] = Field(
        description="for each member, keys of the curves worth having in bulk, as in a chart, with the costs above"
    )
    left_out: list[LeftOutOfMember] = Field(default=[], description="forms that cannot be made of a member")
    surface: list[SurfaceError | None] = Field(
        default=[],
        description="error of the truth of each member against rays on the surface that suits it; null: no map",
    )


class Charts(DocumentPart):
    """Charts of materials and families from one run. A file holds one of them."""

    brdfdb: str
    when: datetime
    machine: str
    charts: list[Chart]
    families: list[FamilyChart]


def chart(
    source: Source,
    wavelength_nm: NDArray[np.float64] | None,
    tolerances: Sequence[float] | None = None,
    *,
    also: Sequence[Form] = (),
    tick: Callable[[], None] = lambda: None,
) -> Chart:
    """Measure error and cost of all forms of a source.

    Parameters
    ----------
    source : Source
        A material of any model, or a function.
    wavelength_nm : array of shape (L,) [nm], or None
        Wavelengths of a spectral source, and only of such a source.
    tolerances : sequence of float, optional
        Tolerances of planned tables, as in `catalogue.forms`.
    also : sequence of Form
        More forms at the same wavelengths, such as a table of a store.
    tick : callable
        A function that is called `STEPS` times.

    Returns
    -------
    Chart
        Errors are measured as stated errors are, at other directions: see `brdfdb.tables.error_measurement`.

    Raises
    ------
    ParameterError
        If a tolerance is outside its range, or the wavelengths do not suit the material.
    """
    offered = catalogue.forms(source, wavelength_nm, tolerances)
    forms = [*offered, *also]
    tick()
    drawn = error_measurement.draw(source, wavelength_nm, DIRECTIONS, SEED)
    errors = _errors(forms, drawn)
    tick()
    batch, block, single = _timed(forms, drawn, tick)
    mixed = timing.mixed_times(forms, drawn.wi[drawn.above], drawn.wr[drawn.above])
    tick()
    middle = None if wavelength_nm is None else float(wavelength_nm[wavelength_nm.size // 2])
    samplers = [
        ChartedSampler(key=key, title=sampler_efficiency.SAMPLERS[key], albedo=_work(albedo), sphere=_work(sphere))
        for key, (albedo, sphere) in sampler_efficiency.works(source, middle).items()
    ]
    tick()
    surface = charted_surface(_truth(source, forms[0]))
    tick()
    seconds = np.stack([cost.seconds for cost in batch], axis=1)
    rungs = [number for number, form in enumerate(forms) if form.kind in ("exact", "quadrature") and not form.rounded]
    front = functools.partial(_front, forms, [error["l1"] for error in errors])
    return Chart(
        material=source.name,
        title=source.title,
        model=source.model if isinstance(source, Material) else "function",
        parameters=source.attributes()["parameters"] if isinstance(source, Material) else {},
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        directions=int(np.count_nonzero(drawn.above)),
        truth=forms[0].key,
        points=[
            ChartPoint(
                **_described(form, batch[number], block[number], single[number]),
                **errors[number],
                **_against(number, rungs, errors, seconds, forms),
                mixed=_cost(mixed[number]),
            )
            for number, form in enumerate(forms)
        ],
        ladder=[forms[number].key for number in sorted(rungs, key=lambda number: errors[number]["l1"])],
        fronts=Fronts(
            batch=front(seconds),
            single=front(np.stack([cost.seconds for cost in single], axis=1)),
            bytes=front(np.array([[form.bytes for form in forms]], dtype=np.float64)),
        ),
        samplers=samplers,
        left_out=offered.left_out,
        surface=surface,
    )


def _against(
    number: int, rungs: Sequence[int], errors: Sequence[dict[str, Any]], seconds: Floats, forms: Sequence[Form]
) -> dict[str, Any]:
    """Return fields of a `ChartPoint`: the cheapest rung as accurate as a form, and the ratio of their times."""
    if forms[number].kind in ("exact", "quadrature"):
        return {"rung": None, "saving": None}
    error = errors[number]
    as_good = [rival for rival in rungs if errors[rival]["l1"] <= error["l1"] and errors[rival]["p99"] <= error["p99"]]
    rung = min(as_good, key=lambda rival: float(np.median(seconds[:, rival])))
    ratios = timing.quartiles(seconds[:, rung] / seconds[:, number])
    saving = Saving(low=_short(ratios.low), times=_short(ratios.middle), high=_short(ratios.high))
    return {"rung": forms[rung].key, "saving": saving}


def _work(work: sampler_efficiency.Work) -> SamplerWork:
    times_ms = timing.quartiles(1e3 * work.seconds_to_percent)
    return SamplerWork(
        variance=_short(float(np.median(work.variance))),
        ns=_short(1e9 * float(np.median(work.seconds))),
        low_ms=_short(times_ms.low),
        ms=_short(times_ms.middle),
        high_ms=_short(times_ms.high),
    )


def chart_family(
    sweep: Sweep,
    materials: Sequence[Material],
    wavelength_nm: NDArray[np.float64] | None,
    tolerances: Sequence[float] | None = None,
    *,
    family: Family | None = None,
    tick: Callable[[], None] = lambda: None,
) -> FamilyChart:
    """Measure the errors of all forms at all members of a family, and the cost of each form at one member.

    Parameters
    ----------
    sweep : Sweep
        The family.
    materials : sequence of Material
        The members of the family, in order.
    wavelength_nm : array of shape (L,) [nm], or None
        Wavelengths of spectral materials, and only of such materials.
    tolerances : sequence of float, optional
        Tolerances of planned tables, as in `catalogue.forms`. The default is 0.1 and 0.01.
    family : Family, optional
        The family in a store, whose lookups between members are measured, too.
    tick : callable
        A function that is called once for each member, and `TIMED` times.

    Returns
    -------
    FamilyChart
        Errors of members are measured as in `chart`.

    Raises
    ------
    ParameterError
        If a tolerance is outside its range, or the wavelengths do not suit the materials.
    StoreError
        If a member of `family` was built again since it was recorded.
    """
    tolerances = SPECTRAL_TOLERANCES if tolerances is None else tolerances
    representatives, errors, left_out = _forms_of_members(materials, wavelength_nm, tolerances, tick)
    timed = [form for _, form in representatives.values()]
    between = None if family is None else of_family(family)
    drawn = error_measurement.draw(materials[len(materials) // 2], wavelength_nm, DIRECTIONS, SEED)
    batch, block, single = _timed([*timed, *([between] if between else [])], drawn, tick)
    seconds = np.stack([cost.seconds for cost in batch], axis=1)
    fronts = []
    for member in errors:
        present = [index for index, form in enumerate(timed) if form.key in member]
        rivals = [timed[index] for index in present]
        fronts.append(_front(rivals, [member[form.key]["l1"] for form in rivals], seconds[:, present]))
    return FamilyChart(
        family=sweep.name,
        title=sweep.title,
        model=sweep.model,
        axes=sweep.axes,
        members=sweep.members,
        diagnostic=_diagnostic(materials, wavelength_nm),
        wavelength_nm=None if wavelength_nm is None else wavelength_nm.tolist(),
        truth=timed[0].key,
        curves=[
            FamilyCurve(
                **_described(form, *costs),
                timed=sweep.members[number],
                l1=[member[form.key]["l1"] if form.key in member else None for member in errors],
                p99=[member[form.key]["p99"] if form.key in member else None for member in errors],
            )
            for (number, form), *costs in zip(representatives.values(), batch, block, single, strict=False)
        ],
        between=None
        if family is None or between is None
        else BetweenMembers(
            **_described(between, batch[-1], block[-1], single[-1]),
            l1=family.error.overall.l1,
            p99=family.error.overall.p99,
        ),
        fronts=fronts,
        left_out=left_out,
        surface=[None if (exact := _truth(member, timed[0])) is None else surface_error(exact) for member in materials],
    )


def _truth(source: Source, form: Form) -> Material | None:
    """Return the material whose model is the first form of a source; None if that is no model of the registry."""
    exact = exact_material(source) if isinstance(source, Material) else None
    return exact if exact is not None and form.python == f"models.{exact.model}" else None


def _forms_of_members(
    materials: Sequence[Material],
    wavelength_nm: NDArray[np.float64] | None,
    tolerances: Sequence[float],
    tick: Callable[[], None],
) -> tuple[dict[str, tuple[int, Form]], list[dict[str, dict[str, Any]]], list[LeftOutOfMember]]:
    """Return by key the form of the member nearest the middle and its number, and by key the errors of all members.

    The forms that cannot be made of a member come last.
    """
    middle = len(materials) // 2
    left_out: list[LeftOutOfMember] = []
    representatives: dict[str, tuple[int, Form]] = {}
    errors: list[dict[str, dict[str, Any]]] = []
    for number, material in enumerate(materials):
        forms = catalogue.forms(material, wavelength_nm, tolerances)
        drawn = error_measurement.draw(material, wavelength_nm, DIRECTIONS, SEED)
        left_out += [LeftOutOfMember(member=material.name, **out.model_dump()) for out in forms.left_out]
        errors.append(dict(zip((form.key for form in forms), _errors(forms, drawn), strict=True)))
        for form in forms:
            if form.key not in representatives or abs(number - middle) <= abs(representatives[form.key][0] - middle):
                representatives[form.key] = number, form
        tick()
    return representatives, errors, left_out


def _diagnostic(materials: Sequence[Material], wavelength_nm: NDArray[np.float64] | None) -> FamilyDiagnostic | None:
    """Return the diagnostic that the model of a family names, for each member; None if it names none."""
    diagnostic = materials[0].spec.diagnostic
    if diagnostic is None:
        return None
    middle = None if wavelength_nm is None else wavelength_nm[wavelength_nm.size // 2]
    values = [_short(diagnostic.value(material.arguments(middle))) for material in materials]
    return FamilyDiagnostic(symbol=diagnostic.symbol, title=diagnostic.title, values=values)


def _timed(
    forms: Sequence[Form], drawn: error_measurement.RandomPairs, tick: Callable[[], None]
) -> tuple[list[timing.Times], list[timing.Times], list[timing.Times]]:
    """Return the times of calls with many directions, with a block of them, and with one."""
    # Directions are shuffled, so that a few of them are as varied as all
    mixed = np.random.default_rng(SEED).permutation(np.flatnonzero(drawn.above))
    wi = drawn.wi[mixed]
    wr = drawn.wr[mixed]
    batch = timing.times(forms, wi, wr, rounds=timing.ROUNDS, tick=tick)
    block, single = (timing.times(forms, wi, wr, most=most, rounds=SINGLES, tick=tick) for most in (BLOCK, 1))
    return batch, block, single


def _front(forms: Sequence[Form], l1: Sequence[float], costs: Floats) -> list[str]:
    """Return keys of the forms worth having. `costs` has one column per form."""
    # A black surface costs nothing and has an l1 of 1, so a form with a larger error is not worth having
    rivals = [
        index
        for index, (form, error) in enumerate(zip(forms, l1, strict=True))
        if form.kind != "other model" and error < 1.0
    ]
    return [forms[rivals[index]].key for index in timing.front([l1[index] for index in rivals], costs[:, rivals])]


def _described(form: Form, batch: timing.Times, block: timing.Times, single: timing.Times) -> dict[str, Any]:
    """Return the fields of a `Form`."""
    return {
        "key": form.key,
        "title": form.title,
        "kind": form.kind,
        "python": form.python,
        "dtype": "float32" if form.dtype is np.float32 else "float64",
        "bytes": form.bytes,
        "batch": _cost(batch),
        "block": _cost(block),
        "single": _cost(single),
    }


def _errors(forms: Sequence[Form], drawn: error_measurement.RandomPairs) -> list[dict[str, Any]]:
    """Return the errors of each form against the first one, fields of a `ChartPoint` with three digits."""
    truth = forms[0].evaluate(drawn.wi, drawn.wr)
    classes = drawn.classes()
    rows = []
    for form in forms:
        given = drawn.wi.astype(form.dtype), drawn.wr.astype(form.dtype)
        values = truth if form is forms[0] else form.evaluate(*given).astype(np.float64)
        overall = error_measurement.compare(values, truth, drawn, SEED).overall
        parts = {
            name: _short(error_measurement.mean_error(values, truth, np.where(some, drawn.weight, 0.0)).max())
            for name, some in classes.items()
        }
        low, high = _tail(
            error_measurement.relative(values, truth, error_measurement.floor_of(truth, drawn))[drawn.above]
        )
        rows.append({"l1": overall.l1, "p99": overall.p99, "p99_low": low, "p99_high": high, **parts})
    return rows


def _tail(errors: Floats) -> tuple[float, float | None]:
    """Return the confidence interval of the 99th percentile of errors (N, L), at the worst wavelength.

    Its ends are two of the errors. Directions count as independent. They are stratified in theta_i, so that the
    interval is wider than necessary.
    """
    worst = np.sort(errors[:, int(np.argmax(np.percentile(errors, 100.0 * SHARE, axis=0)))])
    low, high = ranks(len(worst), SHARE, CONFIDENCE)
    at = [None if rank > len(worst) else _short(worst[max(rank, 1) - 1]) for rank in (low, high)]
    return at[0] or 0.0, at[1]


def ranks(count: int, share: float, confidence: float) -> tuple[int, int]:
    """Return the ranks, from 1, of the order statistics that enclose a quantile with a confidence (binomial law).

    `count` independent draws are taken, and `share` of the distribution is below the quantile. Rank 0 stands for no
    lower bound, and count + 1 for no upper bound.
    """
    k = np.arange(count + 1)
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, count + 1)))])
    log_pmf = (
        log_factorial[-1] - log_factorial - log_factorial[::-1] + k * np.log(share) + (count - k) * np.log1p(-share)
    )
    below = np.cumsum(np.exp(log_pmf))  # probability that k draws or fewer are below the quantile
    # P(the draw of rank r > quantile) = P(fewer than r below) = below[r - 1]
    rest = 0.5 * (1.0 - confidence)
    low = int(np.searchsorted(below, rest, side="right"))
    high = int(np.searchsorted(below, 1.0 - rest, side="left")) + 1
    return low, min(high, count + 1)


def _cost(times: timing.Times) -> Cost:
    ns = times.quartiles_ns
    return Cost(ns=_short(ns.middle), low=_short(ns.low), high=_short(ns.high), directions=times.directions)


def _short(value: float) -> float:
    """Return a number with three digits."""
    return float(f"{value:.3g}")
