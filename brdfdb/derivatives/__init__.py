"""Derivatives of f_r by the parameters of a model: for training, fits and sensitivities, without a renderer."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.arrays import array_function
from brdfdb.errors import ParameterError
from brdfdb.geometry import checked_angles, finished
from brdfdb.models import MODELS
from brdfdb.parameters import Gradient, ModelSpec

__all__ = ["Gradient", "gradient", "gradient_vectors"]


@array_function
def gradient(
    model: str, theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, **parameters: ArrayLike
) -> Gradient:
    """Return f_r [1/sr] of a model and its derivatives by the parameters.

    Parameters
    ----------
    model : str
        A name in `brdfdb.models.MODELS`: a form of Ward, an approximation of Oren and Nayar, or He-Torrance.
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    **parameters : array_like
        Parameters of the model, in its units and ranges. They broadcast with the angles.

    Returns
    -------
    Gradient
        `f_r` [1/sr], and `derivatives`, a dict from the names of parameters to arrays, each in 1/sr over the unit of
        its parameter. All are in the broadcast shape; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If the model is unknown or has no derivatives, or an argument is outside its range.

    Notes
    -----
    The derivatives are those of the formulas, without differences. Where f_r is held at 0, as the fit of Oren and Nayar
    is, they are 0. At the end of a range they are those from inside the range. The derivative of He-Torrance by
    sigma_0_um is 0 where sigma_0_um is 0. Its derivatives by n and k are infinite at the onset of total reflection
    (n < 1 and k = 0), and are given as 0 there.

    Examples
    --------
    >>> surface = dict(rho_d=0.1, rho_s=0.33, alpha_x=0.05, alpha_y=0.16)
    >>> by = gradient("ward", 0.3, 0.0, 0.3, np.pi, **surface).derivatives
    >>> round(float(by["rho_s"]), 4), round(float(by["alpha_x"]), 3)
    (10.4124, -68.722)
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    w_i = _stacked(angles.x_i, angles.y_i, angles.cos_i)
    w_r = _stacked(angles.x_r, angles.y_r, angles.cos_r)
    f_r, derivatives = gradient_vectors(model, w_i, w_r, **parameters)
    return Gradient(finished(f_r, angles), {name: finished(values, angles) for name, values in derivatives.items()})


@array_function
def gradient_vectors(model: str, wi: ArrayLike, wr: ArrayLike, **parameters: ArrayLike) -> Gradient:
    """Return `gradient` for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    spec: ModelSpec = MODELS[model]
    if spec.gradient is None:
        known = [one.name for one in MODELS.values() if one.gradient is not None]
        raise ParameterError(
            "model", f"{model} has no derivatives; models with derivatives are {', '.join(known)}", model, known
        )
    return spec.gradient(wi, wr, **parameters)


def _stacked(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> ArrayLike:
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)
