"""What every pass begins with: options checked against each other, samples brought to cycles, epochs and phases."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.alignment import Alignment, align
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.blocks import let_go, pieces
from sdimu_calibration.core.data.dwell_detection import specification_is_wide
from sdimu_calibration.core.data.epochs import Epochs, cut
from sdimu_calibration.core.data.gaps import Bridges, bridges, judge, largest_acceleration, stepped, weighed
from sdimu_calibration.core.data.long_epochs import long_epochs
from sdimu_calibration.core.data.moved_in_rest import without_tilts
from sdimu_calibration.core.data.phases import (
    Phases,
    PhaseState,
    RestLimits,
    classify,
    contradictions,
    rest_limits,
    without_early_motion,
)
from sdimu_calibration.core.data.resting_cycles import join, standing
from sdimu_calibration.core.data.sample_screening import sound, wild
from sdimu_calibration.core.data.vibration import scatter_of_seconds, with_vibration
from sdimu_calibration.core.effects import body_frame, imu_model
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.measurement_kind import ALL, SENSORS, SKIP
from sdimu_calibration.core.navigation.strapdown import Cycles, Reducer
from sdimu_calibration.core.navigation.track import MAGNETIC_FIELD, Surroundings
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError, DataFault, Recording, TemperatureLog
from sdimu_calibration.core.specification import EPOCH_S, MOST_EPOCHS, ImuSpecification, Model, Site
from sdimu_calibration.core.wording import Option

_LISTED = 40
"""Number of stops that are listed one by one: more do not fit on a line."""
ALIGN_S = 30.0
"""Longest part of the first dwell that levels and gyrocompasses (s): biases are constant over it."""


@dataclass(frozen=True)
class TestSetup:
    """Everything a pass needs that is not data."""

    site: Site
    imu: ImuSpecification
    model: Model
    """`site`, `imu`, `model`: the white noise of `imu` is that of means over `epoch_s`, quantisation included."""
    sensors: ImuModel
    limits: RestLimits
    gravity: float
    """At the site (m/s^2)."""
    epoch_s: float = EPOCH_S
    """Length of an epoch at rest (s)."""
    counted: bool = False
    """A sensor counts pulses: what a second scatters then says nothing of the noise."""
    shaken: bool = False
    """The table vibrates at rest."""

    @property
    def magnetic_n(self) -> Floats:
        """Magnetic field of the site in NED (T), shape (3,); that of mid-northern latitudes where none is stated."""
        stated = self.site.magnetic_field_t
        return MAGNETIC_FIELD if stated is None else np.array(stated)

    def around(self, temperature: TemperatureLog | None) -> Surroundings:
        """Return what is about the IMU at the site, at the temperature that was measured."""
        return Surroundings(self.site.latitude_rad, self.gravity, temperature, self.magnetic_n)


@dataclass(frozen=True)
class PreparedData:
    """A recording after reduction: cycles, epochs and their phases."""

    cycles: Cycles
    epochs: Epochs
    phases: Phases
    kind: Ints
    """What each epoch measures (`measurement_kind`), shape (e,)."""
    temperature: TemperatureLog | None
    bridges: Bridges
    """What gaps in the data add to the noise."""
    faults: tuple[DataFault, ...] = ()
    seconds: tuple[Epochs, Phases] | None = None
    """Those of single seconds, where the epochs are longer only because the test is long."""
    shaking: float | None = None
    """Sigma of the mean rate of an epoch beyond white noise (rad/s) on a table that vibrates at rest; None on others.
    """

    @property
    def rest(self) -> Bools:
        """Cycles in dwell, shape (n,)."""
        return np.repeat(self.phases.dwell, self.epochs.last - self.epochs.first)


def set_up(site: Site, imu: ImuSpecification, model: Model, epoch_s: float | None = None) -> TestSetup:
    """Check the options against each other and prepare what all passes share.

    Parameters
    ----------
    epoch_s : float, optional
        Length of an epoch at rest (s); by default what the quantisation of the IMU asks for.
    """
    counted, epoch_s = imu.epoch_s > EPOCH_S, imu.epoch_s if epoch_s is None else epoch_s
    check_priors(imu)
    sensors = imu_model.restate(imu_model.build(model.effects, imu), model.priors)
    body_frame.check_priors([one.name for one in model.priors], sensors.names, model.body_frame)
    for what, noise in (("gyro", imu.gyro_white_noise), ("accel", imu.accel_white_noise)):
        if not noise > 0.0:
            raise DataError(f"{imu.place}: noise.{what} is zero, and measurements are weighed by it: state its size")
    gravity = site.gravity_m_s2 or float(earth.normal_gravity(site.latitude_rad, site.height_m))
    return TestSetup(site, imu.in_means_over(epoch_s), model, sensors, rest_limits(imu), gravity, epoch_s, counted)


def check_priors(imu: ImuSpecification) -> None:
    """Refuse a prior of zero: it leaves nothing to estimate, and nothing to weigh a candidate by."""
    for name, size in imu.prior.items():
        if not size > 0.0:
            raise DataError(
                f"{imu.place}: prior.{name}: {size:g} leaves nothing to estimate (state one sigma above zero; "
                "without the line the prior is that of the grade)"
            )


def nominal_interval(t: Floats) -> float:
    """Nominal sample interval (s) from the first stamps; live and offline use the same ones.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Stamps (s).
    """
    return float(np.median(np.diff(t[: NOMINAL_FROM + 1])))


def measurement_kinds(phases: Phases, every_epoch: bool) -> Ints:
    """Say what each epoch measures: Zw and Zf in every used one, Zp and Zv after motion (or always).

    Returns
    -------
    ndarray of int, shape (e,)
    """
    kind = np.where(phases.used, SENSORS, SKIP).astype(np.int64)
    kind[phases.used if every_epoch else phases.first] = ALL
    return kind


def reduce(recording: Recording, setup: TestSetup, screened: bool = True) -> PreparedData:
    """Reduce a recording to cycles and epochs and decide the phases.

    Parameters
    ----------
    screened : bool
        Take away samples that are no measurement, weigh rough ones less, and look for tilts in rests; not for the
        perfect samples of `nominal`, which stand still at rest.
    """
    recording, unsound = sound(recording) if screened else (recording, ())
    if len(recording.t) < NOMINAL_FROM + 1:
        raise DataError(f"/imu/data_raw: {len(recording.t)} usable samples are too few to calibrate")
    nominal = nominal_interval(recording.t)
    reducer = Reducer(nominal)
    cycles = Cycles.concatenate(
        [
            reducer.add(recording.t[rows], recording.omega_ib_b[rows], recording.f_ib_b[rows])
            for rows in pieces(len(recording.t))
        ]
    )
    # From here on cycles are looked at, and samples hardly.
    let_go(recording.omega_ib_b, recording.f_ib_b)
    epochs = cut(cycles, nominal)
    if not len(epochs):
        raise DataError("/imu/data_raw: the recording is shorter than one second")
    density = None if setup.counted else setup.imu.gyro_white_noise
    limits, vibrating = with_vibration(cycles, epochs, recording.phase, setup.limits, setup.gravity, density)
    phases = classify(epochs, recording.phase, limits, setup.gravity, setup.model.settle_s, PhaseState())
    phases = without_early_motion(epochs, recording.phase, phases, setup.imu.gyro_white_noise)
    tilted: tuple[DataFault, ...] = ()
    if screened:
        phases, tilted = without_tilts(epochs, recording.phase, phases, setup.imu, setup.model.settle_s)
    cycles = cycles[: int(epochs.last[-1])]
    found = bridges(cycles, epochs, phases.dwell, nominal, largest_acceleration(cycles), setup.gravity)
    found, steps = stepped(found, cycles, epochs, phases.dwell, recording.clock_steps, setup.gravity)
    unsound = (*unsound, *steps)
    if screened:
        at, excess, rough = wild(recording)
        let_go(recording.omega_ib_b, recording.f_ib_b)
        found, unsound = weighed(found, epochs, at, excess), (*unsound, *rough)
    noise = (setup.imu.gyro_white_noise, setup.imu.accel_white_noise)
    lost = judge(cycles, epochs, phases, nominal, found, noise, unsound)
    faults = (
        *unsound,
        *lost,
        *vibrating,
        *tilted,
        *contradictions(epochs, phases, recording.phase, not specification_is_wide(setup.imu)),
    )
    if len(epochs) > MOST_EPOCHS:
        cycles, epochs = join(cycles, epochs, standing(phases))
    seconds = (epochs, phases) if setup.epoch_s > EPOCH_S and not setup.counted else None
    if setup.epoch_s > EPOCH_S:
        epochs, phases, found = long_epochs(epochs, phases, found, setup.epoch_s)
    kind = measurement_kinds(phases, setup.model.zero_velocity == "every_epoch")
    shaken = scatter_of_seconds(epochs, phases, setup.imu.gyro_white_noise) if vibrating else None
    return PreparedData(cycles, epochs, phases, kind, recording.temperature, found, faults, seconds, shaken)


def weighed_for(setup: TestSetup, prepared: PreparedData) -> TestSetup:
    """Weigh the measurements by the vibration that the table shows at rest; the same object where it shows none."""
    if prepared.shaking is None:
        return setup
    rate = float(np.hypot(setup.model.extra_rate_sigma, prepared.shaking))
    return replace(setup, model=replace(setup.model, extra_rate_sigma=rate), shaken=True)


def first_attitude(epochs: Epochs, phases: Phases, setup: TestSetup) -> Alignment:
    """Coarse alignment from the first dwell."""
    if not phases.dwell.any():
        if phases.denied.any():
            raise DataError(
                "/rate_table/status: says rotating all the time, although the IMU rests at times; correct the status, "
                "or leave the topic out: the dwells are then found from the IMU"
            )
        raise DataError(
            "/imu/data_raw: the IMU is never at rest (|f| near gravity and |w| near Earth rate within the IMU's "
            f"specification); check its units, and that {Option.IMU} and {Option.SITE} fit"
        )
    start = int(np.argmax(phases.dwell))
    if start:
        raise DataError(
            f"/imu/data_raw: the recording starts in motion (first rest at {epochs.start[start]:.0f} s); "
            f"start it at rest, or cut it; noise beyond the IMU's specification looks the same: check {Option.IMU}"
        )
    moving = np.flatnonzero(~phases.dwell)
    end = int(moving[0]) if len(moving) else len(phases.dwell)
    rows = slice(0, max(1, min(end, int(np.searchsorted(epochs.end, epochs.start[0] + ALIGN_S + 1e-6)))))
    weight = (epochs.end - epochs.start)[rows]
    w_mean, f_mean = ((v[rows] * weight[:, None]).sum(axis=0) / weight.sum() for v in (epochs.w_mean, epochs.f_mean))
    return align(w_mean, f_mean, float(weight.sum()), setup.site, setup.imu)


def stops_line(recording: Recording, prepared: PreparedData) -> tuple[str, ...]:
    """Say which stops were found where no status says them."""
    if recording.phase is not None:
        return ()
    phases, epochs = prepared.phases, prepared.epochs
    used = np.unique(phases.stop[phases.used])
    spans = [
        (epochs.start[rows][0], epochs.end[rows][-1]) for rows in (phases.dwell & (phases.stop == k) for k in used)
    ]
    listed = ", ".join(f"{a:.0f}-{b:.0f}" for a, b in spans[:_LISTED]) + (", ..." if len(spans) > _LISTED else "")
    return (f"no status: {len(spans)} stops were found from the IMU, at (s) {listed}",)
