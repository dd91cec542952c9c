"""A step that was added and is not among what was found says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.diagnosis.ground import Request
from sdimu_calibration.core.diagnosis.rounds import drop_companions, mark_dropped, search_until_stable
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM
from sdimu_calibration.core.progress import silent


def test_a_companion_that_is_noise_once_calibrated_is_taken_out_and_says_so(bench):
    base = bench.fit(effects=("accel_scale_asymmetry_z=60 ppm",))
    request = Request(base, (), FALSE_ALARM)
    look = search_until_stable(request, silent)
    (step,) = look.found.steps
    assert step.fate == "added"
    column = look.evidence.names.index("accel_cubic_x")
    joined = np.append(look.found.chosen, column)
    companion = replace(step, label="accel_cubic_x")
    exchanged = replace(step, label="accel_cubic_y")
    found = replace(look.found, chosen=joined, steps=(step, companion, exchanged))
    settled = drop_companions(request, replace(look, found=found), silent)
    assert [c.label for c in settled.chosen] == ["accel_scale_asymmetry_z"]
    kept, small, other = settled.found.steps
    assert kept.fate == "added"
    assert small.fate == "added, then taken out: calibrated with it, it is below 3 of its sigmas"
    assert other.fate == "added, then taken out: what else was added explains the same better"
    # Noise took a step out already: that reason stays.
    noisy = replace(other, taken_out="noise with a memory explains the same")
    assert mark_dropped((noisy,), set(), set()) == (noisy,)
