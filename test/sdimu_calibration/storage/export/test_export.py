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
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, SetSummary, no_history
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.storage.export import FORMS, export
from sdimu_calibration.storage.export.shared import number
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.result_file import noise_for

BASELINE = (
    "gyro_bias",
    "gyro_scale",
    "gyro_misalignment",
    "gyro_mass_unbalance",
    "accel_bias",
    "accel_scale",
    "accel_misalignment",
)
IMU = ImuSpecification("mems", 1e-4, 1e-3, grade="mems")
ROUNDING = 1e-12
Apply = Callable[[Path, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def result(*effects: str, seed: int = 1) -> Calibration:
    """Draw a result with errors of percents, in the frame of the accelerometers."""
    rng = np.random.default_rng(seed)
    found = [selection.resolve(name) for name in effects]
    parameters = [p for e in found for p in e.parameters]
    values = np.array([e.prior["mems"] for e in found for _ in e.parameters]) * rng.standard_normal(len(parameters))
    pinned = [p.name.startswith("accel_misalignment_") and p.name.endswith(("xy", "xz", "yx")) for p in parameters]
    values[np.array(pinned)] = 0.0
    return Calibration(
        "accelerometer_triad",
        tuple(effects),
        tuple(p.name for p in parameters),
        tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters),
        values,
        np.diag((0.01 * values) ** 2),
        {},
        {},
        (),
        no_history(len(values)),
    )


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


def by_openvins(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read as VioManagerOptions does, correct as the propagation does; OpenCV asks for the first line."""
    first, _, rest = path.read_text().partition("\n")
    assert first == "%YAML:1.0"
    read = yaml.safe_load(rest)["imu0"]
    Tw, Ta, Tg, R_gyro, R_accel = (np.array(read[k]) for k in ("Tw", "Ta", "Tg", "R_IMUtoGYRO", "R_IMUtoACC"))
    assert read["model"] == "kalibr"
    for T in (Tw, Ta):
        assert np.all(np.triu(np.linalg.inv(T), 1) == 0.0), "the lower triangle alone is read"
    for R in (R_gyro, R_accel):
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=ROUNDING)
    force = (f - read["accelerometer_bias"]) @ np.linalg.inv(Ta).T @ R_accel
    return (w - read["gyroscope_bias"] - force @ Tg.T) @ np.linalg.inv(Tw).T @ R_gyro, force


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


def along_the_axes(read: dict[str, float], names: tuple[str, str, str]) -> Apply:
    """Correct as both autopilots do: offset, then scale of the force; offset of the rate."""
    offset, scale, drift = (np.array([read[name.format(axis)] for axis in "XYZ"]) for name in names)
    return lambda _, w, f: (w - drift, (f - offset) * scale)


def by_px4(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read as QGroundControl does: five columns behind tabs, lines that begin with # are words."""
    rows = [line.split("\t") for line in path.read_text().splitlines() if not line.startswith("#")]
    assert all(len(row) == 5 and row[:2] == ["1", "1"] and row[4] == "9" for row in rows)
    read = {row[2]: float(row[3]) for row in rows}
    assert max(map(len, read)) <= 16  # of MAVLink
    return along_the_axes(read, ("CAL_ACC0_{}OFF", "CAL_ACC0_{}SCALE", "CAL_GYRO0_{}OFF"))(path, w, f)


def by_ardupilot(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read as Mission Planner does: name, comma, value; lines that begin with # are words."""
    rows = [line.split(",") for line in path.read_text().splitlines() if not line.startswith("#")]
    read = {name: float(value) for name, value in rows}
    assert max(map(len, read)) <= 16
    return along_the_axes(read, ("INS_ACCOFFS_{}", "INS_ACCSCAL_{}", "INS_GYROFFS_{}"))(path, w, f)


READERS: dict[str, Apply] = {
    "px4": by_px4,
    "ardupilot": by_ardupilot,
    "matrices": by_matrices,
    "yaml": by_yaml,
    "csv": by_csv,
    "kalibr": by_kalibr,
    "openvins": by_openvins,
    "imu_tk": by_imu_tk,
    "c-header": by_c,
}


def kalibr_noise(path: Path) -> tuple[float, ...]:
    """Read as ImuParameters of Kalibr does; white noise, then random walks, accelerometers first, and the rate."""
    read = yaml.safe_load(path.read_text())
    assert read["rostopic"] == "/imu/data"
    names = ("accelerometer_noise_density", "gyroscope_noise_density", "accelerometer_random_walk")
    return (*(read[name] for name in names), read["gyroscope_random_walk"], read["update_rate"])


def gtsam_noise(path: Path) -> tuple[float, ...]:
    """Read as loadKittiData of GTSAM's example does: a line is passed over, twelve numbers stand in the next."""
    numbers = [float(word) for word in path.read_text().splitlines()[1].split()]
    assert len(numbers) == 12
    assert numbers[:6] == [0.0] * 6, "the example wants the IMU to be the body"
    accel, gyro, _, accel_step, gyro_step, dt = numbers[6:]
    return accel, gyro, accel_step / np.sqrt(dt), gyro_step / np.sqrt(dt), 1.0 / dt


NOISE_READERS = {"kalibr-noise": kalibr_noise, "gtsam": gtsam_noise}


@pytest.mark.parametrize("value", [3e-05, 1e16, 1.5e-300, 0.0, -2e-7, 0.1, 1e5])
def test_a_number_is_read_as_the_same_number(value: float) -> None:
    # YAML 1.1 takes 3e-05 for a text.
    assert yaml.safe_load(number(value)) == value
    assert float(number(value)) == value


def test_every_form_is_read_back():
    assert set(READERS) | set(NOISE_READERS) | {"imu"} == set(FORMS)


LEARNED = (
    NoiseTerm("gyro", "flicker", size=to_si(0.02, "deg/h")),
    NoiseTerm("gyro", "markov", tau=100.0, size=to_si(0.5, "deg/h"), alike=("random_walk",)),
    NoiseTerm("accel", "random_walk", size=to_si(30.0, "ug/sqrt(h)")),
)


def test_an_imu_file_has_the_noise_that_the_calibration_learned_and_the_rest_of_its_own(tmp_path: Path) -> None:
    used = replace(load_imu("rlg_navigation"), accel_white_noise=to_si(12.5, "ug/sqrt(Hz)")).noise_alone
    made = replace(result(*BASELINE), noise=LEARNED, origin=Origin(imu="rlg_navigation"), imu_noise=used)
    done = export("imu", tmp_path / "mine.yaml", made, used)
    found, base = load_imu(tmp_path / "mine.yaml"), load_imu("rlg_navigation")
    assert (found.prior, found.grade, found.gyro_white_noise) == (base.prior, base.grade, base.gyro_white_noise)
    # The white noise of a diagnosis holds what was learned, too: beside that it is the one of the file.
    assert found.accel_white_noise == pytest.approx(base.accel_white_noise)
    assert from_si(found.gyro_bias_instability, "deg/h") == pytest.approx(0.02)
    assert from_si(found.accel_random_walk, "ug/sqrt(h)") == pytest.approx(30.0)
    # The 2 ug of the data sheet were held against the same data, and a walk was found in their place.
    assert base.accel_bias_instability > 0.0 == found.accel_bias_instability
    assert sum("Gauss-Markov noise of 100 s" in line for line in done.missing) == 1
    assert "# NOT IN THIS FILE: gyro Gauss-Markov noise of 100 s" in (tmp_path / "mine.yaml").read_text()


@pytest.mark.parametrize("form", ["kalibr", "openvins", "kalibr-noise", "gtsam"])
def test_a_random_walk_that_was_learned_is_in_every_form_that_states_one(tmp_path: Path, form: str) -> None:
    """It was 0, "not known", and what else was learned was left out without a word."""
    made = replace(result(*BASELINE), noise=LEARNED, imu_noise=load_imu("dtg").noise_alone)
    done = export(form, tmp_path / "noise", made, noise_for(made, None)[0], rate_hz=50.0)
    if form in NOISE_READERS:
        accel, gyro = NOISE_READERS[form](tmp_path / "noise")[2:4]
    else:
        imu = yaml.safe_load((tmp_path / "noise").read_text().replace("%YAML:1.0\n", ""))["imu0"]
        accel, gyro = imu["accelerometer_random_walk"], imu["gyroscope_random_walk"]
    assert (from_si(accel, "ug/sqrt(h)"), gyro) == (pytest.approx(30.0), 0.0)
    lost = [line for line in done.missing if "random walks alone" in line]
    assert [line.partition(" (")[0] for line in lost] == [term.words.partition(" (")[0] for term in LEARNED[:2]]
    assert all(f"NOT IN THIS FILE: {line}" in (tmp_path / "noise").read_text() for line in lost)


def test_an_imu_file_keeps_the_stated_noise_of_a_triad_of_which_nothing_was_learned(tmp_path: Path) -> None:
    base = load_imu("rlg_navigation")
    used = replace(base, gyro_white_noise=2.0 * base.gyro_white_noise)
    export("imu", tmp_path / "mine.yaml", replace(result(*BASELINE), noise=LEARNED[2:]), used)
    found = load_imu(tmp_path / "mine.yaml")
    assert found.gyro_bias_instability == pytest.approx(base.gyro_bias_instability)
    assert found.gyro_white_noise == pytest.approx(2.0 * base.gyro_white_noise)
    assert found.accel_bias_instability == 0.0


def test_markov_noise_that_may_be_flicker_is_stated_as_that(tmp_path: Path) -> None:
    tau, size = 100.0, to_si(0.5, "deg/h")
    alike = NoiseTerm("gyro", "markov", tau=tau, size=size, alike=("flicker",))
    made = replace(result(*BASELINE), noise=(LEARNED[0], alike))
    assert len(export("imu", tmp_path / "mine.yaml", made, load_imu("rlg_navigation")).missing) == 1
    # Allan variance of Markov noise by its integral, at its largest; that of flicker is 2 ln 2 / pi B^2 at any time.
    x = np.geomspace(0.1, 10.0, 2001)
    largest = np.sqrt(np.max(size**2 / x * 2.0 * (1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x))))
    expected = np.hypot(LEARNED[0].size, largest / np.sqrt(2.0 * np.log(2.0) / np.pi))
    assert load_imu(tmp_path / "mine.yaml").gyro_bias_instability == pytest.approx(expected, rel=5e-3)


def test_an_imu_file_says_that_it_holds_nothing_of_what_was_learned(tmp_path: Path) -> None:
    drawn = NoiseTerm("accel", "stop", size=to_si(60.0, "ug"))
    for noise, said in (((drawn,), "learned: none that a file states."), ((), "learned: none.")):
        made = replace(result(*BASELINE), noise=noise)
        export("imu", tmp_path / f"{len(noise)}.yaml", made, load_imu("rlg_navigation"))
        assert said in (tmp_path / f"{len(noise)}.yaml").read_text()


def test_an_imu_file_of_a_set_is_refused(tmp_path: Path) -> None:
    made = replace(result(*BASELINE), of_set=SetSummary((), (), (), np.ones(1), ()))
    with pytest.raises(DataError, match=r"each recording of a set has noise of its own.*export that of one"):
        export("imu", tmp_path / "mine.yaml", made, load_imu("rlg_navigation"))


def test_an_imu_file_of_a_result_that_names_none_asks_for_one(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"names no IMU file: state the one that has grade and priors \(--imu\)"):
        export("imu", tmp_path / "mine.yaml", result(*BASELINE), IMU)


@pytest.mark.parametrize("form", NOISE_READERS)
def test_a_form_of_noise_keeps_every_density_and_says_that_coefficients_are_not_in_it(form, tmp_path: Path) -> None:
    imu = replace(IMU, accel_random_walk=3e-5, gyro_random_walk=2e-7)
    done = export(form, tmp_path / FORMS[form].file_name, result(*BASELINE), imu, rate_hz=200.0)
    assert NOISE_READERS[form](done.files[0]) == pytest.approx((1e-3, 1e-4, 3e-5, 2e-7, 200.0), rel=1e-12)
    text = done.files[0].read_text()
    assert "sigma of a mean over T seconds = density / sqrt(T)" in text
    assert "NOT IN THIS FILE: every coefficient" in text
    assert len(done.missing) == 1


@pytest.mark.parametrize("form", READERS)
def test_a_form_applied_to_raw_samples_gives_the_numbers_of_the_core(form: str, tmp_path: Path) -> None:
    made = result(*BASELINE)
    if form == "imu_tk":  # no place for sensitivity to force: the rest must agree
        made.values[np.array(["unbalance" in name for name in made.names])] = 0.0
    if form in {"px4", "ardupilot"}:  # places for these alone
        kept = ("gyro_bias", "accel_bias", "accel_scale")
        made.values[np.array([not name.startswith(kept) for name in made.names])] = 0.0
    path = tmp_path / FORMS[form].file_name
    export(form, path, made, IMU)
    w, f = raw()
    expected = compensate(compensator(made, IMU), np.arange(len(w)) * 0.01, 0.01, w, f)
    rate, force = READERS[form](path, w, f)
    np.testing.assert_allclose(force, expected.f_ib_b, rtol=0.0, atol=ROUNDING * 100.0)
    np.testing.assert_allclose(rate, expected.omega_ib_b, rtol=0.0, atol=ROUNDING * 100.0)


WARM = (
    *(f"{base}_temperature" for base in BASELINE),
    *(f"{base}_temperature_squared" for base in BASELINE),
    *(f"{base}_temperature_cubed" for base in BASELINE),
    "gyro_bias_temperature_rate",
    "accel_scale_temperature_rate",
    "gyro_bias_temperature_rate_linear",
    "gyro_bias_temperature_rate_quadratic",
)
START, NOW, RATE = 22.0, 47.5, 0.02


def warm_result(*more: str) -> Calibration:
    return replace(result(*BASELINE, *WARM, *more), data={"start_temperature_degc": START})


def of_the_core(made: Calibration, w: np.ndarray, f: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    heat = (np.full(len(w), NOW - START), np.full(len(w), rate))
    done = compensate(compensator(made, IMU, has_temperature=True), np.arange(len(w)) * 0.01, 0.01, w, f, heat)
    return done.omega_ib_b, done.f_ib_b


def by_c_at(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Call the function for any temperature in the place of the other one."""
    text = path.read_text()
    call = f"sdimu_compensate_at(a, b, {NOW}, {RATE}, c, d)"
    path.write_text(text + f"#define sdimu_compensate(a, b, c, d) {call}\n")
    return by_c(path, w, f)


def by_yaml_parts(path: Path, w: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    read = yaml.safe_load(path.read_text())
    x = NOW - read["temperature"]["T0_degc"]
    names = ("M_g", "G", "M_a", "b_g", "b_a")
    total = {name: np.array(read[name]) for name in names}
    for part in read["temperature"]["parts"]:
        for name in names:
            total[name] = total[name] + x ** part["power"] * RATE ** part["rate_power"] * np.array(part[name])
    force = np.linalg.solve(total["M_a"], (f - total["b_a"]).T).T
    return np.linalg.solve(total["M_g"], (w - total["b_g"] - force @ total["G"].T).T).T, force


@pytest.mark.parametrize(("form", "reader"), [("c-header", by_c_at), ("yaml", by_yaml_parts)])
@pytest.mark.parametrize("stated", [None, -10.0])
def test_a_form_with_a_polynomial_gives_the_numbers_of_the_core_at_any_temperature(
    form: str, reader: Apply, stated: float | None, tmp_path: Path
) -> None:
    made = warm_result()
    path = tmp_path / FORMS[form].file_name
    done = export(form, path, made, IMU, temperature_degc=stated)
    assert not done.missing
    w, f = raw()
    for found, expected in zip(reader(path, w, f), of_the_core(made, w, f, RATE), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUNDING * 1000.0)


@pytest.mark.parametrize("form", ["matrices", "kalibr"])
def test_a_form_of_matrices_holds_at_the_temperature_that_is_stated_and_says_so_in_one_line(
    form: str, tmp_path: Path
) -> None:
    made = warm_result()
    # The frame is that of the accelerometers at every temperature; rounding would be seen as another frame.
    path = tmp_path / FORMS[form].file_name
    done = export(form, path, made, IMU, temperature_degc=NOW)
    w, f = raw()
    for found, expected in zip(READERS[form](path, w, f), of_the_core(made, w, f, 0.0), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUNDING * 1000.0)
    (line,) = done.missing
    assert f"hold at {NOW} degC" in line
    assert all(name in line for name in WARM)
    assert f"T0 = {NOW} degC" in path.read_text()


def test_coefficients_in_a_table_say_from_which_temperature_they_count(tmp_path: Path) -> None:
    export("csv", tmp_path / "x.csv", warm_result(), IMU)
    assert (tmp_path / "x.csv").read_text().splitlines()[-1] == f"start_temperature_degc,{START},0.0,degC"


@pytest.mark.parametrize("form", sorted(READERS.keys() - {"csv"}))
def test_hysteresis_and_an_unknown_reference_are_left_out_and_said(form: str, tmp_path: Path) -> None:
    done = export(form, tmp_path / "x.txt", warm_result("gyro_bias_temperature_hysteresis"), IMU)
    assert sum("gyro_bias_temperature_hysteresis_" in line for line in done.missing) == 3
    unstated = replace(result(*BASELINE, "gyro_bias_temperature"), data={})
    done = export(form, tmp_path / "y.txt", unstated, IMU)
    assert sum("from which temperature" in line for line in done.missing) == 1
    with pytest.raises(DataError, match="start_temperature_degc"):
        export(form, tmp_path / "y.txt", unstated, IMU, temperature_degc=20.0)


@pytest.mark.parametrize("form", sorted(READERS.keys() - {"csv"}))
def test_what_a_form_cannot_hold_is_said_in_the_file_and_to_the_user(form: str, tmp_path: Path) -> None:
    done = export(form, tmp_path / "x.txt", result(*BASELINE, "accel_quadratic"), IMU)
    for file in done.files:
        text = file.read_text()
        assert text.count("NOT IN THIS FILE: accel_quadratic_") == 3
    assert sum("accel_quadratic" in line for line in done.missing) == 3


@pytest.mark.parametrize("form", ["px4", "ardupilot"])
def test_an_autopilot_is_told_what_its_parameters_cannot_hold(form: str, tmp_path: Path) -> None:
    done = export(form, tmp_path / "x.params", result(*BASELINE), IMU)
    for words in ("scale factors of the gyros", "misalignment of the gyros", "misalignment of the accel", "mass unbal"):
        assert sum(words in line for line in done.missing) == 1, words
        assert words in (tmp_path / "x.params").read_text()
    assert "force = (measured - offset) * scale" in (tmp_path / "x.params").read_text()


def test_imu_tk_says_that_it_has_no_place_for_mass_unbalance(tmp_path: Path) -> None:
    done = export("imu_tk", tmp_path / "imu.calib", result(*BASELINE), IMU)
    assert [file.name for file in done.files] == ["imu-accel.calib", "imu-gyro.calib"]
    assert any("mass unbalance" in line for line in done.missing)
    assert all("NOT IN THIS FILE: G: mass unbalance" in file.read_text() for file in done.files)


@pytest.mark.parametrize("form", ["kalibr", "openvins"])
def test_a_lower_triangular_form_refuses_another_frame_in_one_line(form: str, tmp_path: Path) -> None:
    made = result(*BASELINE)
    made.values[made.names.index("accel_misalignment_xy")] = 1e-3
    with pytest.raises(DataError, match=f"{form}: .*accelerometer_triad"):
        export(form, tmp_path / "x.yaml", replace(made, body_frame="prior"), IMU)


def test_an_unknown_form_names_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="expected one of matrices, kalibr"):
        export("excel", tmp_path / "x", result(*BASELINE), IMU)


@pytest.mark.parametrize("form", ["xsens", "Xsens"])
def test_a_form_that_cannot_be_says_what_to_do_instead_and_where_it_is_explained(form: str, tmp_path: Path) -> None:
    with pytest.raises(DataError) as caught:
        export(form, tmp_path / "x", result(*BASELINE), IMU)
    said = str(caught.value)
    assert "keep the calibration of the factory" in said
    assert said.endswith("(sdimu compensate; doc/using-the-result.md, Forms of export)")
    page = Path(__file__).resolve().parents[4] / "doc" / "using-the-result.md"
    told = page.read_text(encoding="utf-8").partition("\n## Forms of export\n")[2].partition("\n## ")[0]
    assert "no form for Xsens" in told
