"""RPV, the Ross-Li kernels and Hapke's model against the plugins of eradiate's Mitsuba, in float64."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.models import MODELS

PYTHON = os.environ.get("BRDFDB_ERADIATE")  # of an environment with the package eradiate-mitsuba
PAIRS = 2000
AGREEMENT = 3e-12  # worst measured of 1e5 pairs above 0.6 degrees, with eradiate-mitsuba 0.5.0: 1.2e-12, of hapke
# Our parameters, and those of the plugin
CASES: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "rpv": (
        {"rho_0": 0.1, "k": 0.7, "asymmetry": -0.2, "rho_c": 0.3},
        {"type": "rpv", "rho_0": 0.1, "k": 0.7, "g": -0.2, "rho_c": 0.3},
    ),
    "ross_li": (
        {"f_iso": 0.209741, "f_vol": 0.081384, "f_geo": 0.00414},
        {"type": "rtls", "f_iso": 0.209741, "f_vol": 0.081384, "f_geo": 0.00414},
    ),
    "hapke": (
        {"w": 0.526, "b": 0.187, "c": 0.6365, "b_0": 1.0, "h": 0.083, "theta_bar": float(np.deg2rad(13.3))},
        {"type": "hapke", "w": 0.526, "b": 0.187, "c": 0.6365, "B_0": 1.0, "h": 0.083, "theta": 13.3},
    ),
}


@pytest.mark.judge
@pytest.mark.skipif(PYTHON is None, reason="BRDFDB_ERADIATE names no Python with eradiate-mitsuba")
def test_values_are_those_of_eradiate() -> None:
    rng = np.random.default_rng(1993)
    wi, wr = (unit_vector(np.arccos(rng.uniform(0.01, 1.0, PAIRS)), rng.uniform(-3, 3, PAIRS)) for _ in range(2))
    plugins = {name: plugin for name, (_, plugin) in CASES.items()}
    theirs = json.loads(
        subprocess.run(
            [str(PYTHON), str(Path(__file__).with_name("eradiate_values.py"))],
            input=json.dumps({"plugins": plugins, "wi": wi.tolist(), "wr": wr.tolist()}),
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
    )
    for name, (ours, _) in CASES.items():
        expected = np.maximum(theirs[name], 0.0)  # it has negative sums of the Ross-Li kernels
        np.testing.assert_allclose(MODELS[name].vectors(wi, wr, **ours), expected, rtol=AGREEMENT, err_msg=name)
