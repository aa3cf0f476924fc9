"""The registry of the findings of the audit: every subclass of `Finding` in a module of this room."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path

from brdfdb.audit.finding import Finding, NotJudged

_OTHERS = {"finding", "findings", "report"}  # the interface, this module, and a reader of the registry


def _kinds() -> Iterator[type[Finding]]:
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if module.name not in _OTHERS:
            names = vars(importlib.import_module(f"brdfdb.audit.{module.name}"))
            for each in names.values():
                if isinstance(each, type) and issubclass(each, Finding) and each not in (Finding, NotJudged):
                    yield each


# In the order in which they are judged and shown; the error of a table looks at the verdict on its nodes
FINDINGS: dict[str, type[Finding]] = {
    kind.key: kind for kind in sorted(set(_kinds()), key=lambda kind: (kind.order, kind.key))
}
