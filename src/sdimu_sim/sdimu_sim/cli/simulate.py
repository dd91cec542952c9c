"""The verb `sdimu simulate`: a test without DDS, at full speed, into a bag."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.units import parse_quantity

if TYPE_CHECKING:
    from sdimu_sim.core.by_hand import ByHand

EFFECT = "Hide an effect: what --add takes, =SIZE, such as 'accel_quadratic_x=20 ug/g^2'; repeatable."

NOISE = (
    "Noise with a memory: gyro_noise_KIND=SIZE or accel_noise_KIND=SIZE, KIND random_walk, flicker, markov(tau=300 s), "
    "stop, turn or shift; repeatable."
)
TEMPERATURE = "Temperature: profile (name or path), or that of a soak, such as '-20 degC'."

TURN_ON = (
    "Draw the biases of this power-on about those of the unit: gyro_bias='0.01 deg/h', accel_bias='20 ug'; repeatable."
)


def simulate(
    out: Annotated[Path, typer.Option(help="Bag (folder) to write.")],
    plan: Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")] = "kim18",
    imu: Annotated[
        str | None, typer.Option(help="IMU that gives the true errors their size; dtg (handheld: mems_by_hand).")
    ] = None,
    site: Annotated[str, typer.Option(help="Site.")] = "daejeon",
    unit: Annotated[
        int | None, typer.Option(min=0, help="Seed of the coefficients alone: recordings of one unit.")
    ] = None,
    turn_on: Annotated[list[str] | None, typer.Option(metavar="GROUP=SIGMA", help=TURN_ON)] = None,
    table: Annotated[str, typer.Option(help="Rate table.")] = "ideal",
    rate: Annotated[float, typer.Option(help="Sample rate of the IMU (Hz), 10 to 1000.")] = 100.0,
    seed: Annotated[int, typer.Option(min=0, help="Of coefficients, mount and noise.")] = 1,
    mount: Annotated[str | None, typer.Option(help="Rotation of the IMU on the table: 'X,Y,Z' (deg).")] = None,
    mount_max: Annotated[float, typer.Option(help="Without --mount: drawn up to this about every axis (deg).")] = 3.0,
    effect: Annotated[list[str] | None, typer.Option(help=EFFECT)] = None,
    noise: Annotated[list[str] | None, typer.Option(help=NOISE)] = None,
    temperature: Annotated[str | None, typer.Option(help=TEMPERATURE)] = None,
    truth: Annotated[Path | None, typer.Option(help="Truth file; default: OUT.truth.yaml beside the bag.")] = None,
    by_hand: Annotated[
        int | None, typer.Option(metavar="N", help="No table: a hand puts the IMU into N random attitudes.")
    ] = None,
    serial: Annotated[str, typer.Option(help="Serial number of the unit, kept in the bag's metadata.")] = "",
    power_on: Annotated[str, typer.Option(help="Which switch-on of the unit, kept likewise.")] = "",
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite the bag if it exists.")] = False,
) -> None:
    """Simulate a whole test into a bag, with the truth in a separate file."""
    # Inside the function: the help of `sdimu` must not wait for numerical libraries.
    from rate_table_sim.table_file import load_table
    from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
    from sdimu_sim.bag_file import write_test
    from sdimu_sim.core.scenario import Scenario, simulate_test
    from sdimu_sim.own_effects import simulated_effects
    from sdimu_sim.temperature_file import load_temperature
    from sdimu_sim.truth_file import write_truth

    custom = {key: text for key, text in (("serial", serial), ("power_on", power_on)) if text}
    effects = simulated_effects(effect or ())
    truth_path = truth or out.with_name(f"{out.name}.truth.yaml")
    if by_hand is not None:
        from sdimu_sim.core.by_hand import ByHand

        run = ByHand(by_hand, load_imu(imu or "mems_by_hand"), load_site(site), seed, rate, effects=effects)
        _by_hand(run, out, truth_path, custom, replace)
        return
    scenario = Scenario(
        plan=load_plan(plan),
        imu=load_imu(imu or "dtg"),
        site=load_site(site),
        table=load_table(table),
        rate_hz=rate,
        seed=seed,
        unit=unit,
        turn_on=turn_on_sigmas(turn_on or ()),
        mount_rad=None if mount is None else mount_rad(mount),
        mount_max_rad=math.radians(mount_max),
        effects=effects,
        noise=tuple(noise or ()),
        temperature=None if temperature is None else load_temperature(temperature),
    )
    test = simulate_test(scenario)
    write_test(out, scenario, test, replace=replace, custom=custom)
    write_truth(truth_path, test.truth)
    count = len(test.samples.t)
    plain().print(f"{out}: {count} samples, {test.motion.t[-1]:.0f} s; truth in {truth_path}", soft_wrap=True)


def _by_hand(run: ByHand, out: Path, truth_path: Path, custom: dict[str, str], replace: bool) -> None:
    """Write a run by hand and its truth."""
    from sdimu_sim.bag_file import write_by_hand
    from sdimu_sim.core.by_hand import simulate_by_hand
    from sdimu_sim.truth_file import write_truth

    samples, true = simulate_by_hand(run)
    write_by_hand(out, samples, replace=replace, custom=custom)
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
        out[group] = parse_quantity(size, units[group])
    return out


def mount_rad(text: str) -> tuple[float, float, float]:
    """Read ``"1,2,3"`` (deg) as the rotation vector of the IMU on the platform (rad)."""
    try:
        x, y, z = (math.radians(float(part)) for part in text.split(","))
    except ValueError as error:
        raise DataError(f"--mount '{text}': expected three angles in degrees, such as '1,2,3'") from error
    if not all(map(math.isfinite, (x, y, z))):
        raise DataError(f"--mount '{text}': expected three finite angles in degrees")
    return x, y, z
