"""The registry of the findings of the audit: every subclass of `Finding` in a module of this room."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path

from brdfdb.audit.finding import Finding, NotJudged

_OTHERS = {"answers", "finding", "registry", "report"}  # the interface, this module, and those that read the registry


def _kinds() -> Iterator[type[Finding]]:
    """Yield the subclasses of `Finding` in the modules of this room."""
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if module.name not in _OTHERS:
            names = vars(importlib.import_module(f"brdfdb.audit.{module.name}"))
            for value in names.values():
                if isinstance(value, type) and issubclass(value, Finding) and value not in (Finding, NotJudged):
                    yield value


# The findings are in the order in which they are judged and shown. `TableError` reads the verdict of `Nodes`
FINDINGS: dict[str, type[Finding]] = {
    kind.key: kind for kind in sorted(set(_kinds()), key=lambda kind: (kind.order, kind.key))
}
