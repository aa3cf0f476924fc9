"""Interface of a finding of the audit, one module each: its verdict, sentences, cells, plots and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.audit.pairs import Pairs, pairs_of
from brdfdb.figure import Map, Panel
from brdfdb.materials import FunctionRecord, Source
from brdfdb.tables.table import Table

STRICT = ConfigDict(frozen=True, extra="forbid")

Level = Literal["good", "calm", "note", "bad"]
Verdict = Literal["passes", "known published excess", "accepted excess", "violates"]
# Every word that a finding may use, the worst first: tables are sorted by it
Word = Literal[
    "violates",
    "accepted excess",
    "known published excess",
    "gains",
    "loses",
    "outside",
    "at the edge",
    "unknown",
    "not judged",
    "conserves",
    "passes",
    "inside",
]
# How loud each word is shown
LEVELS: dict[Word, Level] = {
    "violates": "bad",
    "accepted excess": "note",
    "known published excess": "note",
    "gains": "note",
    "loses": "calm",
    "outside": "note",
    "at the edge": "calm",
    "unknown": "calm",
    "not judged": "calm",
    "conserves": "good",
    "passes": "good",
    "inside": "good",
}
RANKS: dict[Word, int] = {word: rank for rank, word in enumerate(LEVELS)}
# Words that decide on a table, the worst first; all others let it pass
DECISIVE: tuple[Verdict, ...] = ("violates", "accepted excess", "known published excess")
LAST = 1e300  # key that sorts after every number


class Cell(NamedTuple):
    """A verdict on one table in a column of the table of all: word, text beside it, number to sort by."""

    word: Word
    text: str
    sort: float


class Sentence(BaseModel):
    """One sentence about a table, under the title of what it is about."""

    model_config = STRICT

    finding: str = Field(description="key of the finding")
    title: str = Field(description="subject of the sentence")
    word: Word
    text: str
    quote: str = Field(default="", description="words of a paper; empty: none")
    where: str = Field(default="", description="place of the quote")


class NumberTable(NamedTuple):
    """Numbers of a finding on one table, as text in rows."""

    caption: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


class Finding(BaseModel):
    """One finding on one table: the data of the report, and how terminal, page and explorer show it.

    A subclass gives the class attributes and `judge`; `brdfdb.audit.findings.FINDINGS` finds it in its module.
    `verdict` is a field of it.

    Attributes
    ----------
    key : str
        Name in the report, of lower-case letters and underscores.
    order : int
        Place among the findings: they are judged and shown in this order.
    title : str
        Name for people; by default the key in words.
    columns : tuple of str
        Headings of its cells; by default one, the title.
    explanation : str
        Sentences on how to read it.
    """

    model_config = STRICT

    key: ClassVar[str]
    order: ClassVar[int] = 100
    title: ClassVar[str]
    columns: ClassVar[tuple[str, ...]]
    explanation: ClassVar[str]

    verdict: Word

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "key" in vars(cls):
            words = cls.key.replace("_", " ")
            cls.title = vars(cls).get("title", words.capitalize())
            cls.columns = vars(cls).get("columns", (words,))

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Judge a table; return `NotJudged` where it takes a source that is not known."""
        raise NotImplementedError

    def sentences(self) -> list[Sentence]:
        """Return the sentences on the table, the first with the verdict."""
        raise NotImplementedError

    def cells(self) -> list[Cell]:
        """Return one cell a column."""
        raise NotImplementedError

    def problems(self) -> list[str]:
        """Return the sentences that a terminal prints: those on what is no plain pass."""
        return [each.text for each in self.sentences() if each.word in DECISIVE]

    def figures(self) -> list[Panel | Map]:
        """Return the plots of the finding."""
        return []

    def tables(self) -> list[NumberTable]:
        """Return the numbers behind the verdict."""
        return []

    @classmethod
    def overview(cls, found: Sequence[Finding]) -> list[str]:  # noqa: ARG003
        """Return sentences on this finding of all tables of a report."""
        return []

    @classmethod
    def sentence(cls, word: Word, text: str, *, title: str = "", quote: str = "", where: str = "") -> Sentence:
        """Return a sentence under the title of the finding, or another one."""
        return Sentence(finding=cls.key, title=title or cls.title, word=word, text=text, quote=quote, where=where)


F = TypeVar("F", bound=Finding)


class NotJudged(Finding):
    """A finding that takes a source which cannot be evaluated, and the reason."""

    verdict: Literal["not judged"] = "not judged"
    reason: str

    def sentences(self) -> list[Sentence]:
        """Return nothing: `audit` puts the reason under the title of the finding."""
        return []

    def cells(self) -> list[Cell]:
        """Return nothing: there is a dash in each column of the finding."""
        return []


@dataclass(frozen=True, eq=False)
class Subject:
    """A table under audit.

    Attributes
    ----------
    table : Table
        As a store holds it, or in memory.
    source : Source or None
        Material or function that gave the values of the table; None where it is not known, or a function that the
        store knows by name only.
    accept_excess : bool
        Accept that the model reflects more than it receives.
    found : dict
        Findings so far, in the order of the registry.
    """

    table: Table
    source: Source | None
    accept_excess: bool = False
    found: dict[str, Finding] = field(default_factory=dict)

    @cached_property
    def pairs(self) -> Pairs:
        """Return f_r [1/sr] of table and source at the directions that several findings share."""
        return pairs_of(self.table, self.source)

    def not_judged(self, needs: str) -> NotJudged:
        """Return the finding on a table whose source does not allow it; `needs` says in a few words why."""
        return NotJudged(reason=f"{needs}; {self.without}")

    @property
    def without(self) -> str:
        """Say why a table is audited without a source, or without a model."""
        if self.source is not None:
            return f"the source of this table, {self.source.title}, is a function"
        if isinstance(self.table.source, FunctionRecord):
            return f"the source of this table, {self.table.source.title}, is a function, which the store does not hold"
        return "the table does not say what its source is, or this program does not have its model"
