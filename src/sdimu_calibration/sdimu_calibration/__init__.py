"""Navigation-level calibration of a strapdown inertial measurement unit on a rate table.

Frames: i inertial, e Earth, n local level (north, east, down), b body (the axes of the IMU), t table. ``C_nb`` maps a
vector from b to n. Units are SI throughout; customary units (deg/h, ppm, arcmin, deg/h/g, ug) stand where a person
reads. ``omega_ib_b`` is the rate of b against i in b (rad/s), ``f_ib_b`` the specific force in b (m/s^2).

    import sdimu_calibration as sdimu
    test = sdimu.open("bag", site="daejeon", imu="dtg")
    fit = sdimu.calibrate(test)
    found = sdimu.diagnose(fit)
"""

from __future__ import annotations

import os
import sys
import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

from sdimu_calibration import shell_words
from sdimu_calibration.core import wording

# The matrices here are small (tens to hundreds of rows): a second thread costs more than it brings, and on a busy
# machine it waits for its core a hundred times longer than the work takes. Only holds if numpy is not loaded yet.
if "numpy" in sys.modules and "OPENBLAS_NUM_THREADS" not in os.environ:
    warnings.warn(
        "numpy was imported before sdimu_calibration and uses several threads, which makes a diagnosis several times "
        "slower: import sdimu_calibration first, or set OPENBLAS_NUM_THREADS=1",
        RuntimeWarning,
        stacklevel=2,
    )
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

wording.speak(shell_words.option, shell_words.work)

if TYPE_CHECKING:
    from sdimu_calibration.api.functions import (
        calibrate,
        compare,
        diagnose,
        open,  # noqa: A004
        open_set,
        plan,
        predict,
        simulate,
    )

    __version__: str

__all__ = ["calibrate", "compare", "diagnose", "open", "open_set", "plan", "predict", "simulate"]


def __getattr__(name: str) -> Any:
    # The functions load the numerical modules, which the start of the command line does not wait for.
    if name in __all__:
        return getattr(import_module("sdimu_calibration.api.functions"), name)
    # The metadata of what is installed says the version; to read them takes longer than this import.
    if name == "__version__":
        return import_module("importlib.metadata").version(__name__)
    raise AttributeError(f"module 'sdimu_calibration' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "__doc__", "__version__"]
