"""Whoever lacks an extra is told in one line what to install; all the rest works without."""

from __future__ import annotations

import gzip
import re
import subprocess
import sys
from importlib.metadata import packages_distributions
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from sdimu_calibration import extras
from sdimu_calibration.core.data_error import DataError

SETUP = Path(__file__).resolve().parents[2] / "src" / "sdimu_calibration" / "setup.py"

WITHOUT = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
"""


def without(absent: set[str], code: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a Python that has no such packages."""
    script = WITHOUT.replace("{absent}", repr(absent)) + code
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)


def asked(extra: str) -> set[str]:
    """Names of the distributions that setup.py lists for an extra."""
    lines = re.search(rf'"{extra}": \[(.*?)\]', SETUP.read_text(encoding="utf-8"), re.DOTALL)
    assert lines, extra
    return {canonicalize_name(Requirement(text).name) for text in re.findall(r'"([^"]+)"', lines.group(1))}


@pytest.mark.parametrize(("module", "extra"), extras._EXTRAS.items())
def test_the_extra_that_is_named_brings_the_package(module, extra):
    owners = {canonicalize_name(name) for name in packages_distributions()[module]}
    # matplotlib brings Pillow, dash brings Flask and Werkzeug.
    more = {"matplotlib": {"pillow"}, "dash": {"flask", "werkzeug"}}
    brought = asked(extra).union(*(more.get(name, ()) for name in asked(extra)))
    assert owners & brought


@pytest.mark.parametrize(
    ("arguments", "absent", "extra"),
    [
        (["workbench", "bag"], {"dash", "flask", "werkzeug", "plotly"}, "workbench"),
        (["pictures", "bag"], {"matplotlib", "PIL"}, "pictures"),
    ],
)
def test_a_verb_that_needs_an_extra_says_so_in_one_line(arguments, absent, extra):
    done = without(absent, f"sys.argv = {['sdimu', *arguments]!r}\nfrom sdimu_calibration.cli.main import main\nmain()")
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("sdimu: this needs the package ")
    assert f'pip install "sdimu_calibration[{extra}]"' in done.stderr


def test_a_figure_in_a_notebook_names_its_extra(monkeypatch):
    from sdimu_calibration.report.drawing import Figure

    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    with pytest.raises(DataError, match=r'plotly: pip install "sdimu_calibration\[notebook\]"'):
        Figure().as_plotly()


def test_a_report_needs_no_library_of_figures():
    done = without(
        {"plotly", "matplotlib", "PIL", "dash"},
        "from sdimu_calibration.report.design.library import library\nassert len(library()) > 1e6",
    )
    assert done.returncode == 0, done.stderr


def test_the_drawing_library_of_reports_is_that_of_the_workbench():
    kept = files("sdimu_calibration.report.design") / "plotly.min.js.gz"
    installed = Path(find_spec("plotly").origin).parent / "package_data" / "plotly.min.js"
    assert gzip.decompress(kept.read_bytes()) == installed.read_bytes()


def test_another_module_that_is_absent_is_no_extra():
    assert extras.lacking(ModuleNotFoundError("No module named 'numpy'", name="numpy")) is None
