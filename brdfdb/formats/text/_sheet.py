"""The table of a text: named columns of numbers and words, and the lines of its rows."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._record import note
from brdfdb.formats.text._columns import plain_name
from brdfdb.formats.text._fields import number_of
from brdfdb.formats.text._layout import SHOWN, TextLayout

_LISTED = 12  # values that a sentence names


@dataclass(frozen=True, eq=False)
class TextSheet:
    """Rows of a text with a column for everything that they mean, however the text arranges it."""

    path: Path
    layout: TextLayout
    record: dict[str, Any]  #: what the reader says of the file, the same for all sheets that are made of it
    names: tuple[str, ...]
    described: tuple[str, ...]  #: names with their units in brackets
    numbers: NDArray[np.float64]  #: numbers of the fields, (N, columns); nan where a field is empty or a word
    words: Mapping[int, NDArray[np.object_]]  #: words (N,) of the columns that have some; "" where a number stands
    lines: NDArray[np.int64]  #: numbers of the lines of the rows, (N,)
    #: columns by what they are: as of `roles_of`, "polarisation" and "mueller"
    roles: Mapping[str, Sequence[int]] = field(default_factory=dict)

    def error(self, sentence: str, column: int | None = None, row: int | None = None) -> FileFormatError:
        """Return an error on the line of a row, by default that of the names, and on a column."""
        line = self.layout.line if row is None else self.lines[row]
        name = "" if column is None else f", field {self.described[column]}"
        return FileFormatError(f"{self.path}: line {line}{name}: {sentence}")

    def note(self, sentence: str) -> None:
        """Add a sentence to the notes of the record."""
        note(self.record, sentence)

    @property
    def used(self) -> set[int]:
        """The columns that have a role."""
        return {column for columns in self.roles.values() for column in columns}

    def name(self, role: str) -> str:
        """Return the name of the first column of a role."""
        return self.names[self.roles[role][0]]

    def is_empty(self, column: int) -> bool:
        """Return True if no field of a column has a number or a word."""
        return column not in self.words and bool(np.all(np.isnan(self.numbers[:, column])))

    def labels(self, column: int) -> list[str]:
        """Return the fields of a column as text, one a row."""
        words = self.words.get(column, [""] * len(self.lines))
        numbers = self.numbers[:, column].tolist()
        return [word or ("" if value != value else f"{value:.12g}") for word, value in zip(words, numbers, strict=True)]

    def selected(self, rows: NDArray[np.intp]) -> TextSheet:
        """Return some of the rows, by their numbers, which may repeat."""
        words = {column: of_rows[rows] for column, of_rows in self.words.items()}
        return replace(self, numbers=self.numbers[rows], lines=self.lines[rows], words=words)

    def with_column(self, name: str, fields: Iterable[float | str]) -> TextSheet:
        """Return the rows with one more column, whose name may end in a unit in square brackets."""
        fields = list(fields)
        numbers = np.array([np.nan if isinstance(each, str) else each for each in fields], dtype=np.float64)
        words = np.array([each if isinstance(each, str) else "" for each in fields], dtype=object)
        return replace(
            self,
            names=(*self.names, re.sub(r"\s*\[[^\]]*\]$", "", name)),
            described=(*self.described, name),
            numbers=np.column_stack([self.numbers, numbers]),
            words={**self.words, **({len(self.names): words} if words.any() else {})},
        )

    def stacked(self, columns: Sequence[int], heads: Sequence[float | str], name: str, values: str) -> TextSheet:
        """Return rows of which each has one of some columns, named `values`, and its head in a column `name`."""
        count = len(self.lines)
        others = [column for column in range(len(self.names)) if column not in columns]
        rows = self.selected(np.tile(np.arange(count), len(columns)))
        rows = replace(
            rows,
            names=tuple(self.names[column] for column in others),
            described=tuple(self.described[column] for column in others),
            numbers=rows.numbers[:, others],
            words={others.index(column): words for column, words in rows.words.items() if column in others},
        )
        rows = rows.with_column(name, (head for head in heads for _ in range(count)))
        return rows.with_column(values, self.numbers[:, list(columns)].T.reshape(-1))

    def where(self, conditions: Mapping[str, str | Sequence[str]]) -> TextSheet:
        """Return the rows whose columns, by name or role, have one of the values that are given for them.

        ParameterError names the columns, or the values, that a text has.
        """
        rows = self
        for name, given in conditions.items():
            wanted = [given] if isinstance(given, str) else list(given)
            named = [column for column, known in enumerate(self.names) if plain_name(known) == plain_name(name)]
            exact = [column for column in named if self.names[column] == name]
            column = next(iter((*exact, *named, *self.roles.get(name, ()))), None)
            if column is None:
                text = f"{name!r} is not a column of {self.path}, which has {', '.join(self.names)[:SHOWN]}"
                raise ParameterError("where", text, name, self.names)
            labels = rows.labels(column)
            compared = [_compared(label) for label in labels]
            for value in wanted:
                if _compared(value) not in compared:
                    text = f"no row has {name} = {value}; the values are {listed(labels)}"
                    raise ParameterError("where", text, value, ())
            rows = rows.selected(np.flatnonzero([label in set(map(_compared, wanted)) for label in compared]))
        return rows


def _compared(label: str) -> float | str:
    """Return a text as it is compared: a number, or a word in lower case."""
    number = number_of(label.strip())
    return label.strip().lower() if number is None or number != number else round(number, 9)


def distinct(labels: Iterable[str]) -> list[str]:
    """Return the distinct texts among labels that are not empty, in their order, whatever the case of their letters."""
    texts: dict[float | str, str] = {}
    for label in dict.fromkeys(labels):
        if label.strip():
            texts.setdefault(_compared(label), label.strip())
    return list(texts.values())


def listed(labels: Iterable[str]) -> str:
    """Return the distinct texts among labels, the first of them, as a sentence lists them."""
    values = distinct(labels)
    more = f" and {len(values) - _LISTED} more" if len(values) > _LISTED else ""
    return ", ".join(values[:_LISTED]) + more
