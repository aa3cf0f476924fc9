"""The figures of a fit: cuts in the plane of incidence against the samples, and maps of the residuals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Figure, Map, Panel, curve_of, rows
from brdfdb.fitting.document import Fits
from brdfdb.fitting.search import FittedSurface
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.parameters import Floats

_MOST = 6  # incidences that are shown
_PLANE_DEG = 2.5  # distance from the plane of incidence of samples that a cut shows
_THETA_DEG = 5.0  # height of the cells of a map
_PHI_DEG = 10.0  # width of the cells of a map


def figure_of(document: Fits, fitted: FittedSurface) -> Figure:
    """Return the figure of a fit: cuts and maps for up to six incidences, of the middle channel.

    A cut has f_r of samples and fit in the plane of incidence, where samples are in it. A map has the mean of
    ln(model / sample) over the direction of the viewer.
    """
    samples = fitted.samples
    _, first = np.unique(samples.incidence, return_index=True)
    order = first[np.lexsort((samples.phi_i[first], samples.theta_i[first]))]
    shown = order[np.linspace(0, order.size - 1, min(_MOST, order.size)).round().astype(np.int64)]
    channel = len(samples.channels) // 2
    cuts: list[Panel] = []
    maps: list[Map] = []
    for row in shown.tolist():
        chosen = samples.incidence == samples.incidence[row]
        title = f"theta_i = {float(degrees(samples.theta_i[row])):.4g} degrees"
        cut = _cut(fitted, np.flatnonzero(chosen), channel, title)
        cuts += [] if cut is None else [cut]
        maps.append(_map(fitted, np.flatnonzero(chosen), channel, title))
    of = f" of {samples.channels[channel]}" if len(samples.channels) > 1 else ""
    return Figure(
        key="fit",
        paper="",
        title=f"{fitted.surface.name}, fitted to {document.name}",
        caption=f"f_r{of} in the plane of incidence, mirror side positive: the fit as a line, samples as dots. Mean of "
        f"ln(model / sample){of} at the viewers of each light; 0 where the fit equals the sample.",
        panels=[*cuts, *maps],
        statements=[],
    )


def _turned(fitted: FittedSurface, chosen: NDArray[np.int64]) -> Floats:
    """Return the azimuths [degree] of viewers from that of the light, in [0, 360)."""
    return np.asarray(degrees(fitted.samples.phi_r[chosen] - fitted.samples.phi_i[chosen]) % 360.0)


def _cut(fitted: FittedSurface, chosen: NDArray[np.int64], channel: int, title: str) -> Panel | None:
    samples = fitted.samples
    phi = _turned(fitted, chosen)
    theta = degrees(samples.theta_r[chosen])
    mirror = np.abs(phi - 180.0) < _PLANE_DEG
    back = np.minimum(phi, 360.0 - phi) < _PLANE_DEG
    inside = (mirror | back | (theta == 0.0)) & samples.known[chosen, channel]
    if inside.sum() < 2:
        return None
    signed = np.where(mirror, theta, -theta)[inside]
    values = samples.values[chosen[inside], channel]
    order = np.argsort(signed, kind="stable")
    fine = np.union1d(np.linspace(signed.min(), signed.max(), 181), signed)
    row = chosen[0]
    wi = np.broadcast_to(unit_vector(samples.theta_i[row], samples.phi_i[row]), (fine.size, 3))
    wr = unit_vector(np.abs(radians(fine)), samples.phi_i[row] + np.where(fine > 0.0, np.pi, 0.0))
    model = fitted.seen(InstrumentView(np.ascontiguousarray(wi), wr, samples.instrument))[:, channel]
    return Panel(
        title=title,
        x_label="theta_r [degree], mirror side positive",
        y_label="f_r [1/sr]",
        curves=[
            curve_of(fitted.surface.name, fine, np.where(model > 0.0, model, np.nan), "ours"),
            curve_of("samples", signed[order], np.where(values > 0.0, values, np.nan)[order], "truth", dots=True),
        ],
        log_y=bool(np.any(values > 0.0)),
    )


def _map(fitted: FittedSurface, chosen: NDArray[np.int64], channel: int, title: str) -> Map:
    phi = _turned(fitted, chosen)
    folded = np.minimum(phi, 360.0 - phi)
    theta = degrees(fitted.samples.theta_r[chosen])
    logarithms = fitted.logarithms[chosen, channel]
    known = np.isfinite(logarithms)
    across, up = int(180.0 / _PHI_DEG) + 1, int(90.0 / _THETA_DEG) + 1
    cell = np.round(folded / _PHI_DEG).astype(np.int64), np.round(theta / _THETA_DEG).astype(np.int64)
    sums, counts = np.zeros((up, across)), np.zeros((up, across))
    np.add.at(sums, (cell[1][known], cell[0][known]), logarithms[known])
    np.add.at(counts, (cell[1][known], cell[0][known]), 1.0)
    with np.errstate(invalid="ignore"):
        mean = sums / counts
    return Map(
        title=f"{title}, residuals",
        x_label="delta_phi [degree], 180 is the mirror side",
        y_label="theta_r [degree]",
        value_label="ln(model / sample)",
        x=(np.arange(across) * _PHI_DEG).tolist(),
        y=(np.arange(up) * _THETA_DEG).tolist(),
        values=rows(mean, 4),
    )
