"""What a rate table is: the order of its axes and what is wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, field

from sdimu_calibration.core.table.description import AxisLimits

AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class Imperfections:
    """Errors of a table. All are real motion of the platform, except the encoder's."""

    outer_middle_nonorthogonality_rad: float = 0.0
    """The middle axis leans towards the outer axis by this angle (turned about outer x middle)."""
    middle_inner_nonorthogonality_rad: float = 0.0
    """The inner axis leans towards the middle axis (turned about middle x inner)."""
    base_tilt_north_rad: float = 0.0
    base_tilt_east_rad: float = 0.0
    """`base_tilt_north_rad`, `base_tilt_east_rad`: the base is turned about North and about East: the two components of
    one rotation vector."""
    wobble_rad: float = 0.0
    """Half angle of the cone on which the inner axis travels, once a turn of the inner axis, against the sense of the
    turn. (In the sense of the turn it would be a constant mount error, and no wobble.)"""
    encoder_noise_rad: float = 0.0
    """One sigma of each encoder reading."""
    encoder_resolution_rad: float = 0.0
    """Step of the encoder; 0 for none."""


@dataclass(frozen=True)
class TableSpecification:
    """A rate table."""

    name: str = "ideal"
    axes: tuple[str, str, str] | None = ("Y", "Z", "X")
    """IMU axis letters about which outer, middle and inner axis turn when all angles are zero; None is a table that
    turns about any body axis."""
    sample_rate_hz: float = 100.0
    """Rate of the motion samples and grid of all profile breakpoints."""
    imperfections: Imperfections = field(default_factory=Imperfections)
    limits: tuple[AxisLimits, AxisLimits, AxisLimits] = (AxisLimits(), AxisLimits(), AxisLimits())
    """What goals may ask of each axis; a plan states its own acceleration."""
    joints: tuple[str, str, str] | None = None
    """Names of the three joints in messages; None for those of the axes."""

    @property
    def axis_names(self) -> tuple[str, str, str]:
        """Names of the three columns of angle and rate."""
        if self.joints is not None:
            return self.joints
        return ("outer", "middle", "inner") if self.axes else ("x", "y", "z")
