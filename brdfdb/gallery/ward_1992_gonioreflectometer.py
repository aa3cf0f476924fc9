"""Ward 1992, Fig. 3: the directions of an imaging gonioreflectometer, eq. 3 against rays that a sphere reflects."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Figure, Map, Panel, Statement, curve_of, listed, rows
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.measurements.gonioreflectometer import eq_3, traced

Array = NDArray[np.float64]

GOOD_DEG = 1.0  # error of "a good approximation", our reading: the 108 by 80 pixels of the prototype have about 2°
SMALL = 0.1  # D over R for "small in relation to R", our reading
OFFSETS = (0.05, 0.1, 0.2)  # D over R of the statement


def _grid() -> tuple[Array, Array]:
    """Return theta_c and phi_c [rad] of directions of the camera up to 75 degrees."""
    return np.meshgrid(radians(np.arange(0.0, 76.0, 5.0)), radians(np.arange(-180.0, 180.0, 10.0)), indexing="ij")


def _apart_deg(one: Array, other: Array) -> Array:
    """Return the angle [degree] between unit vectors, exact where it is small."""
    return np.asarray(degrees(2.0 * np.arcsin(np.minimum(np.linalg.norm(one - other, axis=-1) / 2.0, 1.0))))


def _off_deg(D: float) -> Array:
    """Return the error [degree] of eq. 3."""
    theta_c, phi_c = _grid()
    return _apart_deg(eq_3(theta_c, phi_c, D), traced(theta_c, phi_c, D))


def fig_03() -> Figure:
    """Draw the error of eq. 3 over D and over the picture of the camera."""
    spread = np.geomspace(0.005, 0.3, 15)
    most = np.array([float(_off_deg(D).max()) for D in spread.tolist()])
    middle = np.array([float(np.median(_off_deg(D))) for D in spread.tolist()])
    without = np.array([float(_ignoring(D).max()) for D in spread.tolist()])
    axis = np.linspace(-75.0, 75.0, 31)
    x, y = np.meshgrid(axis, axis)
    theta_c = radians(np.hypot(x, y))
    phi_c = np.arctan2(y, x)
    inside = np.hypot(x, y) <= 75.0
    seen = np.where(inside, theta_c, 0.0)
    off = _apart_deg(eq_3(seen, phi_c, SMALL), traced(seen, phi_c, SMALL))
    return Figure(
        key="ward-1992-fig-03",
        paper="ward1992",
        title="Fig. 3: from a pixel of the gonioreflectometer to the angles of reflection, eq. 3",
        caption="Camera and target are D beside the middle of a hemisphere of radius R. A ray from the camera is "
        "mirrored once and followed to the sample. The paper prints neither D nor R. Directions of the camera end at "
        "75°, because the paper calls those near grazing a limitation (section 3.3). In the map D is a tenth of R.",
        panels=[
            Panel(
                title="Error of eq. 3",
                x_label="D / R",
                y_label="angle at the sample [degree]",
                log_x=True,
                log_y=True,
                curves=[
                    curve_of("eq. 3, largest", spread, most, "printed"),
                    curve_of("eq. 3, median", spread, middle),
                    curve_of("camera's own angles, largest", spread, without),
                ],
            ),
            Map(
                title=f"Error of eq. 3, D / R = {SMALL:g}",
                x_label="θ_c cos(φ_c) [degree]",
                y_label="θ_c sin(φ_c) [degree]",
                value_label="degrees",
                x=axis.tolist(),
                y=axis.tolist(),
                values=rows(np.where(inside, off, np.nan), 3),
            ),
        ],
        statements=[_good(), _second_order()],
    )


def _ignoring(D: float) -> Array:
    """Return the error [degree] of the camera's own angles, taken as those of the target."""
    theta_c, phi_c = _grid()
    return _apart_deg(unit_vector(theta_c, phi_c), traced(theta_c, phi_c, D))


def _good() -> Statement:
    off = [_off_deg(D) for D in OFFSETS]
    plain = [float(_ignoring(D).max()) for D in OFFSETS]
    return Statement(
        says='"the above equations are a good approximation [...] as long as D is small in relation to R"',
        where="section 3.2, eq. 3",
        seen=f"For D / R of {listed(OFFSETS)} they are {listed([float(errors.max()) for errors in off], '.2f')}° off "
        f"at most, and {listed([float(np.median(errors)) for errors in off], '.2f')}° in the median (good: "
        f"{GOOD_DEG:g}° for {SMALL:g}); the angles of the camera itself would be {listed(plain, '.1f')}° off.",
        threshold_from="our reading: good is within 1°, half a pixel of the reduced picture",
        holds=float(off[OFFSETS.index(SMALL)].max()) < GOOD_DEG,
    )


def _second_order() -> Statement:
    spread = (0.01, 0.02)
    slope = float(np.diff(np.log([_off_deg(D).max() for D in spread]))[0] / np.log(2.0))
    return Statement(
        says="a sphere images points near its middle onto the opposite side: the error of eq. 3 is of second order in "
        "D / R",
        where="property of the form: the middle of a sphere is its own image, without coma",
        seen=f"From D / R of {spread[0]:g} to {spread[1]:g} it grows with the power {slope:.3f}.",
        threshold_from="a limit: the second power for small D / R",
        holds=abs(slope - 2.0) < 0.1,
    )


FIGURES: dict[str, Callable[[], Figure]] = {"ward-1992-fig-03": fig_03}
