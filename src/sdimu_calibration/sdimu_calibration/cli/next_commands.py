"""Advice as whole commands: with the recording, the options that were given, and everything spelled out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from sdimu_calibration.cli.console import command, say
from sdimu_calibration.cli.option_groups import words_by_option, words_of
from sdimu_calibration.cli.options import Fitted, Place
from sdimu_calibration.core.advice import Verb
from sdimu_calibration.shell_words import joined
from sdimu_calibration.storage.files.advice_words import EXCLUDE, added, lead, plan_options, sentence

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.advice import Advice

PLAN = "plan.yaml"
"""File beside a diagnosis: the plan as the motion showed it."""
PLAN_SHOWN, PLAN_RUN, PLAN_CHOSEN = "The plan as the motion showed it", "The plan that was run", "The turns chosen for"
"""How the remark begins at the head of a plan that a verb leaves with its results: a new one may replace it."""
TO_LEARN = "To learn what the model misses:"
"""What is said before the command of a diagnosis where the model does not fit."""
NOT_LOOKED_FOR = (
    "Nobody has looked for small effects that the model lacks; one that the fit takes up moves a coefficient by many "
    "of its sigmas. To look:"
)
"""What is said before it where the model fits: a calibration cannot know more without a misfit."""
_FIRST = ("site", "imu", "model", "noise", "estimator")
"""Options that a command names first; the others stand as their groups have them."""


def check_plan_room(folder: Path) -> None:
    """Raise DataError where the plan beside the results would replace a file of the user."""
    from sdimu_calibration.storage.bags.file_room import check_own_file

    check_own_file(folder / PLAN, tuple(f"# {head}" for head in (PLAN_SHOWN, PLAN_RUN, PLAN_CHOSEN)))


@dataclass(frozen=True)
class Asked:
    """What a verb was asked for, so far as the next one has to repeat it."""

    bags: Sequence[Path]
    options: Sequence[str]
    """As words of a command."""
    place: Sequence[str]
    """Site and IMU alone, likewise."""
    folder: Path
    has_plan: bool = True
    """Whether the plan as the motion showed it is in the folder."""

    @classmethod
    def of(cls, bags: Sequence[Path], folder: Path, opening: Place, fitted: Fitted | None = None) -> Asked:
        """Take how a recording was opened, and what was fitted to it."""
        place = words_of(Place(opening.site, opening.imu), Place)
        by_option = words_by_option(opening, type(opening)) | words_by_option(fitted or Fitted(), Fitted)
        order = sorted(by_option, key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST))
        return cls(bags, [word for name in order for word in by_option[name]], place, folder)

    def command(self, verb: str) -> str:
        """Write the command of a verb about the same recording, with the same options."""
        return joined(["sdimu", verb, *map(str, self.bags), *self.options])


def spelled(advice: Advice, asked: Asked) -> str:
    """Write the whole command that an advice means about what was asked; empty where it means none, or lacks the plan.

    What is to be kept becomes a calibration of the recording; a plan is that which was seen, at the same site and with
    the same IMU.
    """
    if advice.verb == Verb.ADD:
        return f"{asked.command('calibrate')} {added(advice)}"
    if advice.verb == Verb.DIAGNOSE:
        return asked.command("diagnose")
    if advice.verb == Verb.LEAVE_OUT:
        return replace(asked, options=_without_times(asked.options, advice.about[0])).command("diagnose")
    if advice.verb == Verb.CUT:
        return _parted(asked, *advice.about)
    if advice.verb == Verb.CONTINUE:
        return joined(["sdimu", "plan", "--after", str(asked.folder)])
    if advice.verb in {Verb.REVERSE_PLAN, Verb.RANK_TURNS}:
        # Where the motion showed no plan, words have to say which one the user states.
        if not asked.has_plan:
            return ""
        return f"sdimu plan {joined(['--plan', str(asked.folder / PLAN), *asked.place])} {plan_options(advice)}"
    return ""


def _without_times(options: Sequence[str], span: str) -> list[str]:
    """Add a span to the times that options leave out."""
    out = list(options)
    if EXCLUDE not in out:
        return [*out, EXCLUDE, span]
    out[out.index(EXCLUDE) + 1] += f",{span}"
    return out


def _parted(asked: Asked, end: str, begin: str) -> str:
    """Write the commands that part the first bag and calibrate both parts; they have stops and times of their own."""
    bag = asked.bags[0]
    parts = [bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_{word}") for word in ("before", "after")]
    cuts = [
        joined(["sdimu", "bag", "cut", str(bag), option, at, "--out", str(part)])
        for option, at, part in (("--to", end, parts[0]), ("--from", begin, parts[1]))
    ]
    together = Asked(parts, asked.options, asked.place, asked.folder).command("calibrate")
    return " && ".join([*cuts, together])


def print_advice(console: Console, advice: Sequence[Advice], asked: Asked) -> None:
    """Print each advice, its command on a line of its own."""
    for one in advice:
        whole = spelled(one, asked)
        say(console, f"advice: {lead(one)}:" if whole else f"advice: {sentence(one)}")
        if whole:
            command(console, whole)
