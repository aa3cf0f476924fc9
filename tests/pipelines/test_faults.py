"""Faults of whole processes: killed, interrupted, without space, without permission, short of memory."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from tests.pipelines.a_build import changed, staged
from tests.pipelines.a_nursery import Nursery
from tests.pipelines.command import run
from tests.pipelines.recipes import anisotropic, isotropic, material

KILLS = 50
SEED = 20261121
WAIT_S = 300.0
PAUSE_S = 0.005  # between reads: the builds need the processor, too


def constant(step: float, rho: float, viewer: float) -> str:
    """Return the recipe of two constant tables: a value tells the recipe, a table of several values mixes two."""
    grid = isotropic(ranged(89, 1), ranged(180, step), viewer=ranged(89, viewer))
    materials = [material(name, name.title(), "lambert", f"rho = {rho}") for name in ("grey", "white")]
    head = 'materials = ["grey", "white"]\nwavelengths_nm = [500]\n'
    return "".join([head, grid, isotropic(kind="spectral"), anisotropic(), *materials])


def ranged(stop: float, step: float) -> str:
    """Return the nodes from 0 to an end."""
    return f"[{{ start = 0, stop = {stop}, step = {step} }}]"


SMALL = {"step": 2.0, "viewer": 1.0}  # a quarter of the values, in blocks that are a quarter as large
# The first call loads a kernel, which takes longer than the rest of a build
PREPARE = """
from pathlib import Path
import numpy, numba, xarray, zarr, zarr.codecs
from brdfdb.store import codec, staging
from brdfdb.tables import layout, tabulation
from brdfdb_pipelines import build, build_survey, recipe_file
layout._BLOCK_VALUES //= 4
job = recipe_file.load(Path({recipe!r})).jobs()[0]
build_survey.check_values(job)
tabulation.block(job.layout(), slice(0, 1))
tabulation.frame(job.layout())
"""


def write_recipe(path: Path, rho: float, step: float = 1.0, viewer: float = 0.5) -> Path:
    path.write_text(constant(step, rho, viewer), encoding="utf-8")
    return path


class Reader(threading.Thread):
    """Opens tables over and over, as a program does that has just started, and checks that each is of one recipe."""

    def __init__(self, root: Path, started: Callable[[], set[float]]) -> None:
        super().__init__()
        self.root, self.started = root, started
        self.reads, self.over = 0, threading.Event()
        self.error: BaseException | None = None

    def run(self) -> None:
        seen: dict[str, int] = {}
        try:
            while not self.over.wait(PAUSE_S):
                for name in ("grey", "white"):
                    try:
                        table = brdfdb.open(self.root)[name]
                    except brdfdb.store.reader.UnknownMaterialError:
                        assert name not in seen, "what was published is gone"
                        continue
                    rho = float(np.float32(table.attrs["parameters"]["rho"] / np.pi))
                    assert np.all(table.brdf == np.float32(rho)), "half of a build was read"
                    assert table.attrs["parameters"]["rho"] in self.started()
                    number = int(table.revision[1:])
                    assert number >= seen.get(name, 0), "an old revision came back"
                    seen[name] = number
                    self.reads += 1
        except BaseException as error:
            self.error = error


def marked(root: Path) -> set[tuple[str, int]]:
    """Materials and numbers of the blocks that are whole in the staging directories.

    A directory without a table is what was left when a build was killed right after it had published.
    """
    return {
        (path.parent.parent.parent.name, int(path.stem))
        for path in (root / ".staging").rglob("blocks/[0-9]*.json")
        if (path.parent.parent / "table").is_dir()
    }


def test_killed_at_fifty_random_moments_nothing_is_lost_and_every_read_is_whole(tmp_path: Path) -> None:
    root, out = tmp_path / "store", tmp_path / "out.jsonl"
    first = write_recipe(tmp_path / "first.toml", 1 / 128, **SMALL)
    with Nursery(PREPARE.format(recipe=str(first))) as nursery:

        def build(recipe: Path, root: Path, kill_after_s: float | None = None) -> int:
            command = ("build", recipe, "--store", root, "--jobs", 2, "--json")
            return nursery.run(*command, told=out, kill_after_s=kill_after_s).code

        assert build(first, tmp_path / "other") == 0
        assert build(first, root) == 0
        kill_fifty_times(root, out, build)
    assert run("gc", "--keep", 1, "--store", root) == 0
    assert staged(root) == []
    for name in ("grey", "white"):
        head = brdfdb.open(root).head(name)
        assert sorted(path.name for path in (root / "materials" / name).iterdir()) == [
            "HEAD.json", head, f"{head}.MANIFEST.json"
        ]  # fmt: skip
    assert run("verify", "--store", root) == 0


def kill_fifty_times(root: Path, out: Path, build: Callable[..., int]) -> None:
    tmp_path = root.parent
    draw = random.Random(SEED)
    rhos = {1 / 128, 2 / 128}
    reader = Reader(root, lambda: rhos)
    reader.start()
    kills = resumed = published = 0
    left: set[tuple[str, int]] = set()
    number = 2
    try:
        second = write_recipe(tmp_path / "2.toml", 2 / 128, **SMALL)
        started = time.perf_counter()
        assert build(second, root) == 0
        whole_s = time.perf_counter() - started  # while the reader reads, as in the builds below
        while kills < KILLS:
            number += 1
            rhos.add(number / 128)
            recipe = write_recipe(tmp_path / f"{number}.toml", number / 128, **SMALL)
            left = set()
            while True:
                last = kills == KILLS
                out.write_bytes(b"")
                started = time.perf_counter()
                code = build(recipe, root, None if last else draw.uniform(0.0, 1.2 * whole_s))
                assert code in (0, -signal.SIGKILL), out.read_text()
                lines = out.read_text().splitlines(keepends=True)
                events = [json.loads(line) for line in lines if line.endswith("\n")]
                kept = {(e["material"], e["block"]) for e in events if e["event"] == "block" and e["kept"]}
                computed = {(e["material"], e["block"]) for e in events if e["event"] == "block" and not e["kept"]}
                assert not computed & left, "what was whole before the kill was computed again"
                resumed += len(kept)
                published += sum(e["event"] == "published" for e in events)
                for name in ("grey", "white"):
                    brdfdb.open(root).verify(name)
                if code == 0:
                    if not kept:  # other programs may have left the machine since the last whole build
                        whole_s = time.perf_counter() - started
                    break
                kills += 1
                left = marked(root)
                if not left:  # other programs may have come since the last whole build
                    whole_s *= 1.1
            store = brdfdb.open(root)
            assert {store.metadata(name).parameters["rho"] for name in store} == {number / 128}
            if number % 8 == 0:
                assert run("gc", "--keep", 1, "--store", root) == 0
    finally:
        reader.over.set()
        reader.join(WAIT_S)
    if reader.error is not None:
        raise reader.error
    assert reader.reads > 10
    assert resumed > 10
    assert published > 0


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "brdfdb_pipelines.cli", *map(str, arguments)]


def listen_to_ctrl_c() -> None:
    """Undo what a shell does to jobs in the background: they ignore Ctrl-C, and so do their children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_ctrl_c_says_how_to_resume_and_the_same_command_does(tmp_path: Path) -> None:
    recipe, root = write_recipe(tmp_path / "recipe.toml", 0.5, step=0.05), tmp_path / "store"
    build = command("build", recipe, "--store", root, "--jobs", 1, "--json")
    with subprocess.Popen(
        build, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=listen_to_ctrl_c
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if json.loads(line)["event"] == "block":
                break
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=WAIT_S)
    assert process.returncode == 130
    assert err == (
        "brdfdb: interrupted; published tables, complete blocks and realisations are preserved; "
        f"to resume: brdfdb build {recipe} --store {root} --jobs 1 --json\n"
    )
    left = marked(root)
    assert left
    done = subprocess.run(build, capture_output=True, text=True, check=True)
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert {(e["material"], e["block"]) for e in events if e["event"] == "block" and e["kept"]} == left
    assert staged(root) == []


# Runs commands in a process that is somebody else or may do less
RESTRICTED = """
import contextlib, io, json, os, resource, sys, tempfile
from brdfdb_pipelines import cli
what, recipe, commands = sys.argv[1:]

def run(*arguments):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = cli.main(arguments)
    return code, out.getvalue(), err.getvalue()

if what == "nobody" and os.geteuid() == 0:
    with tempfile.TemporaryDirectory() as store:  # all that is imported late, nobody may not be able to read
        assert run("build", recipe, "--store", store)[0] == 0
        assert run("lookup", "foam", "0", "0", "0", "0", "--store", store)[0] == 0
    os.setgid(65534)
    os.setuid(65534)
elif what.isdecimal():
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(what), int(what)))
answers = [run(*arguments) for arguments in json.loads(commands)]
print(json.dumps(answers))
"""


def restricted(what: object, recipe: Path, *commands: list[object]) -> list[tuple[int, str, str]]:
    """Exit code, stdout and stderr of each command."""
    said = json.dumps([[str(argument) for argument in command] for command in commands])
    run = [sys.executable, "-c", RESTRICTED, str(what), str(recipe), said]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [(code, out, err) for code, out, err in json.loads(done.stdout)]


@pytest.fixture
def public() -> Iterator[Path]:
    """A directory that everybody may enter, unlike those of pytest."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def sentence(code: int, out: str, err: str) -> str:
    assert (code, out, err.count("brdfdb: ")) == (2, "", 1), err
    assert "Traceback" not in err
    return err.splitlines()[-1]


def cannot_write(said: str, root: Path, reason: str) -> str:
    """Check the sentence of a store that cannot be written; return the name of the material."""
    assert said.startswith("brdfdb: cannot write ")
    assert said.endswith(f" to the store at {root}: {reason}")
    return said.split()[3]


def test_a_directory_that_is_read_only_is_one_sentence(recipe: Path, built: Path, public: Path) -> None:
    root, same = public / "store", public / "recipe.toml"
    shutil.copytree(built, root)
    shutil.copyfile(recipe, same)
    for path in [root, *root.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        of_other, of_same, lookup, new = restricted(
            "nobody",
            same,
            ["build", changed(recipe, public / "other.toml"), "--store", root],
            ["build", same, "--store", root],
            ["lookup", "foam", 0, 0, 0, 0, "--store", root],
            ["build", same, "--store", public / "new"],
        )
    finally:
        for path in [root, *(path for path in root.rglob("*") if path.is_dir())]:
            path.chmod(0o755)
    cannot_write(sentence(*of_other), root, "Permission denied")
    assert (of_same[0], lookup[0]) == (0, 0)
    assert sentence(*new) == f"brdfdb: cannot write a store at {public / 'new'}: Permission denied"
    assert brdfdb.open(root).head("foam") == "r000001"


def test_a_limit_on_the_size_of_files_is_one_sentence_and_the_old_revision_is_served(
    recipe: Path, store_copy: Path, tmp_path: Path
) -> None:
    other = changed(recipe, tmp_path / "other.toml", 5)
    (answer,) = restricted(8000, recipe, ["build", other, "--store", store_copy])
    failed = cannot_write(sentence(*answer), store_copy, "File too large")
    store = brdfdb.open(store_copy)
    assert store.head(failed) == "r000001"
    for name in store:
        store.verify(name)
    assert run("build", other, "--store", store_copy) == 0
    assert store.head(failed) == "r000002"


def test_a_full_disk_is_one_sentence_and_the_old_revision_is_served(recipe: Path, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=600k", "none", str(disk)]
    mounted = subprocess.run(mount, capture_output=True, check=False)
    if mounted.returncode != 0:
        pytest.skip("no tmpfs can be mounted here; test_build has a write that fails instead")
    try:
        root, other = disk / "store", tmp_path / "other.toml"
        build = command("build", other, "--store", root)
        assert run("build", recipe, "--store", root) == 0
        changed(recipe, other, 0.1)
        done = subprocess.run(build, capture_output=True, text=True, check=False)
        assert sentence(done.returncode, done.stdout, done.stderr).startswith("brdfdb: disk: the tables take up to ")
        # room for the values, and not for the small files beside them
        changed(recipe, other, 7.5)
        used = shutil.disk_usage(disk).used // 1000
        subprocess.run(["mount", "-o", f"remount,size={used + 40}k", disk], capture_output=True, check=True)
        done = subprocess.run(build, capture_output=True, text=True, check=False)
        cannot_write(sentence(done.returncode, done.stdout, done.stderr), root, "No space left on device")
        store = brdfdb.open(root)
        for name in store:
            store.verify(name)
        assert store.head("foam") == "r000001"
        subprocess.run(["mount", "-o", "remount,size=20m", disk], capture_output=True, check=True)
        assert run("build", other, "--store", root) == 0
        assert store.head("foam") == "r000002"
    finally:
        subprocess.run(["umount", disk], capture_output=True, check=True)


MEMORY = """
import re, sys
from pathlib import Path
from brdfdb_pipelines import cli
def peak():  # of this program alone: ru_maxrss may be that of the process that started it
    return 1024 * int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
small, large, root, memory = sys.argv[1:]
assert cli.main(["build", small, "--store", root, "--json"]) == 0  # imports, compiled kernels, zarr's threads
before = peak()
assert cli.main(["build", large, "--store", root, "--json", "--memory", memory]) == 0
print(peak() - before, file=sys.stderr)
"""


def test_a_build_stays_within_its_memory(tmp_path: Path) -> None:
    allowed = 100_000_000
    large = write_recipe(tmp_path / "large.toml", 0.5, step=0.2)
    text = large.read_text(encoding="utf-8").replace('["grey", "white"]', '["grey"]')
    large.write_text(text.replace("stop = 89, step = 1 ", "stop = 89, step = 0.1 ", 1), encoding="utf-8")
    small = write_recipe(tmp_path / "small.toml", 0.5, step=90)
    run = [sys.executable, "-c", MEMORY, small, large, tmp_path / "store", str(allowed)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    table = brdfdb.open(tmp_path / "store").dataset("grey")["brdf"]
    assert table.nbytes >= 5 * allowed
    assert int(done.stderr.splitlines()[-1]) <= allowed
