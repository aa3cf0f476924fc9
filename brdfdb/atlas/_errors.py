"""What the figures of the atlas are made of: forms over a sweep, their errors, and what is stated of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.atlas import _proofs_he_torrance, _proofs_oren_nayar, _proofs_ward
from brdfdb.atlas._proofs import Proof, proved
from brdfdb.figure import Figure, Map, Panel, Picture, Role, Statement, curve_of, rows
from brdfdb.geometry import radians
from brdfdb.misprints import MISPRINTS, Kind, Misprint

Array = NDArray[np.float64]
Arguments = Mapping[str, Any]

LARGEST = 10.0  # what the brightest colour of a map stands for
NONE = 1e-17  # drawn for an error of 0, and for smaller ones: a truth is rounded to float64
ERROR = "relative error (1e-17: none)"
FAILS = 100.0  # a form that is off by so many times what ours is held to is said to fail

BY_KEY = {misprint.key: misprint for misprint in MISPRINTS}
PROOFS: Mapping[str, Proof] = {
    **_proofs_oren_nayar.PROOFS,
    **_proofs_he_torrance.PROOFS,
    **_proofs_ward.PROOFS,
}
# How a figure names the form that is not right, in its caption and its legend, and how it draws it
LEADS: Mapping[Kind, str] = {"printed": "Printed", "customary": "Customary", "words": "In words alone"}
LABELS: Mapping[Kind, str] = {"printed": "as printed", "customary": "as is customary", "words": "as the words say"}
ROLES: Mapping[Kind, Role] = {"printed": "printed", "customary": "textbook", "words": "printed"}
PAPERS = {"orennayar1994": "Oren and Nayar 1994", "he1991": "He et al. 1991", "ward1992": "Ward 1992"}


@dataclass(frozen=True)
class Form:
    """One way to compute something."""

    label: str
    role: Role
    evaluate: Callable[..., Any]


@dataclass(frozen=True)
class Measured:
    """A panel, and the errors of each of its forms, nan where a form gives no finite number."""

    panel: Panel | Map
    errors: list[tuple[str, Role, Array]]


def directions(theta_i: float, theta_r: float, delta_phi: float) -> dict[str, Any]:
    """Arguments of a model, from degrees."""
    return {"theta_i": radians(theta_i), "phi_i": 0.0, "theta_r": radians(theta_r), "phi_r": radians(delta_phi)}


def lobe(alpha: ArrayLike) -> dict[str, Any]:
    """Parameters of a lobe of Ward's alone, round, that should reflect all light."""
    return {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha, "alpha_y": alpha}


def relative(value: Any, truth: Any, scale: float | None = None) -> float:
    """abs(value - truth) over abs(truth), or over `scale`; of matrices the largest of each; nan where not finite."""
    value = np.asarray(value, dtype=np.complex128)
    if not np.isfinite(value).all():
        return np.nan
    return float(np.max(np.abs(value - truth)) / (np.max(np.abs(truth)) if scale is None else scale))


def errors(
    evaluate: Callable[..., Any], arguments: Iterable[Arguments], truths: Iterable[Any], scale: float | None = None
) -> Array:
    """`relative` at each of the arguments; one at a time, since not every form broadcasts."""
    with np.errstate(all="ignore"):  # what a form overflows or divides by 0 is what is looked for
        found = [relative(evaluate(**row), truth, scale) for row, truth in zip(arguments, truths, strict=True)]
    return np.array(found)


def sweep(
    x: Sequence[float] | Array,
    x_label: str,
    arguments: Callable[[float], Arguments],
    truth: Callable[..., Any],
    forms: Sequence[Form],
    *,
    title: str = "",
    log_x: bool = False,
    scale: float | None = None,
) -> Measured:
    """A panel of relative errors over x; `arguments` are those of a form, and of its truth, at x."""
    rows = [arguments(float(each)) for each in x]
    truths = [rounded(truth(**row)) for row in rows]
    measured = [(form.label, form.role, errors(form.evaluate, rows, truths, scale)) for form in forms]
    curves = [curve_of(named(label, found), axis(x), np.maximum(found, NONE), role) for label, role, found in measured]
    y_label = ERROR if scale is None else ERROR.replace("relative error", f"error over {scale:.3g}/sr")
    panel = Panel(title=title, x_label=x_label, y_label=y_label, curves=curves, log_x=log_x, log_y=True)
    return Measured(panel, measured)


def axis(x: Sequence[float] | Array) -> list[float]:
    return [float(f"{each:.6g}") for each in x]


def rounded(truth: Any) -> Any:
    """A number or a 2x2 matrix of mpmath as float64 or complex128."""
    if hasattr(truth, "rows"):
        return np.array([[complex(truth[row, column]) for column in range(2)] for row in range(2)])
    return float(truth)


def named(label: str, found: Array) -> str:
    """A label that tells of gaps: one at the end of a curve is not seen."""
    gaps = int(np.isnan(found).sum())
    return label if gaps == 0 else f"{label} (nan or inf at {gaps} of {found.size})"


def error_map(x: Array, y: Array, form: Form, found: Array, *, x_label: str, y_label: str) -> Measured:
    """A map of the errors of one form over logarithmic axes, x running fastest."""
    panel = Map(
        title=named(form.label, found),
        x_label=x_label,
        y_label=y_label,
        value_label=ERROR,
        x=axis(x),
        y=axis(y),
        values=rows(np.maximum(found.reshape(y.size, x.size), NONE), 3),
        log_x=True,
        log_y=True,
        log=True,
        low=NONE,
        high=LARGEST,
    )
    return Measured(panel, [(form.label, form.role, found)])


def figure(
    key: str,
    paper: str,
    where: str,
    title: str,
    caption: str,
    measured: Sequence[Measured],
    *,
    within: float,
    more: Sequence[Statement] = (),
) -> Figure:
    """A figure with a statement a form, that ours stays `within` and that the others do not, and with `more`.

    `where` names the equations; the paper is added.
    """
    found: dict[tuple[str, Role], list[Array]] = {}
    for label, role, values in (each for panel in measured for each in panel.errors):
        found.setdefault((label, role), []).append(values)
    source = f"{where}, {PAPERS[paper]}"
    statements = [
        (stays if role == "ours" else fails)(label, np.concatenate(values), within, source)
        for (label, role), values in found.items()
    ]
    panels: list[Panel | Map | Picture] = [each.panel for each in measured]
    return Figure(key=key, paper=paper, title=title, caption=caption, panels=panels, statements=[*statements, *more])


def stays(label: str, found: Array, within: float, where: str) -> Statement:
    worst, gaps = worst_of(found)
    return Statement(
        says=f"{label}: within {within:.2g} of the truth everywhere",
        where=where,
        seen=f"off by {worst:.2g} at most, of {found.size} points",
        holds=gaps == 0 and worst <= within,
    )


def fails(label: str, found: Array, within: float, where: str) -> Statement:
    worst, gaps = worst_of(found)
    seen = [f"off by up to {worst:.2g}"] * (gaps < found.size) + [f"nan or inf at {gaps}"] * (gaps > 0)
    return Statement(
        says=f"{label}: off by more than {FAILS * within:.2g} somewhere, or no number at all",
        where=where,
        seen=f"{', '.join(seen)}, of {found.size} points",
        holds=gaps > 0 or worst > FAILS * within,
    )


def worst_of(found: Array) -> tuple[float, int]:
    """The largest error of all that are finite, and how many are not."""
    gaps = np.isnan(found)
    return float(np.max(found[~gaps], initial=0.0)), int(gaps.sum())


def of_misprint(
    key: str, title: str, caption: str, measured: Sequence[Measured], *, within: float, more: Sequence[Statement] = ()
) -> Figure:
    """Return the figure of a misprint: its kind and both forms stand before the caption, its proof among `more`."""
    entry = BY_KEY[key]
    where = entry.equation
    if where[0].isdigit():
        where = f"{'eqs' if re.search(r'[,-] ?[0-9]', where) else 'eq.'} {where}"
    text = f"{LEADS[entry.kind]}: {entry.printed}. Right: {entry.right}. {caption}"
    proof = proved(entry, PROOFS[key], f"{where}, {PAPERS[entry.paper]}")
    return figure(key, entry.paper, where, title, text, measured, within=within, more=[*more, proof])


def wrong(entry: Misprint, label: str = "") -> Form:
    """Return the form of an entry that is not right, labelled and drawn by its kind."""
    return Form(label or LABELS[entry.kind], ROLES[entry.kind], entry.as_printed)


def misprint(
    key: str,
    title: str,
    x: Sequence[float] | Array,
    x_label: str,
    arguments: Callable[[float], Arguments],
    truth: Callable[..., Any],
    *,
    caption: str,
    within: float,
    log_x: bool = False,
    scale: float | None = None,
) -> Figure:
    """The figure of a misprint: the printed form and ours over x, the other arguments those where the two differ."""
    entry = BY_KEY[key]
    forms = [wrong(entry), Form("ours", "ours", entry.corrected)]
    panel = sweep(x, x_label, lambda each: {**entry.where, **arguments(each)}, truth, forms, log_x=log_x, scale=scale)
    return of_misprint(key, title, caption, [panel], within=within)
