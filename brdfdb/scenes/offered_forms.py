"""Forms offered for a material of a scene, at all wavelengths or fewer, with or without the truth at limbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brdfdb.forms import catalogue
from brdfdb.forms.catalogue import Form, Forms, LeftOut
from brdfdb.geometry import radians
from brdfdb.materials import Source
from brdfdb.parameters import Floats
from brdfdb.scenes.shapes import Array

# Tolerances of planned tables of grey materials. The 0.001 of charts leaves an error of 1.05 at 84 degrees
GREY_TOLERANCES = (0.1, 0.01, 0.0005)
SAMPLINGS = (3, 8)  # numbers of wavelengths, evenly over those of the scene, for forms that are not evaluated at all
LIMB_DEG = 85.0  # angle from which on a table may leave directions to the truth: its last node but one

# Rows of a product at a time. BLAS gives larger products to threads, which wait for one another on a busy machine
_ROWS = 512


@dataclass(frozen=True, eq=False)
class OfferedForm:
    """A form of a material with f_r at all wavelengths of the scene, and the wavelengths of its evaluation.

    `wavelength_nm` is None for a grey form. f_r is interpolated linearly between these wavelengths.
    """

    form: Form
    wavelength_nm: NDArray[np.float64] | None

    def brdf(self, wi: Array, wr: Array, _wavelength_nm: Array | None = None) -> Floats:
        """Return f_r [1/sr] with the arguments that `render` passes."""
        dtype = self.form.dtype
        return self.form.evaluate(wi.astype(dtype, copy=False), wr.astype(dtype, copy=False)).astype(np.float64)


def offered_forms(
    source: Source, wavelength_nm: NDArray[np.float64] | None, tolerances: Sequence[float] | None = None
) -> Forms[OfferedForm]:
    """Return the forms to choose from, the truth first, at all wavelengths and for spectral sources also at fewer.

    Models that are meant to differ, and forms that differ only in rounding, are not offered. A table that cannot be
    made is among `left_out`. `source` is a material, or a table of a store; `wavelength_nm` (L,) [nm] is None for grey
    ones. `tolerances` are those of planned tables, and errors those of `brdfdb.forms.catalogue.forms`; the default for
    grey materials is `GREY_TOLERANCES`.
    """
    if tolerances is None and wavelength_nm is None:
        tolerances = GREY_TOLERANCES
    complete = _offered(source, wavelength_nm, tolerances)
    offered = [OfferedForm(form, wavelength_nm) for form in complete]
    left_out = complete.left_out
    for count in SAMPLINGS if wavelength_nm is not None else ():
        assert wavelength_nm is not None
        if count < wavelength_nm.size:
            few = wavelength_nm[np.round(np.linspace(0, wavelength_nm.size - 1, count)).astype(np.int64)]
            forms = _offered(source, few, tolerances)
            offered += [OfferedForm(_between(form, few, wavelength_nm), few) for form in forms]
            left_out += [
                LeftOut(
                    key=f"{out.key}-{count}-wavelengths", title=f"{out.title}, {count} wavelengths", reason=out.reason
                )
                for out in forms.left_out
            ]
    exact = [one for one in offered if one.form.kind != "other model" and not one.form.rounded]
    return Forms(exact, left_out)


def _offered(
    source: Source, wavelength_nm: NDArray[np.float64] | None, tolerances: Sequence[float] | None
) -> Forms[Form]:
    """Return all forms of a material, and its tables a second time, with the truth at limbs."""
    forms = catalogue.forms(source, wavelength_nm, tolerances)
    with_limbs = [_with_true_limbs(form, forms[0]) for form in forms if form.kind == "table"]
    return Forms([*forms, *with_limbs], forms.left_out)


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
        folded = np.empty((len(values), wavelength_nm.size), values.dtype)
        for start in range(0, len(values), _ROWS):
            np.matmul(values[start : start + _ROWS], weights, out=folded[start : start + _ROWS])
        return folded

    return replace(
        form,
        key=f"{form.key}-{few.size}-wavelengths",
        title=f"{form.title}, {few.size} wavelengths",
        evaluate=evaluate,
        bytes=form.bytes + weights.nbytes,
    )
