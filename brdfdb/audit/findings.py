"""The registry of the findings of the audit: each is a class in a module of its own."""

from __future__ import annotations

from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import Finding
from brdfdb.audit.nodes import Nodes
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.audit.sampling import Sampling
from brdfdb.audit.smoothness import Smoothness
from brdfdb.audit.table_error import TableError
from brdfdb.audit.validity import Validity
from brdfdb.audit.values import Values

# In the order in which they are judged and shown; the error of a table looks at the verdict on its nodes
FINDINGS: dict[str, type[Finding]] = {
    kind.key: kind for kind in (Energy, Reciprocity, Values, Nodes, Smoothness, TableError, Sampling, Validity)
}
