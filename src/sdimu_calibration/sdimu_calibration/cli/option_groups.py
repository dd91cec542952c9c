"""Options in groups: a verb takes frozen dataclasses, and their fields are its options on the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def with_options(verb: Callable[..., None]) -> Callable[..., None]:
    """Show typer the fields of the groups that a verb takes as options of its own; callers name them likewise.

    `verb`: each of its parameters is an argument or option as usual, or of a dataclass whose fields are options.
    """
    kinds = get_type_hints(verb, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in kinds.items() if is_dataclass(kind)}
    shown: list[Parameter] = []
    for one in signature(verb).parameters.values():
        own = one.replace(annotation=kinds[one.name], kind=Parameter.POSITIONAL_OR_KEYWORD)
        shown += _options(groups[one.name]) if one.name in groups else [own]
    shape = Signature(shown)

    @wraps(verb)
    def called(*given: Any, **named: Any) -> None:
        stated = shape.bind(*given, **named).arguments
        made = {
            name: kind(**{one.name: stated.pop(one.name) for one in fields(kind) if one.name in stated})
            for name, kind in groups.items()
        }
        verb(**stated, **made)

    # typer reads both.
    called.__signature__ = shape  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in shown}
    return called


def _options(group: type) -> Iterator[Parameter]:
    """Fields of a group as parameters of a verb."""
    kinds = get_type_hints(group, include_extras=True)
    for one in fields(group):
        usual = Parameter.empty if one.default is MISSING else one.default
        yield Parameter(one.name, Parameter.POSITIONAL_OR_KEYWORD, default=usual, annotation=kinds[one.name])


def words_by_option(stated: Any, group: Any) -> dict[str, list[str]]:
    """Write what is stated of the options in a group as words of a command; nothing for those left as they are.

    `stated`: the group itself, or one with more options. Gives words by option, in the order of the group.
    """
    words: dict[str, list[str]] = {}
    for one in fields(group):
        value, name = getattr(stated, one.name), f"--{one.name.replace('_', '-')}"
        if isinstance(value, bool):
            words[one.name] = [name] if value else []
        elif value not in (None, one.default):
            parts = value if isinstance(value, list) else [value]
            words[one.name] = [word for part in parts for word in (name, str(part))]
    return words


def words_of(stated: Any, group: Any) -> list[str]:
    """Write the same one after the other."""
    return [word for words in words_by_option(stated, group).values() for word in words]
