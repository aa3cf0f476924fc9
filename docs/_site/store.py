"""The store that the site shows: the default build with its audit."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def made(docs: Path) -> Path:
    """Return the directory of an audited store of all materials.

    It is that of the environment variable ``BRDFDB_STORE``, or ``docs/_build/brdf-store``, which is built and audited
    where something of it is missing.
    """
    root = Path(os.environ.get("BRDFDB_STORE", docs / "_build" / "brdf-store")).absolute()
    if not (root / "audit.html").exists():
        for command in ("build", "audit"):
            subprocess.run([sys.executable, "-m", "brdfdb_pipelines.cli", command, "--store", str(root)], check=True)
    return root
