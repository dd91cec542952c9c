"""What a fit of the workbench is made with: plain data that names, and two fits with the same data are the same fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

_APART_S = 0.01
"""Spans nearer to each other (s) are one: epochs that follow each other."""
Span = tuple[float, float]
Prior = tuple[str, str, str]
"""Coefficient, mean and sigma with their units; a sigma of zero fixes it."""


@dataclass(frozen=True)
class Setting:
    """What is fitted."""

    added: tuple[str, ...] = ()
    """Effects added to the model, in order: what `sdimu calibrate --add` takes, or the text of an effect file."""
    held: tuple[int, ...] = ()
    """Stops left out of the fit, ascending."""
    cut: tuple[Span, ...] = ()
    """Spans of time (s) left out, ascending and apart."""
    priors: tuple[Prior, ...] = ()
    """Coefficients with a prior of their own."""

    def rung(self, count: int) -> Setting:
        """Return the setting with the first effects alone; priors of coefficients that it has not then go, too."""
        kept = self.added[:count]
        gone = list(self.added[count:])
        return replace(self, added=kept, priors=tuple(p for p in self.priors if not _is_of(p[0], gone)))

    @property
    def given(self) -> Setting:
        """The model as given, without effects and priors of a user, fitted to the same measurements."""
        return replace(self, added=(), priors=())

    def without_span(self, begin: float, end: float) -> Setting:
        """Leave a span of time (s) out, too; spans that touch become one."""
        spans: list[Span] = []
        for a, b in sorted((*self.cut, (begin, end))):
            if spans and a <= spans[-1][1] + _APART_S:
                spans[-1] = (spans[-1][0], max(b, spans[-1][1]))
            else:
                spans.append((a, b))
        return replace(self, cut=tuple(spans))

    def with_span(self, begin: float, end: float) -> Setting:
        """Take a span of time (s) in again."""
        spans: list[Span] = []
        for a, b in self.cut:
            spans += [(x, y) for x, y in ((a, min(b, begin)), (max(a, end), b)) if x < y]
        return replace(self, cut=tuple(spans))

    def with_prior(self, name: str, mean: str, sigma: str) -> Setting:
        """Give a coefficient a prior; it replaces the one that it has."""
        others = tuple(p for p in self.priors if p[0] != name)
        return replace(self, priors=tuple(sorted((*others, (name, mean, sigma)))))

    def free(self, name: str) -> Setting:
        """Give a coefficient the prior of the IMU's file again."""
        return replace(self, priors=tuple(p for p in self.priors if p[0] != name))


def _is_of(coefficient: str, effects: list[str]) -> bool:
    """Whether a coefficient is one of added effects: it has their name, or that on their line ``name:``."""
    lines = [line for text in effects for line in text.splitlines()]
    own = [line.partition(":")[2].strip() for line in lines if line.startswith("name:")]
    named = [text.partition("(")[0] for text in effects if "\n" not in text]
    return any(coefficient.startswith(name) for name in (*own, *named))
