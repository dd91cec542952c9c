"""`sdimu replay`: a recording through DDS into the live calibration node."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.options import DomainOption, ImuOption, default_folder, leave
from sdimu_calibration.cli.source_options import (
    AccelSign,
    AccelUnit,
    GyroSign,
    GyroUnit,
    ImuTopic,
    JointTopic,
    StatusTopic,
    TemperatureTopic,
    source,
)


def replay(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="rosbag2 folder or .mcap file.")],
    model: Annotated[str, typer.Option(help="Model to estimate: name in config/model or path.")] = "baseline",
    site: Annotated[
        str | None, typer.Option(help="Where the test was: name in config/site or path; daejeon when left out.")
    ] = None,
    imu: ImuOption = None,
    speed: Annotated[float, typer.Option(help="Times real time; 0 is as fast as the calibration allows.")] = 0.0,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the results; BAG_replay by default.")
    ] = None,
    domain: DomainOption = None,
    patience: Annotated[float, typer.Option(help="Longest time without an end (s); 0 waits for ever.")] = 0.0,
    diagnose: Annotated[bool, typer.Option(help="Publish a diagnosis at the end of each stop.")] = False,
    imu_topic: ImuTopic = None,
    status_topic: StatusTopic = None,
    joint_topic: JointTopic = None,
    temperature_topic: TemperatureTopic = None,
    accel_unit: AccelUnit = None,
    gyro_unit: GyroUnit = None,
    accel_sign: AccelSign = None,
    gyro_sign: GyroSign = None,
) -> None:
    """Play a recording into the live calibration node; leaves result.json."""
    import time

    from sdimu_calibration.report.table import rich_table, rows
    from sdimu_calibration.storage.bags.bag_file import bag_parts
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.result_file import read_result
    from sdimu_calibration.storage.opening import opening_options

    # Errors of bag or options are reported before anything is started.
    bag_parts(bag)
    origin = source(
        imu_topic, status_topic, joint_topic, temperature_topic, accel_unit, gyro_unit, accel_sign, gyro_sign
    )
    opening_options(site, None if imu is None else load_imu(imu), origin)
    folder = out or default_folder(bag, "replay")
    for old in ("result.json", "calibration.journal"):
        (folder / old).unlink(missing_ok=True)
    console = plain()
    begun = time.monotonic()
    calibrating = {
        "site": site or "", "imu": imu or "", "model": model, "out": str(folder), "accel_unit": accel_unit or "",
        "gyro_unit": gyro_unit or "", "accel_sign": accel_sign or 0, "gyro_sign": gyro_sign or 0, "diagnose": diagnose,
    }  # fmt: skip
    playing = {
        "bag": str(bag), "speed": speed, "consumers": 1, "imu_topic": imu_topic or "",
        "status_topic": status_topic or "", "joint_topic": joint_topic or "",
        "temperature_topic": temperature_topic or "",
    }  # fmt: skip
    with console.status("replaying") if console.is_terminal else plain(quiet=True).status(""):
        used = _play(folder / "log", calibrating, playing, patience, domain)
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


def _play(
    log: Path, calibrating: dict[str, Any], playing: dict[str, Any], patience: float, domain: int | None
) -> int:
    """Run the calibration node and the player until both have ended; the ROS domain they ran in."""
    import time

    from sdimu_calibration.cli.processes import Children, own_domain
    from sdimu_calibration.core.recording import DataError

    begun = time.monotonic()
    with own_domain(log, domain) as used, Children(log) as children:
        children.start("calibration", "sdimu_calibration.nodes.calibration_node", calibrating)
        children.start("replay", "sdimu_calibration.nodes.replay_node", playing)
        while children.running():
            if patience and time.monotonic() - begun > patience:
                raise DataError(f"replay: not done after {patience:g} s; see {log}")
            time.sleep(0.05)
    return used
