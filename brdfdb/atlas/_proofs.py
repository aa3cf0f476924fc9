"""Physical laws that the right forms obey and the printed ones break, computed without reference or kernels."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Statement
from brdfdb.integrals.quadrature import gauss_rule
from brdfdb.misprints import Misprint

Array = NDArray[np.float64]
Form = Callable[..., Any]
Law = Callable[[Form], float]

BREAKS = 3.0  # A form breaks the law where its deviation exceeds this multiple of `Proof.within`


@dataclass(frozen=True)
class Proof:
    """A law, and the deviation of a form from it.

    `deviation` takes one of the two forms of an entry of `brdfdb.misprints`. It returns the largest deviation from the
    law, or nan where the form gives no finite number. `within` is the error of the law's own arithmetic, such as a
    quadrature or a count of rays.
    """

    says: str
    deviation: Law
    within: float


def proved(entry: Misprint, proof: Proof, where: str) -> Statement:
    """Return the statement that the right form obeys the law and the printed one breaks it."""
    with np.errstate(all="ignore"):
        right, printed = proof.deviation(entry.corrected), proof.deviation(entry.as_printed)
    seen = "no finite number" if np.isnan(printed) else f"off by {printed:.2g}"
    return Statement(
        says=f"physical proof: {proof.says}",
        where=where,
        seen=f"ours is off by {right:.2g}, {NAMES[entry.kind]} {seen}; {proof.within:.2g} is allowed",
        holds=right <= proof.within and not printed <= BREAKS * proof.within,
    )


NAMES = {"printed": "the printed form", "customary": "the customary form", "words": "the form of the words"}


def largest(deviations: Iterable[Any]) -> float:
    """Return the largest absolute value, or nan if one value is not finite."""
    values = np.concatenate([np.ravel(np.abs(deviation)) for deviation in deviations])
    return float(values.max()) if np.isfinite(values).all() else np.nan


@functools.cache
def hemisphere(polar: int, azimuths: int) -> tuple[Array, Array, Array]:
    """Return theta [rad] of shape (polar, 1), phi [rad], and the weights cos(theta) d omega [sr] of a hemisphere."""
    x, w = gauss_rule(polar)
    theta = (x[:, np.newaxis] + 1.0) * np.pi / 4.0
    phi = (np.arange(azimuths) + 0.5) * 2.0 * np.pi / azimuths
    weights = w[:, np.newaxis] * np.pi / 4.0 * np.sin(theta) * np.cos(theta) * 2.0 * np.pi / azimuths
    return theta, phi, np.broadcast_to(weights, (polar, azimuths))


def albedo(form: Form, theta_i: float, polar: int, azimuths: int, **arguments: Any) -> float:
    """Return the directional albedo [1] of a form by a plain sum over the hemisphere."""
    theta_r, phi_r, weights = hemisphere(polar, azimuths)
    f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=phi_r, **arguments)
    return float(np.sum(f_r * weights))
