"""A running test in the terminal: stop, phase, time left, sigmas that fall, light of the innovations, diagnosis.

In a terminal a picture that changes in place; elsewhere, in a file or a pipe, one plain line a stop.
"""

from __future__ import annotations

from collections.abc import Collection
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.live_seen import (
    Estimated,
    Outline,
    Progress,
    in_the_model,
    left_words,
    place_words,
    time_words,
)
from sdimu_calibration.report.live_text import SeenDiagnosis
from sdimu_calibration.report.progress_text import Falling, falling, light, short, sigma_words

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text


class Watch:
    """Shows a running test; a context manager. `awaited`: coefficients that it was asked to add."""

    def __init__(self, console: Console, test: Outline, awaited: Collection[str] = ()) -> None:
        from rich.live import Live

        self._console, self._test = console, test
        self._estimated = Estimated(awaited)
        self._live = Live(console=console, transient=True, auto_refresh=False) if console.is_terminal else None
        self._reported = -1
        self._diagnosed = SeenDiagnosis()

    def __enter__(self) -> Watch:
        if self._live:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live:
            self._live.stop()

    def show(self, seen: Progress, streaming: bool, wall_s: float) -> None:
        """Show where the test is.

        `streaming`: samples still come; False while the whole test is calibrated once more. `wall_s`: time since the
        first sample.
        """
        if added := self._estimated.added(seen.sigmas):
            self._print(in_the_model(added))
        if self._live:
            self._live.update(self.picture(seen, streaming, wall_s), refresh=True)
            return
        if streaming and seen.sigmas and seen.stop > self._reported:
            self._reported = seen.stop
            self._print(self.line(seen, wall_s))
        if seen.diagnosis is not self._diagnosed:
            # The heat map comes before the rest.
            if seen.diagnosis.line != self._diagnosed.line:
                self._print(seen.diagnosis.line)
            self._diagnosed = seen.diagnosis

    def _print(self, line: str) -> None:
        self._console.print(line, soft_wrap=True, markup=False, highlight=False)

    def line(self, seen: Progress, wall_s: float) -> str:
        """Return the whole of it in one line."""
        parts = [
            place_words(self._test, seen),
            f"{time_words(self._test, seen)}, {left_words(self._test, seen, wall_s)}",
            sigma_words(self._falling(seen)),
            light(seen.nis, seen.verdict),
        ]
        return "; ".join(part for part in parts if part)

    def picture(self, seen: Progress, streaming: bool, wall_s: float) -> RenderableType:
        """Return what the terminal shows."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        fine = seen.verdict == Verdict.CONSISTENT or not seen.nis
        stage = place_words(self._test, seen) if streaming else "last calibration"
        left = left_words(self._test, seen, wall_s) if streaming else "no more to come"
        head = Table.grid(padding=(0, 1))
        head.add_row(
            Text(stage, style="bold"),
            ProgressBar(self._test.duration_s or None, seen.table_s, width=30),
            f"{time_words(self._test, seen)}, {left}",
        )
        sigmas = Table.grid(padding=(0, 2))
        for f in self._falling(seen):
            sigmas.add_row(f.effect, f"{short(f.sigma)} {f.unit}", _gauge(f), f"{short(100.0 * f.share)} %")
        lamp = Text(light(seen.nis, seen.verdict), style="green" if fine else "bold yellow")
        return Group(head, lamp, sigmas, picture(seen.diagnosis, self._test.not_yet))

    def _falling(self, seen: Progress) -> list[Falling]:
        return falling(seen.first, seen.sigmas, self._test.units, self._test.effects)


_DECADES = 4.0
_GAUGE = 20


def _gauge(f: Falling) -> str:
    """Draw what is left of a sigma on a logarithmic scale: full at the start, empty at a ten-thousandth."""
    from math import log10

    left = 1.0 + log10(min(max(f.share, 10.0**-_DECADES), 1.0)) / _DECADES
    full = round(_GAUGE * left)
    return "\N{FULL BLOCK}" * full + "\N{LIGHT SHADE}" * (_GAUGE - full)


_NOTABLE = 3.0
"""Sigmas from which a cell has a number."""
_FULL = 8.0
"""Sigmas from which a cell is bold."""
_MOST_STOPS = 16
_MOST_RANKED = 8


def picture(seen: SeenDiagnosis, not_yet: str) -> RenderableType:
    """Return heat map, ranking and ladder; `not_yet` before there is a diagnosis."""
    from rich.console import Group
    from rich.text import Text

    if seen.stop < 0:
        return Text(not_yet, style="dim")
    style = "dim" if not seen.ladder else "green" if seen.verdict == Verdict.CONSISTENT else "bold yellow"
    head = Text(f"diagnosis of stop {seen.stop}: {seen.sentence}", style=style)
    return Group(head, _heat_map(seen), _tables(seen)) if seen.ladder else head


def _heat_map(seen: SeenDiagnosis) -> RenderableType:
    """Mean innovation in sigmas, channel by stop, the last stops that there is room for."""
    from rich.table import Table

    table = Table.grid(padding=(0, 1))
    first = max(0, len(seen.stops) - _MOST_STOPS)
    for _ in range(1 + len(seen.stops) - first):
        table.add_column(justify="right", min_width=3)
    table.add_row("mean innovation, sigma", *seen.stops[first:], style="dim")
    for channel, row in zip(seen.channels, seen.heat, strict=True):
        table.add_row(channel.replace("_", " "), *(_cell(value) for value in row[first:]))
    return table


def _cell(value: float) -> Text:
    from rich.text import Text

    if not np.isfinite(value):
        return Text("")
    if abs(value) < _NOTABLE:
        return Text("\N{MIDDLE DOT}", style="dim")
    colour = "red" if value > 0.0 else "blue"
    return Text(f"{value:+.0f}", style=f"bold {colour}" if abs(value) >= _FULL else colour)


def _tables(seen: SeenDiagnosis) -> RenderableType:
    from rich.table import Table

    beside = Table.grid(padding=(0, 4))
    beside.add_row(
        _rows(f"candidates, {seen.reaches}", seen.ranking[:_MOST_RANKED]),
        _rows("error with one stop left out", seen.ladder),
    )
    return beside


def _rows(title: str, rows: tuple[tuple[str, str], ...]) -> RenderableType:
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    table.add_row(title, style="dim")
    for row in rows:
        table.add_row(*row)
    return table
