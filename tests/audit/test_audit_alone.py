"""Tables without a source: what can be judged of the table alone is, the rest says why it is not, nothing crashes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from brdfdb.audit import FINDINGS, MaterialAudit, audit
from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import NotJudged
from brdfdb.audit.nodes import Nodes
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.audit.smoothness import Smoothness
from brdfdb.audit.table_error import TableError
from brdfdb.audit.values import ValueCounts
from brdfdb.materials import FunctionSource
from brdfdb.parameters import Floats
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from tests.audit.a_table import ANISOTROPIC, ISOTROPIC, lambert, node, tabulated, written
from tests.benchmarks.sound_materials import built

WHY = "; the table does not say what its source is, or this program does not have its model"
ALONE = {"nodes", "table_error", "sampling", "validity"}
UNRECORDED = {*ALONE, "record"}


def glossy(wi: Floats, wr: Floats, _: Floats | None) -> Floats:
    """A reciprocal f_r [1/sr] with a lobe, and less than 1 of albedo."""
    half = wi + wr
    tan2 = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    return np.asarray(0.1 + 0.3 * np.exp(-tan2 / 0.09))


GLOSSY = FunctionSource(brdf=glossy, name="glossy", title="Glossy by hand", provenance="a test", alpha=0.3)


@cache
def planned() -> Table:
    return built(plan(GLOSSY, None, 0.05))


def not_judged(found: MaterialAudit) -> set[str]:
    return {key for key, each in found.findings.items() if isinstance(each, NotJudged)}


@pytest.mark.parametrize("grid", [ISOTROPIC, ANISOTROPIC], ids=["isotropic", "anisotropic"])
def test_a_bare_table_is_audited_alone(grid: object) -> None:
    table = lambert(0.5, grid)
    found = audit(replace(table, attrs={}))
    assert (found.verdict, found.model, not_judged(found)) == ("not judged", "", UNRECORDED)
    energy, reciprocity = found.of(Energy), found.of(Reciprocity)
    assert energy.model is None
    assert energy.verdict == "conserves"
    assert energy.table.max_albedo == pytest.approx(0.5, rel=1e-6)
    assert (reciprocity.model_random, reciprocity.model_lobe) == (None, None)
    assert reciprocity.table_random.max < 1e-6
    assert found.of(Smoothness).model == []
    assert found.problems() == []
    with pytest.raises(LookupError, match="nodes of made-up is not judged"):
        found.of(Nodes)
    sentences = {each.finding: each for each in found.sentences}
    assert set(sentences) == set(FINDINGS)
    assert {sentences[key].word for key in UNRECORDED} == {"not judged"}
    assert all(sentences[key].text.endswith(WHY) for key in UNRECORDED)
    written([found])


def test_what_is_wrong_with_a_bare_table_violates() -> None:
    table = replace(lambert(0.5), attrs={})
    bright = replace(table, values=table.brdf * np.float32(2.5))
    assert audit(bright).of(Energy).verdict == "violates"
    assert audit(bright, accept_excess=True).verdict == "violates"  # it is accepted of models alone
    assert audit(node(table, -0.1)).of(ValueCounts).verdict == "violates"
    found = audit(node(table, 0.1))
    assert (found.verdict, found.of(Reciprocity).verdict) == ("violates", "violates")


def test_a_table_of_a_function_that_a_store_gives_back_is_audited_alone() -> None:
    found = audit(planned())
    assert (found.verdict, not_judged(found)) == ("passes", ALONE)
    assert "the source of this table, Glossy by hand, is a function" in found.findings["nodes"].reason
    assert found.of(Reciprocity).table_lobe is not None  # whose width the store keeps
    written([found])


def test_a_table_is_held_against_the_function_that_is_given() -> None:
    found = audit(planned(), source=GLOSSY)
    assert (found.verdict, not_judged(found)) == ("passes", {"sampling", "validity"})
    assert found.of(Nodes).wrong == 0
    assert found.of(TableError).fresh_p99 < 0.1
    assert found.of(Energy).model.max_albedo == pytest.approx(found.of(Energy).table.max_albedo, rel=0.05)
    darker = FunctionSource(brdf=lambda *at: 0.8 * glossy(*at), name="glossy", title="x", provenance="x", alpha=0.3)
    wrong = audit(planned(), source=darker)
    assert (wrong.of(Nodes).verdict, wrong.of(TableError).verdict) == ("violates", "violates")
    assert wrong.of(TableError).likeness.startswith("the model times 1.2")  # 1 / 0.8
    written([found, wrong])


def test_a_table_of_a_function_on_a_plain_grid() -> None:
    table = tabulated(GLOSSY, ISOTROPIC)
    assert not_judged(audit(table, source=GLOSSY)) == {"sampling", "validity"}
    assert Layout(GLOSSY, ISOTROPIC).shape == table.values.shape
