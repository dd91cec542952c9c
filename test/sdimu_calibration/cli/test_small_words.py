"""What a user reads in passing: the catalogue in a pipe, help, paragraphs of a narrow window, files of parameters."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yaml

from sdimu_calibration.cli import main as cli
from sdimu_calibration.cli.console import plain, say
from sdimu_calibration.cli.processes import Children
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.noise import TERMS, Terms
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.live_text import size
from sdimu_calibration.report.noise import rows
from sdimu_calibration.storage.files.config import find_config, names_of


@pytest.fixture
def sdimu(monkeypatch, capsys):
    """Run `sdimu` in this process, in a pipe; return stdout."""

    def run(*arguments: str) -> str:
        monkeypatch.setattr("sys.argv", ["sdimu", *arguments])
        monkeypatch.setenv("COLUMNS", "100")
        with pytest.raises(SystemExit):
            cli.main()
        return str(capsys.readouterr().out)

    return run


def test_the_catalogue_in_a_pipe_says_that_a_number_counts_coefficients(sdimu):
    out = sdimu("effects").splitlines()
    assert "  gyro_bias: 3 coefficients in deg/h" in out
    assert out[out.index("  gyro_bias: 3 coefficients in deg/h") + 1].startswith("    dw_i = ")


@pytest.mark.parametrize("verb", [(), ("run",), ("bag", "cut"), ("calibrate",)])
def test_help_names_no_type_beside_an_option_that_takes_no_value(sdimu, verb):
    out = sdimu(*verb, "--help")
    assert "--help" in out
    assert "<bool>" not in out


@pytest.mark.parametrize("verb", [name for name in cli._VERBS if name not in {"bag", "set"}])
def test_help_has_words_and_ranges_in_the_place_of_types(sdimu, verb):
    out = sdimu(verb, "--help")
    assert "--help" in out
    assert not re.search(r"<(list\[|int|float|str|path|file|directory)|x[<>]=", out), out


def test_help_names_what_an_option_takes_and_its_range(sdimu):
    assert re.search(r"--workers +N >= 1 ", sdimu("calibrate", "--help"))
    assert re.search(r"--out +FOLDER ", sdimu("diagnose", "--help"))
    assert re.search(r"--truth +FILE ", sdimu("calibrate", "--help"))


def test_a_line_keeps_the_spaces_that_say_it_belongs_to_the_one_above(capsys):
    say(plain(width=60), "  below")
    assert capsys.readouterr().out == "  below\n"


def test_a_table_too_wide_for_the_window_becomes_paragraphs_with_their_texts_below_each_other(capsys):
    print_table(plain(width=30), ("folder", "nis", "held-out"), [["one", "1.0", "x" * 40]])
    _, first, second = capsys.readouterr().out.splitlines()
    assert first.index("1.0") == second.index("x")


@pytest.mark.parametrize("name", ["y", "2024", "on", "1e3", "~"])
def test_any_name_of_a_folder_reaches_a_node_as_a_text(tmp_path, name, monkeypatch):
    monkeypatch.setattr(Children, "run", lambda *_: None)
    Children(tmp_path).start("node", "module", {"out": name, "diagnose": True, "rate": 50.0})
    text = (tmp_path / "node.yaml").read_text()
    # ROS reads YAML 1.1 with its own parser, to which only quotes say text.
    assert f'"out": "{name}"' in text
    assert yaml.safe_load(text)["node"]["ros__parameters"] == {"out": name, "diagnose": True, "rate": 50.0}


@dataclass(frozen=True)
class Ranked:
    estimate: float
    sigma: float
    display_unit: str


def test_what_the_turns_so_far_do_not_show_has_no_size():
    assert size(Ranked(3.5e3, 4.0e3, "ug/g^2")) == "size not seen yet"
    assert size(Ranked(to_si(20.0, "ug/g^2"), to_si(1.0, "ug/g^2"), "ug/g^2")).startswith("20.0 ")


def test_white_noise_is_told_in_both_customs():
    seen = np.array([term == "white" for term in TERMS])
    value = np.where(seen, to_si(0.6, "deg/h/sqrt(Hz)"), np.nan)
    terms = Terms(np.nan_to_num(value), np.full(len(TERMS), 0.1 * np.nanmax(value)))
    (white,) = (row for row in rows({"gyro_x": terms}) if row[1] == "white noise")
    assert white[-1] == "deg/h/sqrt(Hz) = 0.01 deg/sqrt(h)"


def test_a_folder_in_the_place_of_a_file_says_which_files_there_are(tmp_path):
    with pytest.raises(DataError, match="is a folder; name a YAML file of kind imu") as told:
        find_config("imu", tmp_path)
    assert "dtg" in str(told.value)
    (tmp_path / "imu.yaml").touch()
    with pytest.raises(DataError, match=re.escape(str(tmp_path / "imu.yaml"))):
        find_config("imu", tmp_path)


def test_the_readme_states_the_least_python_of_the_packages():
    root = Path(__file__).parents[3]
    (least,) = re.findall(r"Python (3\.\d+) to", (root / "README.md").read_text())
    for setup in [*root.glob("src/*/setup.py"), root / "study" / "setup.py"]:
        assert f'python_requires=">={least}"' in setup.read_text(), setup


@pytest.mark.parametrize("kind", ["imu", "site", "plan", "model", "goal"])
def test_a_name_that_is_none_names_the_one_that_looks_like_it(kind):
    known = names_of(kind)[0]
    with pytest.raises(DataError, match=rf"no {kind} named '{known}g' \(did you mean '{known}'\? There are: "):
        find_config(kind, f"{known}g")


@pytest.mark.parametrize(("name", "other"), [("gyro", "ug"), ("accel", "deg/h")])
@pytest.mark.parametrize("effect", ["bias_ramp", "bias_warm_up", "bias_settling", "creep", "bias_temperature"])
def test_typical_sizes_are_of_the_sensor_that_is_shown(sdimu, name, other, effect):
    """A ramp of a gyro was said to be 1 to 20 ug/h in an accelerometer."""
    out = sdimu("effects", f"{name}_{effect}_y")
    typical = [line for line in out.splitlines() if line.startswith("typical: ")]
    assert not any(other in line or "accelerometer" in line for line in typical)
    assert typical or (name, effect) == ("gyro", "bias_ramp")


def test_a_verb_that_is_none_names_those_that_look_like_it(monkeypatch, capsys):
    for typed, words in (
        ("calibrat", "did you mean calibrate"),
        ("xyzzy", "sdimu --help lists them"),
        ("bag inf", "did you mean info"),
        ("bag xyzzy", "no verb 'xyzzy'; choose info, cut or recover"),
        ("set xyzzy", "no verb 'xyzzy'; choose init"),
    ):
        monkeypatch.setattr("sys.argv", ["sdimu", *typed.split()])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        assert ending.value.code == 2
        assert words in " ".join(capsys.readouterr().err.replace("│", " ").split())


@pytest.mark.parametrize(
    ("free", "told"), [(0, r"no space is left on the disk of .*log"), (10**9, r"ended with status 1; see .*\.log")]
)
def test_a_node_without_last_words_on_a_full_disk_is_told_as_such(tmp_path, monkeypatch, free, told):
    usage = shutil.disk_usage(tmp_path)._replace(free=free)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    folder = tmp_path / "log"
    folder.mkdir()
    children = Children(folder)
    # A module that is not there writes to the log; its words are lost as on a full disk.
    children.run("recorder", "no_such_module", [])
    children._children["recorder"].process.wait()
    (folder / "recorder.log").write_text("")
    with pytest.raises(DataError, match=f"recorder: .*{told}"):
        children.running()


def test_a_table_has_no_column_that_says_nothing_and_no_per_cent_apart_from_its_number(capsys):
    headings = ("term", "value", "95 %", "limit", "number of recordings", "verdict")
    bias = ["gyro bias", "1.45", "1.44..1.46", "", "10", ""]
    print_table(plain(width=60), headings, [bias, ["x", "3", "", "", "1", ""]])
    head, *lines = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert head.split() == ["term", "value", "95", "%", "number", "of", "recordings"]
    assert [line.rstrip()[-2:] for line in lines if "gyro" in line or "x" in line] == ["10", " 1"]
    print_table(plain(width=45), headings, [bias])
    assert "95 %" in capsys.readouterr().out
