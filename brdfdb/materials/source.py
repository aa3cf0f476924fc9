"""The protocol of a source, and the base class of lookups by angles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import array_lookup
from brdfdb.errors import ParameterError
from brdfdb.geometry import checked_angles, finished
from brdfdb.lobes import Lobe
from brdfdb.materials.spectrum import Spectrum
from brdfdb.parameters import Floats, check_nanometres

# Function of unit vectors (N, 3) of light and viewer that gives f_r [1/sr] of shape (N, L)
Evaluate = Callable[[Floats, Floats], Floats]

# theta_i, phi_i, theta_r and phi_r [rad], which broadcast
FourAngles = tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]


def check_wavelengths(wavelengths_nm: tuple[float, ...] | None) -> tuple[float, ...] | None:
    """Return the wavelengths [nm] of a source; ParameterError if they are not positive and increasing."""
    if wavelengths_nm is not None and np.any(np.diff(check_nanometres("wavelengths_nm", wavelengths_nm)) <= 0.0):
        raise ParameterError("wavelengths_nm", f"{[*wavelengths_nm]} must be positive and increasing", wavelengths_nm)
    return wavelengths_nm


def no_specular_part(theta_i: ArrayLike, wavelength_nm: ArrayLike | None) -> Floats:
    """Return a specular reflectance [1] of 0, nan where theta_i [rad] is nan, shaped as by `Lookups.lookup`."""
    wavelengths = () if wavelength_nm is None else check_nanometres("wavelength_nm", wavelength_nm).shape
    given = checked_angles(theta_i, 0.0, 0.0, 0.0)
    return finished(np.zeros((*given.theta_i.shape, *wavelengths)), given, trailing=len(wavelengths))


class Lookups(ABC):
    """The base of sources and tables: f_r at angles, over one method that takes the four of them together."""

    @array_lookup
    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Floats:
        """Return f_r [1/sr] at angles; a table interpolates it.

        Parameters
        ----------
        theta_i, phi_i, theta_r, phi_r : array_like [rad]
            Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; broadcast.
        wavelength_nm : float or array_like (M,) [nm], optional
            Within the range of a spectral source or table; by default its wavelengths. Grey ones take any.

        Returns
        -------
        array [1/sr]
            In the shape of the angles, with a last axis for the wavelengths of a spectral source or table, or M if an
            array of wavelengths was given; a single wavelength adds no axis. 0 below the horizon, nan where an angle is
            nan. float32 arrays in give float32 out.

        Raises
        ------
        ParameterError
            If an angle or a wavelength is outside its range, or the values of a function are no f_r.
        StoreError, UnknownRevisionError
            If a table is behind a service, and the service or the revision is gone.
        """
        return self._at_angles((theta_i, phi_i, theta_r, phi_r), wavelength_nm)

    @abstractmethod
    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return f_r [1/sr] for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3).

        Wavelengths, result and errors are those of `lookup`.
        """

    @abstractmethod
    def _at_angles(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        """Return f_r [1/sr] as by `lookup`; the angles are not checked yet."""


class Lossless(NamedTuple):
    """A source with nothing absorbed, and the parameters that were changed for it, by name."""

    source: Source
    changes: dict[str, float | Spectrum]


class RefractiveIndices(NamedTuple):
    """n and k [1] at wavelengths, arrays (L,)."""

    n: NDArray[np.float64]
    k: NDArray[np.float64]


class Source(Protocol):
    """A source of f_r: a material with a model, or a function.

    Directions are unit vectors that point away from the surface, or angles [rad]. f_r is without the cosine [1/sr]
    and without the specular part. `wavelength_nm` is None for a grey source in `brdf_at` and `lobe`.

    Attributes
    ----------
    name : str
        Slug of lower-case words joined by hyphens.
    title : str
        A line for people.
    provenance : str
        Origin of the values, in words.
    wavelengths_nm : tuple of float or None
        Wavelengths [nm] for which the source is stated; None if it may be evaluated at any wavelength.
    """

    @property
    def name(self) -> str: ...

    @property
    def title(self) -> str: ...

    @property
    def provenance(self) -> str: ...

    @property
    def wavelengths_nm(self) -> tuple[float, ...] | None: ...

    @property
    def spectral(self) -> bool:
        """Return True if f_r depends on the wavelength."""

    @property
    def anisotropic(self) -> bool:
        """Return True if f_r changes when the surface is turned about its normal."""

    @property
    def elliptical(self) -> bool:
        """Return True if f_r has the symmetry of an ellipse, with axes along x and y."""

    @property
    def reciprocal(self) -> bool:
        """Return True if f_r is the same with light and viewer exchanged."""

    @property
    def grazing_pole(self) -> bool:
        """Return True if f_r grows without bound as a direction reaches 90 degrees."""

    def grazing_power(self, wavelength_nm: NDArray[np.float64] | None) -> float | None:
        """Return p if the directional albedo grows as cos theta_i to the power -p at grazing light; None if unknown.

        It is at least 0, and 0 where the albedo is bounded.
        """

    @property
    def has_lobe(self) -> bool:
        """Return True if `lobe` gives a lobe around the mirror direction; a diffuse source has none."""

    @property
    def has_specular(self) -> bool:
        """Return True if there is a specular part (a Dirac delta)."""

    def uniform_at(self, wavelength_nm: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        """Return the uniform part of f_r [1/sr] at wavelengths (L,) [nm]; None if none is known.

        Its shape is (1,) if it is the same at all wavelengths, else (L,).
        """

    @property
    def lossless(self) -> Lossless | None:
        """Return the source with nothing absorbed; None if it has no such form."""

    def without_uniform(self) -> Source:
        """Return the source without its uniform part."""

    def evaluated_at(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the wavelengths [nm] at which a picture at some wavelengths evaluates the source; None if grey."""

    def brdf_at(self, wavelength_nm: NDArray[np.float64] | None) -> Evaluate:
        """Return f_r [1/sr] at wavelengths (L,) [nm] as a function of unit vectors (N, 3): shape (N, L), L = 1 if grey.

        ParameterError says that the source does not hold at one of the wavelengths.
        """

    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Floats:
        """Return f_r [1/sr] at angles [rad]: their broadcast shape, with a last axis for a list of wavelengths."""

    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return f_r [1/sr] at unit vectors (..., 3), with a last axis for a list of wavelengths."""

    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return the reflectance [1] of the specular part at theta_i [rad], 0 without one; shaped as by `lookup`."""

    def lobe(self, cos_i: Floats, wavelength_nm: NDArray[np.float64] | None) -> Lobe | None:
        """Return the lobe for lights with the cosine cos_i, which broadcasts with wavelengths [nm]; None if diffuse."""

    def refractive_indices(self, wavelength_nm: NDArray[np.float64] | None) -> RefractiveIndices | None:
        """Return n and k [1] at wavelengths [nm]; None if f_r does not depend on them."""

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the source in its table, as JSON with angles in degrees."""

    def document(self) -> dict[str, Any]:
        """Return the document of the source as JSON, which `brdfdb.materials.source_of` reads."""
