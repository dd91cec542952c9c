"""Every package says its version, from one place, and no import waits for it."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("rate_table_sim", "sdimu_calibration", "sdimu_sim")


def manifest(package):
    return ElementTree.parse(ROOT / "src" / package / "package.xml").findtext("version")


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_says_the_version_that_is_installed(package):
    assert import_module(package).__version__ == version(package) == manifest(package)


def test_the_packages_have_one_version():
    assert len({manifest(package) for package in PACKAGES}) == 1


@pytest.mark.parametrize("package", PACKAGES)
def test_an_unknown_attribute_is_still_an_error(package):
    with pytest.raises(AttributeError, match="no_such_name"):
        import_module(package).no_such_name  # noqa: B018


@pytest.mark.parametrize("package", PACKAGES)
def test_the_import_of_a_package_reads_no_metadata(package):
    code = f"import sys, {package}; sys.exit('importlib.metadata' in sys.modules)"
    # -S: what the virtual environment itself loads at the start is no matter of the package.
    path = [str(ROOT / "src" / name) for name in PACKAGES]
    done = subprocess.run([sys.executable, "-S", "-c", f"import sys; sys.path[:0] = {path}; {code}"], check=False)
    assert done.returncode == 0
