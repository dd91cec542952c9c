"""The study of the filter on the way: errors over sigma after some stops, by the truth up to then."""

import numpy as np
import pytest

from sdimu_sim.core.mean_bias import BIASES
from sdimu_study.study import Group
from sdimu_study.way import STOPS, STUDY, _errors, run, world


@pytest.fixture(scope="module")
def tactical():
    one = world(("fog_tactical", "flicker"), 97_901)
    return one, run(one)


def test_white_noise_is_white_in_the_file_too():
    white, flicker = (world(("mems_industrial", noise), 97_902) for noise in ("white", "flicker"))
    assert white.imu.gyro_bias_instability == white.imu.accel_bias_instability == 0.0
    assert white.sensor.noise == ()
    assert len(flicker.sensor.noise) == 2


def test_every_stop_is_judged_by_the_mean_of_the_biases_up_to_then(tactical):
    one, found = tactical
    assert sorted(found) == list(range(19))
    row = STUDY.score(one, found)
    for stop in STOPS:
        at = row["stops"][str(stop)]
        assert (at["biases"]["count"], at["others"]["count"]) == (len(BIASES), 21)
    # Twenty-one errors over sigma, correlated: their root scatters by a fifth about one.
    assert 0.4 < np.sqrt(row["stops"]["18"]["others"]["z2"] / 21) < 1.8
    # Judged by the end of the test the biases of the third stop are others.
    late = _errors(one, found[18])["biases"]["z2"]
    assert late != row["stops"]["3"]["biases"]["z2"]


def test_the_table_has_a_cell_of_both_kinds_for_every_stop(tactical):
    row = STUDY.score(*tactical)
    cells = [cell(Group(("fog_tactical", "flicker"), [row, {"error": "x"}])) for _, cell in STUDY.columns]
    assert cells[:4] == ["fog_tactical", "flicker", "2", "1"]
    assert all(len(cell.split(", ")) == 2 for cell in cells[4:8])
