"""A study: worlds drawn from seeds, what is done in each, its score by the truth, columns that tell what came out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Generic, TypeVar

import numpy as np
from rich.box import SIMPLE
from rich.table import Table as TerminalTable

Row = dict[str, Any]
Rows = Sequence[Mapping[str, Any]]
Key = tuple[str, ...]
Results = Mapping[Key, Rows]
"""Rows of a study by what was varied, such as IMU file and plan."""
Case = TypeVar("Case")
World = TypeVar("World")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Group:
    """Rows that one line of a table sums up; `good` are those of runs that did not fail."""

    key: Key
    rows: Rows

    @property
    def good(self) -> Rows:
        """Rows without an error."""
        return good(self.rows)

    def count(self, test: Callable[[Mapping[str, Any]], Any]) -> int:
        """How many good rows pass a test."""
        return sum(bool(test(row)) for row in self.good)


Column = tuple[str, Callable[[Group], str]]


@dataclass(frozen=True)
class Study(Generic[Case, World, Found]):
    """One question to the method."""

    name: str
    """Part of the key of its runs."""
    world: Callable[[Case, int], World]
    """``world(case, seed)`` draws and simulates a test; the case is what is varied."""
    run: Callable[[World], Found]
    """``run(world)`` calibrates or diagnoses it, and does not look at what the world knows to be true."""
    score: Callable[[World, Found], Row]
    """``score(world, found)`` holds what was found against the truth: a row, as JSON knows it."""
    columns: Sequence[Column] = ()
    """Heading, and what makes a cell of the rows of a line."""

    def of(self, case: Case) -> Runs[Case, World, Found]:
        """Return the work of a case: one row a seed."""
        return Runs(self.name, case, self.world, self.run, self.score)

    def table(self, results: Results, total: Key = ()) -> Table:
        """Sum results up, one line a key; with `total` a last line of all rows by that name."""
        groups = [Group(key, rows) for key, rows in results.items()]
        if total:
            groups.append(Group(total, [row for rows in results.values() for row in rows]))
        return Table(
            [heading for heading, _ in self.columns], [[cell(one) for _, cell in self.columns] for one in groups]
        )


@dataclass(frozen=True)
class Runs(Generic[Case, World, Found]):
    """The work of one case of a study, for `sdimu_study.campaign.run_campaign`."""

    name: str
    case: Case
    world: Callable[[Case, int], World]
    run: Callable[[World], Found]
    score: Callable[[World, Found], Row]

    def __call__(self, seed: int) -> Row:
        """Run a seed; what a world, a fit or a diagnosis refuses is raised."""
        world = self.world(self.case, seed)
        found = self.run(world)
        # From here on the truth is known; nothing before this line has seen it.
        return self.score(world, found)


@dataclass(frozen=True)
class Table:
    """Headings and lines of cells, for a page or for a terminal."""

    headings: Sequence[str]
    lines: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """Lines of a page, the last one ended."""
        head = "|".join(f" {word} " if word else " " for word in self.headings)
        lines = [f"|{head}|", "|---" * len(self.headings) + "|", *(f"| {' | '.join(line)} |" for line in self.lines)]
        return "\n".join(lines) + "\n"

    def terminal(self, title: str | None = None) -> TerminalTable:
        """Table as rich prints it."""
        table = TerminalTable(*self.headings, title=title, box=SIMPLE)
        for line in self.lines:
            table.add_row(*line)
        return table


def head(name: str, **told: Any) -> str:
    """Give the text above the table of a page, from the folder heads, with what is told put in."""
    return (files(__package__) / "heads" / f"{name}.md").read_text(encoding="utf-8").format(**told)


def good(rows: Rows) -> Rows:
    """Rows of the runs that did not fail."""
    return [row for row in rows if "error" not in row]


def of(part: int, whole: Iterable[Any] | int) -> str:
    """Cell ``part of whole``."""
    return f"{part} of {whole if isinstance(whole, int) else len(list(whole))}"


def rms_z(rows: Rows) -> float:
    """RMS of error over sigma of all coefficients of rows, of their ``z2`` and ``count``; 0 of none."""
    return float(np.sqrt(sum(row["z2"] for row in rows) / max(sum(row["count"] for row in rows), 1)))


def rms_cell(rows: Rows) -> str:
    """Cell of `rms_z`, empty without a coefficient."""
    return f"{rms_z(rows):.2f}" if any(row["count"] for row in rows) else ""


def largest_z(rows: Rows) -> str:
    """Cell of the largest error over sigma."""
    return f"{max(row['largest_z'] for row in rows):.1f}" if rows else ""
