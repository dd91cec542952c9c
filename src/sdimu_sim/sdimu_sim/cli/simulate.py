"""The verb `sdimu simulate`: a test without DDS, at full speed, into a bag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import ReplaceOption
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.effect_key import read_quantity
from sdimu_sim.cli.options import PlanOption, SeedOption, World
from sdimu_sim.cli.usual_options import check_stated

if TYPE_CHECKING:
    from sdimu_sim.core.by_hand import ByHand


@dataclass(frozen=True)
class Drawn:
    """What is drawn for a test."""

    unit: Annotated[int | None, typer.Option(min=0, help="Seed of the coefficients alone: recordings of one unit.")] = (
        None
    )
    turn_on: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GROUP=SIGMA",
            help="Draw the biases of this power-on about those of the unit: gyro_bias='0.01 deg/h', "
            "accel_bias='20 ug'; repeatable.",
        ),
    ] = None
    seed: SeedOption = 1
    noise: Annotated[
        list[str] | None,
        typer.Option(
            help="Noise with a memory: gyro_noise_KIND=SIZE or accel_noise_KIND=SIZE, KIND random_walk, flicker, "
            "markov(tau=300 s), stop, turn or shift; repeatable."
        ),
    ] = None


@dataclass(frozen=True)
class Kept:
    """What is written beside the samples."""

    truth: Annotated[Path | None, typer.Option(help="Truth file; default: OUT.truth.yaml beside the bag.")] = None
    serial: Annotated[str, typer.Option(help="Serial number of the unit, kept in the bag's metadata.")] = ""
    power_on: Annotated[str, typer.Option(help="Which switch-on of the unit, kept likewise.")] = ""
    replace: ReplaceOption = False

    @property
    def custom(self) -> dict[str, str]:
        """Serial number and power-on where they are stated, for the metadata of the bag."""
        return {key: text for key, text in (("serial", self.serial), ("power_on", self.power_on)) if text}


PLAN = "kim18"
"""Plan that is simulated where none is stated."""


@with_options
def simulate(
    out: Annotated[Path, typer.Option(help="Bag (folder) to write.")],
    plan: PlanOption = PLAN,
    imu: Annotated[
        str | None, typer.Option(help="IMU that gives the true errors their size; dtg (handheld: mems_by_hand).")
    ] = None,
    by_hand: Annotated[
        int | None, typer.Option(metavar="N", help="No table: a hand puts the IMU into N random attitudes.")
    ] = None,
    *,
    world: World,
    drawn: Drawn,
    kept: Kept,
) -> None:
    """Simulate a whole test into a bag, with the truth in a separate file."""
    # Inside the function: the help of `sdimu` must not wait for numerical libraries.
    from sdimu_calibration.storage.bags.bag_folder import check_room
    from sdimu_sim.bag_file import write_test
    from sdimu_sim.core.scenario import simulate_test
    from sdimu_sim.truth_file import check_truth_room, usual_truth, write_truth

    truth_path = kept.truth or usual_truth(out)
    check_room(out, kept.replace)
    check_truth_room(truth_path, out, kept.replace)
    check_stated(world.effect or ())
    if by_hand is not None:
        from sdimu_calibration.storage.files.config import load_imu, load_site
        from sdimu_sim.core.by_hand import ByHand

        _refuse_by_hand(plan, world, drawn)
        place, sensor = load_site(world.site), load_imu(imu or "mems_by_hand")
        run = ByHand(by_hand, sensor, place, drawn.seed, world.rate, effects=world.effects)
        _by_hand(run, out, truth_path, kept)
        _tell_twins(world.effects)
        return
    scenario = world.scenario(
        plan,
        imu or "dtg",
        seed=drawn.seed,
        unit=drawn.unit,
        turn_on=turn_on_sigmas(drawn.turn_on or ()),
        noise=tuple(drawn.noise or ()),
    )
    test = simulate_test(scenario)
    write_test(out, scenario, test, replace=kept.replace, custom=kept.custom)
    write_truth(truth_path, test.truth)
    count = len(test.samples.t)
    plain().print(f"{out}: {count} samples, {test.motion.t[-1]:.0f} s; truth in {truth_path}", soft_wrap=True)
    _tell_twins(world.effects)


def _tell_twins(effects: Sequence[str]) -> None:
    """Say which hidden effects are a coefficient that the sensor has already."""
    from sdimu_sim.core.hidden import parse_effects
    from sdimu_sim.core.true_coefficients import one_coefficient

    for other, name in one_coefficient(parse_effects(effects).sizes):
        plain().print(
            f"{other} is {name} by another name: no test tells them apart, the truth has their sum under both names",
            soft_wrap=True,
        )


def _refuse_by_hand(plan: str, world: World, drawn: Drawn) -> None:
    """Refuse what belongs to a table, and what a run by hand does not draw."""
    given = {
        "--plan": plan != PLAN,
        "--table": world.table != World.table,
        "--mount": world.mount is not None,
        "--temperature": world.temperature is not None,
        "--unit": drawn.unit is not None,
        "--turn-on": bool(drawn.turn_on),
        "--noise": bool(drawn.noise),
    }
    asked = [option for option, is_there in given.items() if is_there]
    if asked:
        raise DataError(
            f"{' and '.join(asked)}: a run by hand (--by-hand) does not take it; leave it out, or simulate a plan"
        )


def _by_hand(run: ByHand, out: Path, truth_path: Path, kept: Kept) -> None:
    """Write a run by hand and its truth."""
    from sdimu_sim.bag_file import write_by_hand
    from sdimu_sim.core.by_hand import simulate_by_hand
    from sdimu_sim.truth_file import write_truth

    samples, true = simulate_by_hand(run)
    write_by_hand(out, samples, replace=kept.replace, custom=kept.custom)
    write_truth(truth_path, true)
    plain().print(
        f"{out}: {len(samples.t)} samples, {samples.t[-1]:.0f} s handheld; truth in {truth_path}", soft_wrap=True
    )


def turn_on_sigmas(texts: Sequence[str]) -> dict[str, float]:
    """Read ``gyro_bias='0.01 deg/h'`` and the like into SI."""
    from sdimu_sim.core.truth import COEFFICIENT_UNITS

    units = {name.rpartition("_")[0]: unit for name, unit in COEFFICIENT_UNITS.items()}
    out = {}
    for text in texts:
        group, equals, size = text.partition("=")
        if not equals or group not in units:
            raise DataError(f"--turn-on '{text}': expected gyro_bias='0.01 deg/h' or accel_bias='20 ug'")
        out[group] = read_quantity(f"--turn-on '{text}'", size, units[group])
        if out[group] < 0.0:
            raise DataError(f"--turn-on '{text}': expected a sigma of zero or more")
    return out
