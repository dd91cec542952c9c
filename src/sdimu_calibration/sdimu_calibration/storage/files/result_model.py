"""Result files as pydantic models: a model writes its file and reads it back, and says which key is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    PlainValidator,
    Strict,
    ValidationError,
    create_model,
)
from pydantic_core import CoreSchema, core_schema

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.json_file import read_json, write_json

_NAN = float("nan")


class ResultModel(BaseModel):
    """Base of models of result files: keys that a file of others has beyond ours are passed over."""

    model_config = ConfigDict(
        frozen=True, arbitrary_types_allowed=True, protected_namespaces=(), populate_by_name=True, defer_build=True
    )

    def plain(self) -> dict[str, Any]:
        """Give what was set as plain data, in the order of the fields."""
        return self.model_dump(by_alias=True, exclude_unset=True, warnings=False)

    def write(self, path: Path) -> None:
        """Write the file, whole or not at all; the folder is made."""
        write_json(path, self.plain())


M = TypeVar("M", bound=ResultModel)


def read_model(path: Path, model: type[M]) -> M:
    """Read a file of the format that its model names."""
    expected = str(model.model_fields["format"].default)
    content = read_json(path, expected)
    with complete(path, expected):
        return model.model_validate(content)


@contextmanager
def complete(path: Path, expected: str) -> Iterator[None]:
    """Raise DataError with file and key where a value of a file of the format `expected` is missing or wrong."""
    try:
        yield
    except ValueError as error:
        raise DataError(f"{path}: not a complete {expected} file ({wrong(error)})") from error


def wrong(error: ValueError) -> str:
    """Say on one line which key is wrong, and why."""
    if not isinstance(error, ValidationError):
        return one_line(str(error))
    first = error.errors(include_url=False, include_input=False)[0]
    key = ".".join(map(str, first["loc"]))
    what = "missing key" if first["type"] == "missing" else first["msg"].removeprefix("Value error, ")
    return one_line(f"{key}: {what}" if key else what)


def _or(default: Any, value: Any) -> Any:
    return default if value is None else value


def _figure(value: Any) -> int | float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("a number is expected")
    try:
        float(value)
    except OverflowError as error:
        raise ValueError("a number is expected that 64 bits can hold") from error
    return value


def _array(dtype: Any, value: Any) -> NDArray[Any]:
    try:
        given = np.array(value)
        with np.errstate(invalid="ignore"):
            found = given.astype(dtype)
    except (TypeError, OverflowError, ValueError) as error:
        raise ValueError(_NO_NUMBERS) from error
    # numpy would take text and truth values for numbers.
    mixed = given.dtype.kind == "O" and any(isinstance(one, str | bool) for one in given.flat)
    truth = given.dtype.kind == "b", found.dtype.kind == "b"
    other = given.dtype.kind in "US" or (given.size and truth[0] != truth[1])
    # A stop that is no whole number, or larger than any.
    cut = found.dtype.kind == "i" and not np.array_equal(found, given)
    if not given.ndim or mixed or other or cut:
        raise ValueError(_NO_NUMBERS)
    return found


_NO_NUMBERS = "a list of numbers is expected, rows of equal length"
Number = Annotated[float, Strict(), BeforeValidator(partial(_or, _NAN))]
"""A number, and no text that looks like one; ``null`` is NaN."""
Figure = Annotated[int | float, PlainValidator(_figure)]
"""A number as the file has it, whole or not."""
Line = Annotated[str, BeforeValidator(lambda value: one_line(str(value)))]
Said = Annotated[str, BeforeValidator(lambda value: one_line(str(value), None))]
"""What is told to people, however long."""
Array = Annotated[Floats, PlainValidator(partial(_array, float))]
"""Numbers, ``null`` for NaN."""


@dataclass(frozen=True)
class Entry:
    """In ``Annotated[KIND, Entry()]``: an object of the file that is a dataclass of the core, field by field.

    Words are read on one line; ``null`` is the default of the field, or NaN; an array that is missing is empty.
    """

    also: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict, hash=False)
    """What is written beside the fields, from the object; passed over when the file is read."""
    seldom: tuple[str, ...] = ()
    """Fields that are written only where they hold something."""

    def __get_pydantic_core_schema__(self, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        """Make the schema of the dataclass that is annotated."""
        hints = get_type_hints(source)
        parts: dict[str, Any] = {each.name: _field(hints[each.name], each.default) for each in fields(source)}
        model = create_model(source.__name__, __base__=ResultModel, **parts)
        return core_schema.no_info_after_validator_function(
            lambda read: source(**{name: getattr(read, name) for name in parts}),
            handler.generate_schema(model),
            serialization=core_schema.plain_serializer_function_ser_schema(self.plain),
        )

    def plain(self, value: Any) -> dict[str, Any]:
        """Give a dataclass as plain data."""
        own = {each.name: getattr(value, each.name) for each in fields(value)}
        own = {name: entry for name, entry in own.items() if name not in self.seldom or entry}
        return own | {key: of(value) for key, of in self.also.items()}


def _field(hint: Any, default: Any) -> tuple[Any, Any]:
    """Type and default of a field of a file, from those of a dataclass."""
    if get_origin(hint) is np.ndarray:
        (dtype,) = get_args(get_args(hint)[1])
        return Annotated[hint, PlainValidator(partial(_array, dtype))], np.zeros(0, dtype)
    if hint is str:
        return Line, ... if default is MISSING else default
    if get_origin(hint) is tuple:
        parts = tuple(part if part is ... else _field(part, MISSING)[0] for part in get_args(hint))
        hint = tuple[parts]  # type: ignore[valid-type]
    empty = default if default is not MISSING else _NAN if hint is float else None
    hint = Annotated[float, Strict()] if hint is float else hint  # type: ignore[assignment]
    return Annotated[hint, BeforeValidator(partial(_or, empty))], ... if default is MISSING else default


def is_semidefinite(matrix: Floats, slack: float) -> bool:
    """Whether a matrix is symmetric and positive semidefinite, but for rounding.

    Parameters
    ----------
    matrix : ndarray, shape (k, k)
        Finite, in any units; its diagonal is not below zero.
    slack : float
        By how much an element may be wrong, as a share of the root of the product of its two diagonal elements (1).
    """
    size = np.sqrt(np.diag(matrix))
    scale = np.divide(1.0, size, out=np.zeros(len(size)), where=size > 0.0)
    shares = scale[:, None] * matrix * scale
    least = float(np.linalg.eigvalsh(shares).min(initial=0.0))
    return bool((np.abs(shares - shares.T) <= slack).all() and least >= -slack * max(1, len(size)))
