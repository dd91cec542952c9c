"""`sdimu replay`: a recording through DDS into the live calibration node."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.opened import default_folder, leave
from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.options import (
    BagArgument,
    ChosenModelOption,
    DomainOption,
    EachStopOption,
    Recorded,
    results_in,
)
from sdimu_calibration.core.data_error import DataError


@dataclass(frozen=True)
class Playing:
    """How a recording is played into the node."""

    model: ChosenModelOption = None
    speed: Annotated[
        float, typer.Option(min=0.0, max=1e6, help="Times real time; 0 is as fast as the calibration allows.")
    ] = 0.0
    out: Annotated[Path | None, results_in("results; BAG_replay")] = None
    domain: DomainOption = None
    patience: Annotated[float, typer.Option(min=0.0, help="Longest time without an end (s); 0 waits for ever.")] = 0.0
    diagnose: EachStopOption = False


@with_options
def replay(bag: BagArgument, playing: Playing, opening: Recorded) -> None:
    """Play a recording into the live calibration node; leaves result.json.

    Exit status 3: done, but the estimate is not to be trusted; stderr says why.
    """
    import time

    from sdimu_calibration.report.table import rich_table, rows
    from sdimu_calibration.storage.bags.bag_file import bag_parts
    from sdimu_calibration.storage.files.journal import JOURNAL
    from sdimu_calibration.storage.files.result_file import read_result
    from sdimu_calibration.storage.files.whole_file import put_aside
    from sdimu_calibration.storage.opening import opening_options

    # Errors of bag or options are reported before anything is started.
    bag_parts(bag)
    opening_options(opening.site, opening.specification, opening.source)
    folder = playing.out or default_folder(bag, "replay")
    if not (folder / "log" / "replay.yaml").is_file():
        # The journal of a live test in that folder may be all that there is of it.
        put_aside(folder / JOURNAL)
    for old in ("result.json", JOURNAL):
        (folder / old).unlink(missing_ok=True)
    console = plain()
    begun = time.monotonic()
    calibrating = {
        "site": opening.site or "",
        "imu": opening.imu or "",
        "model": playing.model or "",
        "out": str(folder),
        "accel_unit": opening.accel_unit or "",
        "gyro_unit": opening.gyro_unit or "",
        "accel_sign": opening.accel_sign or 0,
        "gyro_sign": opening.gyro_sign or 0,
        "diagnose": playing.diagnose,
    }
    player = {
        "bag": str(bag),
        "speed": playing.speed,
        "consumers": 1,
        "imu_topic": opening.imu_topic or "",
        "status_topic": opening.status_topic or "",
        "joint_topic": opening.joint_topic or "",
        "temperature_topic": opening.temperature_topic or "",
    }
    with console.status("replaying") if console.is_terminal else plain(quiet=True).status(""):
        used = _play(folder / "log", calibrating, player, playing.patience, playing.domain)
    calibration = read_result(folder / "result.json")
    wall = time.monotonic() - begun
    console.print(rich_table(rows(calibration), f"body frame: {calibration.body_frame}"), soft_wrap=True)
    duration, lost = calibration.data["duration_s"], calibration.data["lost"]
    console.print(
        f"{duration:.0f} s in {wall:.1f} s: {duration / wall:.0f} times real time; {lost:.0f} samples lost",
        highlight=False,
    )
    console.print(f"results in {folder}; it ran in ROS domain {used}", soft_wrap=True, highlight=False)
    leave(calibration)


def _play(log: Path, calibrating: dict[str, Any], player: dict[str, Any], patience: float, domain: int | None) -> int:
    """Run the calibration node and the player until both have ended; the ROS domain they ran in."""
    import time

    from sdimu_calibration.cli.processes import Children, own_domain

    begun = time.monotonic()
    with own_domain(log, domain) as used, Children(log) as children:
        children.start("calibration", "sdimu_calibration.nodes.calibration_node", calibrating)
        children.start("replay", "sdimu_calibration.nodes.replay_node", player)
        while children.running():
            if patience and time.monotonic() - begun > patience:
                raise DataError(f"replay: not done after {patience:g} s; see {log}")
            time.sleep(0.05)
    return used
