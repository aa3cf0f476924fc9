"""The points that a lookup asks for: read from a query or a JSON body in degrees, checked, counted, evaluated."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import orjson
from numpy.typing import NDArray

from brdfdb.geometry import radians
from brdfdb_api.responses import RequestError

if TYPE_CHECKING:
    from brdfdb.lookup import Table

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
REQUIRED = ("theta_i", "theta_r")
FIELDS = (*ANGLES, "wavelength_nm")


@dataclass(frozen=True)
class Points:
    """Directions and wavelengths of one lookup, checked.

    Attributes
    ----------
    angles : dict of arrays [rad]
        theta_i, phi_i, theta_r, phi_r; they broadcast.
    shape : tuple of int
        What they broadcast to.
    wavelength_nm : float, array of shape (n,) or None
        None is every wavelength of the table.
    """

    angles: dict[str, NDArray[np.float64]]
    shape: tuple[int, ...]
    wavelength_nm: float | NDArray[np.float64] | None

    @property
    def count(self) -> int:
        """How many points there are."""
        return math.prod(self.shape)

    @classmethod
    def from_json(cls, body: bytes) -> Self:
        """Read the body of a POST.

        Raises
        ------
        RequestError
            422, with the sentence that the client reads; of the body it repeats names and single numbers at most.
        """
        try:
            fields = orjson.loads(body)
        except orjson.JSONDecodeError:
            # The NaN and Infinity that some clients write are not JSON: read them all the same, to name the parameter.
            try:
                fields = json.loads(body)
            except (ValueError, RecursionError):
                raise RequestError(422, "the body is not JSON") from None
        if not isinstance(fields, dict):
            raise RequestError(422, f"the body is not a JSON object with {', '.join(FIELDS)}")
        return cls.from_fields(fields)

    @classmethod
    def from_fields(cls, fields: Mapping[str, Any]) -> Self:
        """Check numbers or nested lists of numbers: angles in degrees, wavelengths in nm.

        theta is within [0, 180] degrees, phi any finite number and 0 where it is missing; `wavelength_nm` is a finite
        number or a list of them, and missing or None for every wavelength.

        Raises
        ------
        RequestError
            422, naming the parameter.
        """
        for name in fields:
            refuse_unknown(name, FIELDS)
        angles = {}
        for name in ANGLES:
            if name not in fields and name in REQUIRED:
                raise RequestError(422, f"{name}: missing", name)
            degrees = _numbers(name, fields.get(name, 0.0))
            if name.startswith("theta") and np.any(bad := (degrees < 0.0) | (degrees > 180.0)):
                raise RequestError(422, f"{name}: {degrees[bad][0]} is outside [0, 180] degrees", name)
            angles[name] = radians(degrees)
        try:
            shape = np.broadcast_shapes(*(angle.shape for angle in angles.values()))
        except ValueError:
            shapes = ", ".join(f"{name} {angle.shape}" for name, angle in angles.items())
            raise RequestError(422, f"the shapes of the angles do not broadcast: {shapes}") from None
        return cls(angles, shape, _wavelengths(fields.get("wavelength_nm")))

    def wavelengths(self, table: Table) -> float | NDArray[np.float64] | None:
        """The wavelengths [nm] of the values: what was asked for, else those of the table; None if it is grey."""
        return table.wavelength_nm if self.wavelength_nm is None else self.wavelength_nm

    def values(self, table: Table) -> int:
        """How many numbers the answer holds: points times wavelengths."""
        wavelengths = self.wavelengths(table)
        return self.count * (1 if wavelengths is None else np.size(wavelengths))

    def brdf(self, table: Table) -> NDArray[Any]:
        """The BRDF [1/sr], of `shape`, then the wavelengths; a RequestError (422) where the table does not reach."""
        with _refused():
            theta_i, phi_i, theta_r, phi_r = (self.angles[name] for name in ANGLES)
            return np.asarray(table.lookup(theta_i, phi_i, theta_r, phi_r, self.wavelength_nm))

    def specular_reflectance(self, table: Table) -> NDArray[Any]:
        """The Dirac part [1], of the shape of theta_i, then the wavelengths."""
        with _refused():
            return np.asarray(table.specular_reflectance(self.angles["theta_i"], self.wavelength_nm))


def refuse_unknown(name: str, allowed: tuple[str, ...]) -> None:
    """Raise the RequestError (422) of a parameter that is not one of `allowed`: a misspelt one is never ignored."""
    if name not in allowed:
        shown = name.encode("ascii", "backslashreplace").decode()[:40]
        raise RequestError(422, f"{shown}: unknown parameter; allowed are {', '.join(allowed) or 'none'}", shown)


@contextmanager
def _refused() -> Iterator[None]:
    """Turn a ValueError of the library that starts with the name of a parameter into a RequestError (422)."""
    try:
        yield
    except ValueError as error:
        name = str(error).partition(":")[0]
        if name not in FIELDS:
            raise
        raise RequestError(422, str(error), name) from error


def _numbers(name: str, value: Any) -> NDArray[np.float64]:
    """A JSON number or nested lists of them as a float64 array: not empty, all finite."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise RequestError(422, f"{name}: the lists have unequal lengths or are nested too deep", name) from None
    if array.size == 0:
        raise RequestError(422, f"{name}: an empty list", name)
    if array.dtype.kind not in "iuf" or bool in _types(value):
        raise RequestError(422, f"{name}: not a number or a list of numbers", name)
    if not np.all(finite := np.isfinite(array)):
        raise RequestError(422, f"{name}: {array[~finite][0]} is not a finite number", name)
    return array.astype(np.float64)


def _types(value: Any) -> set[type]:
    """The types of the leaves of nested lists. numpy alone would read true as 1."""
    if not isinstance(value, list):
        return {type(value)}
    types = set(map(type, value))
    return types.union(*map(_types, value)) if list in types else types


def _wavelengths(value: Any) -> float | NDArray[np.float64] | None:
    if value is None:
        return None
    array = _numbers("wavelength_nm", value)
    if array.ndim > 1:
        raise RequestError(422, "wavelength_nm: not a number or a flat list of numbers", "wavelength_nm")
    return array if array.ndim else array.item()
