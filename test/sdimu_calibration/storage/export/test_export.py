"""Every form, read back by what it says of itself and applied to raw samples, gives the numbers of the core."""

from __future__ import annotations

import csv
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from sdimu_calibration.core.compensation import compensate, compensator, linear_model
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.storage.export import FORMS, export

BASELINE = (
    "gyro_bias", "gyro_scale", "gyro_misalignment", "gyro_mass_unbalance", "accel_bias", "accel_scale",
    "accel_misalignment",
)  # fmt: skip
IMU = ImuSpecification("mems", 1e-4, 1e-3, grade="mems")
ROUNDING = 1e-12
Apply = Callable[[Path, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def result(*effects: str, seed: int = 1) -> Calibration:
    """Draw a result with errors of percents, in the frame of the accelerometers."""
    rng = np.random.default_rng(seed)
    found = [selection.resolve(name) for name in effects]
    parameters = [p for e in found for p in e.parameters]
    values = np.array([e.prior["mems"] for e in found for _ in e.parameters]) * rng.standard_normal(len(parameters))
    pinned = [p.name.removeprefix("accel_misalignment_") in {"xy", "xz", "yx"} for p in parameters]
    values[np.array(pinned)] = 0.0
    return Calibration(
        "accelerometer_triad", tuple(effects), tuple(p.name for p in parameters), tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters), values, np.diag((0.01 * values) ** 2), {}, {}, (),
        no_history(len(values)),
    )  # fmt: skip


def raw(n: int = 50) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return rng.standard_normal((n, 3)), 10.0 * rng.standard_normal((n, 3))


def by_matrices(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rows = np.loadtxt(path)
    M_g, G, M_a, b_g, b_a = rows[0:3], rows[3:6], rows[6:9], rows[9], rows[10]
    force = np.linalg.solve(M_a, (f - b_a).T).T
    return np.linalg.solve(M_g, (w - b_g - force @ G.T).T).T, force


def by_yaml(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    read = {k: np.array(v) for k, v in yaml.safe_load(path.read_text()).items() if k[:2] in {"M_", "G", "b_"}}
    force = np.linalg.solve(read["M_a"], (f - read["b_a"]).T).T
    return np.linalg.solve(read["M_g"], (w - read["b_g"] - force @ read["G"].T).T).T, force


def by_csv(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    with path.open() as stream:
        read = {row["name"]: float(row["value"]) for row in csv.DictReader(stream)}
    linear = linear_model(replace(result(*BASELINE), values=np.array(list(read.values())), names=tuple(read)))
    force = np.linalg.solve(linear.accel, (f - linear.accel_bias).T).T
    return np.linalg.solve(linear.gyro, (w - linear.gyro_bias - force @ linear.by_force.T).T).T, force


def by_kalibr(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Invert the equations of Kalibr's IccScaledMisalignedImu."""
    read = yaml.safe_load(path.read_text())["imu0"]
    assert read["model"] == "scale-misalignment"
    accel, gyro = read["accelerometers"], {k: np.array(v) for k, v in read["gyroscopes"].items()}
    C = gyro["C_gyro_i"]
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(C) > 0.0
    for M in (np.array(accel["M"]), gyro["M"]):
        assert np.all(np.triu(M, 1) == 0.0), "Kalibr's matrices are lower triangular"
    force = np.linalg.solve(accel["M"], (f - np.array(accel["bias"])).T).T
    seen = np.linalg.solve(gyro["M"], (w - gyro["bias"] - force @ C.T @ gyro["A"].T).T).T
    return seen @ C, force


def by_imu_tk(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read as CalibratedTriad::load does: the first 21 numbers; apply as unbiasNormalize does."""
    out = []
    for triad, v in (("gyro", w), ("accel", f)):
        text = path.with_name(f"{path.stem}-{triad}{path.suffix}").read_text()
        first = [float(word) for word in text.split()[:21]]
        T, K, B = np.reshape(first[:9], (3, 3)), np.reshape(first[9:18], (3, 3)), np.array(first[18:])
        assert np.count_nonzero(K - np.diag(np.diag(K))) == 0
        np.testing.assert_allclose(np.diag(T), 1.0, atol=ROUNDING)
        out.append((v - B) @ (T @ K).T)
    return out[0], out[1]


def by_c(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("no gcc here")
    main = path.with_name("main.c")
    main.write_text(
        f'#include <stdio.h>\n#include "{path.name}"\n'
        "int main(void) { double a[3], b[3], c[3], d[3];\n"
        'while (scanf("%lf %lf %lf %lf %lf %lf", a, a+1, a+2, b, b+1, b+2) == 6) { sdimu_compensate(a, b, c, d);\n'
        'printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", c[0], c[1], c[2], d[0], d[1], d[2]); } return 0; }\n'
    )
    program = path.with_name("main")
    options = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run([gcc, *options, str(main), "-o", str(program)], check=True)
    given = "\n".join(" ".join(repr(float(v)) for v in row) for row in np.hstack([w, f]))
    done = subprocess.run([str(program)], input=given, capture_output=True, text=True, check=True)
    out = np.array([[float(v) for v in line.split()] for line in done.stdout.splitlines()])
    return out[:, :3], out[:, 3:]


READERS: dict[str, Apply] = {
    "matrices": by_matrices, "yaml": by_yaml, "csv": by_csv, "kalibr": by_kalibr, "imu_tk": by_imu_tk, "c-header": by_c
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_a_form_applied_to_raw_samples_gives_the_numbers_of_the_core(form: str, tmp_path: Path) -> None:
    made = result(*BASELINE)
    if form == "imu_tk":  # no place for sensitivity to force: the rest must agree
        made.values[np.array(["unbalance" in name for name in made.names])] = 0.0
    path = tmp_path / FORMS[form].file_name
    export(form, path, made, IMU)
    w, f = raw()
    expected = compensate(compensator(made, IMU), np.arange(len(w)) * 0.01, 0.01, w, f)
    rate, force = READERS[form](path, w, f)
    np.testing.assert_allclose(force, expected.f_ib_b, rtol=0.0, atol=ROUNDING * 100.0)
    np.testing.assert_allclose(rate, expected.omega_ib_b, rtol=0.0, atol=ROUNDING * 100.0)


@pytest.mark.parametrize("form", sorted(FORMS.keys() - {"csv"}))
def test_what_a_form_cannot_hold_is_said_in_the_file_and_to_the_user(form: str, tmp_path: Path) -> None:
    done = export(form, tmp_path / "x.txt", result(*BASELINE, "accel_quadratic"), IMU)
    for file in done.files:
        text = file.read_text()
        assert text.count("NOT IN THIS FILE: accel_quadratic_") == 3
    assert sum("accel_quadratic" in line for line in done.missing) == 3


def test_imu_tk_says_that_it_has_no_place_for_mass_unbalance(tmp_path: Path) -> None:
    done = export("imu_tk", tmp_path / "imu.calib", result(*BASELINE), IMU)
    assert [file.name for file in done.files] == ["imu-accel.calib", "imu-gyro.calib"]
    assert any("mass unbalance" in line for line in done.missing)
    assert all("NOT IN THIS FILE: G: mass unbalance" in file.read_text() for file in done.files)


def test_kalibr_refuses_another_frame_in_one_line(tmp_path: Path) -> None:
    made = result(*BASELINE)
    made.values[made.names.index("accel_misalignment_xy")] = 1e-3
    with pytest.raises(DataError, match="accelerometer_triad"):
        export("kalibr", tmp_path / "x.yaml", replace(made, body_frame="prior"), IMU)


def test_an_unknown_form_names_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="expected one of matrices, kalibr"):
        export("excel", tmp_path / "x", result(*BASELINE), IMU)
