"""A table less its model: at fresh directions against the error that it states, and over planes of incidence."""

from __future__ import annotations

import numpy as np

from brdfdb.audit.findings import Disagreement, TableError, Verdict
from brdfdb.audit.likeness import bias_of, likeness_of
from brdfdb.audit.pairs import SEED, Pairs, representative_nm
from brdfdb.audit.statement import contradictions, disagreements
from brdfdb.figure import Map, rows
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import Material
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.albedo import wavelengths_of
from brdfdb.tables.table import Table

# Of the Dirac part, which is stored as float32: measured 6e-8
SPECULAR_TOLERANCE = 1e-6
_STEP_DEG = 3.0  # of the maps
_LAST_DEG = 89.0
LEAST, _MOST = 1e-6, 1.0  # what is less is drawn as the least: zeros have no colour; all maps have the same colours
# Azimuth [degree] of viewers at negative theta_r
_PLANES = {"in the plane of incidence": 0.0, "across the plane of incidence": 90.0}


def table_error_of(table: Table, material: Material, pairs: Pairs, nodes: Verdict = "passes") -> TableError:
    """Hold a table against what it states of its error, and draw the error at the middle of its wavelengths.

    `nodes` is the verdict on its nodes: what is wrong with a table is looked for where that, or its error, violates.
    """
    with np.errstate(invalid="ignore"):  # of what is not finite
        fresh = error_measurement.compare(pairs.table, pairs.model, pairs.drawn, SEED).overall.p99
    contradicts: list[str] = []
    disagree: list[Disagreement] = []
    if table.error is not None:
        contradicts = contradictions(table.error, wavelengths_of(table))
        disagree = [] if contradicts else disagreements(table.error, pairs, table.wavelength_nm)
    specular = _specular_error(table, material)
    mirrors = specular is None or specular <= SPECULAR_TOLERANCE  # nan is not
    good = mirrors and not contradicts and not disagree
    floor = error_measurement.floor_of(pairs.model, pairs.drawn)
    middle = floor[[floor.size // 2]]
    return TableError(
        stated_p99=None if table.error is None else table.error.overall.p99,
        fresh_p99=fresh if np.isfinite(fresh) else None,
        specular=None if specular is None or not np.isfinite(specular) else specular,
        directions=int(np.count_nonzero(pairs.drawn.above)),
        contradictions=contradicts,
        disagreements=len(disagree),
        worst=list({each.statistic: each for each in reversed(disagree)}.values())[::-1],
        bias=bias_of(pairs),
        likeness="" if good and nodes == "passes" else likeness_of(table, material, pairs),
        maps=[_map(table, material, middle, *plane) for plane in _PLANES.items()],
        verdict="passes" if good else "violates",
    )


def _specular_error(table: Table, material: Material) -> float | None:
    """The largest difference of the stored reflectances of the Dirac part from the model's; None: there is none."""
    if table.specular is None or material.spec.specular is None:
        return None
    nodes = table.axes_deg["theta_i"] if table.specular_theta_deg is None else table.specular_theta_deg
    arguments = material.arguments(table.wavelength_nm)
    parameters = {name: arguments[name] for name in material.spec.specular_parameters}
    theta_i = radians(nodes) if table.wavelength_nm is None else radians(nodes)[:, np.newaxis]
    truth = material.spec.specular(theta_i, **parameters)
    return float(f"{np.max(np.abs(table.specular.reshape(truth.shape) - truth)):.3g}")


def _map(table: Table, material: Material, floor: Floats, title: str, delta_phi_deg: float) -> Map:
    wavelength = representative_nm(table)
    theta_i_deg = np.append(np.arange(0.0, _LAST_DEG, _STEP_DEG), _LAST_DEG)
    theta_r_deg = np.concatenate([-theta_i_deg[:0:-1], theta_i_deg])
    # a viewer at -theta looks from the other side of the normal: negative is back towards the light
    wi = unit_vector(radians(theta_i_deg), 0.0)[:, np.newaxis]
    wr = unit_vector(-radians(theta_r_deg), radians(delta_phi_deg))
    wi, wr = (np.reshape(w, (-1, 3)) for w in np.broadcast_arrays(wi, wr))
    found = table.lookup_vectors(wi, wr, wavelength)
    truth = error_measurement.model_values(material, None if wavelength is None else np.array([wavelength]), wi, wr)[
        :, 0
    ]
    with np.errstate(invalid="ignore"):
        error = error_measurement.relative(found, truth, floor).reshape(theta_i_deg.size, -1)
    return Map(
        title=f"Error {title}" if wavelength is None else f"Error {title}, {wavelength:g} nm",
        x_label="theta_r [degrees], negative back towards the light",
        y_label="theta_i [degrees]",
        value_label=f"abs(table - model) / model, no less than {LEAST:g}",
        x=theta_r_deg.tolist(),
        y=theta_i_deg.tolist(),
        values=rows(np.maximum(error, LEAST), 2),
        log=True,
        low=LEAST,
        high=_MOST,
    )
