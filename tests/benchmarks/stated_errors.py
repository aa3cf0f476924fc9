"""The share of values that are as near to the model as stated, where a percentile of a band of theta_i says little.

Directions are drawn here, apart from the code that states errors: towards the light exactly and within a cone of two
degrees, both directions at 85 to 90 degrees, and over the hemisphere; of spectral tables at the wavelengths, in the
middle between them, and at random ones. A line for each preset; exit status 1 if a share is below 98 %.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.materials import Material
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb_pipelines.recipe_file import load
from tests.benchmarks.recording import Column, Run, model_of

PROMISED = 0.98
QUICK, QUICK_WAVELENGTHS = ("rolled-brass", "scene-copper-sphere"), (500.0, 510.0, 520.0)
COUNT, WAVELENGTHS = 2000, 20  # pairs of directions; wavelengths at random, and at most of those stored
ROUNDING = 1e-6  # of the model: tables are float32
PLACES = ("hemisphere", "towards the light", "within 2 degrees", "both grazing")
MEASURED = (
    "The share of values whose difference from the model is at most the stated error, at directions drawn for this."
)
Array = NDArray[np.float64]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print the shares, and return 1 if one is below the promised one."""
    run = Run("stated_errors", "accuracy", "Stated errors that hold", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    table = run.table(
        "Share of values within their stated error; of spectral tables the least of all wavelengths",
        Column(name="material", width=32),
        Column(name="wavelengths", width=18),
        *(Column(name=place, digits=4) for place in PLACES),
    )
    for material, made in planned(options.quick):
        for words, shares in shares_of(made, material).items():
            table.add(made.name, words, *(shares[place] for place in PLACES))
    least = [(min(row[2:]), row) for row in table.rows]
    share, row = min(least, key=lambda pair: pair[0])
    run.say(f"The least share is {share:.4f}, of {row[0]}. Promised are {PROMISED}.")
    run.say(
        "For each model and kind of wavelengths, the page shows the material with the smallest share over a hemisphere."
    )
    table.keep_worst("hemisphere", lambda row: (model_of(row), row[1]), smallest=True)
    run.end()
    return int(share < PROMISED)


def planned(quick: bool) -> Iterator[tuple[Material, Table]]:
    """Materials of the default recipe with their tables; a few at a few wavelengths for a quick run."""
    for job in load().jobs():
        material, wavelength_nm = job.material, job.wavelength_nm
        if quick and material.name not in QUICK:
            continue
        if quick and wavelength_nm is not None and material.wavelengths_nm is None:
            wavelength_nm = np.array(QUICK_WAVELENGTHS)
        layout = plan(material, wavelength_nm, 0.01)
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
        error = error_measurement.measure(layout, lambda rows, values=values: values[rows])
        yield material, replace(Table.of(layout, values), attrs={"error": error.model_dump(mode="json")})


def shares_of(table: Table, material: Material) -> dict[str, dict[str, float]]:
    """Return the share of values within the stated error, by kind of wavelength and place."""
    rng = np.random.default_rng(20261122)
    pairs = {
        "hemisphere": (upwards(rng, 0.0, 90.0), upwards(rng, 0.0, 90.0)),
        "towards the light": (light := upwards(rng, 0.0, 88.0), light),
        "within 2 degrees": (light, near(rng, light, 2.0)),
        "both grazing": (upwards(rng, 85.0, 90.0), upwards(rng, 85.0, 90.0)),
    }
    own = table.wavelength_nm
    at: dict[str, Array | None] = {"grey": None}
    if own is not None:
        at = {"at the wavelengths": own[:: -(-own.size // WAVELENGTHS)]}
    if own is not None and own.size > 1:
        at["between them"] = 0.5 * (own[1:] + own[:-1])
        at["at random ones"] = rng.uniform(own[0], own[-1], WAVELENGTHS)
    return {
        words: {place: share(table, material, wi, wr, wavelength_nm) for place, (wi, wr) in pairs.items()}
        for words, wavelength_nm in at.items()
    }


def share(table: Table, material: Material, wi: Array, wr: Array, wavelength_nm: Array | None) -> float:
    """Return the share of values that are as near to the model as stated; the least of all wavelengths."""
    found = table.lookup_vectors_with_error(wi, wr, wavelength_nm)
    truth = error_measurement.model_values(material, wavelength_nm, wi, wr).reshape(found.brdf.shape)
    held = np.abs(found.brdf - truth) <= found.error + ROUNDING * truth
    return float(held.reshape(len(wi), -1).mean(axis=0).min())


def upwards(rng: np.random.Generator, low_deg: float, high_deg: float) -> Array:
    """Unit vectors with theta uniform in a range."""
    theta, phi = np.deg2rad(rng.uniform(low_deg, high_deg, COUNT)), rng.uniform(0.0, 2.0 * np.pi, COUNT)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def near(rng: np.random.Generator, light: Array, most_deg: float) -> Array:
    """Unit vectors off those given by angles uniform up to the most."""
    aside = np.cross(light, rng.normal(size=light.shape))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    off = np.deg2rad(most_deg * rng.random((len(light), 1)))
    return np.cos(off) * light + np.sin(off) * aside


if __name__ == "__main__":
    sys.exit(main())
