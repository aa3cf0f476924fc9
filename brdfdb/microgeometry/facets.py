"""The reflectance of facets, Lambertian and mirror-like with Fresnel's reflectance, and light that bounces on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.fresnel import unpolarised
from brdfdb.parameters import check_nanometres

Spectrum = NDArray[np.float64]


@dataclass(frozen=True)
class Facets:
    """Facets that reflect as a mixture of Lambert and a mirror, as the body-and-surface model of Oren and Nayar 1994.

    Each number but `mirror` may be given for each wavelength. ParameterError if a value is outside its range, if rho
    and mirror together exceed 1, or if the lengths differ.
    """

    rho: ArrayLike = 0.0  #: albedo of the Lambertian part, in [0, 1], a number or (L,) [1]
    mirror: float = 0.0  #: weight of the mirror-like part, in [0, 1] [1]
    n: ArrayLike | None = None  #: refractive index of the mirror-like part; None: it reflects all light [1]
    k: ArrayLike = 0.0  #: extinction coefficient of the mirror-like part [1]
    wavelength_nm: ArrayLike | None = None  #: wavelengths (L,) [nm]; None: the facets are grey

    def __post_init__(self) -> None:
        count = 1
        if self.wavelength_nm is not None:
            wavelength_nm = np.atleast_1d(check_nanometres("wavelength_nm", self.wavelength_nm))
            object.__setattr__(self, "wavelength_nm", wavelength_nm)
            count = wavelength_nm.size
        for name, low, high in (("rho", 0.0, 1.0), ("mirror", 0.0, 1.0), ("n", 0.0, np.inf), ("k", 0.0, np.inf)):
            given = getattr(self, name)
            if given is None:
                continue
            values = np.atleast_1d(np.asarray(given, np.float64))
            wrong = values[~((values >= low) & (values <= high) & (values < np.inf))]
            if wrong.size or values.ndim != 1 or values.size not in (1, count):
                text = f"has shape {values.shape}; allowed are a number or a list of {count}"
                if wrong.size:
                    text = f"{wrong[0]:g} is not in [{low:g}, {high:g}]"
                    text = text if high < np.inf else f"{wrong[0]:g} is not a number of at least {low:g}"
                raise ParameterError(name, text, given, (low, high))
            if name != "mirror":
                object.__setattr__(self, name, np.broadcast_to(values, count))
        most = float(np.max(self.rho)) + self.mirror
        if most > 1.0:
            raise ParameterError("rho", f"rho and mirror together are {most:g}; allowed is at most 1", most, (0.0, 1.0))

    @property
    def wavelengths(self) -> int:
        """Number of wavelengths, 1 of grey facets."""
        return int(np.size(self.rho))

    def mirrored(self, cosine: ArrayLike) -> Spectrum:
        """Return the reflectance [1] of the mirror-like part at cosines (N,) to the normal, shape (N, L)."""
        at = np.asarray(cosine, np.float64)[:, np.newaxis]
        if self.n is None:
            return np.full((at.shape[0], self.wavelengths), self.mirror)
        return np.asarray(self.mirror * unpolarised(at, np.asarray(self.n), np.asarray(self.k)))


class Bounces(NamedTuple):
    """Light by the number of its bounces.

    Attributes
    ----------
    one, two, further : array (lights, viewers, wavelengths) [1/sr]
        f_r after one, two and more bounces.
    escaped : array (lights, 3, wavelengths) [1]
        Share of the light that leaves the surface after one, two and more bounces.
    """

    one: NDArray[np.float64]
    two: NDArray[np.float64]
    further: NDArray[np.float64]
    escaped: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """f_r [1/sr] of all bounces."""
        return self.one + self.two + self.further
