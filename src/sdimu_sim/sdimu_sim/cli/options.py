"""Options that several verbs of the simulators have, each declared once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sdimu_calibration.core.data_error import DataError

if TYPE_CHECKING:
    from sdimu_sim.core.scenario import Scenario

PlanOption = Annotated[str, typer.Option(help="Test plan: name in config/plan or path.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Of coefficients, mount and noise.")]


@dataclass(frozen=True)
class World:
    """The world of a simulated test: where, on which table, what is hidden in it."""

    site: Annotated[str, typer.Option(help="Site.")] = "daejeon"
    table: Annotated[str, typer.Option(help="Rate table.")] = "ideal"
    rate: Annotated[float, typer.Option(help="Sample rate of the IMU (Hz), 10 to 1000.")] = 100.0
    mount: Annotated[str | None, typer.Option(help="Rotation of the IMU on the table: 'X,Y,Z' (deg).")] = None
    mount_max: Annotated[
        float, typer.Option(min=0.0, max=180.0, help="Without --mount: drawn up to this about every axis (deg).")
    ] = 3.0
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help="Hide an effect: what --add takes, =SIZE, such as 'accel_quadratic_x=20 ug/g^2'; repeatable."
        ),
    ] = None
    temperature: Annotated[
        str | None, typer.Option(help="Temperature: profile (name or path), or that of a soak, such as '-20 degC'.")
    ] = None

    @property
    def effects(self) -> tuple[str, ...]:
        """What is hidden, as the simulator takes it."""
        from sdimu_sim.own_effects import simulated_effects

        return tuple(simulated_effects(self.effect or ()))

    def scenario(self, plan: str, imu: str, **drawn: Any) -> Scenario:
        """Read all of it for the simulator. `plan`, `imu`: names or paths; `**drawn`: what else the scenario takes."""
        from rate_table_sim.table_file import load_table
        from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
        from sdimu_sim.core.scenario import Scenario
        from sdimu_sim.temperature_file import load_temperature

        return Scenario(
            plan=load_plan(plan),
            imu=load_imu(imu),
            site=load_site(self.site),
            table=load_table(self.table),
            rate_hz=self.rate,
            mount_rad=None if self.mount is None else mount_rad(self.mount),
            mount_max_rad=math.radians(self.mount_max),
            effects=self.effects,
            temperature=None if self.temperature is None else load_temperature(self.temperature),
            **drawn,
        )


def mount_rad(text: str) -> tuple[float, float, float]:
    """Read ``"1,2,3"`` (deg) as the rotation vector of the IMU on the platform (rad)."""
    try:
        x, y, z = (math.radians(float(part)) for part in text.split(","))
    except ValueError as error:
        raise DataError(f"--mount '{text}': expected three angles in degrees, such as '1,2,3'") from error
    if not all(abs(angle) <= math.tau for angle in (x, y, z)):
        raise DataError(f"--mount '{text}': expected three finite angles in degrees, up to 360")
    return x, y, z
