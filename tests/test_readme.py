"""The front door: the code of the README prints what it says, and its links lead somewhere."""

from __future__ import annotations

import contextlib
import io
import os
import re
import tomllib
from pathlib import Path

import pytest

from brdfdb.materials import Material
from brdfdb_pipelines import cli, recipe_file

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md")]


def blocks(text: str, language: str) -> list[str]:
    """The blocks of code of a page in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_lead_to_files_and_headings_that_exist(page: Path) -> None:
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link]
    assert local
    for link in local:
        name, _, anchor = link.partition("#")
        target = ROOT / name if name else page
        assert target.is_file(), f"{page.name} links to {link}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), flags=re.MULTILINE)
            assert anchor in {re.sub(r"[^a-z0-9 -]", "", title.lower()).replace(" ", "-") for title in headings}, link


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store that the README's first command built, or one with the two materials of its example."""
    if checked := os.environ.get("BRDFDB_CHECKED_STORE"):
        return Path(checked)
    folder = tmp_path_factory.mktemp("readme")
    recipe = (ROOT / "pipelines" / "brdfdb_pipelines" / "recipes" / "default.toml").read_text(encoding="utf-8")
    two = recipe.replace('materials = ["*"]', 'materials = ["rolled-brass", "scene-copper-sphere"]')
    (folder / "two.toml").write_text(two, encoding="utf-8")
    assert cli.main(["build", str(folder / "two.toml"), "--store", str(folder / "brdf-store")]) == 0
    return folder / "brdf-store"


def test_the_code_prints_what_its_comments_say(store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_STORE", str(store))
    monkeypatch.chdir(tmp_path)
    (code,) = blocks(README, "python")
    stated = [line.rsplit("  # ", 1)[1] for line in code.splitlines() if line.startswith("print(")]
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {})
    assert printed.getvalue().splitlines() == stated
    assert len(stated) == 3
    assert (tmp_path / "lobe.svg").stat().st_size > 1000


def test_the_form_of_a_material_is_a_recipe_with_all_fields_of_the_schema(tmp_path: Path) -> None:
    (form,) = blocks(CONTRIBUTING, "toml")
    table = tomllib.loads(form)["define"]["my-material"]
    assert set(table) == set(Material.model_fields) - {"name", "known_excess"}
    assert "known_excess = {" in CONTRIBUTING
    (tmp_path / "form.toml").write_text(form, encoding="utf-8")
    (job,) = recipe_file.load(tmp_path / "form.toml").jobs()
    assert job.material.wavelengths_nm == (550.0,)
    assert set(job.material.assumed) == {"a"}
