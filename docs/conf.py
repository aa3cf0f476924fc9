"""The configuration of the site: ``sphinx-build -W -j auto docs site`` in the root of the repository builds it."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

_OF_LLVM = re.compile(r"libLLVM\.so\.(19|2\d)")  # Dr.Jit ends the process with LLVM 16 and older ones


def llvm_path() -> str:
    """Return the path of LLVM 19 or newer: that of the environment, or the newest one installed; empty if none is."""
    if path := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return path
    ldconfig = shutil.which("ldconfig", path="/usr/sbin:/sbin:/usr/bin")
    if ldconfig is None:
        return ""
    lines = subprocess.run([ldconfig, "-p"], capture_output=True, text=True, check=False).stdout.splitlines()
    newest = max((line for line in lines if _OF_LLVM.search(line)), default="")
    return newest.split()[-1] if newest else ""


project = "brdfdb"
author = "the authors of brdfdb"
version = release = importlib.metadata.version("brdfdb")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "_site",
]
exclude_patterns = ["_build", "**/.ipynb_checkpoints"]

# Pages with code run when the site is built, in a temporary directory; an error in one of them ends the build
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 900  # seconds a cell, on a busy machine too; tutorials take less than a minute
nb_merge_streams = True

# Mitsuba's LLVM variants need LLVM 19 or newer. Without it their page is built, and its code does not run
if llvm := llvm_path():
    os.environ["DRJIT_LIBLLVM_PATH"] = llvm
nb_execution_excludepatterns = [] if llvm else ["tutorials/mitsuba.md"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True, "show-inheritance": True, "member-order": "bysource"}
suppress_warnings = ["ref.python"]  # types of fields are words; some are names of several classes, too
autodoc_typehints = "none"  # the docstrings state types, units and ranges
autodoc_use_type_comments = False  # there are none
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_param = napoleon_use_rtype = False  # types are words such as "array (N, 3)", not names to link
smartquotes = False  # messages and options are copied from pages
default_role = "py:obj"  # single backquotes in docstrings: a link where a name is known
add_module_names = False
toc_object_entries_show_parents = "hide"

html_theme = "pydata_sphinx_theme"
html_title = "brdfdb"
html_static_path = ["_static"]
html_css_files = ["figures.css", "site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_align": "left",
    "show_toc_level": 2,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "collapse_navigation": True,
    "footer_start": ["copyright"],
    "footer_end": [],
}
