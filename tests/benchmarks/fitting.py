"""Fits of synthetic samples: ``python tests/benchmarks/fitting.py``, three minutes.

Twelve materials of the papers are sampled at four incidences, with 3 % of noise and gaps. The share of parameters that
lie in their 95 % intervals, the same where noise is not in proportion to f_r, and the processor time of one fit of 7000
samples by each analytic model, without the first calls of kernels.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.fitting.fit import fit, fits
from brdfdb.fitting.residuals import Kind
from brdfdb.fitting.surface import NotDescribedError, fitted_by_default
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material, presets
from brdfdb.measurements import Samples
from brdfdb.models import MODELS
from tests.benchmarks.recording import Column, Run

MATERIALS = (
    *("glossy-grey-paper", "white-ceramic-tile", "painted-cardboard-box", "latex-gloss-rolled-wood"),
    *("clay-vase", "white-sand", "wall-plaster", "rendered-sphere-20deg"),
    *("roughened-aluminum-500nm", "roughened-aluminum-2000nm", "magnesium-oxide-ceramic", "aluminum-cylinder-12d"),
)
NOISE, GAPS, HOLES = 0.03, 0.2, 0.05  # relative noise; shares of directions and of values that are missing
SEEDS, QUICK_SEEDS = 6, 1
MANY, QUICK_MANY = 7000, 500
DARK = {"rho_d": 0.02, "rho_s": 0.1, "alpha_x": 0.15, "alpha_y": 0.15}  # a glossy black surface, of ward
CONSTANT, MANY_SEEDS = 0.003, 60  # noise [1/sr] of all its samples alike
QUICK_MATERIALS = ("glossy-grey-paper", "clay-vase", "roughened-aluminum-500nm")  # one of each paper
QUICK_MODELS = ("lambert", "ward", "ggx")
MEASURED = "The share of true parameters in the 95 % intervals of fits to noisy samples, and the time of one fit."

Array = NDArray[np.float64]


def samples(material: Material, seed: int) -> Samples:
    """Return noisy samples of a material, more of them around the mirror direction."""
    rng = np.random.default_rng(seed)
    lights = [10.0, 30.0, 50.0, 65.0]
    azimuths = [0.0, 45.0, 90.0] if material.anisotropic else [0.0]
    wide = np.meshgrid(lights, azimuths, np.arange(0, 81, 8.0), [0, 30, 60, 90, 120, 150, 165, 175, 180], indexing="ij")
    near = np.meshgrid(lights, azimuths, [-6.0, -3.0, 0.0, 3.0, 6.0], [174.0, 177.0, 180.0], indexing="ij")
    axes = np.deg2rad([np.concatenate([a.ravel(), b.ravel()]) for a, b in zip(wide, near, strict=True)])
    axes[2, wide[0].size :] += axes[0, wide[0].size :]
    theta_i, phi_i, theta_r, turn = axes[:, rng.random(axes.shape[1]) > GAPS]
    at = np.array([(material.wavelengths_nm or (550.0,))[0]]) if material.spectral else None
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_i + turn)
    values = np.reshape(material.lookup_vectors(wi, wr, at), (-1, 1))
    values = values * (1.0 + NOISE * rng.standard_normal(values.shape))
    values[rng.random(values.shape) < HOLES] = np.nan
    channels = ("grey",) if at is None else (f"{at[0]:g}nm",)
    return Samples(material.name, theta_i, phi_i, theta_r, phi_i + turn, channels, at, values)


def coverage(run: Run, materials: Sequence[str], seeds: int) -> None:
    """Measure the share of parameters in their intervals."""
    table = run.table(
        "parameters in their 95 % intervals",
        Column(name="material", width=28),
        Column(name="model", width=12),
        "parameters",
        "inside",
        Column(name="share", unit="%"),
    )
    known = presets()
    every = inside = 0
    for name in materials:
        material = known[name]
        truth, counted, hits = material.file_parameters(), 0, 0
        for seed in range(seeds):
            document, _ = fits(samples(material, seed), [material.model], refractive_index=material.refractive_index)
            for one in document.fits[0].estimates:
                value = truth[one.name]
                assert isinstance(value, float)
                counted, hits = counted + 1, hits + (one.low <= value <= one.high)
        table.add(name, material.model, counted, hits, 100.0 * hits / counted)
        every, inside = every + counted, inside + hits
    table.add("all", "", every, inside, 100.0 * inside / every)


def constant_noise(run: Run, seeds: int) -> None:
    """Measure how many intervals of rho_d hold it where noise is not in proportion to f_r, which is what log takes."""
    table = run.table(
        f"rho_d = {DARK['rho_d']:g} in its 95 % interval, with noise of {CONSTANT:g} /sr",
        Column(name="residual", width=12),
        "intervals",
        "inside",
    )
    axes = np.meshgrid([10, 30, 50, 65], np.arange(0, 81, 5), [0, 60, 120, 170, 175, 180], indexing="ij")
    theta_i, theta_r, turn = np.deg2rad([axis.ravel() for axis in axes])
    phi_i = np.zeros_like(theta_i)
    clean = MODELS["ward"].vectors(unit_vector(theta_i, phi_i), unit_vector(theta_r, turn), **DARK)[:, np.newaxis]
    residuals: tuple[Kind, ...] = ("log", "uncertainty")
    for residual in residuals:
        inside = 0
        for seed in range(seeds):
            values = clean + CONSTANT * np.random.default_rng(seed).standard_normal(clean.shape)
            stated = np.full_like(values, CONSTANT)
            noisy = Samples("dark", theta_i, phi_i, theta_r, turn, ("grey",), None, values, stated)
            document, _ = fits(noisy, ["ward"], residual=residual)
            (one,) = (one for one in document.fits[0].estimates if one.name == "rho_d")
            inside += one.low <= DARK["rho_d"] <= one.high
        table.add(residual, seeds, inside)


def times(run: Run, searched: Sequence[str], count: int) -> None:
    """Measure the processor time of a fit by each model."""
    table = run.table(
        f"one fit of {count} samples", Column(name="model", width=32), Column(name="time", unit="s"), "rms_ln"
    )
    few = samples(presets()["glossy-grey-paper"], 0)
    rows = np.tile(np.arange(len(few)), -(-count // len(few)))[:count]
    noise = 1.0 + NOISE * np.random.default_rng(1).standard_normal((count, 1))
    many = replace(few.selected(rows), values=few.values[rows] * noise)
    for model in searched:
        try:
            fit(few, model)  # compiles
        except NotDescribedError:
            continue
        begin = time.process_time()
        fitted = fit(many, model)
        seconds = time.process_time() - begin
        left = fitted.logarithms[np.isfinite(fitted.logarithms)]
        table.add(model, seconds, float(np.sqrt(np.mean(left**2))))


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and record."""
    run = Run("fitting", "accuracy", "Fits of synthetic samples", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    if options.quick:
        coverage(run, QUICK_MATERIALS, QUICK_SEEDS)
        constant_noise(run, QUICK_SEEDS)
        times(run, QUICK_MODELS, QUICK_MANY)
    else:
        coverage(run, MATERIALS, SEEDS)
        constant_noise(run, MANY_SEEDS)
        times(run, fitted_by_default(sums=False), MANY)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
