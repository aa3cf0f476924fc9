"""The interface of a finding of the audit: verdict, sentences, cells, plots and tables. Each finding is a module."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.audit.pairs import ComparedPairs, pairs_of
from brdfdb.figure import Map, Panel
from brdfdb.materials import FunctionRecord, Source
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.statements import MEASURED, stated_metadata
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import metadata_of

STRICT = ConfigDict(frozen=True, extra="forbid")

Level = Literal["good", "calm", "note", "bad"]
Verdict = Literal["passes", "known published excess", "accepted excess", "violates"]
TableVerdict = Verdict | Literal["not judged"]  # nothing says what the values of the table are of
# Words that a finding may use, the worst first. Tables are sorted in this order
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
    "compared",
    "conserves",
    "passes",
    "inside",
]
# Emphasis of each word in page and explorer
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
    "compared": "calm",
    "conserves": "good",
    "passes": "good",
    "inside": "good",
}
RANKS: dict[Word, int] = {word: rank for rank, word in enumerate(LEVELS)}
# Words that decide the verdict on a table, the worst first. All other words let it pass
DECISIVE: tuple[Verdict, ...] = ("violates", "accepted excess", "known published excess")
LAST = 1e300  # sort key of cells without a number: it sorts after every number


class Cell(NamedTuple):
    """A verdict on one table in the table of all materials: its word, its text, and the number to sort by."""

    word: Word
    text: str
    sort: float


class Sentence(BaseModel):
    """One sentence about a table, with the title of its subject."""

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
    """One finding on one table: the data of the report, and the text and plots of terminal, page and explorer.

    A subclass defines the class attributes, the field `verdict` and the method `judge`. `brdfdb.audit.registry` finds
    it in its module.
    """

    model_config = STRICT

    key: ClassVar[str]  #: name in the report: lower-case letters and underscores
    order: ClassVar[int] = 100  #: position among the findings, which are judged and shown in this order
    title: ClassVar[str]  #: name for people; by default the key in words
    columns: ClassVar[tuple[str, ...]]  #: headings of its cells; by default one, the title
    explanation: ClassVar[str]  #: sentences on how to read it

    verdict: Word

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "key" in vars(cls):
            words = cls.key.replace("_", " ")
            cls.title = vars(cls).get("title", words.capitalize())
            cls.columns = vars(cls).get("columns", (words,))

    @classmethod
    @abstractmethod
    def judge(cls, subject: Subject) -> Finding:
        """Judge a table; return `NotJudged` if the finding needs a source that is not known."""

    @abstractmethod
    def sentences(self) -> list[Sentence]:
        """Return the sentences on the table, the first with the verdict."""

    @abstractmethod
    def cells(self) -> list[Cell]:
        """Return one cell for each column."""

    def problems(self) -> list[str]:
        """Return the sentences that a terminal prints: those whose verdict is not a plain pass."""
        return [sentence.text for sentence in self.sentences() if sentence.word in DECISIVE]

    def figures(self) -> list[Panel | Map]:
        """Return the plots of the finding."""
        return []

    def tables(self) -> list[NumberTable]:
        """Return the numbers behind the verdict."""
        return []

    @classmethod
    def overview(cls, findings: Sequence[Finding]) -> list[str]:  # noqa: ARG003
        """Return sentences on all findings of this kind in a report."""
        return []

    @classmethod
    def sentence(cls, word: Word, text: str, *, title: str = "", quote: str = "", where: str = "") -> Sentence:
        """Return a sentence with the title of the finding, or another title."""
        return Sentence(finding=cls.key, title=title or cls.title, word=word, text=text, quote=quote, where=where)


F = TypeVar("F", bound=Finding)


class NotJudged(Finding):
    """A finding that needs a source which cannot be evaluated, with the reason."""

    verdict: Literal["not judged"] = "not judged"
    reason: str

    @classmethod
    def judge(cls, subject: Subject) -> NotJudged:
        """Return the finding on a table that no finding judges."""
        return subject.not_judged("it takes a source")

    def sentences(self) -> list[Sentence]:
        """Return no sentences: `audit` reports the reason under the title of the finding."""
        return []

    def cells(self) -> list[Cell]:
        """Return no cells: the table shows a dash in each column of the finding."""
        return []


@dataclass(frozen=True, eq=False)
class Subject:
    """A table under audit, with its source: the material or function that gave its values, None if it is not known.

    With `accept_excess` the model may reflect more than it receives. `findings` are those judged so far, in the order
    of the registry.
    """

    table: Table
    source: Source | None
    accept_excess: bool = False
    findings: dict[str, Finding] = field(default_factory=dict)

    @property
    def smooth(self) -> Table:
        """Return the table without its glints, which the findings on interpolation and on errors judge."""
        return self.table.without_glints()

    @cached_property
    def pairs(self) -> ComparedPairs:
        """Return f_r [1/sr] of table and source at the directions that several findings share."""
        return pairs_of(self.smooth, self.source)

    @cached_property
    def restated(self) -> TableMetadata | None:
        """Return what a build would state of the table, None if its source is not known.

        It is measured anew, unless the table states nothing that is measured.
        """
        if self.source is None:
            return None
        layout = self.table.laid_out(self.source)
        values = self.table.values
        if not set(MEASURED) & self.table.attrs.keys():
            return metadata_of(layout)
        return stated_metadata(layout, lambda rows: values[rows])

    @property
    def unrecorded(self) -> bool:
        """Return whether nothing says where the values come from: no source, and no record of data or a function."""
        known = self.table.metadata.measured is not None or isinstance(self.table.source, FunctionRecord)
        return self.source is None and not known

    def not_judged(self, needs: str) -> NotJudged:
        """Return `NotJudged`; `needs` is what the finding needs of the source, in a few words."""
        return NotJudged(reason=f"{needs}; {self.without}")

    @property
    def origin(self) -> str:
        """Return whether the data of a table were measured or simulated."""
        measured = self.table.metadata.measured
        return "measured" if measured is None else measured.origin

    @property
    def without(self) -> str:
        """The reason why a table is audited without a source, or without a model."""
        if self.source is not None:
            return f"the source of this table, {self.source.title}, is a function"
        if self.origin == "simulated":
            return "the table is simulated by rays, which the store does not hold"
        if self.table.metadata.measured is not None:
            return "the table is of measured data, which the store does not hold"
        if isinstance(self.table.source, FunctionRecord):
            return f"the source of this table, {self.table.source.title}, is a function, which the store does not hold"
        return "the table does not say what its source is, or this program does not have its model"
