"""Tables of the members of a sweep: the same as those of each material alone, on plans that keep to tolerances."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.materials import Material
from brdfdb.tables import sweeps
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.plan_trials import values_of
from brdfdb.tables.planner import planned
from brdfdb.tables.statements import stated_metadata
from brdfdb.tables.sweeps import MemberPlan, plans_of_members, stated_members

THETA = [0.0, 20.0, 40.0, 60.0, 80.0, 89.5]
PHI = [0.0, 60.0, 120.0, 180.0]
ISOTROPIC = Grid({"theta_i": THETA, "theta_r": THETA, "delta_phi": PHI})
ROUND = np.linspace(0.0, 360.0, 7)
ANISOTROPIC = Grid({"theta_i": THETA, "phi_i": ROUND, "theta_r": THETA, "phi_r": ROUND})
VISIBLE = np.array([450.0, 550.0, 650.0])
SPECTRUM = {"wavelengths_nm": [400.0, 500.0, 700.0], "values": [0.1, 0.5, 0.3]}


def members(model: str, **swept: object) -> list[Material]:
    """Return three materials that differ in the parameters with lists."""
    more = {"refractive_index": "main/Cu/Johnson"} if model == "he_torrance" else {}
    return [
        Material.from_table(
            f"member-{number}",
            {
                "title": "A member",
                "model": model,
                "source": "a test",
                "parameters": {name: v[number] if isinstance(v, list) else v for name, v in swept.items()},
                **more,
            },
        )
        for number in range(3)
    ]


SWEEPS = {
    "oren-nayar": (members("oren_nayar", rho=[0.2, 0.9, 0.9], sigma_deg=[10.0, 10.0, 40.0]), ISOTROPIC, None),
    "ward": (members("ward", rho_d=[0.1, 0.2, 0.6], rho_s=0.3, alpha_x=0.2, alpha_y=0.2), ISOTROPIC, None),
    "ward-anisotropic": (
        members("ward", rho_d=0.1, rho_s=0.2, alpha_x=[0.2, 0.3, 0.4], alpha_y=[0.4, 0.3, 0.3]),
        ANISOTROPIC,
        None,
    ),
    "he-torrance": (members("he_torrance", sigma_0_um=[0.1, 0.2, 0.3], tau_um=2.0), ISOTROPIC, VISIBLE),
    "spectral": (members("oren_nayar", rho=SPECTRUM, sigma_deg=[5.0, 20.0, 40.0]), ISOTROPIC, VISIBLE),
}


@pytest.mark.parametrize("name", SWEEPS)
def test_members_state_what_each_states_alone(name: str) -> None:
    materials, grid, wavelength_nm = SWEEPS[name]
    plans = [
        MemberPlan(Layout(material, grid, wavelength_nm), None, {"tolerance": None, **material.document()})
        for material in materials
    ]
    for plan, (layout, values, metadata) in zip(plans, stated_members(plans), strict=True):
        alone = values_of(plan.layout)
        assert layout is plan.layout
        assert np.array_equal(values, alone)
        assert metadata == stated_metadata(plan.layout, alone.__getitem__, plan.request)


def test_members_share_plans_that_keep_to_the_tolerance() -> None:
    tolerance = 0.05
    materials = members("oren_nayar", rho=[0.2, 0.5, 0.9], sigma_deg=[20.0, 21.0, 22.0])
    plans = [*plans_of_members(materials, None, tolerance)]
    first, middle, last = (plan.layout for plan in plans)
    for own, number in ((first, 0), (last, 2)):  # the ends are planned as they would be alone
        alone = planned(materials[number], None, tolerance).layout
        assert own.document() == alone.document()
    assert middle.grid.axes in (first.grid.axes, last.grid.axes)
    assert "planned for member-" in middle.reason
    tables = stated_members(MemberPlan(layout, values, {}) for layout, values in plans)
    errors = [table.metadata.error for table in tables]
    assert all(error is not None and error.overall.p99 <= tolerance for error in errors)


def test_a_member_that_no_plan_suits_gets_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeps, "_PLANNED_FIRST", 1)
    tolerance = 0.05
    materials = members("oren_nayar", rho=0.9, sigma_deg=[2.0, 60.0, 59.0])
    smooth, rough, last = (plan.layout for plan in plans_of_members(materials, None, tolerance))
    assert smooth.document() == planned(materials[0], None, tolerance).layout.document()
    assert rough.document() == planned(materials[1], None, tolerance).layout.document()
    assert rough.size > smooth.size
    assert last.shape == rough.shape
    assert "planned for member-1" in last.reason
