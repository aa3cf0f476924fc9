"""The errors between the members of a family: ``python tests/benchmarks/families.py``.

Builds families of rough copper of more and more members, and prints what each states between its members. Then looks up
values at random parameters and directions, apart from the code that states the error, and prints the share of values
within it. Exits with 1 if fewer than 98 % are.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.geometry import unit_vector
from brdfdb.models import he_torrance_vectors
from brdfdb.refractive_indices import refractive_index
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import Recipe
from brdfdb_pipelines.workers import threads
from tests.benchmarks.recording import Column, Run

INDEX = "main/Cu/Johnson"
DIRECTIONS, PROMISED = 100, 0.98


class Families(NamedTuple):
    """Families over the same ranges of two parameters, each with its number of values of each parameter."""

    counts: tuple[int, ...]
    sigma_0_um: tuple[float, float]
    tau_um: tuple[float, float]
    wavelengths_nm: tuple[float, ...]
    tolerance: float
    drawn: int  # random sets of parameters


FULL = Families((5, 9), (0.1, 0.2), (1.0, 2.0), (450.0, 550.0, 650.0), 0.02, 200)
SMALL = Families((2,), (0.1, 0.11), (1.9, 2.0), (550.0,), 0.1, 4)
MEASURED = (
    "Families of rough copper over the height and the correlation length of the surface: size, stated error, and the "
    "share of values within it."
)


def recipe(families: Families, count: int) -> Recipe:
    """Return the recipe of a family with so many values of each parameter."""
    ranges = {"sigma_0_um": families.sigma_0_um, "tau_um": families.tau_um}
    parameters = {name: np.linspace(*ends, count).tolist() for name, ends in ranges.items()}
    sweep = {"title": "Rough copper", "model": "he_torrance", "source": "a sweep", "refractive_index": INDEX}
    return Recipe.model_validate(
        {
            "materials": ["rough-copper"],
            "wavelengths_nm": list(families.wavelengths_nm),
            "tolerance": families.tolerance,
            "sweep": {"rough-copper": {**sweep, "parameters": parameters}},
        }
    )


def share_within(store: brdfdb.Store, families: Families) -> float:
    """Return the share of values within the stated error, at random parameters and directions."""
    rng = np.random.default_rng(20261122)
    family = store.family("rough-copper")
    n, k = refractive_index(INDEX, np.array(families.wavelengths_nm))
    inside = []
    for _ in range(families.drawn):
        theta, phi = rng.uniform(0.0, np.deg2rad(85.0), (2, DIRECTIONS)), rng.uniform(0.0, 2.0 * np.pi, (2, DIRECTIONS))
        wi, wr = unit_vector(theta[0], phi[0]), unit_vector(theta[1], phi[1])
        sigma_0_um, tau_um = float(rng.uniform(*families.sigma_0_um)), float(rng.uniform(*families.tau_um))
        value = family.lookup_vectors_with_error(wi, wr, sigma_0_um=sigma_0_um, tau_um=tau_um)
        for number, wavelength_nm in enumerate(families.wavelengths_nm):
            surface = {"sigma_0_um": sigma_0_um, "tau_um": tau_um, "a": 0.0, "n": n[number], "k": k[number]}
            model = he_torrance_vectors(wi, wr, wavelength_nm=wavelength_nm, **surface)
            inside.append(np.abs(value.brdf[..., number] - model) <= value.error[..., number])
    return float(np.mean(inside))


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the families, and return 1 if a stated error does not hold."""
    run = Run("families", "accuracy", "Between the members of families", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    families = SMALL if options.quick else FULL
    (low, high), (short, long) = families.sigma_0_um, families.tau_um
    table = run.table(
        f"sigma_0 {low:g} to {high:g} um, tau {short:g} to {long:g} um, {len(families.wavelengths_nm)} wavelengths, "
        f"tables for {100 * families.tolerance:g} %",
        Column(name="values of each parameter", width=24),
        "members",
        Column(name="stored", unit="MB"),
        *(Column(name=name, unit="%") for name in ("stated mean error", "stated p99")),
        Column(name="values within the stated error", unit="%", digits=4),
        Column(name="build", unit="s"),
    )
    least = 1.0
    for count in families.counts:
        with tempfile.TemporaryDirectory() as root, threads(1) as at:
            start = time.perf_counter()
            build(recipe(families, count), Path(root), at)
            seconds = time.perf_counter() - start
            store = brdfdb.open(root)
            record = store.family("rough-copper").record
            size = sum(path.stat().st_size for path in Path(root).rglob("*") if path.is_file())
            share = share_within(store, families)
            stated = record.error.overall
            table.add(count, len(record.members), size / 1e6, 100 * stated.l1, 100 * stated.p99, 100 * share, seconds)
            least = min(least, share)
    run.end()
    return int(least < PROMISED)


if __name__ == "__main__":
    sys.exit(main())
