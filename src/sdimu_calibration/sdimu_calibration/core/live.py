"""The closed-loop filter fed in pieces, as a test goes on; the end of the test is `calibrate` on all of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.prepared import ALIGN_S, first_attitude, measurement_kinds, set_up
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.arrival import arrange
from sdimu_calibration.core.data.epochs import Epochs, cut
from sdimu_calibration.core.data.gaps import bridges, largest_acceleration
from sdimu_calibration.core.data.phases import Phases, PhaseState, classify
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.filter.filter_pass import NAV, PassInput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.passes import pass_settings, start_state
from sdimu_calibration.core.navigation.strapdown import Cycles, Reducer
from sdimu_calibration.core.navigation.track import motion
from sdimu_calibration.core.recording import (
    NOMINAL_FROM,
    DataError,
    PhaseLog,
    Recording,
    TemperatureLog,
    nominal_interval_ns,
    origin_ns,
    seconds,
)
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.rotation import quaternion
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

Stamps = Ints

NIS_CHANNELS = ("position", "velocity", "rate", "force")
_FAR = 5.0
"""Standard deviations of chi-square beyond which a channel contradicts its sigma."""


@dataclass(frozen=True)
class EpochEstimate:
    """What the filter knows at the end of an epoch.

    Attributes
    ----------
    t : float
        End of the epoch (s after the `start_ns` that the caller gave).
    dwell, used : bool
        At rest; a measurement was taken.
    stop : int
    body_frame : str
    names, units, display_units : tuple of str, length p
    coefficients, covariance : ndarray, shapes (p,) and (p, p)
        SI, in `body_frame`.
    latitude_rad, longitude_rad, height_m : float
    position_error_m, velocity : ndarray, shape (3,)
        N, E, D against the known point (m); N, E, D (m/s).
    q_nb : ndarray, shape (4,)
        Scalar first.
    navigation_covariance : ndarray, shape (9, 9)
    nis : dict
        Mean squared normalised innovation per degree of freedom so far, by channel of `NIS_CHANNELS`.
    verdict : str
        ``consistent``, or which channels contradict their sigma at the present stop. A first pass is linearised about
        what it did not know yet, so the first stops may complain about a wrong initial azimuth.
    counts : dict
        samples, late, lost, rejected, contradicted.
    """

    t: float
    dwell: bool
    used: bool
    stop: int
    body_frame: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    display_units: tuple[str, ...]
    coefficients: Floats
    covariance: Floats
    latitude_rad: float
    longitude_rad: float
    height_m: float
    position_error_m: Floats
    velocity: Floats
    q_nb: Floats
    navigation_covariance: Floats
    nis: dict[str, float]
    verdict: str
    counts: dict[str, int]


class LiveCalibration:
    """A calibration while it runs.

    Parameters
    ----------
    site, imu, model : Site, ImuSpecification, Model
    start_ns : int
        Stamp from which the caller counts its times; only a convention between caller and object.

    Raises
    ------
    DataError
        When model and IMU do not fit together.
    """

    def __init__(self, site: Site, imu: ImuSpecification, model: Model, start_ns: int) -> None:
        self.setup = set_up(site, imu, model)
        self.start_ns = start_ns
        # As they came, for the end; and what of them is new and finite, for the filter on the way.
        self._arrived: list[tuple[Stamps, Floats, Floats]] = []
        self._ns: list[Stamps] = []
        self._omega: list[Floats] = []
        self._force: list[Floats] = []
        self._acceleration = 0.0
        self._phase: list[tuple[int, bool, int]] = []
        self._temperature: list[tuple[int, float]] = []
        self._late = self._rejected = self._lost = self._contradicted = self._samples = 0
        self._reduced_to = 0  # blocks of samples already handed to the reducer
        self._last_ns = -(2**62)
        self._origin_ns: int | None = None
        self._nominal_s = 0.0
        self._reducer: Reducer | None = None
        self._pending: list[Cycles] = []
        self._waiting: list[tuple[Cycles, Epochs, Phases]] = []
        self._phase_state = PhaseState()
        self._alignment: Alignment | None = None
        self._state: PassState | None = None
        self._track = np.eye(3)
        self._before: Motion | None = None
        self._settings = pass_settings(self.setup, closed_loop=True)
        self._J = body_frame.frame_jacobian(self.setup.sensors.names, model.body_frame)
        self._nis_sum = np.zeros(4)
        self._nis_count = np.zeros(4)
        self._stop_nis = np.zeros((2, 4))  # sum and degrees of freedom at the present stop

    def add_samples(self, t: Floats, omega_ib_b: Floats, f_ib_b: Floats) -> None:
        """Take samples: end stamps (s after `start_ns`) shape (n,), rates and specific forces shape (n, 3).

        Samples that are not finite, or not later than the last one taken, are counted and do not reach the filter on
        the way; the end of the test sorts them in as the reader of bags does.
        """
        ns = self.start_ns + np.rint(np.asarray(t) * 1e9).astype(np.int64)
        self._arrived.append((ns, np.array(omega_ib_b, dtype=float), np.array(f_ib_b, dtype=float)))
        finite = np.isfinite(omega_ib_b).all(axis=1) & np.isfinite(f_ib_b).all(axis=1)
        newest = np.maximum.accumulate(np.concatenate([[self._last_ns], np.where(finite, ns, self._last_ns)]))
        later = ns > newest[:-1]
        keep = finite & later
        self._rejected += int(np.sum(~keep))
        self._late += int(np.sum(finite & ~later))
        if keep.any():
            self._ns.append(ns[keep])
            self._omega.append(np.array(omega_ib_b, dtype=float)[keep])
            self._force.append(np.array(f_ib_b, dtype=float)[keep])
            self._last_ns = int(ns[keep][-1])
            self._samples += int(keep.sum())

    def add_phase(self, t: float, dwell: bool, stop: int) -> None:
        """Take a status of the table that holds from `t` (s after `start_ns`) on."""
        self._phase.append((self.start_ns + round(t * 1e9), dwell, stop))

    def add_temperature(self, t: float, value: float) -> None:
        """Take an IMU temperature (deg C) at `t` (s after `start_ns`)."""
        if np.isfinite(value):
            self._temperature.append((self.start_ns + round(t * 1e9), value))

    def advance(self, until_s: float, status_known: bool = True) -> list[EpochEstimate]:
        """Process the whole epochs that end at or before `until_s` (s after `start_ns`).

        The caller makes sure that all samples, and all status and temperature messages that will come, are in up to
        then. `status_known` is False when there is no status topic.

        Returns
        -------
        list of EpochEstimate
            Empty until the first alignment is possible; then it catches up.
        """
        if not self._begin():
            return []
        assert self._reducer is not None
        assert self._origin_ns is not None
        for ns, omega, force in zip(
            self._ns[self._reduced_to :], self._omega[self._reduced_to :], self._force[self._reduced_to :], strict=True
        ):
            self._pending.append(self._reducer.add(seconds(ns, self._origin_ns), omega, force))
        self._reduced_to = len(self._ns)
        limit = until_s - (self._origin_ns - self.start_ns) * 1e-9
        self._close_epochs(limit, self._phase_log() if status_known else None)
        return self._filter()

    def finish(self) -> Calibration:
        """Calibrate on everything taken so far; what `sdimu calibrate` says of the same data.

        Raises
        ------
        DataError
            When there is too little of it.
        """
        return calibrate(self.recording(), self.setup.site, self.setup.imu, self.setup.model)

    def recording(self) -> Recording:
        """Everything taken so far."""
        if not self._ns or sum(map(len, self._ns)) < NOMINAL_FROM + 1:
            raise DataError("/imu/data_raw: too few samples have come to calibrate")
        ns, omega, force = (np.concatenate(part) for part in zip(*self._arrived, strict=True))
        done = arrange(ns, omega, force, "/imu/data_raw")
        rows = done.rows
        start = origin_ns(ns[rows])
        self._origin_ns = start
        return Recording(
            start, seconds(ns[rows], start), omega[rows], force[rows], self._phase_log(), self._temperature_log(),
            rejected=len(ns) - len(rows), notes=done.notes,
        )  # fmt: skip

    def _begin(self) -> bool:
        """Learn origin and sample interval from the first samples; False while there are too few."""
        if self._reducer is None:
            if sum(map(len, self._ns)) < NOMINAL_FROM + 1:
                return False
            ns = np.concatenate(self._ns)
            self._origin_ns = origin_ns(ns)
            self._nominal_s = nominal_interval_ns(ns) * 1e-9
            self._reducer = Reducer(self._nominal_s)
        return True

    def _phase_log(self) -> PhaseLog | None:
        if not self._phase or self._origin_ns is None:
            return None
        entries = sorted(self._phase, key=lambda entry: entry[0])
        ns = np.array([entry[0] for entry in entries], dtype=np.int64)
        return PhaseLog(
            seconds(ns, self._origin_ns),
            np.array([entry[1] for entry in entries]),
            np.array([entry[2] for entry in entries], dtype=np.int64),
        )

    def _temperature_log(self) -> TemperatureLog | None:
        if not self._temperature or self._origin_ns is None:
            return None
        entries = dict(sorted(self._temperature))
        ns = np.array(list(entries), dtype=np.int64)
        return TemperatureLog(seconds(ns, self._origin_ns), np.array(list(entries.values())))

    def _close_epochs(self, limit: float, log: PhaseLog | None) -> None:
        """Cut the pending cycles into epochs that end by `limit` and decide their phases."""
        if not self._pending:
            return
        cycles = Cycles.concatenate(self._pending)
        whole = cycles[: int(np.searchsorted(cycles.t, limit + 1e-9, side="right"))]
        epochs = cut(whole, self._nominal_s) if len(whole) else None
        if epochs is None or not len(epochs):
            self._pending = [cycles]
            return
        used = int(epochs.last[-1])
        self._pending = [cycles[used:]]
        setup = self.setup
        phases = classify(epochs, log, setup.limits, setup.gravity, setup.model.settle_s, self._phase_state)
        self._lost += int(cycles[:used].lost.sum())
        self._contradicted += int(phases.contradicted.sum())
        self._waiting.append((cycles[:used], epochs, phases))

    def _filter(self) -> list[EpochEstimate]:
        """Run the filter over the epochs that wait, once the first dwell has given an attitude."""
        if self._state is None and not self._align():
            return []
        estimates = [
            self._one_epoch(cycles, epochs, phases, k)
            for cycles, epochs, phases in self._waiting
            for k in range(len(epochs))
        ]
        self._waiting = []
        return estimates

    def _align(self) -> bool:
        if not self._waiting:
            return False
        parts = [w[1] for w in self._waiting]
        epochs = Epochs(*(np.concatenate([getattr(e, n) for e in parts]) for n in Epochs.__dataclass_fields__))
        phases = Phases(
            *(np.concatenate([getattr(w[2], n) for w in self._waiting]) for n in Phases.__dataclass_fields__)
        )
        if len(epochs) < ALIGN_S and phases.dwell.all():
            return False
        self._alignment = first_attitude(epochs, phases, self.setup)
        self._track = self._alignment.C_nb.copy()
        none = np.zeros(len(self.setup.sensors.prior))
        self._state = start_state(self.setup, self._alignment, self._alignment.C_nb, none)
        return True

    def _one_epoch(self, cycles: Cycles, epochs: Epochs, phases: Phases, k: int) -> EpochEstimate:
        assert self._state is not None
        setup, sensors = self.setup, self.setup.sensors
        part = cycles[slice(int(epochs.first[k]), int(epochs.last[k]))]
        rest = np.full(len(part), phases.dwell[k])
        seen = motion(
            part, rest, sensors, np.zeros(len(sensors.prior)), self._track, setup.site.latitude_rad, setup.gravity,
            self._temperature_log(), predicted=False, before=self._before,
        )  # fmt: skip
        self._before = seen
        one = Phases(*(getattr(phases, n)[k : k + 1] for n in Phases.__dataclass_fields__))
        kind = measurement_kinds(one, setup.model.zero_velocity == "every_epoch")
        # The largest acceleration so far; a first gap in the first turn knows no more than that turn's beginning.
        self._acceleration = max(self._acceleration, largest_acceleration(part))
        alone = Epochs(
            np.zeros(1, dtype=np.int64), np.full(1, len(part), dtype=np.int64),
            *(getattr(epochs, n)[k : k + 1] for n in ("start", "end", "peak_rate", "f_mean", "w_mean")),
        )  # fmt: skip
        gap = bridges(part, alone, one.dwell, self._nominal_s, self._acceleration, setup.gravity)
        data = PassInput(
            part.dt, part.alpha, part.upsilon, part.coning, part.sculling, alone.first, alone.last,
            gap.white, gap.angle, gap.velocity, kind,
            sensors.regressors(seen), sensors.channel, sensors.parameter,
        )  # fmt: skip
        out = new_output(1, len(sensors.prior), False, 1)
        run_pass(data, self._settings, self._state, out)
        measured = np.isfinite(out.nis[0])
        self._nis_sum[measured] += out.nis[0][measured]
        self._nis_count[measured] += 3
        if phases.first[k]:
            self._stop_nis[:] = 0.0
        self._stop_nis[:, measured] += np.array([out.nis[0][measured], np.full(int(measured.sum()), 3.0)])
        return self._report(epochs, phases, k, out.estimate[0])

    def _report(self, epochs: Epochs, phases: Phases, k: int, estimate: Floats) -> EpochEstimate:
        assert self._state is not None
        assert self._origin_ns is not None
        sensors, frame, state = self.setup.sensors, self.setup.model.body_frame, self._state
        p = len(sensors.prior)
        site = self.setup.site
        radius = 6.371e6 + site.height_m
        with np.errstate(invalid="ignore"):
            nis = self._nis_sum / self._nis_count
        return EpochEstimate(
            t=float(epochs.end[k]) + (self._origin_ns - self.start_ns) * 1e-9,
            dwell=bool(phases.dwell[k]), used=bool(phases.used[k]), stop=int(phases.stop[k]),
            body_frame=frame, names=sensors.names,
            units=tuple(q.unit for q in sensors.parameters),
            display_units=tuple(q.display_unit for q in sensors.parameters),
            coefficients=body_frame.values_in_frame(sensors.names, estimate, frame),
            covariance=self._J @ state.P[NAV : NAV + p, NAV : NAV + p] @ self._J.T,
            latitude_rad=float(state.position[0]), longitude_rad=float(state.position[1]),
            height_m=float(state.position[2]),
            position_error_m=np.array([
                (state.position[0] - site.latitude_rad) * radius,
                state.position[1] * radius * np.cos(site.latitude_rad),
                site.height_m - state.position[2],
            ]),
            velocity=state.velocity.copy(), q_nb=quaternion(state.C_nb),
            navigation_covariance=state.P[:NAV, :NAV].copy(),
            verdict=stop_verdict(*self._stop_nis),
            nis={c: float(v) for c, v in zip(NIS_CHANNELS, nis, strict=True) if np.isfinite(v)},
            counts={
                "samples": self._samples, "late": self._late, "lost": self._lost, "rejected": self._rejected,
                "contradicted": self._contradicted,
            },
        )  # fmt: skip


def stop_verdict(total: Floats, dof: Floats) -> str:
    """Judge the squared normalised innovations of one stop, by channel of `NIS_CHANNELS`.

    Parameters
    ----------
    total, dof : ndarray, shape (4,)
        Sum of squares, and how many there are.

    Returns
    -------
    str
        ``consistent`` while every sum lies within five standard deviations of chi-square.
    """
    far = [
        f"{channel} {t / d:.2f}"
        for channel, t, d in zip(NIS_CHANNELS, total, dof, strict=True)
        if d > 0 and abs(t - d) > _FAR * np.sqrt(2.0 * d)
    ]
    return "inconsistent: " + ", ".join(far) + " of 1" if far else "consistent"
