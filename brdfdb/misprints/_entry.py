"""The type of an entry, and functions that the entries of the three papers share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import radians, unit_vector

Array = NDArray[np.float64]
Form = Callable[..., Any]
Kind = Literal["printed", "customary", "words"]

# Keys of references.bib
ORENNAYAR = "orennayar1994"
HE = "he1991"
WARD = "ward1992"


@dataclass(frozen=True)
class Misprint:
    """One misprint, ambiguity or unsafe form of a paper, in words and as two functions of the same arguments.

    `kind` states the origin of the first function. "printed" is the formula that the paper prints. "customary" is a
    formula or method that is common in its place. With "words" the formula of the paper is right, and the first
    function follows the words or names beside it.
    """

    key: str
    paper: str  # key in references.bib
    equation: str
    kind: Kind
    printed: str
    right: str
    consequence: str
    as_printed: Form = field(compare=False)
    corrected: Form = field(compare=False)
    where: Mapping[str, Any] = field(compare=False)  # arguments at which the two differ visibly


def at(theta_i: Any, theta_r: Any, delta_phi: Any) -> dict[str, Any]:
    """Return the arguments of a model for directions in degrees."""
    return {"theta_i": radians(theta_i), "phi_i": 0.0, "theta_r": radians(theta_r), "phi_r": radians(delta_phi)}


def part(model: Form, name: str) -> Form:
    """Return a form that is one part of what a model returns."""
    return lambda **arguments: getattr(model(**arguments), name)


def dot(a: Array, b: Array) -> Any:
    """Return the scalar products of vectors along the last axis."""
    return np.sum(a * b, axis=-1)


def propagation(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any) -> tuple[Array, Array]:
    """Return k_i and k_r, the directions in which light travels to the surface and away from it."""
    k_i, k_r = np.broadcast_arrays(-unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))
    return k_i, k_r


def polarisation(k: Array, normal: Any) -> tuple[Array, Array]:
    """Return s = k x n / abs(k x n) and p = s x k, eqs 14, 35, 37 and 42 of He et al.; nan where k is along n."""
    s = np.cross(k, normal)
    with np.errstate(all="ignore"):
        s = s / np.linalg.norm(s, axis=-1, keepdims=True)
    return s, np.cross(s, k)
