"""Campaigns without dask say what to install."""

from __future__ import annotations

import importlib
import sys

import pytest

from sdimu_calibration.core.recording import DataError


@pytest.mark.parametrize("lacking", ["dask", "distributed"])
def test_whoever_lacks_the_extra_is_told_so_in_one_line(monkeypatch, lacking):
    monkeypatch.delitem(sys.modules, "sdimu_calibration.storage.cluster", raising=False)
    monkeypatch.setitem(sys.modules, lacking, None)
    with pytest.raises(DataError, match=rf'the package {lacking}: pip install "sdimu_calibration\[study\]"'):
        importlib.import_module("sdimu_calibration.storage.cluster")
