"""Does `make test` notice a wrong core? Each mutant changes one place; some test of its folders must fail.

    make mutants                                 # all, one after the other: a quarter of an hour
    .venv/bin/python test/mutants.py kalman.py   # those whose file has this in its name

Run in a clean tree: a mutant is written into the source, and the source put back, however the run ends.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / "src" / "sdimu_calibration" / "sdimu_calibration" / "core"
TESTS = "test/sdimu_calibration/core"
PATIENCE_S = 1800.0
"""Longest time for the tests of one mutant (s): its loops compile first, on a busy machine."""


class Mutant(NamedTuple):
    """One place of the core made wrong.

    Attributes
    ----------
    file : str
        Below the core.
    right, wrong : str
        What stands there, and what is put in its place.
    tests : tuple of str
        Files and folders of which some test must fail.
    """

    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]


MUTANTS = (
    Mutant(
        "filter/kalman.py", "P[i, j] = FPF[i, j] + Q[i, j]\n", "P[i, j] = FPF[i, j] - Q[i, j]\n", (f"{TESTS}/filter",)
    ),
    Mutant(
        "evidence/held_out.py",
        "        A = self.columns.square - W.T @ W + np.diag(self.weight)\n",
        "        A = self.columns.square + np.diag(self.weight)\n",
        (f"{TESTS}/evidence", f"{TESTS}/diagnosis"),
    ),
    Mutant(
        "evidence/noise_kernels.py",
        "np.fill_diagonal(out, start + (end - start) / 3.0)",
        "np.fill_diagonal(out, start + (end - start) / 2.0)",
        (f"{TESTS}/evidence",),
    ),
    Mutant(
        "posterior/models.py",
        "            - 0.5 * (log_det - float(np.log(loading).sum()))",
        "            - 0.5 * (log_det + float(np.log(loading).sum()))",
        (f"{TESTS}/posterior",),
    ),
    Mutant("posterior/prior.py", "np.log(named + 1.0)", "np.log(named + 2.0)", (f"{TESTS}/posterior",)),
    Mutant(
        "posterior/coefficients.py",
        "within + (weight[:, None] * apart).T @ apart",
        "within",
        (f"{TESTS}/posterior", f"{TESTS}/diagnosis"),
    ),
    Mutant("filter/bend.py", "more + 2.0 * np.outer(q, q)", "more + np.outer(q, q)", (f"{TESTS}/filter",)),
    Mutant(
        "filter/pass_setup.py",
        " = setup.sensors.prior_covariance\n",
        " = np.diag(setup.sensors.prior**2)\n",
        (f"{TESTS}/filter",),
    ),
    Mutant("effects/misalignment.py", "[-z, y, z, -x, -y, x]", "[-z, y, z, -x, y, x]", ("test/effects",)),
    Mutant(
        "navigation/track.py",
        "0.5 * (alpha[k, 0] + coning[k, 0])",
        "0.5 * (alpha[k, 0] - coning[k, 0])",
        (f"{TESTS}/navigation", "test/effects"),
    ),
    Mutant(
        "evidence/information.py",
        "        d[known] = 0.0\n        return Information(0.5 * (J + J.T), d)",
        "        return Information(0.5 * (J + J.T), d)",
        (f"{TESTS}/evidence", f"{TESTS}/posterior", f"{TESTS}/diagnosis"),
    ),
    Mutant(
        "joint/combine.py",
        "        var_u = np.sum(inverse**2, axis=2) + np",
        "        var_u = np.sum(inverse**2, axis=2) - np",
        (f"{TESTS}/joint",),
    ),
    Mutant("joint/set_board.py", " Share(J - B.T @ X", " Share(J + B.T @ X", (f"{TESTS}/joint/test_set_board.py",)),
    Mutant(
        "joint/rival_noises.py",
        "    explained -= float(2.0 * d @ point",
        "    explained += float(2.0 * d @ point",
        (f"{TESTS}/joint/test_set_board.py",),
    ),
    Mutant(
        "joint/set_board.py",
        "log_det + float(np.linalg.slogdet(M)[1])",
        "log_det",
        (f"{TESTS}/joint/test_set_board.py",),
    ),
    Mutant("joint/set_board.py", "            d[shared] += d[own]\n", "", (f"{TESTS}/joint/test_set_board.py",)),
    Mutant(
        "evidence/linear.py",
        "        e = fresh.e - self.W[:, places]",
        "        e = fresh.e + self.W[:, places]",
        (f"{TESTS}/evidence/test_linear.py",),
    ),
    Mutant("evidence/linear.py", "weighed.T @ self.e", "W.T @ self.e", (f"{TESTS}/evidence/test_linear.py",)),
    Mutant("posterior/models.py", " & ~prior.own & ", " & ", (f"{TESTS}/posterior/test_models.py",)),
    Mutant(
        "batch/batch.py",
        "    point = LinearisationPoint(coefficients, np.repeat",
        "    point = LinearisationPoint(0.0 * coefficients, np.repeat",
        (f"{TESTS}/batch/test_batch.py",),
    ),
    Mutant("earth.py", "linear * height + 3.0", "linear * height - 3.0", (f"{TESTS}/test_earth.py",)),
)


def killed_by(mutant: Mutant) -> str:
    """Name the test that fails with a mutant; empty where none does."""
    path = CORE / mutant.file
    source = path.read_text(encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "not thorough and not slow and not bench"]
    try:
        path.write_text(source.replace(mutant.right, mutant.wrong), encoding="utf-8")
        done = subprocess.run(
            [*command, *mutant.tests], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    finally:
        path.write_text(source, encoding="utf-8")
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0].partition(" ")[2] if done.returncode == 1 and failed else ""


def main(names: list[str]) -> int:
    """Run the mutants whose file has one of the names in it, or all; the exit status is the number that survive."""
    survived = 0
    for mutant in MUTANTS:
        if names and not any(name in mutant.file for name in names):
            continue
        begun = time.monotonic()
        by = killed_by(mutant)
        survived += not by
        print(f"{mutant.file}: {by or 'SURVIVES'} ({time.monotonic() - begun:.0f} s)", flush=True)  # noqa: T201
    return survived


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
