"""The distribution: wheel and sdist hold what they must, nothing else, and the wheel runs away from the repository."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {"brdfdb": "brdfdb", "brdfdb_pipelines": "pipelines/brdfdb_pipelines", "brdfdb_api": "api/brdfdb_api"}


def _hatch(source: Path, out: Path, target: str) -> Path:
    """Build the wheel or the sdist of a source tree, as pip does, and return its path."""
    out.mkdir(exist_ok=True)
    before = set(out.iterdir())
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(out)], cwd=source, check=True)
    (path,) = set(out.iterdir()) - before
    return path


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist of the repository, the wheel made from that sdist, and both unpacked."""
    folder = tmp_path_factory.mktemp("distribution")
    with tarfile.open(_hatch(ROOT, folder, "sdist")) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)  # Python 3.11.4 and later
        archive.extractall(folder / "source")
    (source,) = (folder / "source").iterdir()
    with zipfile.ZipFile(_hatch(source, folder, "wheel")) as archive:
        archive.extractall(folder / "wheel")
    return folder


def _tracked(*folders: str) -> set[str]:
    """Return the files of the repository below some folders: those that git tracks, or would."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *folders]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return set(listed.stdout.splitlines())


def test_the_sdist_has_every_file_that_is_tracked(built: Path) -> None:
    (source,) = (built / "source").iterdir()
    files = {path.relative_to(source).as_posix() for path in source.rglob("*") if path.is_file()}
    assert files - {"PKG-INFO"} == {name for name in _tracked() if not name.startswith(".ci/")}


def test_the_wheel_of_the_sdist_has_the_three_packages_and_no_more(built: Path) -> None:
    wheel = built / "wheel"
    files = {path.relative_to(wheel).as_posix() for path in wheel.rglob("*") if path.is_file()}
    packaged = {name.replace(folder, package, 1) for package, folder in PACKAGES.items() for name in _tracked(folder)}
    assert {name for name in files if ".dist-info/" not in name} == packaged


def test_the_wheel_runs_away_from_the_repository(built: Path, tmp_path: Path) -> None:
    code = "import brdfdb; print(brdfdb.__file__); from brdfdb_pipelines.cli import main; main(['list', '--presets'])"
    environment = {**os.environ, "PYTHONPATH": str(built / "wheel")}
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(str(built / "wheel"))
    assert "rolled-brass" in done.stdout


SCENE = """
store = "edition"
lights = [{ direction = [0, -1, 0] }]
camera = { position = [0, -5, 0], target = [0, 0, 0], height = 2.2 }
tolerance = { ciede2000 = 1.0 }
[[objects]]
name = "ball"
material = "store:rolled-brass"
[objects.shape]
kind = "sphere"
radius = 1
"""


@pytest.mark.judge
def test_a_new_user_needs_the_wheel_and_an_edition_alone(built: Path, tmp_path: Path) -> None:
    kept = ROOT / "tests" / "store" / "kept"
    shutil.unpack_archive(kept / "edition-1.zip", tmp_path / "edition")
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    venv.create(tmp_path / "venv", with_pip=True)
    (wheel,) = built.glob("*.whl")
    environment = {name: text for name, text in os.environ.items() if not name.startswith(("BRDFDB_", "PYTHON"))}

    def run(program: str, *arguments: str) -> str:
        command = [str(tmp_path / "venv" / "bin" / program), *arguments]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("pip", "install", "--quiet", "--no-compile", f"{wheel}[scenes]")
    number = json.loads((kept / "numbers.json").read_text(encoding="utf-8"))["materials"]["rolled-brass"]["lookups"][0]
    looked_up = run("brdfdb", "lookup", "rolled-brass", "30", "0", "30", "180", "--store", "edition")
    assert looked_up == f"{number['f_r'][0]:.6g} /sr\n"
    run("brdfdb", "plot", "rolled-brass", "--kind", "lobe", "--store", "edition", "--out", "plots")
    run("brdfdb", "render", "scene.toml", "--width", "32", "--out", "pictures")
    assert [path.suffix for path in (tmp_path / "plots").iterdir()] == [".png"]
    assert {path.suffix for path in (tmp_path / "pictures").iterdir()} >= {".png", ".exr"}
