"""The generated part of the site: pages that are made from the code, a store and its audit before Sphinx reads them.

Each module of this package writes one kind of page into a folder that git ignores. Pages are written at every build of
the site; an unchanged page keeps its date, so that Sphinx does not read it again.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

from _site import api, commands, figures, formats, http, libraries, materials, models, papers, results, schemas
from _site.markup import write_page

# Each has write(docs, store)
_WRITERS = (api, commands, figures, formats, http, libraries, materials, models, papers, results, schemas)

# The configuration of the kernels that run pages: they live for seconds, and searching their garbage takes a tenth of
# that, and half a second more when they end
_KERNELS = """\
c.IPKernelApp.exec_lines = ["import atexit, gc; gc.disable(); atexit.register(gc.freeze); del atexit, gc"]
c.HistoryManager.enabled = False
"""


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the writers of pages with Sphinx, and let it search garbage page by page."""
    gc.disable()  # a fifth of the time: Python would go through all pages that were read, again and again
    app.connect("config-inited", _write_pages)
    app.connect("source-read", _free_last_page)
    app.connect("doctree-resolved", _free_last_page)
    app.connect("build-finished", _leave_garbage)
    app.connect("autodoc-process-docstring", _keep_moduli)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _write_pages(app: Sphinx, _: Any) -> None:
    docs = Path(app.srcdir)
    root = _store(docs)
    os.environ["BRDFDB_STORE"] = str(root)  # for pages with code, which begin with brdfdb.open()
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # for their commands
    os.environ["TTY_COMPATIBLE"] = "0"  # rich: these commands write as to a file, without codes that move a cursor
    for writer in _WRITERS:
        writer.write(docs, root)
    folder = docs / "_build" / "ipython"
    write_page(folder / "profile_default" / "ipython_kernel_config.py", _KERNELS)
    os.environ["IPYTHONDIR"] = str(folder)  # kernels write files there, too


def _store(docs: Path) -> Path:
    """Return the directory of an audited store of all materials.

    It is that of the environment variable ``BRDFDB_STORE``, or ``docs/_build/brdf-store``, which is built and audited
    where something of it is missing.
    """
    root = Path(os.environ.get("BRDFDB_STORE", docs / "_build" / "brdf-store")).absolute()
    if not (root / "audit.html").exists():
        for command in ("build", "audit"):
            subprocess.run([sys.executable, "-m", "brdfdb_pipelines.cli", command, "--store", str(root)], check=True)
    return root


def _free_last_page(*_: object) -> None:
    """Free the tree of the page before, whose nodes refer to one another. What lives longer is not searched again."""
    gc.collect(0)


def _leave_garbage(*_: object) -> None:
    """Search no garbage when the process ends."""
    gc.freeze()
    gc.enable()


def _keep_moduli(_app: Sphinx, _what: str, _name: str, _value: object, _options: object, lines: list[str]) -> None:
    """Escape the bars of moduli such as |F|^2, which reStructuredText reads as substitutions."""
    lines[:] = [line if "``" in line else line.replace("|", r"\|") for line in lines]
