"""Measurement of a conversion: what a material leaves of a source, over all pairs of directions and view by view."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.conversion.document import Peak, WorstView
from brdfdb.conversion.nodes import Evaluate, Left, Nodes, Specular, ViewError, specular_of
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.integrals.pairs import Counts, Symmetry, view_of, views
from brdfdb.lobes import Lobe
from brdfdb.materials import Material, Source
from brdfdb.tables import error_measurement

Array = NDArray[np.float64]

DIRECTIONS, SEED = 1000, 1992  # of p99: those of charts
VIEWS_DEG = np.arange(0.0, 90.0, 5.0)  # theta_r of the viewers among whom the worst one is looked for
STEP_DEG = 15.0  # between phi_r of these viewers, for an anisotropic source
PEAK_DEG = 45.0  # theta_i of the mirror direction whose f_r is stated


def lobe_of(source: Source, wavelength_nm: Array | None) -> Callable[[Array], Lobe | None]:
    """Return the lobe of a source at wavelengths [nm] as a function of the cosine alone."""
    return lambda cosine: source.lobe(cosine, wavelength_nm) if source.has_lobe else None


class Sides(NamedTuple):
    """Source and model as functions: f_r (N, L) of both, their specular parts, and the narrower of their lobes."""

    truth: Evaluate
    model: Evaluate
    mirrors: tuple[Specular | None, Specular | None]
    lobe: Callable[[Array], Lobe | None]


def sides_of(source: Source, material: Material, wavelength_nm: Array | None) -> Sides:
    """Return both sides at wavelengths [nm]; None where both are grey."""
    before, after = (wavelength_nm if side.spectral else None for side in (source, material))
    lobes = lobe_of(source, before), lobe_of(material, after)

    def narrower(cosine: Array) -> Lobe | None:
        both = [lobe for lobe in (one(cosine) for one in lobes) if lobe is not None]
        if not both:
            return None
        alpha_x = min(np.min(lobe.alpha_x) for lobe in both)
        alpha_y = min(np.min(lobe.alpha_y) for lobe in both)
        return Lobe(np.asarray(1.0), np.asarray(alpha_x), np.asarray(alpha_y))

    mirrors = specular_of(source, before), specular_of(material, after)
    return Sides(source.brdf_at(before), material.brdf_at(after), mirrors, narrower)


def left_by(sides: Sides, counts: Counts, symmetry: Symmetry) -> Left:
    """Return the error that the model leaves, over all pairs of directions."""
    return Left(views(sides.lobe, counts, symmetry), *sides[:3])


def l1_at(nodes: Nodes, sides: Sides) -> float:
    """Return the mean l1 [1] at the nodes of a search, of all wavelengths that these have."""
    values, mirror = sides.model(nodes.wi, nodes.wr), sides.mirrors[1]
    specular = np.zeros(nodes.specular.shape) if mirror is None else mirror(nodes.theta)
    wrong = nodes.weight @ np.abs(values - nodes.truth) + nodes.theta_weight @ np.abs(specular - nodes.specular)
    return float(np.mean(wrong / nodes.total))


def peak_of(sides: Sides) -> Peak:
    """Return f_r of both in the mirror direction at `PEAK_DEG`, at the middle wavelength."""
    wi, wr = (unit_vector(radians(PEAK_DEG), phi)[np.newaxis] for phi in (0.0, np.pi))
    before, after = (np.ravel(one(wi, wr)) for one in (sides.truth, sides.model))
    return Peak(theta_deg=PEAK_DEG, before=float(before[before.size // 2]), after=float(after[after.size // 2]))


def p99_of(source: Source, wavelength_nm: Array | None, sides: Sides) -> float:
    """Return the 99th percentile of the relative error [1], at directions drawn as charts draw them."""
    drawn = error_measurement.draw(source, wavelength_nm, DIRECTIONS, SEED)
    truth, values = sides.truth(drawn.wi, drawn.wr), sides.model(drawn.wi, drawn.wr)
    return error_measurement.compare(values, truth, drawn).overall.p99


def worst_view(
    sides: Sides, counts: Counts, symmetry: Symmetry, wavelength_nm: Array | None
) -> tuple[list[float], WorstView]:
    """Return the largest l1 of viewers at each theta_r, and the viewer with the largest of all."""
    anisotropic, elliptical = symmetry
    end_deg = 90.0 if elliptical else 345.0
    phis_deg = np.arange(0.0, end_deg + 1.0, STEP_DEG) if anisotropic else np.zeros(1)
    largest: list[float] = []
    worst: tuple[float, int, ViewError] | None = None
    for theta_deg in VIEWS_DEG.tolist():
        of_theta = 0.0
        for phi_deg in phis_deg.tolist():
            view = view_of(sides.lobe, float(radians(theta_deg)), float(radians(phi_deg)), counts, symmetry)
            error = ViewError(view, *sides[:3])
            column = int(np.argmax(error.l1))
            l1 = float(error.l1[column])
            of_theta = max(of_theta, l1)
            if worst is None or l1 > worst[0]:
                worst = l1, column, error
        largest.append(of_theta)
    assert worst is not None
    l1, column, error = worst
    (theta_i_deg, phi_i_deg), before, after = error.largest(column)
    return largest, WorstView(
        theta_r_deg=round(float(degrees(error.view.theta)), 6),
        phi_r_deg=round(float(degrees(error.view.phi)), 6),
        l1=l1,
        wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[column]),
        theta_i_deg=round(theta_i_deg, 2),
        phi_i_deg=round(phi_i_deg, 2),
        before=before,
        after=after,
    )
