"""Sources that are functions: a callable of the user, and its record in a table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator

from brdfdb._elementary import COS_HORIZON
from brdfdb.arrays import array_lookup
from brdfdb.errors import ParameterError, sentence_of
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished, radians, unit_vector
from brdfdb.lobes import Lobe
from brdfdb.materials.provenance import MOST_NAME, NAME_PATTERN, Text
from brdfdb.materials.source import Evaluate, FourAngles, Lookups, Lossless, check_wavelengths, no_specular_part
from brdfdb.parameters import Floats, check_nanometres

# (wi, wr, wavelength_nm) of shapes (N, 3), (N, 3) and (L,) -> f_r [1/sr] of shape (N, L). A grey function gets None for
# the wavelengths, and its result may have the shape (N,)
Function = Callable[[Floats, Floats, NDArray[np.float64] | None], ArrayLike]

_LOBE_SHARE = 0.5  # share of the reflected light in a lobe whose share is unknown; half of the directions follow it
_CHECKED = 64  # pairs of directions at which symmetries are checked
_CHECKED_UP_TO_DEG = 85.0  # largest angle of these directions from the normal
_SEED = 1967
_SAME = 1e-6  # relative difference that rounding may leave between values that a symmetry makes the same


def _two_widths(alpha: Any) -> Any:
    """Return the widths along x and y; one number stands for both."""
    return (alpha, alpha) if isinstance(alpha, int | float) else alpha


class FunctionRecord(BaseModel):
    """The record of a function in its table, because the function itself cannot be stored.

    Attributes
    ----------
    name : str
        Slug of lower-case words joined by hyphens.
    title : str
        A line for people.
    provenance : str
        Where the function comes from: a paper, a measurement, a program and its version.
    wavelengths_nm : tuple of float or None
        Increasing wavelengths [nm] at which the function is tabulated. It may be evaluated between the first and the
        last. None for a grey function.
    anisotropic : bool
        True if f_r changes when the surface is turned about its normal.
    elliptical : bool
        True if an anisotropic f_r has the symmetry of an ellipse with axes along x and y. Its tables are a quarter as
        large.
    reciprocal : bool
        True if f_r is the same with light and viewer exchanged. Tables of others hold both ways.
    grazing_pole : bool
        True if f_r grows without bound as a direction reaches 90 degrees.
    alpha : (float, float) or None
        Widths [1] of the lobe around the mirror direction, along x and y: root mean square slopes of its half vectors,
        times the square root of 2. One number stands for both. None if there is no lobe.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: str = Field(pattern=NAME_PATTERN, max_length=MOST_NAME)
    title: Text
    provenance: Text
    wavelengths_nm: tuple[float, ...] | None = Field(default=None, min_length=1)
    anisotropic: bool = False
    elliptical: bool = False
    reciprocal: bool = True
    grazing_pole: bool = False
    alpha: Annotated[
        tuple[Annotated[float, Field(gt=0.0, le=10.0)], Annotated[float, Field(gt=0.0, le=10.0)]] | None,
        BeforeValidator(_two_widths),
    ] = None

    _check_wavelengths = field_validator("wavelengths_nm")(check_wavelengths)

    @model_validator(mode="after")
    def _check_symmetry(self) -> FunctionRecord:
        if self.elliptical and not self.anisotropic:
            raise ParameterError("elliptical", "an isotropic function has more symmetry than an ellipse; leave it out")
        if not self.anisotropic and self.alpha is not None and self.alpha[0] != self.alpha[1]:
            raise ParameterError("alpha", f"{self.alpha} differs along x and y; an isotropic function has one width")
        return self

    @property
    def spectral(self) -> bool:
        """Return True if f_r depends on the wavelength."""
        return self.wavelengths_nm is not None

    def lobe(self, cos_i: Floats, _wavelength_nm: NDArray[np.float64] | None = None) -> Lobe | None:
        """Return the lobe for lights with the cosine cos_i, which is the same for all; None without a lobe."""
        if self.alpha is None:
            return None
        share, alpha_x, alpha_y = (np.full(np.shape(cos_i), value) for value in (_LOBE_SHARE, *self.alpha))
        return Lobe(share, alpha_x, alpha_y)

    def document(self) -> dict[str, Any]:
        """Return the record as JSON; `brdfdb.materials.source_of` reads it."""
        return {"function": FunctionRecord.model_dump(self, mode="json", include=set(FunctionRecord.model_fields))}


class FunctionSource(FunctionRecord, Lookups):
    """A function of the user as a source, which is tabulated, audited, charted and rendered like a material.

    Parameters
    ----------
    brdf : callable
        ``brdf(wi, wr, wavelength_nm)`` gives f_r [1/sr] without the cosine, finite and not below 0. `wi` and `wr` are
        float64 arrays of shape (N, 3): unit vectors of light and viewer, above the horizon. `wavelength_nm` is an
        array of shape (L,) [nm], and the result has the shape (N, L). For a grey function `wavelength_nm` is None, and
        the result has the shape (N,) or (N, 1).
    **record
        The attributes of `FunctionRecord`: name, title, provenance, and properties of the function.

    Raises
    ------
    ParameterError
        If a value of the record is not allowed. If the function gives another shape, or a value that is negative or not
        finite. If it is not reciprocal and does not say so, or lacks a symmetry that tables use. The function is called
        at 64 pairs of directions to check this.

    Examples
    --------
    >>> import numpy as np
    >>> white = FunctionSource(
    ...     brdf=lambda wi, wr, wavelength_nm: np.full(len(wi), 1.0 / np.pi),
    ...     name="white", title="White", provenance="Lambert's law",
    ... )
    >>> round(float(white.lookup(0.3, 0.0, 0.2, 1.0)), 6)
    0.31831
    """

    brdf: Function = Field(exclude=True, repr=False)

    def __init__(self, *, brdf: Function, **record: Any) -> None:
        try:
            super().__init__(**{"brdf": brdf, **record})
        except ValidationError as error:
            raise _refusal(error) from None
        self._check_function()

    def grazing_power(self, _wavelength_nm: NDArray[np.float64] | None) -> None:
        """Return None, because the growth of a function is measured."""
        return

    @property
    def has_lobe(self) -> bool:
        """Return True if the widths of a lobe are known."""
        return self.alpha is not None

    @property
    def has_specular(self) -> bool:
        """Return False, because a specular part is no function of two directions."""
        return False

    def uniform_at(self, _wavelength_nm: NDArray[np.float64] | None) -> None:
        """Return None, because the uniform part of a function is unknown."""
        return

    @property
    def lossless(self) -> Lossless | None:
        """Return None, because the absorption of a function is unknown."""
        return None

    def without_uniform(self) -> FunctionSource:
        """Return the function unchanged."""
        return self

    def evaluated_at(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the same wavelengths [nm]; None if grey."""
        return wavelength_nm if self.spectral else None

    def brdf_at(self, wavelength_nm: NDArray[np.float64] | None) -> Evaluate:
        """Return f_r [1/sr] at wavelengths (L,) [nm] as a function of unit vectors (N, 3): shape (N, L), L = 1 if grey.

        ParameterError says that a wavelength is outside the range of the function, or that wavelengths are missing.
        """
        at = self._wavelengths(wavelength_nm)
        return lambda wi, wr: self._values(checked_vectors(wi, wr), wi, wr, at)

    def _at_angles(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        given = checked_angles(*angles)
        light = unit_vector(given.theta_i, given.phi_i)
        viewer = unit_vector(given.theta_r, given.phi_r)
        return self._shaped(given, light, viewer, wavelength_nm)

    @array_lookup
    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        vectors = checked_vectors(wi, wr)
        return self._shaped(vectors, vectors.w_i, vectors.w_r, wavelength_nm)

    @array_lookup
    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return 0, shaped as by `lookup`."""
        return no_specular_part(theta_i, wavelength_nm)

    def refractive_indices(self, _wavelength_nm: NDArray[np.float64] | None) -> None:
        """Return None: the function is not made from refractive indices."""
        return

    def attributes(self) -> dict[str, Any]:
        """Return the attributes that a table has of the function."""
        return {"title": self.title, "material": self.name, "source": self.provenance}

    def _wavelengths(self, wavelength_nm: ArrayLike | None) -> NDArray[np.float64] | None:
        """Return wavelengths [nm] as an array (L,), or None; ParameterError if one is outside the function's range."""
        at = None if wavelength_nm is None else check_nanometres("wavelength_nm", wavelength_nm).reshape(-1)
        if self.wavelengths_nm is None:
            return None
        at = np.array(self.wavelengths_nm) if at is None else at
        low = self.wavelengths_nm[0]
        high = self.wavelengths_nm[-1]
        bad = ~((at >= low) & (at <= high))
        if np.any(bad):
            first = float(at[bad][0])
            text = f"{first:g} is outside [{low:g}, {high:g}] nm of {self.name}"
            raise ParameterError("wavelength_nm", text, first, (low, high))
        return at

    def _shaped(self, given: Directions, light: Floats, viewer: Floats, wavelength_nm: ArrayLike | None) -> Floats:
        """Return values in the shape of directions, with a last axis for a list of wavelengths."""
        values = self._values(given, light, viewer, self._wavelengths(wavelength_nm))
        if wavelength_nm is None:
            return values if self.spectral else values[..., 0][()]
        if np.ndim(wavelength_nm) == 0:
            return values[..., 0][()]
        return values if self.spectral else np.repeat(values, np.size(wavelength_nm), axis=-1)

    def _values(self, given: Directions, light: Floats, viewer: Floats, at: NDArray[np.float64] | None) -> Floats:
        """Return f_r (..., L) [1/sr] at unit vectors that broadcast, 0 below the horizon; ParameterError if invalid."""
        light, viewer = np.broadcast_arrays(light, viewer)
        wi, wr = (np.array(w.reshape(-1, 3), dtype=np.float64) for w in (light, viewer))
        whole = ~np.isnan(wi + wr).any(axis=1)
        above = whole & (wi[:, 2] >= 0.0) & (wr[:, 2] >= 0.0)
        count = 1 if at is None else at.size
        values = np.where(whole, 0.0, np.nan)[:, np.newaxis].repeat(count, axis=1)
        wi = wi[above]
        wr = wr[above]
        for w in (wi, wr):
            w[:, 2] = np.maximum(w[:, 2], COS_HORIZON)
        f_r = np.asarray(self.brdf(wi, wr, at))
        allowed = [(len(wi), count)] + ([(len(wi),)] if at is None else [])
        if f_r.shape not in allowed or f_r.dtype.kind not in "iuf":
            pairs = f"{len(wi)} pairs of directions" + ("" if at is None else f" at {count} wavelengths")
            text = f"{self.name} gave {f_r.dtype} of shape {f_r.shape} for {pairs}; allowed is {allowed[0]}"
            raise ParameterError("brdf", text)
        f_r = f_r.astype(np.float64).reshape(len(wi), count)
        bad = ~(np.isfinite(f_r) & (f_r >= 0.0))
        if np.any(bad):
            row, column = np.argwhere(bad)[0]
            text = (
                f"{self.name} gave {f_r[row, column]:g} for the light {_vector(wi[row])} and the viewer "
                f"{_vector(wr[row])}; f_r must be finite and not below 0"
            )
            raise ParameterError("brdf", text, f_r[row, column])
        values[above] = f_r
        return finished(values.reshape(*light.shape[:-1], count), given, trailing=1)

    def _check_function(self) -> None:
        """Raise a ParameterError if the function is not reciprocal, or lacks a symmetry that tables use."""
        rng = np.random.default_rng(_SEED)
        least = np.cos(radians(_CHECKED_UP_TO_DEG))
        theta = np.arccos(rng.uniform(least, 1.0, (2, _CHECKED)))
        phi = rng.uniform(0.0, 2.0 * np.pi, (2, _CHECKED))
        turn = rng.uniform(0.0, 2.0 * np.pi, _CHECKED)

        def at(azimuths: Floats) -> tuple[Floats, ...]:
            return unit_vector(theta[0], azimuths[0]), unit_vector(theta[1], azimuths[1])

        wi, wr = at(phi)
        exchanged = "is not reciprocal; set reciprocal=False: light and viewer exchanged"
        others: dict[str, tuple[Floats, ...]] = {exchanged: (wr, wi)}
        if not self.reciprocal:
            others.clear()
        if not self.anisotropic:
            others["is anisotropic; set anisotropic=True: the surface turned"] = at(phi + turn)
        if self.elliptical:
            others["lacks the symmetry of an ellipse; leave elliptical out: the surface turned by 180 degrees"] = at(
                phi + np.pi
            )
        if self.elliptical or not self.anisotropic:
            others["lacks mirror symmetry: -phi for phi"] = at(-phi)
        brdf = self.brdf_at(None if self.wavelengths_nm is None else np.array(self.wavelengths_nm))
        value = brdf(wi, wr)
        for what, directions in others.items():
            other = brdf(*directions)
            bad = np.abs(other - value) > _SAME * np.maximum(other, value)
            if np.any(bad):
                row, column = np.argwhere(bad)[0]
                values = f"{other[row, column]:.6g} 1/sr in place of {value[row, column]:.6g}"
                pair = f"the light {_vector(wi[row])} and the viewer {_vector(wr[row])}"
                raise ParameterError("brdf", f"{self.name} {what} gives {values} for {pair}")


def _vector(w: Floats) -> str:
    return f"({', '.join(f'{x:.4g}' for x in w)})"


def _refusal(error: ValidationError) -> ParameterError:
    """Return the first finding of pydantic as an error that names the parameter."""
    first = error.errors(include_url=False)[0]
    parameter = str(first["loc"][0]) if first["loc"] else ""
    if first["type"] == "missing":
        return ParameterError(parameter, "missing; a function needs a name, a title and a provenance")
    if first["type"] != "value_error":
        return ParameterError(parameter, sentence_of(first), first["input"])
    ours = first["ctx"]["error"]
    return ours if isinstance(ours, ParameterError) else ParameterError(parameter, str(ours), first["input"])
