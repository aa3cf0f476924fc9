"""Physical laws that the right forms obey and the printed ones break, computed without reference and kernels."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Statement
from brdfdb.misprints import Misprint

Array = NDArray[np.float64]
Form = Callable[..., Any]
Law = Callable[[Form], float]

BREAKS = 3.0  # a form that is off by so many times what the right one is allowed is said to break the law


@dataclass(frozen=True)
class Proof:
    """A law, and by how much a form is off it.

    `off` takes a form, as an entry of `brdfdb.misprints` has two, and returns the largest deviation from what the law
    demands; nan where the form gives no finite number. `within` is what the arithmetic of the law itself, a quadrature
    or a count of rays, leaves open.
    """

    says: str
    off: Law
    within: float


def proved(entry: Misprint, proof: Proof, where: str) -> Statement:
    """Return the statement that the right form obeys the law and the printed one breaks it."""
    with np.errstate(all="ignore"):
        right, printed = proof.off(entry.corrected), proof.off(entry.as_printed)
    seen = "no finite number" if np.isnan(printed) else f"off by {printed:.2g}"
    return Statement(
        says=f"physical proof: {proof.says}",
        where=where,
        seen=f"ours is off by {right:.2g}, {NAMES[entry.kind]} {seen}; {proof.within:.2g} is allowed",
        holds=right <= proof.within and not printed <= BREAKS * proof.within,
    )


NAMES = {"printed": "the printed form", "customary": "the customary form", "words": "what the words say"}


def largest(deviations: Iterable[Any]) -> float:
    """Return the largest absolute value; nan if one of them is not finite."""
    values = np.concatenate([np.ravel(np.abs(each)) for each in deviations])
    return float(values.max()) if np.isfinite(values).all() else np.nan


@functools.cache
def hemisphere(polar: int, azimuths: int) -> tuple[Array, Array, Array]:
    """Return theta of shape (polar, 1), phi, and the weights cos(theta) d omega of sums over a hemisphere."""
    x, w = np.polynomial.legendre.leggauss(polar)
    theta = (x[:, np.newaxis] + 1.0) * np.pi / 4.0
    phi = (np.arange(azimuths) + 0.5) * 2.0 * np.pi / azimuths
    weights = w[:, np.newaxis] * np.pi / 4.0 * np.sin(theta) * np.cos(theta) * 2.0 * np.pi / azimuths
    return theta, phi, np.broadcast_to(weights, (polar, azimuths))


def albedo(form: Form, theta_i: float, polar: int, azimuths: int, **arguments: Any) -> float:
    """Return the share [1] of the light from theta_i that a form reflects, a plain sum over the hemisphere."""
    theta_r, phi_r, weights = hemisphere(polar, azimuths)
    f_r = form(theta_i=theta_i, phi_i=0.0, theta_r=theta_r, phi_r=phi_r, **arguments)
    return float(np.sum(f_r * weights))
