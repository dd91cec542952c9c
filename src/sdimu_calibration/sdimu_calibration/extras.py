"""What some features need beside the rest, and how to install it: the extras of the package."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from sdimu_calibration.core.data_error import DataError

_EXTRAS = {
    "dash": "workbench",
    "flask": "workbench",
    "werkzeug": "workbench",
    "plotly": "notebook",
    "pandas": "notebook",
    "matplotlib": "pictures",
    "PIL": "pictures",
    "matio": "matlab",
    "h5py": "matlab",
    "dask": "study",
    "distributed": "study",
}
"""Extra that brings a package."""


class ExtraError(DataError):
    """A package that comes with an extra is not installed."""


def lacking(error: ImportError) -> ExtraError | None:
    """Say in one line what to install; None where no extra brings what could not be imported."""
    module = (error.name or "").partition(".")[0]
    return ExtraError(lacking_module(module)) if module in _EXTRAS else None


def lacking_module(module: str) -> str:
    """Say what to install for a module that an extra brings."""
    return f'this needs the package {module}: pip install "sdimu_calibration[{_EXTRAS[module]}]"'


def needed(module: str) -> Any:
    """Import a module of a package that comes with an extra. Raises ExtraError when the package is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise lacking(error) or error from error
