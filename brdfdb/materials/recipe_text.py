"""Materials as text of a recipe, and the digits of numbers that were searched."""

from __future__ import annotations

import re
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")  # keys that TOML takes without quotation marks
DIGITS = 6  # significant digits of parameters that were searched
_ZERO = 1e-12  # parameters that are not larger are 0


def rounded(value: float) -> float:
    """Return a parameter that was searched with the digits that recipes have."""
    return float(f"{value:.{DIGITS}g}") if abs(value) > _ZERO else 0.0


def toml_of(name: str, table: dict[str, Any]) -> str:
    """Return a table of a recipe as TOML: text, numbers, lists, and tables of them in one line."""
    lines = [f"[define.{name}]", *(f"{key} = {_value(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        keys = {key: key if _BARE.fullmatch(key) else _value(key) for key in value}
        return "{ " + ", ".join(f"{keys[key]} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ").replace("\t", " ")
        return f'"{escaped}"'
    return repr(value)
