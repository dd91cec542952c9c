"""The page on faults in the data, doc/faults.md: how each is met, and the table of the study."""

from __future__ import annotations

from sdimu_study.fault_run import LIMIT, Outcome
from sdimu_study.fault_study import table, totals

_HEAD = """# Faults in the data

Drivers, clocks, tables and people spoil data in ways that no sensor model describes. Each kind is tried at five sizes
(`sdimu study faults`, this page is its output). A run ends in one of these ways:

| | |
|---|---|
| ok | every coefficient within {limit:g} sigma of the truth, nothing to report |
| noted | within {limit:g} sigma; result.json names what was wrong (`data.faults`, `notes`) |
| warned | a coefficient beyond {limit:g} sigma, and `warnings` says that the result is not to be trusted |
| refused | exit status 1, one line that says why and what to do |
| SILENT WRONG, traceback | must not happen |

## How a fault is met

- **Order of arrival** (`core/data/arrival`): numbers that are not finite and repeated stamps are dropped and
  counted; late samples are sorted in. When late samples cover a time that already has other readings, the clock was
  set back, and the run is refused.
- **No measurement** (`core/data/sample_screening`): a number that stands still, a reading at the end of its range, a
  single spike. Each is a probability under the channel's own noise; such samples count as missing.
- **Missing samples** (`core/data/gaps`): the noise of the two samples that bridge a gap is counted as often as they
  stand in for others. In a turn the rate inside the gap is limited by the largest angular acceleration in the
  recording: the angle is known to +-(a^2 T^2 - D^2) / (4 a); force and velocity follow. At rest nothing is added, but
  readings before and after must agree, or the IMU was moved or switched off. Where the attitude is uncertain by more
  than {linear:g} mrad the linear filter would be wrong by more than its noise: refused.
- **Status** (`core/data/phases`): rest needs the status of the table *and* the readings of the IMU. Without a status
  the IMU decides; impossible stop numbers are replaced by counting.
- **What does not fit** (`core/evidence/stop_misfit`): the whitened innovations of every stop are summed; a stop
  beyond chance (1e-4 a test) is named; a mean over the whole test would hide it. Too few attitudes leave the azimuth
  uncertain, and the estimate is then biased (`core/estimation/azimuth_check`): warned.

No data can show one case: a gap at rest in which the IMU was switched off and came back with biases that differ by
less than the noise of the stops. Every gap at rest from 2 s on is therefore a warning.

A killed calibration node goes on from its journal (`calibration.journal` in its folder of results: every sample is
written there before it is acknowledged) and ends with the same digits; samples missed meanwhile are a gap.

## The table

{runs} runs: {totals}. Plan kim18_signed in ten minutes (dwells of 20 s, turns at 9 deg/s), IMU dtg, seeds
{seeds}. Cells: size: how it ended (largest error in sigmas; without a fault the largest of 27 is 2.2 on average).

| fault | | | | | |
|---|---|---|---|---|---|
"""


def page(outcomes: list[Outcome]) -> str:
    """Make doc/faults.md from the outcomes of a study."""
    from sdimu_calibration.core.data.gaps import LINEAR_RAD  # noqa: PLC0415 (the campaign joins both sides)

    seeds = sorted({o.seed for o in outcomes})
    head = _HEAD.format(
        limit=LIMIT,
        linear=LINEAR_RAD * 1e3,
        runs=len(outcomes),
        totals=", ".join(f"{n} {verdict}" for verdict, n in totals(outcomes).items()),
        seeds=", ".join(map(str, seeds)),
    )
    return head + "".join(f"| {what} | {' | '.join(cells)} |\n" for _, what, cells in table(outcomes))
