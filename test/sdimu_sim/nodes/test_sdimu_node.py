"""The simulated IMU without its topics: what it says of motion that it cannot use."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.core.generator import ImuGenerator
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.nodes.sdimu_node import SdimuNode

TOPIC = "/rate_table/true_motion"


@pytest.mark.parametrize(
    ("tables", "told"), [(1, "times do not ascend"), (2, f"a second table publishes {TOPIC}: end one")]
)
def test_motion_of_two_tables_in_one_domain_is_told_as_such(tables: int, told: str) -> None:
    scenario = Scenario(plan=load_plan("kim18"), imu=load_imu("dtg"), site=load_site("daejeon"))
    node: Any = object.__new__(SdimuNode)
    node._generator = ImuGenerator(imu_truth(scenario), scenario.site, scenario.rate_hz, scenario.seed, None)
    node._motion = SimpleNamespace(topic=TOPIC)
    node.node = SimpleNamespace(count_publishers=lambda topic: tables if topic == TOPIC else 0)
    block = PlatformMotion(np.linspace(0.0, 0.5, 6), np.tile([1.0, 0.0, 0.0, 0.0], (6, 1)), np.zeros((6, 3)))
    node._samples(block)
    with pytest.raises(DataError, match=told):
        node._samples(block)
