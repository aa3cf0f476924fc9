"""The reading of "much less" and "small" in the limits that papers state of their models."""

from __future__ import annotations

from brdfdb.parameters import Standing

MUCH = 10.0  # "much less" is a tenth
ORDER: tuple[Standing, ...] = ("inside", "at the edge", "outside")


def standing(value: float, inside: float, edge: float) -> Standing:
    """Return the standing of a value that must be small: inside up to one limit, at the edge below another."""
    return "inside" if value <= inside else "at the edge" if value < edge else "outside"
