"""Epochs that measure are joined stop by stop; means, noise and marks go with them."""

import numpy as np
import pytest

from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.gaps import Bridges
from sdimu_calibration.core.data.long_epochs import long_epochs
from sdimu_calibration.core.data.phases import Phases


def made(used, stop, first):
    m = len(used)
    rng = np.random.default_rng(1)
    used, stop, first = np.array(used, bool), np.array(stop), np.array(first, bool)
    none = np.zeros(m, bool)
    at = np.arange(m)
    epochs = Epochs(
        10 * at,
        10 * at + 10,
        at + 0.0,
        at + 1.0,
        rng.random(m),
        rng.standard_normal((m, 3)),
        rng.standard_normal((m, 3)),
    )
    gaps = Bridges(1.0 + rng.random(m), rng.random(m), rng.random(m))
    return epochs, Phases(used, used, first, stop, none, none), gaps


USED = [1] * 7 + [0] * 3 + [1] * 4 + [1] * 2
STOP = [0] * 10 + [1] * 4 + [2] * 2
FIRST = [0] * 10 + [1] + [0] * 5


def test_stops_are_cut_into_equal_pieces_of_about_the_length():
    epochs, phases, _ = long_epochs(*made(USED, STOP, FIRST), 3.0)
    length = (epochs.end - epochs.start)[phases.used]
    assert length.tolist() == [3.0, 4.0, 4.0, 2.0]
    assert (epochs.end - epochs.start)[~phases.used].tolist() == [1.0] * 3
    assert phases.stop[phases.used].tolist() == [0, 0, 1, 2]
    assert phases.first.sum() == 1
    # Every cycle stays in one epoch.
    assert epochs.first[1:].tolist() == epochs.last[:-1].tolist()


def test_means_and_bridges_are_those_of_the_joined_seconds():
    before, phases, gaps = made(USED, STOP, FIRST)
    epochs, _, joined = long_epochs(before, phases, gaps, 3.0)
    np.testing.assert_allclose(epochs.w_mean[0], before.w_mean[:3].mean(axis=0))
    np.testing.assert_allclose(epochs.f_mean[1], before.f_mean[3:7].mean(axis=0))
    assert joined.white[0] == pytest.approx(gaps.white[:3].mean())
    assert joined.angle[0] == pytest.approx(np.linalg.norm(gaps.angle[:3]))
    assert epochs.peak_rate[0] == before.peak_rate[:3].max()
