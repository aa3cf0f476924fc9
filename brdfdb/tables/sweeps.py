"""Tables of the members of a sweep: they share plans where their error allows, and are measured together."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Material
from brdfdb.tables import plan_trials
from brdfdb.tables.albedo import largest_albedos
from brdfdb.tables.layout import Layout
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.plan_trials import MARGIN, PlannedTable
from brdfdb.tables.planner import first_reason, planned
from brdfdb.tables.stated_error import LargestAlbedo
from brdfdb.tables.statements import stated_metadata

SHARED_PLAN_VERSION = 1

_TOGETHER = 32  # members whose albedos are integrated together
_PLANNED_FIRST = 4  # members that are planned before the others: those at the ends of the sweep
_MOST_PLANS = 8  # plans that are tried for a member, those of the latest members


class MemberTable(NamedTuple):
    """The table of a member: its layout, its values, and its metadata with the numbers that it states."""

    layout: Layout
    values: NDArray[np.float32]
    metadata: TableMetadata


class MemberPlan(NamedTuple):
    """The layout of a member, its values if they are known, and the request that the table is made for."""

    layout: Layout
    values: NDArray[np.float32] | None
    request: Mapping[str, Any]


def stated_members(plans: Iterable[MemberPlan]) -> Iterator[MemberTable]:
    """Yield the tables of members of one model, with the metadata that `stated_metadata` gives of each."""
    plans = iter(plans)
    while some := [*itertools.islice(plans, _TOGETHER)]:
        for (layout, known, request), largest in zip(some, _largest_albedos(some), strict=True):
            values = plan_trials.values_of(layout) if known is None else known
            yield MemberTable(layout, values, stated_metadata(layout, values.__getitem__, request, largest))


def _largest_albedos(plans: Sequence[MemberPlan]) -> Sequence[LargestAlbedo | None]:
    """Return the largest albedos of grey materials, computed together; None for each if there are other sources."""
    materials = [plan.layout.source for plan in plans if isinstance(plan.layout.source, Material)]
    models = {material.model for material in materials}
    if len(materials) < len(plans) or len(models) > 1 or materials[0].spectral or materials[0].spec.slow:
        return [None] * len(plans)
    return largest_albedos(materials)


def plans_of_members(
    materials: Sequence[Material],
    wavelength_nm: NDArray[np.float64] | None,
    tolerance: float,
    hot_spot_tolerance: float | None = None,
) -> Iterator[PlannedTable]:
    """Yield a plan for each material of a sweep that keeps to a tolerance, as `brdfdb.tables.planner.planned` does.

    Members at the ends of the sweep are planned first. The others take the smallest of these plans with which their
    error, measured as that of any finished plan, keeps to the tolerance. A member without such a plan gets its own,
    which the members after it try, too.
    """
    hot_spot = None if hot_spot_tolerance is None else tolerance / hot_spot_tolerance
    own = {
        number: planned(materials[number], wavelength_nm, tolerance, hot_spot_tolerance=hot_spot_tolerance)
        for number in _ends(materials)
    }
    plans = [plan.layout for plan in own.values()]
    for number, material in enumerate(materials):
        if number in own:
            yield own.pop(number)
            continue
        final = plan_trials.final_of(material, wavelength_nm, hot_spot)
        plan = next(_kept(plans, material, final, tolerance), None)
        if plan is None:
            plan = planned(material, wavelength_nm, tolerance, hot_spot_tolerance=hot_spot_tolerance)
            plans = [*plans, plan.layout][-_MOST_PLANS:]
        yield plan


def _ends(materials: Sequence[Material]) -> list[int]:
    """Return the numbers of members with extreme parameters: the least and the largest of each."""
    numbers = range(len(materials))
    swept = [name for name in materials[0].numbers if len({material.parameters[name] for material in materials}) > 1]
    ends = [
        of(numbers, key=lambda number: materials[number].numbers[name]) for of in (min, max) for name in reversed(swept)
    ]
    return [*dict.fromkeys(ends or [0])][:_PLANNED_FIRST]


def _kept(
    plans: Sequence[Layout], material: Material, final: plan_trials.PlanSample, tolerance: float
) -> Iterator[PlannedTable]:
    """Yield the plans of other members, smallest first, with which a material keeps to the tolerance."""
    for plan in sorted(plans, key=lambda plan: plan.size):
        if plan.source.anisotropic != material.anisotropic:
            continue
        interpolation = plan.interpolation
        if interpolation.logarithm and plan.part_nm is None:
            interpolation = replace(interpolation, offset=float(max(0.5 * final.floor.min(), 1e-12)))
        layout = replace(plan, source=material, interpolation=interpolation)
        values = plan_trials.values_of(layout)
        if plan_trials.keeps(layout, values, final, MARGIN * tolerance):
            reason = f"{first_reason(layout, tolerance)}; planned for {plan.source.name}, of the same sweep"
            yield PlannedTable(replace(layout, reason=reason), values)
