"""The pair of directions with the largest error, and a word why it is large there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.geometry import degrees
from brdfdb.materials import Source
from brdfdb.parameters import Floats
from brdfdb.tables.places import ALONGSIDE_DEG, RINGS_DEG

_ROUNDING = 1e-5  # relative error that float32 and the bits of a table leave


class WorstPair(BaseModel):
    """The pair of directions at which the largest error was met."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    theta_i_deg: float
    theta_r_deg: float
    delta_phi_deg: float = Field(description="0 is back towards the light, 180 the mirror half plane")
    wavelength_nm: float | None = Field(description="null: grey")
    why: str = Field(description="why the error is large there, in words")


def worst_pair(
    error: Floats,
    truth: Floats,
    floor: Floats,
    wi: Floats,
    wr: Floats,
    in_lobe: NDArray[np.bool_],
    source: Source,
    wavelength_nm: Floats | None,
) -> WorstPair:
    """Return the pair of directions with the largest error.

    Parameters
    ----------
    error, truth : arrays (N, L)
        Relative errors [1], and f_r [1/sr] that they are of.
    floor : array (L,) [1/sr]
        Values below which an error is relative to the floor.
    wi, wr : arrays (N, 3)
        Unit vectors above the horizon.
    in_lobe : bool array (N,)
        True for viewers that were drawn in the lobe.
    source : Source
        Material or function that has the lobe and the pole.
    wavelength_nm : array (L,) [nm], or None
        None for a grey source.
    """
    row, column = np.unravel_index(int(np.argmax(error)), error.shape)
    light, viewer = wi[row], wr[row]
    theta_i, theta_r = (float(degrees(np.arccos(np.clip(w[2], -1.0, 1.0)))) for w in (light, viewer))
    turn = np.arctan2(viewer[1], viewer[0]) - np.arctan2(light[1], light[0])
    delta_phi = abs((float(degrees(turn)) + 180.0) % 360.0 - 180.0)
    grazing = sum(theta >= RINGS_DEG[0] for theta in (theta_i, theta_r))
    steep = "grows without bound" if source.grazing_pole else "changes fast"
    if error[row, column] < _ROUNDING:
        why = "it is rounding"
    elif grazing:
        which = "both directions are" if grazing == 2 else "one direction is"
        why = f"{which} near the horizon, where f_r {steep}"
    elif truth[row, column] <= floor[column]:
        why = "f_r is less than the floor there, and errors are relative to the floor"
    elif source.has_lobe and in_lobe[row]:
        why = "the viewer is in the lobe, where f_r changes most"
    elif abs(theta_i - theta_r) <= ALONGSIDE_DEG and delta_phi <= 90.0:
        why = "the viewer is beside the light, where f_r has a ridge"
    else:
        why = "f_r is bent there"
    return WorstPair(
        theta_i_deg=round(theta_i, 2),
        theta_r_deg=round(theta_r, 2),
        delta_phi_deg=round(delta_phi, 2),
        wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[column]),
        why=why,
    )
