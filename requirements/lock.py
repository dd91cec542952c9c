"""Write the lock files: what each set needs of what is installed here, with the hash of the file every Python gets.

    make lock    # after installing or upgrading something in .venv

The sets are the requirements and extras in the setup.py of the packages; a package stands in the first set that needs
it. The hashes are those that pip reports, as it would install, for each Python on this kind of machine.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

FOLDER = Path(__file__).resolve().parent
USED = ("sdimu-calibration", "rate-table-sim", "sdimu-sim")
OWN = (*USED, "sdimu-study")
SETS = {
    "run": ("what `sdimu` and its nodes need, and setuptools, which installs them from a clone", [*USED, "setuptools"]),
    "extras": (
        "workbench, notebooks, pictures, objects of MATLAB",
        ["sdimu-calibration[workbench,notebook,pictures,matlab]"],
    ),
    "campaigns": ("many runs at once: monte-carlo, hidden-campaign, study", ["sdimu-study"]),
    "test": ("style, types, tests", ["sdimu-calibration[test]"]),
    "build": ("colcon, as ROS users build", ["sdimu-calibration[build]"]),
    "docs": ("the book: make docs", ["sdimu-calibration[docs]"]),
}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
_ABSENT = re.compile(r"No matching distribution found for ([\w.-]+==\S+)")

Package = dict[str, Any]
"""What pip reports of a package that it would install."""


def closure(wanted: list[str]) -> set[str]:
    """Pins of everything that requirements bring, as installed here, but for the project's own packages."""
    found: set[str] = set()
    waiting, seen = [Requirement(text) for text in wanted], set[tuple[str, ...]]()
    while waiting:
        one = waiting.pop()
        name, extras = canonicalize_name(one.name), one.extras or {""}
        if (name, *sorted(extras)) in seen:
            continue
        seen.add((name, *sorted(extras)))
        try:
            if name not in OWN:
                found.add(f"{name}=={version(name)}")
            more = [Requirement(text) for text in requires(name) or []]
        except PackageNotFoundError:  # for another system or Python
            continue
        waiting += [r for r in more if r.marker is None or any(r.marker.evaluate({"extra": extra}) for extra in extras)]
    return found


def asked(pins: list[str], *options: str) -> list[Package]:
    """Ask pip what it would install.

    Raises
    ------
    RuntimeError
        What pip says.
    """
    with tempfile.TemporaryDirectory() as folder:
        report, names = Path(folder) / "report.json", Path(folder) / "names.txt"
        names.write_text("\n".join(pins), encoding="utf-8")
        command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--no-deps", "--quiet"]
        command += ["--report", str(report), "--target", folder, "-r", str(names), *options]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr)
        found: list[Package] = json.loads(report.read_text(encoding="utf-8"))["install"]
    return found


def wheels_for(python: str, pins: list[str]) -> tuple[list[Package], list[str]]:
    """Files for another Python, and the pins that have none for it."""
    absent: list[str] = []
    while True:
        try:
            left = [pin for pin in pins if pin not in absent]
            # The first patch of it, as distributions have early ones: Debian 12 has 3.11.2.
            return asked(left, "--only-binary=:all:", "--python-version", f"{python}.0"), absent
        except RuntimeError as error:  # noqa: PERF203 (pip names one at a time)
            found = _ABSENT.search(str(error))
            if found is None or found.group(1) not in pins:
                raise
            absent.append(found.group(1))


def pin_of(package: Package) -> str:
    """Name and version."""
    return f"{canonicalize_name(package['metadata']['name'])}=={package['metadata']['version']}"


def main() -> None:
    """Write one file for each set."""
    sets: dict[str, list[str]] = {}
    for name, (_, wanted) in SETS.items():
        sets[name] = sorted(closure(wanted) - {pin for pins in sets.values() for pin in pins})
    everything = [pin for pins in sets.values() for pin in pins]
    files = asked(everything)
    sources = {pin_of(one) for one in files if not one["download_info"]["url"].endswith(".whl")}
    markers = dict.fromkeys(everything, "")
    for python in PYTHONS:
        found, absent = wheels_for(python, [pin for pin in everything if pin not in sources])
        files += found
        if absent and python == PYTHONS[0]:
            raise SystemExit(f"{', '.join(absent)}: no file for Python {python}.0; install an older version into .venv")
        for pin in absent:
            markers[pin] += f' ; python_version != "{python}"'
    hashes: dict[str, set[str]] = {pin: set() for pin in everything}
    for one in files:
        hashes[pin_of(one)].add(f"--hash=sha256:{one['download_info']['archive_info']['hashes']['sha256']}")
    for name, pins in sets.items():
        entries = [" \\\n    ".join([pin + markers[pin], *sorted(hashes[pin])]) for pin in pins]
        text = "\n".join([f"# {SETS[name][0]}. Made by requirements/lock.py.", *entries, ""])
        (FOLDER / f"{name}.lock").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
