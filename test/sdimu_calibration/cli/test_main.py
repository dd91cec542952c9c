"""The command line says what is wrong in one line, and starts fast."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.cli.calibrate import default_folder


@pytest.fixture
def sdimu(monkeypatch, capsys):
    """Run `sdimu` in this process; return exit status, stdout, stderr."""

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["sdimu", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as ending:
            cli.main()
        captured = capsys.readouterr()
        return int(ending.value.code or 0), captured.out, captured.err

    return run


def assert_one_line(err: str, *words: str) -> None:
    assert err.startswith("sdimu: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    for word in words:
        assert word in err


def test_help_lists_the_verbs_of_all_packages(sdimu):
    status, out, _ = sdimu("--help")
    assert status == 0
    for verb in ("run", "simulate", "calibrate", "effects", "replay", "bag"):
        assert verb in out


@pytest.mark.parametrize("verb", [(), ("calibrate",), ("diagnose",), ("run",), ("replay",)])
def test_help_says_where_the_exit_status_can_be_3(sdimu, verb):
    _, out, _ = sdimu(*verb, "--help")
    assert "not to be trusted" in " ".join(out.split())


def test_the_version_is_that_of_the_package(sdimu):
    assert sdimu("--version") == (0, f"sdimu {version('sdimu_calibration')}\n", "")


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["calibrate", "--help"], ["diagnose", "--help"]])
def test_version_and_help_load_nothing_heavy(arguments):
    # What makes a command line slow is what it imports; this holds on a busy machine too.
    heavy = {"numpy", "numba", "scipy", "plotly", "matplotlib", "rclpy", "dash", "dask", "rosbags", "mcap"}
    code = (
        "import sys\n"
        "from sdimu_calibration.cli import main\n"
        f"sys.argv = {['sdimu', *arguments]!r}\n"
        "try:\n    main.main()\nexcept SystemExit:\n    pass\n"
        f"heavy = {heavy!r} & set(sys.modules)\n"
        "sys.exit(f'loaded {sorted(heavy)}' if heavy else 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "sdimu" in done.stdout


def test_the_package_alone_loads_nothing_heavy():
    code = "import sys, sdimu_calibration\nsys.exit('numpy is loaded' if 'numpy' in sys.modules else 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_wrong_usage_exits_2(sdimu):
    assert sdimu("calibrate")[0] == 2
    assert sdimu("no-such-verb")[0] == 2
    assert sdimu("calibrate", "bag", "--no-such-option")[0] == 2


def test_an_absent_bag_is_one_line_and_exit_1(sdimu, tmp_path):
    status, out, err = sdimu("calibrate", tmp_path / "nowhere")
    assert (status, out) == (1, "")
    assert_one_line(err, "no such file or folder")


def test_unknown_names_of_every_option_are_one_line(sdimu, bag, tmp_path):
    for option in ("--model", "--site", "--imu", "--add"):
        status, _, err = sdimu("calibrate", bag, option, "no_such_thing", "--out", tmp_path / "out")
        assert status == 1
        assert_one_line(err, "no_such_thing")
    assert not (tmp_path / "out").exists()


def test_a_wrong_unit_is_one_line(sdimu, bag, tmp_path):
    (tmp_path / "site.yaml").write_text("format: sdimu-site/1\nlatitude_deg: north\n")
    status, _, err = sdimu("calibrate", bag, "--site", tmp_path / "site.yaml")
    assert status == 1
    assert_one_line(err, "site.yaml", "latitude_deg")


@pytest.mark.parametrize("verb", ["calibrate", "diagnose"])
def test_a_file_in_the_place_of_the_results_is_told_before_any_work(sdimu, tmp_path, verb):
    (tmp_path / "taken").write_text("")
    status, _, err = sdimu(verb, tmp_path / "bag", "--out", tmp_path / "taken")
    assert status == 2
    assert "--out" in err
    assert "is a file" in err


def test_a_file_in_the_way_of_a_folder_is_told_with_what_to_do(sdimu, monkeypatch):
    def taken(*_: object) -> None:
        raise FileExistsError(17, "File exists", "out")

    monkeypatch.setattr(cli, "app", taken)
    status, _, err = sdimu("study", "mount")
    assert status == 1
    assert_one_line(err, "out: a file is in the way", "--out")


def test_limits_without_a_line_are_told_with_what_to_write(sdimu, tmp_path):
    (tmp_path / "goal.yaml").write_text("format: sdimu-goal/1\nname: g\nminutes: 5\nlimits:\n")
    status, _, err = sdimu("run", "--adaptive", tmp_path / "goal.yaml", "--out", tmp_path / "run")
    assert status == 1
    assert_one_line(err, "goal.yaml", "limits", "name: value", "nothing")


def test_an_error_of_the_system_names_the_file(sdimu, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "out/result.json")

    monkeypatch.setattr(cli, "app", full)
    status, _, err = sdimu()
    assert status == 1
    assert_one_line(err, "out/result.json", "No space left")


def test_a_lack_of_memory_says_what_to_do(sdimu, monkeypatch):
    def full(*_: object) -> None:
        raise MemoryError("Unable to allocate 63.3 GiB")

    monkeypatch.setattr(cli, "app", full)
    status, _, err = sdimu()
    assert status == 1
    assert_one_line(err, "sdimu bag cut")


def test_an_interrupt_exits_130(sdimu, monkeypatch):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "app", interrupted)
    assert sdimu()[0] == 130


def test_a_package_that_does_not_load_harms_only_its_own_verbs(sdimu, monkeypatch):
    monkeypatch.setitem(cli._VERBS, "broken", "no_such_package.cli:verb")
    assert sdimu("--help")[0] == 0
    status, _, err = sdimu("broken")
    assert status == 1
    assert_one_line(err, "no_such_package")


def test_effects_shows_every_registered_effect_and_each_in_full(sdimu):
    from sdimu_calibration.core.effects import registry

    status, out, _ = sdimu("effects")
    assert status == 0
    for name in registry.names():
        assert name in out
        status, page, _ = sdimu("effects", name)
        assert status == 0
        assert registry.get(name).equation in page
    assert_one_line(sdimu("effects", "phlogiston")[2], "phlogiston")


def test_bag_info_counts_and_bag_recover_mends(sdimu, bag, small_test):
    status, out, _ = sdimu("bag", "info", bag)
    assert status == 0
    assert str(len(small_test.ns)) in out
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-50])
    assert "sdimu bag recover" in sdimu("bag", "info", bag)[1]
    status, out, _ = sdimu("bag", "recover", bag)
    assert status == 0
    assert f"/imu/data_raw {len(small_test.ns)}" in out
    assert "cut" not in sdimu("bag", "info", bag)[1]


def test_results_of_a_bag_go_beside_it(tmp_path):
    (tmp_path / "x.mcap").touch()
    (tmp_path / "v1.2").mkdir()
    assert default_folder(tmp_path / "x.mcap") == tmp_path / "x_calibration"
    assert default_folder(tmp_path / "v1.2") == tmp_path / "v1.2_calibration"


def test_a_real_recording_leaves_result_and_report(sdimu, recorded, tmp_path: Path):
    status, out, err = sdimu("calibrate", recorded("blind/a"), "--out", tmp_path)
    # What its simulator hid in it, nobody told: the baseline does not fit.
    assert status == 3
    assert_one_line(err, "not to be trusted", "does not fit", "run: sdimu diagnose")
    assert "gyro_scale_x" in out
    content = json.loads((tmp_path / "result.json").read_text())
    assert len(content["coefficients"]) == 30
    assert (tmp_path / "report.html").stat().st_size < 6e6


def test_an_estimate_that_is_not_to_be_trusted_ends_with_3_and_says_why(sdimu, tmp_path):
    plan = tmp_path / "two.yaml"
    plan.write_text(
        "format: sdimu-plan/1\nname: two\ndwell: 30 s\nrate: 9 deg/s\nacceleration: 20 deg/s^2\n"
        "turns:\n  - {axis: Y, angle: 90 deg}\n"
    )
    bag = tmp_path / "bag"
    assert sdimu("simulate", "--plan", plan, "--rate", 20, "--out", bag)[0] == 0
    status, out, err = sdimu("calibrate", bag, "--out", tmp_path / "out")
    assert status == 3
    assert_one_line(err, "not to be trusted", "2 attitudes only")
    assert "results in" in out
    assert (tmp_path / "out" / "result.json").is_file()
