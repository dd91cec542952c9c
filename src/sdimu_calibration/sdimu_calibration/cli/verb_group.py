"""Verbs of one command, and what is said of a word that is none of them."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

from typer.core import TyperGroup

from sdimu_calibration.core.plain_text import listing, one_line

_LIKE = 0.6
"""Share of letters (1) from which a verb looks like what was typed: one letter more, less or other."""
_LONGEST_VERB = 60
"""Number of characters of a verb that is none (1) that a message shows."""
_FEW = 8
"""Number of verbs (1) up to which a message names them all."""


class VerbGroup(TyperGroup):
    """A command that has verbs."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the verb; of one that is none, name those that look like it, else where all are."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            names = self.list_commands(ctx)
            near = get_close_matches(args[0], names, n=3, cutoff=_LIKE)
            all_ = f"choose {listing(names, 'or')}" if len(names) <= _FEW else f"{ctx.command_path} --help lists them"
            hint = f"did you mean {', '.join(near)}?" if near else all_
            ctx.fail(f"no verb '{one_line(args[0], _LONGEST_VERB)}'; {hint}")
        return super().resolve_command(ctx, args)
