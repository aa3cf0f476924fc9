"""Sentences on tables that are not what they say, for the terminal and the page of an audit alike."""

from __future__ import annotations

from brdfdb.audit.findings import Disagreement, Nodes, TableError

_NAMES = {"l1": "mean error", "median": "median", "p95": "95th percentile", "p99": "99th percentile"}
_NAMES |= {"max": "maximum", "floor": "floor"}


def of_nodes(nodes: Nodes) -> str:
    """Return what the nodes of a table, its refractive index and its uniform part are, against those of its model."""
    part = "" if nodes.compared == nodes.count else f", of the {nodes.count} in the table,"
    said = [f"all {nodes.compared} stored values that were compared{part} are the model's"]
    if nodes.wrong:
        said = [f"{nodes.wrong} of {nodes.compared} stored values{part} are not the model's"]
        if nodes.expected is not None:
            stored = "a value that is not finite" if nodes.stored is None else f"{nodes.stored:.4g}"
            said[0] += f", such as {stored} for {nodes.expected:.4g}"
    return "; ".join([*said, *nodes.beside])


def of_error(error: TableError) -> list[str]:
    """Return a sentence for each thing that is wrong with the error that a table states."""
    said = [f"its stated error contradicts itself: {each}" for each in error.contradictions]
    if error.worst:
        worst = "; ".join(_disagreement(each) for each in error.worst)
        said.append(f"{error.disagreements} numbers of its stated error are not those of fresh directions: {worst}")
    if error.likeness:
        said.append(f"the table agrees with {error.likeness}")
    return said


def _disagreement(each: Disagreement) -> str:
    low, high = each.theta_i_deg
    where = "overall" if (low, high) == (0.0, 90.0) else f"at theta_i of {low:g} to {high:g} degrees"
    at = "" if each.wavelength_nm is None else f", {each.wavelength_nm:g} nm"
    fresh = "not finite" if each.fresh is None else f"{each.fresh:.3g}"
    return f"{_NAMES[each.statistic]} {fresh}, stated {each.stated:.3g}, {where}{at}"
