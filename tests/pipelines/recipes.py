"""Recipes that tests change: a good one, a material of its own, and a sweep."""

from __future__ import annotations

GOOD = """\
title = "one"
materials = ["foam"]
wavelengths_nm = [500, 550]
[grids.isotropic]
theta_i_deg = [{ start = 0, stop = 80, step = 40 }]
theta_r_deg = [0, 80]
delta_phi_deg = [0, 180]
[grids.spectral]
theta_i_deg = [0, 40]
theta_r_deg = [0, 40]
delta_phi_deg = [0, 90, 180]
[grids.anisotropic]
theta_i_deg = [0, 60]
phi_i_deg = [0, 180, 360]
theta_r_deg = [0, 60]
phi_r_deg = [0, 180, 360]
"""
DEFINED = """\
[define.mine]
title = "My own"
model = "ward"
source = "me"
[define.mine.parameters]
rho_d = 0.1
rho_s = 0.2
alpha_x = 0.3
alpha_y = 0.3
"""
SWEPT = (
    GOOD.replace('["foam"]', '["mine"]')
    + """\
[sweep.mine]
title = "My own"
model = "ward"
source = "me"
[sweep.mine.parameters]
alpha_x = [0.1, { start = 0.2, stop = 0.3, step = 0.1 }]
rho_d = 0.1
rho_s = [0.2, 0.4]
alpha_y = 0.3
"""
)
