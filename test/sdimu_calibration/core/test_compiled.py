"""Compiled functions are compiled anew when anything that is compiled into them changes."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import sdimu_calibration.core

CORE = Path(sdimu_calibration.core.__file__).parent
PACKAGE = "sdimu_calibration.core"


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

print(triangle(10), sum(triangle.stats.cache_hits.values()))
"""


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_damaged_cache_is_compiled_anew(tmp_path, kind):
    script = tmp_path / "loop.py"
    script.write_text(LOOP)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}

    def run():
        done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    assert run() == ["45", "0"]
    assert run() == ["45", "1"]
    (file,) = (tmp_path / "cache").rglob(f"*.{kind}")
    content = bytearray(file.read_bytes())
    for place in range(16, len(content), 64):
        content[place] ^= 0xFF
    file.write_bytes(content)
    assert run() == ["45", "0"]
    assert run() == ["45", "1"]


def test_an_edited_kernel_compiles_only_the_kernels_that_use_it(tmp_path):
    for name, source in {
        "used.py": "from sdimu_calibration.core.compiled import compiled\n\n@compiled\ndef one(x):\n    return x + 1\n",
        "using.py": "from sdimu_calibration.core.compiled import compiled\nfrom sdimu_kernels.used import one\n\n"
        "@compiled\ndef two(x):\n    return 2 * one(x)\n",
        "apart.py": "from sdimu_calibration.core.compiled import compiled\n\n@compiled\n"
        "def three(x):\n    return 3 * x\n",
        "__init__.py": "",
    }.items():
        (tmp_path / "sdimu_kernels").mkdir(exist_ok=True)
        (tmp_path / "sdimu_kernels" / name).write_text(source)
    call = (
        "from sdimu_kernels.using import two; from sdimu_kernels.apart import three; print(two(1), three(1), "
        "sum(two.stats.cache_hits.values()), sum(three.stats.cache_hits.values()))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    environment.pop("NUMBA_CACHE_DIR", None)

    def run():
        done = subprocess.run([sys.executable, "-c", call], env=environment, capture_output=True, text=True, check=True)
        return done.stdout.split()

    assert run() == ["4", "3", "0", "0"]
    assert run() == ["4", "3", "1", "1"]
    edited = tmp_path / "sdimu_kernels" / "used.py"
    edited.write_text(edited.read_text().replace("x + 1", "x + 2"))
    assert run() == ["6", "3", "0", "1"], "the kernel that uses the edited one is compiled anew, the other is not"
