"""Forms offered for a material of a scene: at all wavelengths or fewer, with the truth at limbs or without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brdfdb.forms import catalogue
from brdfdb.forms.catalogue import Form
from brdfdb.geometry import radians
from brdfdb.materials import Source
from brdfdb.parameters import Floats
from brdfdb.scenes.shapes import Array

GREY_TOLERANCES = (0.1, 0.01, 0.0005)  # of planned tables; 0.001, as in charts, leaves 1.05 at 84 degrees
SAMPLINGS = (3, 8)  # wavelengths, evenly over those of the scene, that a form may be evaluated at in place of all
LIMB_DEG = 85.0  # from where a table may leave directions to the truth: its last nodes but one are there

_ROWS = 512  # of products at a time: larger ones BLAS gives to threads, which wait for each other on a busy machine


@dataclass(frozen=True, eq=False)
class OfferedForm:
    """A form of a material, whose f_r is that of all wavelengths of the scene, and where it is evaluated itself.

    `wavelength_nm` is None of a grey form; between its wavelengths f_r is interpolated on straight lines.
    """

    form: Form
    wavelength_nm: NDArray[np.float64] | None

    def brdf(self, wi: Array, wr: Array, _wavelength_nm: Array | None = None) -> Floats:
        """Return f_r [1/sr], as `render` takes it."""
        dtype = self.form.dtype
        return self.form.evaluate(wi.astype(dtype, copy=False), wr.astype(dtype, copy=False)).astype(np.float64)


def offered_forms(
    source: Source, wavelength_nm: NDArray[np.float64] | None, tolerances: Sequence[float] | None = None
) -> list[OfferedForm]:
    """Return forms to choose from, the truth first: at all wavelengths, and of spectral sources at fewer.

    Parameters
    ----------
    source : Source
        Material, or table of a store.
    wavelength_nm : array of shape (L,) [nm], or None
        Those of the scene, for spectral materials, and only for them.
    tolerances : sequence of float, optional
        Of planned tables: see `brdfdb.forms.catalogue`. By default `GREY_TOLERANCES` of grey materials.

    Returns
    -------
    list of OfferedForm
        Without models that are meant to differ, and forms that differ from another in rounding alone.

    Raises
    ------
    ValueError
        As `brdfdb.forms.catalogue.forms` does.
    """
    if tolerances is None and wavelength_nm is None:
        tolerances = GREY_TOLERANCES
    offered = [OfferedForm(form, wavelength_nm) for form in _offered(source, wavelength_nm, tolerances)]
    for count in SAMPLINGS if wavelength_nm is not None else ():
        assert wavelength_nm is not None
        if count < wavelength_nm.size:
            few = wavelength_nm[np.round(np.linspace(0, wavelength_nm.size - 1, count)).astype(np.int64)]
            offered += [
                OfferedForm(_between(form, few, wavelength_nm), few) for form in _offered(source, few, tolerances)
            ]
    return [one for one in offered if one.form.kind != "other model" and not one.form.rounded]


def _offered(
    source: Source, wavelength_nm: NDArray[np.float64] | None, tolerances: Sequence[float] | None
) -> list[Form]:
    """Return all forms of a material, and its tables a second time, with the truth at limbs."""
    forms = catalogue.forms(source, wavelength_nm, tolerances)
    return [*forms, *(_with_true_limbs(form, forms[0]) for form in forms if form.kind == "table")]


def _with_true_limbs(form: Form, truth: Form) -> Form:
    """Return a form that leaves directions beyond `LIMB_DEG`, of light or viewer, to the truth."""
    least = np.cos(radians(LIMB_DEG))

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values = form.evaluate(wi, wr)
        limb = np.flatnonzero(np.minimum(wi[:, 2], wr[:, 2]) < least)
        if limb.size:
            values[limb] = truth.evaluate(wi[limb], wr[limb])
        return values

    return replace(
        form,
        key=f"{form.key}-true-limbs",
        title=f"{form.title}, truth from {LIMB_DEG:g}°",
        python=f"{form.python}, {truth.python}",
        evaluate=evaluate,
        bytes=form.bytes + truth.bytes,
    )


def _between(form: Form, few: Array, wavelength_nm: Array) -> Form:
    """Return a form at a few wavelengths, interpolated to all of them."""
    weights = np.stack([np.interp(wavelength_nm, few, one) for one in np.eye(few.size)]).astype(form.dtype)

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        values = form.evaluate(wi, wr)
        whole = np.empty((len(values), wavelength_nm.size), values.dtype)
        for start in range(0, len(values), _ROWS):
            np.matmul(values[start : start + _ROWS], weights, out=whole[start : start + _ROWS])
        return whole

    return replace(
        form,
        key=f"{form.key}-{few.size}-wavelengths",
        title=f"{form.title}, {few.size} wavelengths",
        evaluate=evaluate,
        bytes=form.bytes + weights.nbytes,
    )
