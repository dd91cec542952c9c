"""Noise with a memory in the simulator: sizes by brute force, the same digits in any blocks, bad keys refused."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.noise.allan import allan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_sim.core.coloured import ColouredNoise, parse_noise

DT = 0.1


def made(term, moving, seed=3):
    out = np.zeros((6, len(moving)))
    ColouredNoise([term], DT, seed).add(out, moving)
    return out


def test_blocks_do_not_change_a_digit():
    moving = np.zeros(4000, dtype=bool)
    moving[1000:1400] = moving[2200:2600] = True
    for kind in ("random_walk", "flicker", "stop", "turn", "shift"):
        unit = "deg/h/sqrt(h)" if kind == "random_walk" else "deg/h"
        term = f"gyro_noise_{kind}=1 {unit}"
        whole = made(term, moving)
        noise, parts = ColouredNoise([term], DT, 3), []
        for a, b in ((0, 1), (1, 1000), (1000, 1200), (1200, 2300), (2300, 4000)):
            part = np.zeros((6, b - a))
            noise.add(part, moving[a:b])
            parts.append(part)
        np.testing.assert_array_equal(np.hstack(parts), whole)
        assert not whole[3:].any()
        assert whole[:3].any()


def test_flicker_and_random_walk_have_the_allan_deviation_of_their_size():
    still = np.zeros(400_000, dtype=bool)
    flicker = made("gyro_noise_flicker=1 deg/h", still)[:3]
    found = [allan([row], DT) for row in flicker]
    near = [np.interp(100.0, f.tau, f.deviation) for f in found]
    assert np.mean(near) == pytest.approx(0.664 * to_si(1.0, "deg/h"), rel=0.1)
    walk = made("gyro_noise_random_walk=1 deg/h/sqrt(h)", still)[:3]
    K = to_si(1.0, "deg/h/sqrt(h)")
    near = [np.interp(100.0, f.tau, f.deviation) for f in (allan([row], DT) for row in walk)]
    assert np.mean(near) == pytest.approx(K * np.sqrt(100.0 / 3.0), rel=0.1)


def test_what_is_drawn_anew_is_constant_in_a_stop_and_another_in_the_next():
    moving = np.zeros(3000, dtype=bool)
    moving[1000:1500] = True
    out = made("accel_noise_stop=5 ug", moving)
    assert np.ptp(out[3, :1000]) == 0.0
    assert not out[:, 1000:1500].any()
    assert out[3, 0] != out[3, 2000]
    shift = made("accel_noise_shift=5 ug", moving)
    assert not shift[:, :1000].any()
    assert np.ptp(shift[3, 1000:]) == 0.0
    assert shift[3, 2000] != 0.0


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("gyro_noise_pink=1 deg/h", "expected gyro_noise_KIND"),
        ("gyro_noise_flicker=1", "has no unit"),
        ("gyro_noise_flicker", "no size"),
        ("gyro_noise_markov=1 deg/h", "tau"),
        ("gyro_noise_markov(tau=0 s)=1 deg/h", "must be positive"),
        ("gyro_noise_flicker=1 ug", "gyro_noise_flicker"),
        ("gyro_noise_flicker=1e300 deg/h", "gyro_noise_flicker=1e300 deg/h': .*larger than any quantity"),
    ],
)
def test_a_bad_key_says_what_is_wrong(text, part):
    with pytest.raises(DataError, match=part):
        parse_noise(text)
