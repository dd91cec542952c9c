"""Compiled functions are compiled anew when anything that is compiled into them changes."""

from __future__ import annotations

import ast
import os
import runpy
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numba
import pytest

import sdimu_calibration.core
from sdimu_calibration.core import compiled

CORE = Path(sdimu_calibration.core.__file__).parent
PACKAGE = "sdimu_calibration.core"


CONSTANTS = """
from sdimu_calibration.core.compiled import compiled


@compiled
def times(x, count):
    return x * count


@compiled
def both(x):
    return times(x, 3) + times(x, count=5)
"""


def compiled_files():
    return [f for f in sorted(CORE.rglob("*.py")) if "@compiled" in f.read_text(encoding="utf-8")]


def names_of_compiled_functions(tree):
    """Names that the compiled functions of a module use."""
    used = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any(
            isinstance(d, ast.Name) and d.id == "compiled" for d in node.decorator_list
        ):
            used |= {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    return used


def imported_from_core(tree):
    """Name to the file of the core that it is imported from; None for a whole module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(PACKAGE):
            place = CORE.joinpath(*node.module.split(".")[2:])
            for alias in node.names:
                module = place / f"{alias.name}.py"
                file = module if module.is_file() else place.with_suffix(".py")
                yield alias.asname or alias.name, file


def test_whatever_compiled_functions_take_from_the_core_is_part_of_the_key_of_their_cache():
    files = compiled_files()
    assert len(files) > 5
    for file in files:
        tree = ast.parse(file.read_text(encoding="utf-8"))
        used = names_of_compiled_functions(tree)
        for name, origin in imported_from_core(tree):
            # Names of array types stand in annotations only, which are not compiled.
            if name in used and origin.name != "arrays.py":
                assert origin in files, f"{file.name} compiles {name} of {origin.name} into its functions"


LOOP = """
from sdimu_calibration.core.compiled import compiled

@compiled
def triangle(n):
    total = 0
    for k in range(n):
        total += k
    return total

TOLD = triangle(10), sum(triangle.stats.cache_hits.values())
if __name__ == "__main__":
    print(*TOLD)
"""
KERNEL = """
from sdimu_calibration.core.compiled import compiled
{imported}

@compiled
def {name}(x):
    return {value}
"""


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_damaged_cache_is_compiled_anew(tmp_path, monkeypatch, kind):
    script = tmp_path / "loop.py"
    script.write_text(LOOP)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))

    def run():
        return runpy.run_path(str(script))["TOLD"]

    assert run() == (45, 0)
    assert run() == (45, 1)
    (file,) = (tmp_path / "cache").rglob(f"*.{kind}")
    content = bytearray(file.read_bytes())
    for place in range(16, len(content), 64):
        content[place] ^= 0xFF
    file.write_bytes(content)
    assert run() == (45, 0)
    assert run() == (45, 1)


def test_processes_that_start_together_compile_a_function_once(tmp_path):
    script = tmp_path / "loop.py"
    script.write_text(LOOP)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, script]
    together = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    told = [one.communicate(timeout=200)[0].split() for one in together]
    assert sorted(told) == [["45", "0"], ["45", "1"]]


def test_an_edited_kernel_compiles_only_the_kernels_that_use_it(tmp_path, monkeypatch):
    package = tmp_path / "sdimu_kernels"
    package.mkdir()
    (package / "__init__.py").touch()
    one, two, three = (package / f"{name}.py" for name in ("used", "using", "apart"))
    one.write_text(KERNEL.format(imported="", name="one", value="x + 1"))
    two.write_text(KERNEL.format(imported="from sdimu_kernels.used import one", name="two", value="2 * one(x)"))
    three.write_text(KERNEL.format(imported="", name="three", value="3 * x"))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", numba.config.CACHE_DIR)

    def run():
        """Import the package as a new process does: results, hits in the cache."""
        for name in [name for name in sys.modules if name.startswith("sdimu_kernels")]:
            del sys.modules[name]
        for kept in (compiled._package, compiled._source, compiled._compiled_into, compiled._digest):
            kept.cache_clear()
        loops = [import_module("sdimu_kernels.using").two, import_module("sdimu_kernels.apart").three]
        return [loop(1) for loop in loops] + [sum(loop.stats.cache_hits.values()) for loop in loops]

    assert run() == [4, 3, 0, 0]
    assert run() == [4, 3, 1, 1]
    one.write_text(one.read_text().replace("x + 1", "x + 1000"))
    assert run() == [2002, 3, 0, 1], "the kernel that uses the edited one is compiled anew, the other is not"


def test_a_function_called_with_several_constants_is_compiled_once(tmp_path, monkeypatch):
    script = tmp_path / "constants.py"
    script.write_text(CONSTANTS)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    names = runpy.run_path(str(script))
    assert names["both"](2.0) == 2.0 * 3 + 2.0 * 5
    assert [[str(kind) for kind in kinds] for kinds in names["times"].overloads] == [["float64", "int64"]]
    how = names["times"].targetoptions
    assert how["nopython"]
    assert how["nogil"], "loops run side by side in threads"
    assert how["error_model"] == "numpy", "a division by zero is no exception"


def test_a_copy_is_compiled_once_most_kernels_are_kept(tmp_path, monkeypatch):
    from sdimu_calibration.core.compiled import still_to_compile

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert still_to_compile()
    (tmp_path / "room").mkdir()
    for number in range(49):
        (tmp_path / "room" / f"loop.{number}.nbc").touch()
    assert still_to_compile()
    (tmp_path / "room" / "loop.49.nbc").touch()
    assert not still_to_compile()
