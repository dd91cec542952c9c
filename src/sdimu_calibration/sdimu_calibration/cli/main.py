"""Entry of `sdimu`: finds the verbs, and turns errors of data and options into one line.

Verbs are loaded when they are asked for, so that the command starts fast and a package that adds broken
verbs harms no other.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from types import FrameType
from typing import Annotated, Any

import typer
from typer.main import get_command

import sdimu_calibration
from sdimu_calibration.cli.closed_pipe import outliving_readers
from sdimu_calibration.cli.verb_group import VerbGroup
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.units import UnitError
from sdimu_calibration.extras import lacking

ENTRY_POINTS = "sdimu_calibration.verbs"

_PANELS = {
    "Simulate and record": "simulate run import bag set",
    "Calibrate": "calibrate noise replay watch",
    "Diagnose": "diagnose compare effects workbench pictures",
    "Plan": "predict plan",
    "Use": "compensate export datasheet fleet",
    "Study": "monte-carlo hidden-campaign study bench",
}
"""Verbs in the order of work."""
_ELSEWHERE = "simulate run monte-carlo hidden-campaign study bench"
"""Those of other packages, which may not be installed."""
_PLACES = {"import": "import_files:import_files", "bag": "bag:app", "set": "set_files:app", "watch": "watch_verb:watch"}
"""Where a verb is, as ``module:attribute``; the others are a function in a module of their name."""
_PLACED = [name for verbs in _PANELS.values() for name in verbs.split()]
_VERBS = {
    name: f"sdimu_calibration.cli.{_PLACES.get(name, f'{name}:{name}')}"
    for name in _PLACED
    if name not in _ELSEWHERE.split()
}
_WORDS = {"Path": "FILE", "int": "N", "float": "NUMBER"}
"""What stands in help for a type of Python; any other is a text."""
_MORE = "More"
"""Where verbs of other packages stand that have no place above."""


class Verbs(VerbGroup):
    """The verbs of this package and of every package that adds some."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 (the signature is the base class')
        """Names of the verbs in the order of work, then what other packages add."""
        there = {**_VERBS, **_added()}
        return [*(name for name in _PLACED if name in there), *(name for name in there if name not in _PLACED)]

    def get_params(self, ctx: Any) -> Any:
        """Options of `sdimu` itself, and its help."""
        options = super().get_params(ctx)
        _speak_plainly(options)
        return options

    def invoke(self, ctx: Any) -> Any:
        """Run the verb; what is wrong with its options is told in a few lines, however long a word is."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = one_line(error.message)
            raise

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """Load a verb; None when there is none of that name."""
        place = _VERBS.get(cmd_name) or _added().get(cmd_name, "")
        return _loaded(cmd_name, place) if place else None


app = typer.Typer(
    name="sdimu",
    cls=Verbs,
    help="Calibrate a strapdown inertial measurement unit on a rate table at navigation level.",
    epilog="Exit status: 0 done, 1 data or options are unusable, 2 wrong usage, 3 done, but not to be trusted, or "
    "a limit does not pass.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _say_version(asked: bool) -> None:
    if asked:
        typer.echo(f"sdimu {sdimu_calibration.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version and leave.")
    ] = False,
) -> None:
    """Calibrate a strapdown inertial measurement unit on a rate table at navigation level."""


def main() -> None:
    """Run `sdimu`: exit 0 when done, 1 with one line when data or options are unusable, 2 on wrong usage.

    `opened.leave` ends with 3 when all is done and the estimate is not to be trusted, `datasheet` when a limit is
    missed. A reader of the output that closes its pipe changes none of it.
    """
    with outliving_readers():
        _run()


def _run() -> None:
    try:
        with _ending_tidily():
            app()
    except (DataError, UnitError) as error:
        sys.exit(_complain(str(error)))
    except ModuleNotFoundError as error:
        lack = lacking(error)
        if lack is None:
            raise
        sys.exit(_complain(str(lack)))
    except (FileExistsError, NotADirectoryError) as error:
        sys.exit(_complain(f"{error.filename or 'system'}: a file is in the way of a folder; name another with --out"))
    except OSError as error:
        sys.exit(_complain(f"{error.filename or 'system'}: {error.strerror or error}"))
    except MemoryError:
        sys.exit(_complain("not enough memory for this recording; take a part of it with: sdimu bag cut"))
    except KeyboardInterrupt:
        sys.exit(130)


@contextmanager
def _ending_tidily() -> Iterator[None]:
    """Let a request to end (SIGTERM) pass through what takes half-written files away."""

    def end(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _complain(text: str) -> int:
    sys.stderr.write(f"sdimu: {one_line(text)}\n")
    return 1


def _added() -> dict[str, str]:
    """Verbs of other packages, by name, as ``module:attribute``."""
    return {point.name: point.value for point in entry_points(group=ENTRY_POINTS)}


@cache
def _loaded(name: str, place: str) -> Any:
    """Make the command of a verb of ``module:attribute``, once: a command line asks for it twice."""
    module, _, attribute = place.partition(":")
    try:
        return _command(name, getattr(import_module(module), attribute))
    except ImportError as error:
        return _command(name, _unavailable(name, error))


def _unavailable(name: str, error: ImportError) -> Callable[[], None]:
    """Stand in for a verb whose package does not load, so that all others still work."""
    lack = lacking(error)
    reason = str(lack or error)

    def verb() -> None:
        raise lack or DataError(f"{name}: its package does not load ({reason}); install it again")

    verb.__doc__ = f"(not available: {reason})"
    return verb


def _speak_plainly(options: Iterable[Any]) -> None:
    """Name what an option takes by a word, and its range behind it: typer writes ``<list[Path]>`` and ``[x>=1]``."""
    for option in options:
        # A second look at the same command finds its range in its word already.
        if getattr(option, "is_flag", False):
            option.metavar = option.metavar or ""
        elif option.param_type_name == "argument":
            option.display_type_rich = _nothing
        elif option._get_number_range_help_str is not _nothing:
            option.metavar = _with_range(option.metavar or _word(option.type_descriptor), option.min, option.max)
        option._get_number_range_help_str = _nothing


def _nothing(**_: Any) -> None:
    """Say nothing, in the place of a method of typer."""


def _word(kind: Any) -> str:
    """Word for what an option takes, as `typer` describes its type."""
    if kind.is_path:
        return "FILE" if kind.parameter_info.file_okay else "FOLDER"
    label = str(kind.annotation)
    return next((word for name, word in _WORDS.items() if name in label), "TEXT")


def _with_range(word: str, least: float | None, most: float | None) -> str:
    """Write a word with its range: ``N >= 1``, ``0 <= N <= 232``."""
    if least is None:
        return word if most is None else f"{word} <= {most:g}"
    return f"{word} >= {least:g}" if most is None else f"{least:g} <= {word} <= {most:g}"


def _speaking_plainly(command: Any) -> None:
    """Keep words of a programming language out of the help of a verb and of those inside it."""
    _speak_plainly((*command.params, command.get_help_option(typer.Context(command))))
    for inner in getattr(command, "commands", {}).values():
        _speaking_plainly(inner)


def _command(name: str, verb: Any) -> Any:
    """Make a click command of a function or of a typer application."""
    if not isinstance(verb, typer.Typer):
        single = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        single.command(name=name)(verb)
        verb = single
    command: Any = get_command(verb)
    command.name = name
    _speaking_plainly(command)
    command.rich_help_panel = next((panel for panel, verbs in _PANELS.items() if name in verbs.split()), _MORE)
    return command


if __name__ == "__main__":
    main()
