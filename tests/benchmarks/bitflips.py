"""Flip bits in every file of a store: nothing may be wrong in silence, and what is damaged is named and repaired.

python tests/benchmarks/bitflips.py --count 300
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb_pipelines import cli
from tests.benchmarks.recording import Column, Run
from tests.pipelines.recipes import anisotropic, isotropic, material

# A grey, a spectral and two members of a family, on grids so coarse that the store is built in seconds
THETA = "[0, 40, 80]"
RECIPE = "".join(
    (
        'materials = ["white", "copper", "shade"]\nwavelengths_nm = [450, 550, 650]\n',
        *(isotropic(THETA, "[0, 90, 180]", kind=kind) for kind in ("isotropic", "spectral")),
        anisotropic(),
        material("white", "White", "lambert", "rho = RHO"),
        material("copper", "Copper", "he_torrance", "sigma_0_um = 0.1", "tau_um = 2.0"),
        material("shade", "Shades", "lambert", "rho = [0.2, 0.8]", table="sweep"),
    )
)
LOOKUPS = (
    ("white", "30", "0", "50", "120"),
    ("copper", "30", "0", "50", "120"),
    ("shade-001", "30", "0", "50", "120"),
    ("shade-002", "30", "0", "50", "120"),
    ("shade", "30", "0", "50", "120", "--set", "rho=0.6"),
)
NAMES = ("white", "copper", "shade-001", "shade-002")
QUICK_COUNT = 2
SEED = 20261122  # of files and bits
MEASURED = "Bits flipped one at a time in the files of a store: every command must refuse or answer as before."
_ROUNDS = 6  # of verify and the repairs that it names


class Flips(NamedTuple):
    """Counts of a run: flips and repairs by the kind of file, and every fault as a sentence."""

    kinds: Counter[str]
    repaired: Counter[str]
    faults: list[str]


def run(*arguments: object) -> tuple[int, str, str]:
    """Run a command; return its exit code, stdout and stderr. A traceback is an exit code of -1."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        try:
            code = cli.main([str(argument) for argument in arguments])
        except Exception as error:
            return -1, out.getvalue(), f"{type(error).__name__}: {error}"
        except SystemExit as error:
            return int(error.code or 0), out.getvalue(), err.getvalue()
    return code, out.getvalue(), err.getvalue()


def make(folder: Path) -> tuple[Path, Path]:
    """Build a store with two revisions of white, a family and a snapshot; return it and its recipe."""
    root, recipe = folder / "store", folder / "recipe.toml"
    for rho in (0.25, 0.5):
        recipe.write_text(RECIPE.replace("RHO", str(rho)), encoding="utf-8")
        code, _, err = run("build", recipe, "--store", root, "--jobs", 1, "--json")
        assert code == 0, err
    code, _, err = run("snapshot", "paper", "--store", root)
    assert code == 0, err
    return root, recipe


def answers(root: Path) -> dict[str, tuple[int, str, str]]:
    """Everything a reader asks of a store, with what it is told, whether it is an answer or a refusal."""
    asked: list[tuple[str, ...]] = [("list",), ("list", "--snapshot", "paper")]
    asked += [("lookup", *lookup, "--with-error", "--json") for lookup in LOOKUPS]
    asked += [("lookup", *LOOKUPS[0], "--json", "--snapshot", "paper"), ("show", "white"), ("show", "shade")]
    asked += [("history", name) for name in NAMES]
    return {" ".join(arguments): run(*arguments, "--store", root) for arguments in asked}


def kind(path: Path) -> str:
    """Return the kind of a file of a store."""
    name = path.name
    if name.endswith("MANIFEST.json"):
        return "manifest"
    if name in ("HEAD.json", "brdfdb.json", "zarr.json"):
        return name
    return {"families": "family record", "snapshots": "snapshot"}.get(path.parent.name, "chunk")


def repair(root: Path, recipe: Path, said: str) -> None:
    """Run the commands that a sentence of verify names."""
    if "brdfdb build`" in said:
        run("build", recipe, "--store", root, "--jobs", 1, "--json")
    elif "brdfdb snapshot --remove" in said:
        run("snapshot", "--remove", "paper", "--store", root)
        if "gc --damaged" not in said:
            run("snapshot", "paper", "--store", root)
    if "gc --damaged" in said:
        run("gc", "--damaged", "--keep", 9, "--store", root)
    elif "brdfdb gc`" in said:
        run("gc", "--keep", 9, "--store", root)


def flip(
    master: Path, recipe: Path, file: Path, bit: int, told: dict[str, tuple[int, str, str]]
) -> tuple[str, list[str]]:
    """Flip a bit in a copy of a store; return what verify said first, and every fault as a sentence."""
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "store"
        shutil.copytree(master, root)
        data = bytearray((root / file).read_bytes())
        data[bit // 8] ^= 1 << (bit % 8)
        (root / file).write_bytes(data)
        where = f"bit {bit} of {file}"
        for asked, (code, out, err) in answers(root).items():
            if code == -1:
                faults.append(f"{where}: {asked}: traceback: {err}")
            elif code == 0 and out.replace(str(root), str(master)) != told[asked][1]:
                faults.append(f"{where}: {asked}: another answer in silence: {out}")
        first = ""
        for _ in range(_ROUNDS):
            code, _, err = run("verify", "--store", root)
            sentences = [line for line in err.splitlines() if line.startswith("brdfdb: ")]
            if code == -1:
                faults.append(f"{where}: verify: traceback: {err}")
            if code == 0 or not sentences:
                break
            first = first or sentences[0]
            repair(root, recipe, " ".join(sentences))
        if not first:
            faults.append(f"{where}: verify says nothing")
        if code != 0:
            faults.append(f"{where}: not repaired: {err}")
        code, _, err = run("build", recipe, "--store", root, "--jobs", 1, "--json")
        if code != 0:
            faults.append(f"{where}: build: {err}")
        for lookup in LOOKUPS:
            code, out, err = run("lookup", *lookup, "--with-error", "--json", "--store", root)
            before = json.loads(told[" ".join(("lookup", *lookup, "--with-error", "--json"))][1])
            if code != 0 or {**json.loads(out), "revision": ""} != {**before, "revision": ""}:
                faults.append(f"{where}: after the repair {lookup[0]} is {out or err}, not {before}")
    return first, faults


def flips(count: int, seed: int, folder: Path) -> Flips:
    """Flip `count` bits, at least one in every file of a store.

    Parameters
    ----------
    count : int
        Flips, each in a copy of its own; of fewer than there are files, files are drawn at random.
    seed : int
        Of the files and bits.
    folder : Path
        Where the store is built.
    """
    master, recipe = make(folder)
    told = answers(master)
    assert all(code == 0 for code, _, _ in told.values()), told
    assert run("verify", "--store", master)[0] == 0
    draw = random.Random(seed)
    files = sorted(
        path.relative_to(master) for path in master.rglob("*") if path.is_file() and ".staging" not in path.parts
    )
    kinds = {kind(file): file for file in draw.sample(files, len(files))}  # of few flips, one of each kind
    rest = draw.sample(files, len(files))
    chosen = [*kinds.values(), *(file for file in rest if file not in kinds.values())]
    while len(chosen) < count:
        chosen.append(draw.choice(list(kinds.values()) + files))
    result = Flips(Counter(), Counter(), [])
    for number, file in enumerate(chosen[:count], 1):
        first, faults = flip(master, recipe, file, draw.randrange(8 * (master / file).stat().st_size), told)
        result.kinds[kind(file)] += 1
        result.repaired[kind(file)] += bool(first and not faults)
        result.faults.extend(faults)
        print(f"\r{number} of {count} flips, {len(result.faults)} faults", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Flip bits, and return 1 if one is not named and repaired."""
    bench = Run("bitflips", "accuracy", "Flipped bits in a store", MEASURED)
    parser = bench.parser(__doc__)
    parser.add_argument("--count", type=int, default=300, metavar="N", help="flips (default: %(default)s)")
    options = bench.parse(parser, arguments)
    with tempfile.TemporaryDirectory() as folder:
        result = flips(QUICK_COUNT if options.quick else options.count, SEED, Path(folder))
    table = bench.table("Flips by the kind of file", Column(name="file", width=20), "flips", "named and repaired")
    for name, count in sorted(result.kinds.items()):
        table.add(name, count, result.repaired[name])
    for fault in result.faults:
        print(fault)
    bench.say(f"{result.kinds.total()} flips, {len(result.faults)} faults.")
    bench.end()
    return 1 if result.faults else 0


if __name__ == "__main__":
    sys.exit(main())
