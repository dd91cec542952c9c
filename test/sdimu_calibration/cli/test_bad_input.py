"""What a verb cannot use is one line that names the option and what to do: no traceback, no hang, no silence."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.cut_bag import cut_bag
from sdimu_calibration.storage.files.whole_file import write_whole

UNUSABLE = (
    ("simulate --out new --mount 1e300,0,0", "--mount '1e300,0,0'"),
    ("simulate --out new --plan folder.yaml", "folder.yaml: is a folder"),
    ("simulate --out new --by-hand 100000000", "attitudes by hand"),
    (
        "simulate --out new --by-hand 12 --unit 3 --noise 'gyro_noise_flicker=1 deg/h'",
        "--unit and --noise: a run by hand",
    ),
    ("simulate --out new --turn-on 'gyro_bias=-1 deg/h'", "--turn-on 'gyro_bias=-1 deg/h'"),
    ("simulate --out new --turn-on 'gyro_bias=nan deg/h'", "--turn-on 'gyro_bias=nan deg/h'"),
    ("simulate --out new --temperature '-300 degC'", "temperature '-300 degC'"),
    ("bag cut BAG --out new --from 1e300", "no sample between"),
    ("effects 'gyro_bias_warm_up_x(tau=-1 s)'", "tau must be positive, not '-1 s'"),
    ("effects 'gyro_bias_warm_up_x(tau=0 s)'", "tau must be positive, not '0 s'"),
    ("effects folder.yaml", "folder.yaml: is a folder"),
    ("calibrate BAG --reference-temperature '-300 degC'", "--reference-temperature"),
    ("calibrate BAG --whole-turns nan", "--whole-turns"),
    ("calibrate BAG --out found", "found holds a diagnosis"),
    ("calibrate BAG BAG --out found", "found holds a diagnosis"),
    ("plan --rates 1e300", "--rates '1e300'"),
    ("plan --dwells 1e300", "--dwells '1e300'"),
    ("plan --acceleration nan", "--acceleration nan"),
    ("plan --acceleration 0", "--acceleration 0"),
    ("plan --acceleration -5", "--acceleration -5"),
    ("plan --acceleration 1e-3", "--acceleration 0.001: too low for every turn of kim18: at a mean of 2 deg/s"),
    ("plan --tell gyro_bias_x --tell gyro_bias_x", "gyro_bias_x: named twice"),
    ("plan --backwards --out folder.yaml", "folder.yaml: is a folder"),
    ("predict --mount 1e300", "--mount '1e300'"),
    ("compensate BAG --result nowhere --out new --start-temperature nan", "--start-temperature nan"),
    ("compensate BAG --result nowhere --out new --start-temperature -400", "--start-temperature -400"),
    ("export nowhere --rate nan", "--rate nan"),
    ("export nowhere --rate 0", "--rate 0"),
    ("export nowhere --temperature nan", "--temperature nan"),
    ("run --speed nan", "--speed nan"),
    ("run --temperature '-300 degC'", "temperature '-300 degC'"),
    ("workbench BAG --host nowhere.invalid", "--host nowhere.invalid"),
)
WRONG_USAGE = (
    ("simulate --out new --mount-max nan", "--mount-max"),
    ("simulate --out new --mount-max -1", "--mount-max"),
    ("bag cut BAG --out new --from -5", "--from"),
    ("noise BAG --seed -1", "--seed"),
    ("replay BAG --speed nan", "--speed"),
    ("replay BAG --patience nan", "--patience"),
    ("run --mount-max nan", "--mount-max"),
    ("bench --repeats 0", "--repeats"),
)


@pytest.fixture
def ended(monkeypatch, capsys, tmp_path, bag):
    """Run a line of `sdimu` in a folder of its own; return exit status and stderr."""
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "found").mkdir()
    (tmp_path / "found" / "diagnosis.json").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(line: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["sdimu", *shlex.split(line.replace("BAG", str(bag)))])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        return int(ending.value.code or 0), capsys.readouterr().err

    return run


@pytest.mark.parametrize(("line", "words"), UNUSABLE)
def test_what_cannot_be_used_is_one_line(ended, line, words):
    status, err = ended(line)
    assert status == 1
    assert err.startswith("sdimu: ")
    assert err.count("\n") == 1
    assert words in err
    assert not Path("new").exists()


@pytest.mark.parametrize(("line", "option"), WRONG_USAGE)
def test_a_number_out_of_range_is_wrong_usage(ended, line, option):
    status, err = ended(line)
    assert status == 2
    assert option in err


@pytest.mark.parametrize("line", ["WORD", "predict --out FILE", "bag cut BAG --out new --from WORD"])
def test_wrong_usage_shows_no_endless_word(ended, tmp_path, line):
    folder = tmp_path / "/".join(["a" * 200] * 12)
    folder.mkdir(parents=True)
    (folder / "file").touch()
    status, err = ended(line.replace("WORD", "a" * 5000).replace("FILE", str(folder / "file")))
    assert status == 2
    assert len(err) < 1500


def test_a_cut_to_any_time_ends_with_the_recording(bag, tmp_path):
    assert cut_bag(bag, tmp_path / "a", 0.0, 1e300).counts == cut_bag(bag, tmp_path / "b", 0.0, float("inf")).counts


def test_a_file_is_not_written_in_the_place_of_a_folder(tmp_path):
    with pytest.raises(DataError, match="is a folder"):
        write_whole(tmp_path, "text")
    assert not list(tmp_path.iterdir())
