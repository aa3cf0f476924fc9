"""Damaged files of ten formats: ``python tests/benchmarks/mutations.py``.

Good files of a made surface are damaged at random: cut, joined, with a wrong count, a header in the middle, blank
lines, other encodings and ends of lines, without a character, or with two lines exchanged. What is read is compared
with the closed form at the directions that it claims. Exits with 1 if a kind of damage that a file shows is read
wrongly without a note. Of a digit or of lines that are exchanged a file may show nothing: their counts are printed.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb import formats
from brdfdb.errors import BrdfdbError, DegreesWarning
from tests.benchmarks.recording import Column, Run
from tests.formats import made_files as made
from tests.formats.a_file import notes_of

MEASURED = "Files of ten formats, damaged at random: how many are read right, are refused, or are read wrongly."
GOOD = {
    "sheet": (made.sheet(), ".csv"),
    "astm": (made.astm(), ".astm"),
    "fred": (made.fred(), ".fred.txt"),
    "pabopto": (made.pabopto(), ".dat"),
    "zemax": (made.zemax(), ".bsdf"),
    "lighttools": (made.lighttools(), ".bsdf"),
    "ssdd": (made.ssdd(), ".ssdd"),
    "openmaterial": (made.openmaterial(), ".xompt"),
    "bird": (made.bird(), ".json"),
    "klems": (made.klems(), ".xml"),
}
DIGITS = 2e-5  # of six decimals that are divided by cosines [1/sr]
USUAL = ("33 rows repeat", "Side:", "Wavelengths are")  # notes on the files before the damage
COUNT = re.compile(r"(NUM_POINTS |Scatter(?:Radial|Azimuth) |AngleOfIncidence |SampleRotation |<nPhis>)(\d+)")

Damage = Callable[[str, random.Random], str]


def cut(text: str, draw: random.Random) -> str:
    return text[: draw.randrange(1, len(text))]


def cut_between(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    return "".join(lines[: draw.randrange(1, len(lines))])


def joined(text: str, draw: random.Random) -> str:
    return text + "\n" * draw.randrange(2) + text


def header_again(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    place = draw.randrange(6, len(lines))
    return "".join([*lines[:place], *lines[: draw.choice([2, 3, 5])], *lines[place:]])


def miscounted(text: str, draw: random.Random) -> str:
    counts = list(COUNT.finditer(text))
    if not counts:
        return cut_between(text, draw)
    count = draw.choice(counts)
    number = max(0, int(count[2]) + draw.choice([-5, -2, -1, 1, 2, 10]))
    return f"{text[: count.start(2)]}{number}{text[count.end(2) :]}"


def blank(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    place = draw.choice([0, draw.randrange(len(lines))])
    return "".join([*lines[:place], "\n" * draw.choice([1, 2]), *lines[place:]])


def digit(text: str, draw: random.Random) -> str:
    place = draw.choice([match.start() for match in re.finditer(r"[\d.,]", text)])
    return text[:place] + text[place + 1 :]


def exchanged(text: str, draw: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    one, other = draw.sample(range(len(lines)), 2)
    lines[one], lines[other] = lines[other], lines[one]
    return "".join(lines)


DAMAGES: dict[str, Damage] = {
    "cut": cut,
    "cut between lines": cut_between,
    "joined": joined,
    "header again": header_again,
    "miscounted": miscounted,
    "blank lines": blank,
    "encoding": lambda text, _: text,
    "digit": digit,
    "lines exchanged": exchanged,
}
UNSEEN = ("digit", "lines exchanged")  # damage that a file may not show
ENCODINGS = ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be")


def outcome(path: Path, count: int) -> str:
    """Return how a file is read: right, noted, refused, rows missing, or wrong."""
    try:
        samples = formats.samples(path)
    except BrdfdbError:
        return "refused"
    turn = samples.phi_r - samples.phi_i
    expected = made.f_r(*(np.degrees(angle) for angle in (samples.theta_i, samples.theta_r, turn)))
    wrong = np.abs(samples.values[:, 0] - expected) > DIGITS
    noted = [note for note in notes_of(samples).splitlines() if not note.startswith(USUAL)]
    if not wrong.any() and len(samples) >= count:
        return "right"
    return "noted" if noted else "wrong" if wrong.any() else "rows missing"


def main(arguments: Sequence[str] | None = None) -> int:
    """Damage, read and judge all files."""
    run = Run("mutations", "accuracy", "Damaged files", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--seed", type=int, help="seed of the draws (default: a new one)")
    parser.add_argument("--rounds", type=int, default=20, help="files of each format and damage (default: 20)")
    options = run.parse(parser, arguments)
    draw = random.Random(options.seed)
    words = ("right", "noted", "refused", "rows missing", "wrong")
    counts: dict[str, Counter[str]] = {damage: Counter() for damage in DAMAGES}
    warnings.simplefilter("ignore", DegreesWarning)  # of numbers without their points
    with tempfile.TemporaryDirectory() as folder:
        for name, (text, suffix) in GOOD.items():
            path = Path(folder) / f"a{suffix}"
            path.write_text(text, encoding="utf-8")
            count = len(formats.samples(path))
            for damage, change in DAMAGES.items():
                for _ in range(2 if options.quick else options.rounds):
                    damaged = change(text, draw)
                    encoding = draw.choice(ENCODINGS) if damage == "encoding" else "utf-8"
                    end = draw.choice(["\n", "\r\n", "\r"]) if damage == "encoding" else "\n"
                    path.write_bytes(damaged.replace("\n", end).encode(encoding))
                    word = outcome(path, count)
                    counts[damage][word] += 1
                    if word == "wrong" and damage not in UNSEEN:
                        print(f"  {name}, {damage}: read wrongly without a note", flush=True)
    shown = run.table("Damaged files", Column(name="damage", width=18), *words)
    for damage, number in counts.items():
        shown.add(damage, *(number[word] for word in words))
    wrong = sum(number["wrong"] for damage, number in counts.items() if damage not in UNSEEN)
    run.say(f"{wrong} files are read wrongly without a note, of damage that a file shows; none is allowed.")
    run.end()
    return 0 if wrong == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
