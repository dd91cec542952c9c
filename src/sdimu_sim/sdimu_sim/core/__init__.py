"""The truth by exact geometry: platform motion, sensors, hidden effects; no ROS and no files."""

from sdimu_sim.core.generator import ImuGenerator, ImuSamples, simulate_imu
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, generate, imu_truth
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.core.truth import ImuTruth, Truth, draw_coefficients, draw_mount, in_body_frame

__all__ = [
    "ImuGenerator",
    "ImuSamples",
    "ImuTruth",
    "PlatformMotion",
    "Scenario",
    "TemperatureProfile",
    "Truth",
    "draw_coefficients",
    "draw_mount",
    "generate",
    "imu_truth",
    "in_body_frame",
    "simulate_imu",
]
