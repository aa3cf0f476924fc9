"""Numbers for "much less" and "small" in the limits that papers state for their models."""

from __future__ import annotations

from brdfdb.parameters import Standing

MUCH = 10.0  # ratio that counts as "much": "much less" is a tenth
ORDER: tuple[Standing, ...] = ("inside", "at the edge", "outside")


def standing(value: float, inside: float, edge: float) -> Standing:
    """Return the standing of a value that must be small: inside up to the first limit, at the edge below the second."""
    return "inside" if value <= inside else "at the edge" if value < edge else "outside"
