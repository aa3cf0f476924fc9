"""Tables with one thing wrong are named, and what is wrong with them; sound tables of random materials are not.

`tests/benchmarks/audit_power.py` is the whole of it: 200 materials, and all findings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numba
import numpy as np
import pytest

from brdfdb.audit import pairs
from brdfdb.audit.nodes import Nodes, nodes_of
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.reciprocity import reciprocity_of
from brdfdb.audit.smoothness import smoothness_of
from brdfdb.audit.statement import contradictions
from brdfdb.audit.table_error import TableError, table_error_of
from brdfdb.audit.values import values_of
from brdfdb.materials import presets
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.audit.a_table import material
from tests.benchmarks.planted_tables import PLANTED, brass, clay, copper, grooves
from tests.benchmarks.sound_materials import materials
from tests.tables.test_albedo import measured, planned

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

# What the audit calls some of them
LIKE = {
    "copper times 0.8, whose stated p99 is above 1": "the model times 0.8",
    "brass turned by 90 degrees": "the model turned by 90 degrees",
    "clay times 1.05": "the model times 1.05",
    "copper seen from the other side": "the model seen from the other side, delta_phi of 180 degrees for 0",
    "grooves in a mirror": "the model in a mirror, -phi for phi",
    "grooves turned by 90 degrees": "the model turned by 90 degrees",
}


def findings(table: Table) -> tuple[Nodes, TableError]:
    nodes = nodes_of(table, table.source)
    return nodes, table_error_of(table, table.source, pairs_of(table, table.source), nodes.verdict)


@pytest.mark.parametrize("make", [copper, brass, clay, grooves])
def test_the_tables_that_are_spoilt_are_sound(make: Callable[[], Table]) -> None:
    nodes, error = findings(make())
    assert (nodes.verdict, error.verdict, error.likeness) == ("passes", "passes", "")
    assert nodes.compared == nodes.count


def test_the_coarse_copper_states_a_percentile_above_1() -> None:
    assert copper().attrs["error"]["overall"]["p99"] > 1.0


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_table_is_named(name: str) -> None:
    nodes, error = findings(PLANTED[name]())
    assert "violates" in (nodes.verdict, error.verdict)
    assert error.likeness == LIKE.get(name, error.likeness)


@pytest.mark.parametrize("field", ["n", "k"])
def test_refractive_indices_are_held_against_their_entry(field: str) -> None:
    table = copper()
    wrong = np.array(getattr(table, field))
    wrong[2] *= 1.3
    nodes = nodes_of(replace(table, **{field: wrong}), table.source)
    assert (nodes.verdict, nodes.wrong) == ("violates", 0)
    (said,) = nodes.beside
    assert said.startswith(f"{field} is stored as ")
    assert " at 550 nm, where main/Cu/Johnson has " in said
    rounded = replace(table, **{field: np.array(getattr(table, field)) * (1.0 + 1e-12)})
    assert nodes_of(rounded, table.source).beside == []


def test_bits_that_a_table_does_not_have_are_named() -> None:
    table = copper()
    assert nodes_of(replace(table, attrs={**table.attrs, "bits": 8}), table.source).verdict == "violates"


def test_one_number_among_all_is_found() -> None:
    table = copper()
    values = table.values.copy()
    values[7, 3, 5, 1] *= np.float32(1.0 + 1e-6)
    nodes = nodes_of(replace(table, values=values), table.source)
    assert (nodes.wrong, nodes.verdict) == (1, "violates")
    assert nodes.stored == pytest.approx(float(values[7, 3, 5, 1]), rel=1e-5)


def test_a_seam_is_judged_by_its_band() -> None:
    """This table jumps by more than its overall error at 89.6 degrees, where its band states four times as much.

    Its nodes of phi_d are uneven, and light and viewer change places where phi_h is folded.
    """
    bounded = material("ward_bounded", {"rho_d": 0.5844, "rho_s": 0.0999, "alpha_x": 0.232, "alpha_y": 0.1496})
    axes = {
        "theta_h": [0, 1.3, 5, 10.4, 16.6, 24, 33.2, 90],
        "phi_h": [0, 15, 31.7, 54.4, 73, 90],
        "theta_d": [0, 23.6, 44.1, 59.3, 69.6, 75, 77.8, 79.9, 81.9, 83.8, 85.2, 86.2, 87, 88, 90],
        "phi_d": [0, 92.66, 180],
    }
    table = measured(Layout(bounded, Grid(axes), None, Interpolation("cubic", True, 1e-4)))
    found = smoothness_of(table, bounded, pairs_of(table, bounded))
    assert found.verdict == "passes"
    worst = max(found.table, key=lambda jump: jump.largest)
    assert table.error.overall.p99 < worst.largest <= worst.tolerance == table.error.p99[8][0]
    # the same jump between 0 and 10 degrees would be too much
    error = {**table.attrs["error"], "p99": [*table.attrs["error"]["p99"][:8], table.attrs["error"]["p99"][0]]}
    same = replace(table, attrs={**table.attrs, "error": error})
    assert smoothness_of(same, bounded, pairs_of(same, bounded)).verdict == "violates"


def test_rounding_next_to_a_pole_is_no_asymmetry(monkeypatch: pytest.MonkeyPatch) -> None:
    """The logarithms hold f_r times the cosines and an offset: what that rounds to, the cosines magnify."""
    table = planned("ward_duer", {"rho_d": 0.109, "rho_s": 0.0332, "alpha_x": 0.0825, "alpha_y": 0.135}, None, 0.03)
    assert table.interpolation.power == 1.0
    monkeypatch.setattr(pairs, "SEED", 1)
    assert reciprocity_of(table, pairs_of(table, table.source)).verdict == "passes"


def test_no_sound_table_is_named() -> None:
    for words, table in materials(6, seed=2):
        nodes, error = findings(table)
        assert (nodes.verdict, error.verdict) == ("passes", "passes"), words
        assert smoothness_of(table, table.source, pairs_of(table, table.source)).verdict == "passes", words


def test_a_dirac_part_that_is_missing_or_has_other_nodes_is_named() -> None:
    table = copper()
    (said,) = nodes_of(replace(table, specular=None), table.source).beside
    assert said == "the specular part of the model is not stored"
    ends = np.array([0, len(table.specular) - 1])
    fewer = replace(table, specular=table.specular[ends], specular_theta_deg=np.array([0.0, 90.0]))
    (said,) = nodes_of(fewer, table.source).beside
    assert said.startswith("the specular part is stored at 2 angles that are not the ")


def test_a_planned_table_that_states_no_error_is_named() -> None:
    table = clay()
    attrs = {key: value for key, value in table.attrs.items() if key != "error"} | {"request": {"tolerance": 0.05}}
    (said,) = nodes_of(replace(table, attrs=attrs), table.source).beside
    assert said == "no error is stated, though a tolerance of 0.05 was asked for"


@pytest.mark.parametrize("wrong", [float("nan"), -1.0])
def test_limits_in_places_that_are_no_numbers_contradict_themselves(wrong: float) -> None:
    error = copper().error
    assert contradictions(error, len(error.floor)) == []
    rows = [[wrong] * len(row) for row in error.places.alongside]
    other = error.model_copy(update={"places": error.places.model_copy(update={"alongside": rows})})
    (said,) = contradictions(other, len(error.floor))
    assert said.startswith("its limits in places and between wavelengths are not all finite")


def test_nodes_below_the_horizon_may_be_negative_and_lookups_may_not() -> None:
    layout = Layout(presets()["foam"], Grid({"theta_h": [0, 45, 90], "theta_d": [0, 45, 90], "phi_d": [0, 45, 90]}))
    table = Table.of(layout, tabulate(layout)["brdf"].values)
    numbers = np.array(table.values)
    numbers[-1, -1] = -1.0
    table, looked_up = replace(table, values=numbers), np.ones((3, 1))
    assert table.values_are_brdf
    assert values_of(table, looked_up).positivity == "passes"
    assert values_of(table, -looked_up).positivity == "violates"
