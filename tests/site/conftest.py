"""The site, built once for all tests of it, from a copy of its sources without what an earlier build wrote."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.site.pages import Page, read_pages

ROOT = Path(__file__).parents[2]
# Folders and files that the build of the site writes between the pages of the repository
GENERATED = ("_build", "figures", "figures.css", "materials", "api", "generated", "__pycache__")


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site. It shows the store of BRDFDB_CHECKED_STORE or BRDFDB_STORE, or builds one of its own."""
    pytest.importorskip("sphinx")
    source = tmp_path_factory.mktemp("site")
    for path in ROOT.iterdir():
        if path.name not in ("docs", "site", ".git"):
            (source / path.name).symlink_to(path)
    shutil.copytree(ROOT / "docs", source / "docs", ignore=shutil.ignore_patterns(*GENERATED))
    environment = dict(os.environ)
    store = environment.get("BRDFDB_CHECKED_STORE") or environment.get("BRDFDB_STORE")
    environment["BRDFDB_STORE"] = store or str(source / "brdf-store-of-the-site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", "doctrees", "docs", "site"]
    run = subprocess.run(command, cwd=source, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return source / "site"


@pytest.fixture(scope="session")
def pages(site: Path) -> dict[Path, Page]:
    """Every page of the site, with its links and anchors."""
    return read_pages(site)
