"""Packages are loaded without what nobody here uses, and numpy is whole afterwards."""

import subprocess
import sys

import numpy as np

from sdimu_calibration.core.lean import lean

LOADED = """
import sys
from sdimu_calibration.core.lean import lean
with lean():
    import numba
    from scipy.linalg import solve_triangular
print(*({"numpy.f2py", "numpy.testing", "coverage"} & set(sys.modules)))
import coverage, numpy.f2py
"""


def test_scipy_and_numba_load_no_compiler_and_no_tools_for_tests():
    told = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, timeout=100, check=True)
    assert told.stdout.split() == []


def test_numpy_is_whole_afterwards():
    before = np.__all__, dir(np)
    with lean():
        assert "f2py" not in {*dir(np)}
    assert (np.__all__, dir(np)) == before
    assert "f2py" in dir(np)
