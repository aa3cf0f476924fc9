"""Hostile recipes: each is one sentence with exit code 2, in bounded time and memory, and nothing is written."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

from tests.pipelines.a_nursery import Nursery
from tests.pipelines.command import Captured, refused
from tests.pipelines.recipes import COARSE

MOST_S = 10  # processor time [s] of a build
MOST_BYTES = 500_000_000  # memory of the process; the program itself takes 190 MB

HEAD = 'materials = ["foam"]\nwavelengths_nm = [500]\n'
GOOD = HEAD + COARSE
DEFINE = '[define.mine]\ntitle = "T"\nmodel = "lambert"\nsource = "me"\nparameters = { rho = 0.5 }\n'
MINE = GOOD.replace("foam", "mine") + DEFINE
SWEEP = GOOD.replace("foam", "fam") + (
    '[sweep.fam]\ntitle = "T"\nmodel = "ward"\nsource = "me"\n[sweep.fam.parameters]\n'
    "rho_d = 0.1\nrho_s = 0.1\nalpha_x = [0.1, 0.2]\nalpha_y = 0.1\n"
)
LONG = "{ start = 0, stop = 99998, step = 1 },"
AXIS = "theta_i_deg = [0, 80]"
COPPER = GOOD.replace("foam", "scene-copper-sphere")


def ranged(text: str, axis: str, step: float) -> str:
    """A recipe whose isotropic grid has a fine step for one axis."""
    end = 180 if axis == "delta_phi" else 80
    return text.replace(f"{axis}_deg = [0, {end}]", f"{axis}_deg = [{{ start = 0, stop = {end}, step = {step} }}]", 1)


def fine(text: str, step: float) -> str:
    """A recipe whose isotropic grid has one step for all axes."""
    return ranged(ranged(ranged(text, "theta_i", step), "theta_r", step), "delta_phi", step)


def family(letter: str) -> str:
    """A family of 60 001 members."""
    table = SWEEP[SWEEP.index("[sweep.fam]") :].replace("sweep.fam", f"sweep.fam-{letter}")
    return table.replace("[0.1, 0.2]", "[{ start = 0.1, stop = 0.7, step = 1e-5 }]")


def many(count: int, text: Callable[[int], str]) -> str:
    return "".join(map(text, range(count)))


# name, text or bytes, and what the sentence contains
RECIPES: list[tuple[str, str | bytes, str]] = [
    ("arrays in arrays, 500", f"materials = {'[' * 500}{']' * 500}", "nested too deeply"),
    ("arrays in arrays, 200 000", f"materials = {'[' * 200_000}{']' * 200_000}", "nested too deeply"),
    ("arrays in arrays, never closed", "materials = " + "[" * 200_000, "nested too deeply"),
    ("tables in tables, 5000", "a = " + "{a = " * 5000 + "1" + "}" * 5000, "nested too deeply"),
    ("arrays in arrays, 150", f"materials = {'[' * 150}{']' * 150}", "materials"),
    ("arrays in a parameter", MINE.replace("0.5", "[" * 150 + "]" * 150), "rho"),
    ("a key of 100 000 dots", "a." * 100_000 + "a = 1", "parts between dots"),
    ("a key of 4 MB", "a." * 1_900_000 + "a = 1", "parts between dots"),
    ("a table of 100 000 dots", "[" + "a." * 100_000 + "a]", "parts between dots"),
    ("a quoted key of dots", '"a b".' * 100_000 + "a = 1", "parts between dots"),
    ("a key of spaced dots", "a . " * 100_000 + "a = 1", "parts between dots"),
    ("an array of tables of dots", "[[" + "a." * 100_000 + "a]]", "parts between dots"),
    ("a key of dots in a table", "x = {" + "a." * 100_000 + "a = 1}", "parts between dots"),
    ("8 MB of numbers", "wavelengths_nm = [" + "500," * 2_000_000 + "]", "the limit for a file"),
    ("5 MB of a comment", "#" * 5_000_000, "the limit for a file"),
    ("3.9 MB of a comment", "#" * 3_900_000, "materials"),
    ("3.9 MB of one word", "a" * 3_900_000, "not TOML"),
    ("3.9 MB of quotes", "a = " + '"' * 3_900_000, "not TOML"),
    ("3.9 MB of line ends", "\n" * 3_900_000, "materials"),
    ("bytes of no text", b"\xff\xfe" * 1000, "not TOML"),
    ("zeros", b"\0" * 100_000, "not TOML"),
    ("nothing", "", "materials"),
    ("a key of 3 MB", "a" * 3_000_000 + " = 1", "materials: is missing"),
    ("100 000 unknown keys", many(100_000, lambda n: f"k{n} = 1\n"), "materials: is missing"),
    ("100 000 wrong numbers", HEAD.replace("[500]", "[" + '"",' * 100_000 + "]"), "wavelengths_nm"),
    ("300 000 right numbers", HEAD.replace("[500]", "[" + "51," * 300_000 + "]"), "wavelengths_nm"),
    ("100 000 materials", GOOD.replace('"foam"', '"x",' * 100_000), "materials"),
    ("500 000 wrong materials", GOOD.replace('"foam"', "1," * 500_000), "materials"),
    ("a pattern of stars", GOOD.replace("foam", "*a" * 5000 + "!"), "materials"),
    ("9999 patterns", GOOD.replace('"foam"', many(9999, lambda n: f'"*x{n}",')), "materials"),
    ("112 ranges of 99 999", GOOD.replace(AXIS, f"theta_i_deg = [{LONG * 112}]"), "nodes; an axis has at most"),
    ("a range of 1e300 nodes", GOOD.replace(AXIS, "theta_i_deg = [{ start = 0, stop = 80, step = 1e-298 }]"), "nodes"),
    ("a range of wavelengths", HEAD.replace("[500]", "[{ start = 1, stop = 1e9, step = 1e-9 }]") + COARSE, "nodes"),
    ("112 ranges of wavelengths", GOOD.replace("[500]", f"[{LONG * 112}]"), "nodes"),
    ("a range of nan", GOOD.replace(AXIS, "theta_i_deg = [{ start = 0, stop = nan, step = 1 }]"), "theta_i_deg"),
    ("a number of 100 000 digits", HEAD.replace("500", "5" * 100_000), "not TOML: Exceeds the limit"),
    ("an exponent of 100 000 digits", HEAD.replace("500", "1e" + "5" * 100_000), "wavelengths_nm"),
    ("a number of 4000 digits", HEAD.replace("500", "5" * 4000), "wavelengths_nm"),
    ("1e12 values", fine(GOOD, 0.016), "a table has at most"),
    (
        "axes of 80 001 nodes",
        ranged(ranged(ranged(GOOD, "theta_i", 1e-3), "theta_r", 1e-3), "delta_phi", 9),
        "a table has at most",
    ),
    (
        "246 GB",
        ranged(ranged(ranged(GOOD, "theta_i", 0.025), "theta_r", 0.025), "delta_phi", 0.03),
        "disk: the tables take",
    ),
    ("rows of 50 GB", ranged(ranged(GOOD, "theta_r", 0.0016), "delta_phi", 0.0036), "memory: a block of foam"),
    ("99 001 wavelengths", COPPER.replace("[500]", "[{ start = 300, stop = 1290, step = 0.01 }]"), "copper"),
    ("a name of 129 letters", MINE.replace("mine", "m" * 129), "more than the 128 characters that are allowed"),
    ("a name of a megabyte", MINE.replace("mine", "m" * 1_000_000), "more than the 128 characters that are allowed"),
    ("a family of 125 letters", SWEEP.replace("fam", "f" * 125), "more than the 128 characters that are allowed"),
    ("a title that clears the screen", MINE.replace('"T"', '"\\u001b[2J"'), "control character"),
    ("a title that turns the text", MINE.replace('"T"', '"\\u202e"'), "control character"),
    ("a source that rings", MINE.replace('"me"', '"\\u0007"'), "control character"),
    ("a title of nothing", MINE.replace('"T"', '""'), "title"),
    ("a value of 3 MB", MINE.replace("0.5", '"' + "x" * 3_000_000 + '"'), "rho"),
    ("25 000 sources", MINE + "[define.mine.sources]\n" + many(25_000, lambda n: f"k{n} = 1\n"), "sources"),
    ("100 000 assumptions", MINE + "assumed = [" + "1," * 100_000 + "]", "assumed"),
    ("25 000 parameters", MINE.replace("rho = 0.5", many(25_000, lambda n: f"k{n} = 1, ") + "rho = 0.5"), "k0"),
    ("a family of 1e10 members", SWEEP.replace("= 0.1", "= [{ start = 0.1, stop = 0.4, step = 1e-4 }]"), "members"),
    ("20 families of 60 001", GOOD.replace("foam", "fam*") + many(20, lambda n: family(chr(97 + n))), "sweep.fam-"),
    ("a family of 7 lists", SWEEP.replace("rho_d = 0.1", many(7, lambda n: f"p{n} = [1, 2]\n")), "at most 6"),
    ("a family of itself", SWEEP.replace("[sweep.fam]", '[define."fam-001"]\n[sweep.fam]'), "fam-001"),
    ("a table in place of a list", GOOD.replace(AXIS, "theta_i_deg = { a = { b = { c = 1 } } }"), "theta_i_deg"),
    ("a date", GOOD.replace("500", "1979-05-27T07:32:00Z"), "wavelengths_nm"),
    ("a name that climbs", GOOD + DEFINE.replace("mine", '"../../etc"'), "define.../../etc: name"),
    ("a name that is none", GOOD.replace("foam", "\\u0000"), "materials"),
]


# Whatever memory and disk this machine has
PREPARE = """
import shutil
from types import SimpleNamespace
from brdfdb_pipelines import build, build_survey
build_survey.machine_memory = lambda: 24 * 10**9
shutil.disk_usage = lambda _: SimpleNamespace(free=50 * 10**9)
"""


def test_hostile_recipes_are_a_sentence_each(tmp_path: Path) -> None:
    failures = {}
    path, store, told = tmp_path / "recipe.toml", tmp_path / "store", tmp_path / "said.txt"
    with Nursery(PREPARE) as nursery:
        for name, content, said in RECIPES:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
            code, peak = nursery.run("build", path, "--store", store, "--jobs", 1, told=told, cpu_s=MOST_S)
            text = told.read_text(encoding="utf-8", errors="replace")
            sentence = "" if "Traceback" in text else text.strip().rpartition("\n")[2]
            in_bounds = code == 2 and peak <= MOST_BYTES and not store.exists()
            if not (in_bounds and sentence.startswith("brdfdb: ") and said in sentence):
                failures[name] = f"exit {code}, {peak // 10**6} MB, store begun: {store.exists()}, {text[-300:]}"
                shutil.rmtree(store, ignore_errors=True)
    assert not failures, "\n".join(f"{name}: {said}" for name, said in failures.items())


def test_what_is_no_file_is_refused(tmp_path: Path, capsys: Captured) -> None:
    kinds = ("device", "pipe", "directory", "endless")
    device, pipe, directory, endless = paths = [tmp_path / f"{kind}.toml" for kind in kinds]
    device.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    directory.mkdir()
    with endless.open("wb") as file:
        file.truncate(1 << 40)
    store, out = ("--store", tmp_path / "store"), ("--out", tmp_path / "out")
    for path in paths:
        for command in (
            ("build", path, *store),
            ("render", path, *out),
            ("chart", "foam", "--recipe", path, *out, *store),
        ):
            assert refused(capsys, *command).startswith(f"{path}: ")
    assert sorted(tmp_path.iterdir()) == sorted(paths)
