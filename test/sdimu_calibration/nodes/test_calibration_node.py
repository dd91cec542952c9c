"""The calibration node without its topics: what a request does to the model in use."""

import math
from types import SimpleNamespace

from std_srvs.srv import Trigger

from sdimu_calibration.nodes.calibration_node import CalibrationNode


def test_a_save_right_after_an_add_writes_the_new_model(tmp_path):
    """The filter with the new model is finished before the result is written from it."""
    done = []
    node = SimpleNamespace(
        _out=tmp_path,
        _take_model=lambda seconds=math.inf: done.append(("model", seconds)),
        _write_result=lambda: done.append(("result", 0)),
    )
    assert CalibrationNode._answer_save(node, Trigger.Request(), Trigger.Response()).success
    assert done == [("model", math.inf), ("result", 0)]
