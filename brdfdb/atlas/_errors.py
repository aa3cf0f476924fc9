"""Building blocks of the atlas: forms over a sweep, their errors, and the statements about them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.atlas._proofs import PROOFS, proved
from brdfdb.figure import Figure, Map, Panel, Picture, Role, Statement, curve_of, rows
from brdfdb.geometry import radians, unit_vector
from brdfdb.misprints import MISPRINTS, Kind, Misprint

Array = NDArray[np.float64]
Arguments = Mapping[str, Any]

# Relative errors that the models promise. Worst measured errors of closed forms: 9.9e-16 for Oren and Nayar, 8.8e-13
# for He et al. with the sum of eq. 78 and 8e-16 without it, 3.4e-11 for Ward at an alpha of 1e-6
CLOSED = 1e-10
SINGLE = 2e-5  # Promised for float32. Worst measured: 4.4e-8, 3.8e-8 and 4.8e-8

LARGEST = 10.0  # error that the brightest colour of a map stands for
NONE = 1e-17  # drawn for an error of 0 and for smaller errors, because a truth is rounded to float64
ERROR = "relative error (1e-17: none)"
FAILS = 100.0  # A form fails where its error exceeds this multiple of the tolerance of our form

CORNER = 1e-13  # drawn for a distance of 0 on a logarithmic axis
DISTANCES = [*np.logspace(-0.5, -12.0, 24), CORNER]  # from a corner of the directions [rad]
TRUTH = "Truth: 40 digits."
LIGHT = "light [degrees from the normal]"
VIEWER = "viewer [degrees from the normal]"
OFF_LIGHT = "viewer off the light [radians]"

BY_KEY = {misprint.key: misprint for misprint in MISPRINTS}
# Names and roles of the form that is not right: in the caption, in the legend, and as drawn
LEADS: Mapping[Kind, str] = {"printed": "Printed", "customary": "Customary", "words": "In words alone"}
LABELS: Mapping[Kind, str] = {"printed": "as printed", "customary": "as is customary", "words": "as the words say"}
ROLES: Mapping[Kind, Role] = {"printed": "printed", "customary": "textbook", "words": "printed"}
PAPERS = {
    "orennayar1994": "Oren and Nayar 1994",
    "he1991": "He et al. 1991",
    "ward1992": "Ward 1992",
    "rahman1993": "Rahman et al. 1993",
    "lucht2000": "Lucht et al. 2000",
}


@dataclass(frozen=True)
class ComparedForm:
    """One way to compute a quantity."""

    label: str
    role: Role
    evaluate: Callable[..., Any]


@dataclass(frozen=True)
class ErrorPanel:
    """A panel, and the errors of each of its forms; nan where a form gives no finite number."""

    panel: Panel | Map
    errors: list[tuple[str, Role, Array]]


def directions(theta_i: float, theta_r: float, delta_phi: float) -> dict[str, Any]:
    """Return the angles [rad] that a model takes, from angles in degrees."""
    return {"theta_i": radians(theta_i), "phi_i": 0.0, "theta_r": radians(theta_r), "phi_r": radians(delta_phi)}


def lobe(alpha: ArrayLike) -> dict[str, Any]:
    """Return the parameters of Ward's round lobe alone, with a specular reflectance of 1."""
    return {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha, "alpha_y": alpha}


def of_vectors(model: Callable[..., Any]) -> Callable[..., Any]:
    """Return a model of unit vectors as a function of angles."""

    def evaluate(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **parameters: float) -> Any:
        return model(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r), **parameters)

    return evaluate


def zero(distance: float) -> float:
    """Return the distance that a point of the logarithmic axis stands for: 0 at `CORNER`."""
    return 0.0 if distance == CORNER else distance


def relative(value: Any, truth: Any, scale: float | None = None) -> float:
    """Return the relative error [1] of a value, or its error over `scale`.

    Of matrices it is the largest error over the largest element. A value that is not finite has nan.
    """
    value = np.asarray(value, dtype=np.complex128)
    if not np.isfinite(value).all():
        return np.nan
    return float(np.max(np.abs(value - truth)) / (np.max(np.abs(truth)) if scale is None else scale))


def errors(
    evaluate: Callable[..., Any], arguments: Iterable[Arguments], truths: Iterable[Any], scale: float | None = None
) -> Array:
    """Return the `relative` errors of a form, evaluated point by point because not every form broadcasts."""
    with np.errstate(all="ignore"):  # The atlas looks for overflow and division by 0
        return np.array([relative(evaluate(**row), truth, scale) for row, truth in zip(arguments, truths, strict=True)])


@dataclass(frozen=True)
class FormSweep:
    """A quantity x over which forms are compared with the truth.

    `arguments` gives the arguments of the forms and of the truth at x. Errors are relative, or over `scale` [1/sr].
    """

    x: Sequence[float] | Array
    x_label: str
    arguments: Callable[[float], Arguments]
    truth: Callable[..., Any]
    title: str = ""
    log_x: bool = False
    scale: float | None = None

    def panel(self, forms: Sequence[ComparedForm]) -> ErrorPanel:
        """Return the panel of the errors of forms."""
        rows = [self.arguments(float(value)) for value in self.x]
        truths = [rounded(self.truth(**row)) for row in rows]
        measured = [(form.label, form.role, errors(form.evaluate, rows, truths, self.scale)) for form in forms]
        curves = [
            curve_of(with_gaps(label, deviations), axis(self.x), np.maximum(deviations, NONE), role)
            for label, role, deviations in measured
        ]
        y_label = ERROR if self.scale is None else ERROR.replace("relative error", f"error over {self.scale:.3g}/sr")
        panel = Panel(
            title=self.title, x_label=self.x_label, y_label=y_label, curves=curves, log_x=self.log_x, log_y=True
        )
        return ErrorPanel(panel, measured)


def axis(x: Sequence[float] | Array) -> list[float]:
    """Return the values of an axis to six digits."""
    return [float(f"{value:.6g}") for value in x]


def rounded(truth: Any) -> Any:
    """Return a number or a 2x2 matrix of mpmath as float64 or complex128."""
    if hasattr(truth, "rows"):
        return np.array([[complex(truth[row, column]) for column in range(2)] for row in range(2)])
    return float(truth)


def with_gaps(label: str, deviations: Array) -> str:
    """Return a label with the number of gaps, because a gap at the end of a curve cannot be seen."""
    gaps = int(np.isnan(deviations).sum())
    return label if gaps == 0 else f"{label} (nan or inf at {gaps} of {deviations.size})"


def error_map(x: Array, y: Array, form: ComparedForm, deviations: Array, *, x_label: str, y_label: str) -> ErrorPanel:
    """Return a map of the errors of one form over logarithmic axes; x runs fastest."""
    panel = Map(
        title=with_gaps(form.label, deviations),
        x_label=x_label,
        y_label=y_label,
        value_label=ERROR,
        x=axis(x),
        y=axis(y),
        values=rows(np.maximum(deviations.reshape(y.size, x.size), NONE), 3),
        log_x=True,
        log_y=True,
        log=True,
        low=NONE,
        high=LARGEST,
    )
    return ErrorPanel(panel, [(form.label, form.role, deviations)])


def figure(
    key: str,
    paper: str,
    where: str,
    title: str,
    caption: str,
    measured: Sequence[ErrorPanel],
    *,
    within: float,
    more: Sequence[Statement] = (),
) -> Figure:
    """Return a figure with one statement per form, and with the statements in `more`.

    Our form has to stay within `within`, the others have to fail. `where` names the equations; the paper is added.
    """
    by_form: dict[tuple[str, Role], list[Array]] = {}
    for label, role, deviations in (entry for panel in measured for entry in panel.errors):
        by_form.setdefault((label, role), []).append(deviations)
    source = f"{where}, {PAPERS[paper]}"
    statements = [
        (stays if role == "ours" else fails)(label, np.concatenate(deviations), within, source)
        for (label, role), deviations in by_form.items()
    ]
    panels: list[Panel | Map | Picture] = [entry.panel for entry in measured]
    return Figure(key=key, paper=paper, title=title, caption=caption, panels=panels, statements=[*statements, *more])


def stays(label: str, deviations: Array, within: float, where: str) -> Statement:
    """Return the statement that a form stays within a tolerance of the truth."""
    worst, gaps = worst_of(deviations)
    return Statement(
        says=f"{label}: within {within:.2g} of the truth everywhere",
        where=where,
        seen=f"off by {worst:.2g} at most, of {deviations.size} points",
        holds=gaps == 0 and worst <= within,
    )


def fails(label: str, deviations: Array, within: float, where: str) -> Statement:
    """Return the statement that a form exceeds `FAILS` times a tolerance, or gives no finite number."""
    worst, gaps = worst_of(deviations)
    seen = [f"off by up to {worst:.2g}"] * (gaps < deviations.size) + [f"nan or inf at {gaps}"] * (gaps > 0)
    return Statement(
        says=f"{label}: off by more than {FAILS * within:.2g} somewhere, or no number at all",
        where=where,
        seen=f"{', '.join(seen)}, of {deviations.size} points",
        holds=gaps > 0 or worst > FAILS * within,
    )


def worst_of(deviations: Array) -> tuple[float, int]:
    """Return the largest finite error [1] and the number of errors that are not finite."""
    gaps = np.isnan(deviations)
    return float(np.max(deviations[~gaps], initial=0.0)), int(gaps.sum())


def of_misprint(
    key: str,
    title: str,
    caption: str,
    measured: Sequence[ErrorPanel],
    *,
    within: float,
    more: Sequence[Statement] = (),
) -> Figure:
    """Return the figure of a misprint: its kind and both forms precede the caption, its proof follows `more`."""
    entry = BY_KEY[key]
    where = entry.equation
    if where[0].isdigit():
        where = f"{'eqs' if re.search(r'[,-] ?[0-9]', where) else 'eq.'} {where}"
    text = f"{LEADS[entry.kind]}: {entry.printed}. Right: {entry.right}. {caption}"
    proof = proved(entry, PROOFS[key], f"{where}, {PAPERS[entry.paper]}")
    return figure(key, entry.paper, where, title, text, measured, within=within, more=[*more, proof])


def wrong(entry: Misprint, label: str = "") -> ComparedForm:
    """Return the form of an entry that is not right, labelled and drawn by its kind."""
    return ComparedForm(label or LABELS[entry.kind], ROLES[entry.kind], entry.as_printed)


def misprint(
    key: str, title: str, sweep: FormSweep, *, caption: str, within: float = CLOSED
) -> tuple[str, Callable[[], Figure]]:
    """Return the key of a misprint and the function that draws its figure: both forms over one quantity.

    The arguments that the sweep does not give are those of the entry, where the two forms differ.
    """
    entry = BY_KEY[key]

    def draw() -> Figure:
        whole = replace(sweep, arguments=lambda x: {**entry.where, **sweep.arguments(x)})
        panel = whole.panel([wrong(entry), ComparedForm("ours", "ours", entry.corrected)])
        return of_misprint(key, title, caption, [panel], within=within)

    return key, draw
