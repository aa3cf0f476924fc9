"""Files of made-up measurements."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from brdfdb.geometry import degrees
from brdfdb.measurements import Samples


def write_csv(path: Path, samples: Samples, names: str = "theta_i,theta_r,delta_phi,brdf") -> Path:
    """Write samples of one channel as columns of these names; angles are degrees."""
    columns = [*map(degrees, (samples.theta_i, samples.theta_r, samples.phi_r)), samples.values[:, 0]]
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=names, comments="", fmt="%.9g")
    return path
