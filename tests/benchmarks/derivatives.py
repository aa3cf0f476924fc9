"""Gradients beside values: ``python tests/benchmarks/derivatives.py``, the processor time of both in one run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.derivatives import gradient_vectors
from brdfdb.models import MODELS
from tests.benchmarks.recording import Column, Run, times_of

COUNT, QUICK_COUNT = 200_000, 2_000
REPEATS, QUICK_REPEATS = 15, 1
WARD = {"rho_d": 0.1, "rho_s": 0.2, "alpha_x": 0.1, "alpha_y": 0.2}
GREY = {"rho": 0.3, "sigma": 0.3}
COPPER = {"wavelength_nm": 500.0, "n": 1.15, "k": 2.6}
SURFACES: tuple[tuple[str, dict[str, float]], ...] = (
    *((name, WARD) for name in ("ward", "ward_half_vector", "ward_duer", "ward_bounded")),
    *((name, GREY) for name in ("oren_nayar", "oren_nayar_qualitative")),
    *(("he_torrance", {**COPPER, "sigma_0_um": sigma_0, "tau_um": 5.0 * sigma_0}) for sigma_0 in (0.02, 0.2, 2.0)),
)
MEASURED = "f_r alone, and f_r with its derivatives, at random unit vectors on one core."


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and record."""
    run = Run("derivatives", "speed", "Derivatives by parameters", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    count, repeats = (QUICK_COUNT, QUICK_REPEATS) if options.quick else (COUNT, REPEATS)
    wi, wr = np.random.default_rng(0).normal(size=(2, count, 3))
    for w in (wi, wr):
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        w[:, 2] = np.abs(w[:, 2])
    columns = [Column(name="value", unit="ns"), Column(name="value and gradient", unit="ns"), Column(name="ratio")]
    named = [Column(name="model", width=24), Column(name="sigma_0", unit="um"), "derivatives"]
    table = run.table(f"{count} pairs of directions", *named, *columns)
    for name, parameters in SURFACES:
        with np.errstate(all="ignore"):
            value = min(times_of(lambda: MODELS[name].vectors(wi, wr, **parameters), repeats))  # noqa: B023  # called at once
            both = min(times_of(lambda: gradient_vectors(name, wi, wr, **parameters), repeats))  # noqa: B023  # the same
        size = len(gradient_vectors(name, wi[:1], wr[:1], **parameters).derivatives)
        ratio = both / value if value > 0.0 else None
        table.add(name, parameters.get("sigma_0_um"), size, 1e9 * value / count, 1e9 * both / count, ratio)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
