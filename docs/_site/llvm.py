"""The library of LLVM that Mitsuba's variants on a processor need."""

from __future__ import annotations

import os
import re
import shutil
import subprocess

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
