"""The calibration node without its topics: what a request does to the model in use."""

import math
from types import SimpleNamespace

import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.units import to_si
from sdimu_calibration.nodes.calibration_node import CalibrationNode, _models
from sdimu_calibration.storage.files.config import load_imu, load_site


def test_a_save_right_after_an_add_writes_the_new_model(tmp_path):
    """The filter with the new model is finished before the result is written from it."""
    done = []
    node = SimpleNamespace(
        _out=tmp_path,
        _take_model=lambda seconds=math.inf: done.append(("model", seconds)),
        _write_result=lambda: done.append(("result", 0)),
        _diagnosing=SimpleNamespace(report=lambda: done.append(("report", 0))),
    )
    assert CalibrationNode._answer_save(node, Trigger.Request(), Trigger.Response()).success
    assert done == [("model", math.inf), ("result", 0), ("report", 0)]


def setting(*effects):
    """The node's answer to `ros2 param set /calibration add`, and the node."""
    options = OpeningOptions(load_imu("dtg"), load_site("daejeon"))
    node = SimpleNamespace(_options=options, _base="baseline", _checked=None)
    parameter = Parameter("add", Parameter.Type.STRING_ARRAY, list(effects))
    return CalibrationNode._check_added(node, [parameter]), node


def test_an_effect_that_fits_is_taken_as_it_was_checked():
    answer, node = setting("gyro_scale_asymmetry_y")
    assert answer.successful
    assert "gyro_scale_asymmetry_y" in [getattr(effect, "key", effect) for effect in node._checked[0].effects]


@pytest.mark.parametrize(
    "effect",
    [
        "gyro_x: " + "*".join(["t"] * 800),
        "gyro_x: " + "+".join(["t"] * 900),
        "gyro_x: " + "-" * 1500 + "t",
        "gyro_x: " + "(" * 900 + "t" + ")" * 900,
        "gyro_x: ((2**9)**9)**9",
        "no\0such.yaml",
        "a\ud800.yaml",
        "gyro_bias_warm_up_x(tau=1 furlong)",
        "x" * 4096 + ".yaml",
        "\n",
    ],
    ids=lambda text: ascii(text[:16]),
)
def test_whatever_is_added_live_the_node_goes_on_and_says_in_one_line_why_not(effect):
    answer, node = setting(effect)
    assert not answer.successful
    assert answer.reason
    assert "\n" not in answer.reason
    assert node._checked is None


def test_a_huge_effect_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "huge.yaml"
    path.write_text("format: sdimu-effect/1\n" + "".join(f"k{i}: 1\n" for i in range(90_000)))
    answer, _ = setting(str(path))
    assert not answer.successful
    assert f"{path}: longer than" in answer.reason


def test_shares_after_an_add_are_of_the_sigmas_at_the_start_of_the_test():
    """A scale factor known to 0.3 % of its prior had 71 % left in the log: all shares began anew with the model."""
    said = []
    node = SimpleNamespace(
        _options=OpeningOptions(load_imu("dtg"), load_site("daejeon")),
        _models=_models("baseline", ()),
        _first={},
        _last="",
        node=SimpleNamespace(get_logger=lambda: SimpleNamespace(info=said.append)),
        _feed=SimpleNamespace(catch_up=lambda _: True),
    )
    CalibrationNode._make(node)
    start = dict(node._first)
    node._models = _models("baseline", ("gyro_scale_asymmetry_y",))
    CalibrationNode._make(node)
    CalibrationNode._take_model(node)
    assert node._first == {**start, "gyro_scale_asymmetry_y": pytest.approx(to_si(25.0, "ppm"))}
    assert start["gyro_bias_x"] == pytest.approx(to_si(1.0, "deg/h"))
    # As it is published: in the body frame misalignments of the two triads add up.
    assert start["gyro_misalignment_xy"] == pytest.approx(math.sqrt(2.0) * to_si(1.0, "arcmin"))
