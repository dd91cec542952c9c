"""The filter on the way fed in pieces, as a test goes on; the end of the test is `calibrate` on all of it.

Stamps are integers (ns). The end goes through the front door of every recording (`front_door`), so that live and
offline give the same digits. On the way the filter gets what can be known by then: units and signs as soon as the
samples decide (`early_reading`), without a status the rests so far (`GrowingDwells`), stamps as they come.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.alignment.prepared import ALIGN_S, first_attitude
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.arrival import KeptTest, RawTest, in_order, of_the_test
from sdimu_calibration.core.data.dwell_detection import GrowingDwells, specification_is_wide
from sdimu_calibration.core.data.early_reading import EarlyReading
from sdimu_calibration.core.data.epochs import Epochs, cut
from sdimu_calibration.core.data.intake import Intake
from sdimu_calibration.core.data.phases import Phases, PhaseState, classify
from sdimu_calibration.core.data.stray_stamps import StampSieve, stray_note
from sdimu_calibration.core.data.streams import one_stream
from sdimu_calibration.core.data.why_handheld import why_handheld
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.front_door import OpenedTest, OpeningOptions, open_test
from sdimu_calibration.core.live_filter import LiveFilter
from sdimu_calibration.core.live_model import live_model
from sdimu_calibration.core.navigation.strapdown import Cycles, Reducer
from sdimu_calibration.core.navigation.track import TEMPERATURE_WINDOW_S
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError, PhaseLog, seconds
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.rotation import quaternion
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.verdict import Verdict

NS = 1_000_000_000
"""Stamps of a second (ns): header stamps are integers."""

NIS_CHANNELS = ("position", "velocity", "rate", "force")
_LOOK_S = 60.0
"""Time (s) after which a second publisher is looked for: a minute of samples shows it, and little of a test is lost."""
_FORGET_S = 5.0
"""Time (s) after which what the filter has used is forgotten again: looking costs more than keeping it so long."""
_FAR = 5.0
"""Deviation of chi-square (its standard deviations) that is reported: beyond it a channel contradicts its sigma."""


@dataclass(frozen=True)
class EpochEstimate:
    """What the filter knows at the end of an epoch."""

    ns: int
    """Stamp of the end of the epoch (ns)."""
    t: float
    """The same in seconds after the origin of the recording."""
    dwell: bool
    used: bool
    """`dwell`, `used`: at rest; a measurement was taken."""
    stop: int
    body_frame: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    display_units: tuple[str, ...]
    """`names`, `units`, `display_units`: length p."""
    coefficients: Floats
    covariance: Floats
    """`coefficients`, `covariance`: SI, in `body_frame`, shapes (p,) and (p, p)."""
    position_error_m: Floats
    velocity: Floats
    """`position_error_m`, `velocity`: shape (3,). N, E, D against the known point (m); N, E, D (m/s)."""
    q_nb: Floats
    """Scalar first, shape (4,)."""
    navigation_covariance: Floats
    """Shape (9, 9)."""
    nis: dict[str, float]
    """Mean squared normalised innovation per degree of freedom so far, by channel of `NIS_CHANNELS`."""
    stop_nis: dict[str, float]
    """The same at the present stop, or the last one: what the verdict is about."""
    verdict: str
    """``consistent``, or which channels contradict their sigma at the present stop. Until the filter looks back it is
    linearised about what it did not know yet, so the first stops may complain about a wrong initial azimuth."""
    counts: dict[str, int]
    """samples, late, lost, rejected, contradicted."""


class LiveCalibration:
    """A calibration while it runs.

    Parameters
    ----------
    options : OpeningOptions
        IMU, site, and what the user states of units and signs.
    by_hand : Model, optional
        Of the end, where that finds a run by hand; else it is `model`, too.
    """

    def __init__(self, options: OpeningOptions, model: Model, by_hand: Model | None = None) -> None:
        self.options = options
        self._by_hand = by_hand or model
        self._model = live_model(options, model)
        self.setup = self._model.setup
        self.notes = self._model.notes
        """What the caller should publish, such as what the filter waits for; the caller empties the list."""
        self._sieve, self._strays = StampSieve(), 0
        self._intake = Intake()
        self._kept: KeptTest | None = KeptTest()
        self._raw: Callable[[], RawTest] = self._kept.raw
        self._reading = EarlyReading(options.stated)
        self._dwells: GrowingDwells | None = None
        self._second = 0  # whole seconds after the origin that are done
        self._idle = False
        self._forgotten = 0.0  # until when what was used has been forgotten (s)
        self._early: KeptTest | None = KeptTest()
        self._lost = self._contradicted = 0
        self._reducer: Reducer | None = None
        self._pending: list[Cycles] = []
        self._waiting: list[tuple[Cycles, Epochs, Phases]] = []
        self._phase_state = PhaseState()
        self._on_the_way: LiveFilter | None = None
        asked = self._model.asked.parameters
        self._names, self._units, self._display_units = (
            tuple(getattr(one, word) for one in asked) for word in ("name", "unit", "display_unit")
        )
        self._J = body_frame.frame_jacobian(self._names, model.body_frame)
        self._nis_sum = np.zeros(4)
        self._nis_count = np.zeros(4)
        self._stop_nis = np.zeros((2, 4))  # sum and degrees of freedom at the present stop

    def kept_by(self, raw: Callable[[], RawTest]) -> None:
        """Keep nothing here: the caller keeps everything that comes, on a disk, and gives it back by `raw`."""
        self._kept, self._raw = None, raw

    def add_samples(self, ns: Ints, omega_ib_b: Floats, f_ib_b: Floats) -> None:
        """Take samples as the messages have them.

        Samples with a stamp of no time of the test are left out, on the way and at the end. Samples that are not
        finite, or not later than the last one taken, are counted and do not reach the filter on the way; the end of the
        test sorts them in as the reader of bags does.

        Parameters
        ----------
        ns : ndarray of int, shape (n,)
            Header stamps (ns).
        omega_ib_b, f_ib_b : ndarray, shape (n, 3)
            Rates and specific forces, in the units of the messages.
        """
        if self._kept is not None:
            self._kept.samples(ns, omega_ib_b, f_ib_b)
        if self._early is not None:
            self._early.samples(ns, omega_ib_b, f_ib_b)
        ns, omega_ib_b, f_ib_b = self._sieve.take(ns, omega_ib_b, f_ib_b)
        self._count_strays(self._sieve.strays())
        if not self._idle:
            self._intake.add_samples(ns, omega_ib_b, f_ib_b)

    def _count_strays(self, strays_ns: Ints) -> None:
        """Count samples with stamps (ns) of no time of the test, and say so once."""
        if len(strays_ns) and not self._strays:
            self.notes.append(stray_note(strays_ns))
        self._strays += len(strays_ns)
        self._intake.rejected += len(strays_ns)

    def add_phase(self, ns: int, dwell: bool, stop: int) -> None:
        """Take a status of the table that holds from a stamp (ns) on; stop `UNNUMBERED` where it names none."""
        if self._kept is not None:
            self._kept.status(ns, dwell, stop)
        if not self._idle:
            self._intake.add_status(ns, dwell, stop)

    def add_temperature(self, ns: int, value: float) -> None:
        """Take an IMU temperature (deg C) at a stamp (ns)."""
        if self._kept is not None:
            self._kept.temperature(ns, value)
        if not self._idle:
            self._intake.add_temperature(ns, value)

    @property
    def first_ns(self) -> int:
        """Stamp (ns) of the first sample of the test; `NEVER` before it has come."""
        return self._sieve.first_ns

    @property
    def newest_ns(self) -> int:
        """Newest stamp (ns) of the samples of the test; `NEVER` before the first has come."""
        return self._sieve.newest_ns

    @property
    def next_ns(self) -> int | None:
        """Stamp (ns) at which the next whole second ends that has samples, as far as they have come.

        None while none wait, too few have come to know the origin, or the filter on the way has given up.
        """
        origin_ns, first_ns = self._intake.origin_ns, self._intake.first_ns
        if origin_ns is None or first_ns is None:
            return None
        # Empty seconds are passed over: a stamp of another year would be millions of them.
        return origin_ns + (max(self._second, (first_ns - origin_ns - 1) // NS) + 1) * NS

    def advance(self, until_ns: int, status_known: bool = True, *, final: bool = False) -> list[EpochEstimate]:
        """Process the whole seconds that end at or before a stamp (ns).

        The caller makes sure that all samples, and all status and temperature messages that will come, are in up to
        then. `status_known` is False when there is no status topic. `final` says that no more will come: what the
        filter still waits for is then taken as it stands.

        Returns
        -------
        list of EpochEstimate
            Empty while units and signs are not recognised, and until the first alignment; then it catches up. Samples
            that the filter on the way cannot use (they start in motion) leave it empty, with a note; the end decides.
        """
        estimates: list[EpochEstimate] = []
        origin_ns = self._intake.origin_ns
        while origin_ns is not None and (end_ns := self.next_ns) is not None and end_ns <= until_ns:
            self._second = (end_ns - origin_ns) // NS
            estimates += self._advance(end_ns, float(self._second), status_known, final=False)
        if final and origin_ns is not None:
            estimates += self._advance(until_ns, (until_ns - origin_ns) * 1e-9, status_known, final=True)
        return estimates

    def _advance(self, until_ns: int, until_s: float, status_known: bool, final: bool) -> list[EpochEstimate]:
        origin_ns = self._intake.origin_ns
        assert origin_ns is not None
        if until_s >= _LOOK_S:
            self._look_for_publishers()
        if self._idle:
            return []
        ns, omega, force = self._intake.due(until_ns)
        samples = self._reading.read(seconds(ns, origin_ns), omega, force, until_s, final)
        self.notes += self._reading.notes
        self._reading.notes = []
        if self._reading.gave_up:
            self._stop()
        if samples is None:
            return []
        if self._reducer is None:
            self._reducer = Reducer(self._intake.interval_s)
            if specification_is_wide(self.setup.imu):
                self._dwells = GrowingDwells(self._intake.interval_s)
        self._pending.append(self._reducer.add(*samples))
        log, decided_s = self._phases(samples, status_known)
        self._close_epochs(until_s if final else min(until_s, decided_s), log)
        try:
            return self._filter()
        except (DataError, np.linalg.LinAlgError) as error:
            # The same samples may do at the end, when clocks are compared and the whole test is seen.
            self.notes.append(f"the filter on the way stops: {error}; the end of the test is calibrated all the same")
            self._stop()
            return []

    def _look_for_publishers(self) -> None:
        """Say once, while it can still be mended, what the end would say of a second publisher."""
        if self._early is None:
            return
        raw, self._early = of_the_test(self._early.raw())[0], None
        try:
            self.notes += one_stream(raw.ns, raw.omega_ib_b, raw.f_ib_b, raw.where)[1]
        except DataError as error:
            self.notes.append(f"the end of the test will be refused as it is now: {error}")

    def _stop(self) -> None:
        """Leave the rest to the end."""
        self._look_for_publishers()
        self._idle, self._pending, self._waiting = True, [], []
        self._intake.clear()

    def _phases(self, samples: tuple[Floats, Floats, Floats], status_known: bool) -> tuple[PhaseLog | None, float]:
        """Phases of the table, or as the samples show them, and the time up to which they are decided (s)."""
        if self._dwells is not None:
            if not self._intake.has_status:
                self._dwells.add(*samples)
                return self._dwells.log()
            self._dwells = None
        return (self._intake.phase_log() if status_known else None), np.inf

    def finish(self) -> Calibration:
        """Calibrate on everything taken so far; what a calibration of the recording says of the same data."""
        test = self.opened()
        model = self._by_hand if why_handheld(test.recording, test.imu) else self.setup.model
        return calibrate(test.recording, test.site, test.imu, model)

    def opened(self) -> OpenedTest:
        """Everything taken so far, opened as a recording is."""
        raw = self._raw()
        if len(raw.ns) <= NOMINAL_FROM:
            raise DataError("/imu/data_raw: too few samples have come to calibrate")
        return open_test(in_order(raw), self.options)

    def _close_epochs(self, limit: float, log: PhaseLog | None) -> None:
        """Cut the pending cycles into epochs that end by `limit` and decide their phases."""
        if not self._pending:
            return
        cycles = Cycles.concatenate(self._pending)
        whole = cycles[: int(np.searchsorted(cycles.t, limit + 1e-9, side="right"))]
        epochs = cut(whole, self._intake.interval_s) if len(whole) else None
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
        if self._on_the_way is None and not self._align():
            return []
        estimates = [
            self._one_epoch(cycles, epochs, phases, k)
            for cycles, epochs, phases in self._waiting
            for k in range(len(epochs))
        ]
        begun = float(self._waiting[-1][1].start[-1]) if self._waiting else 0.0
        if begun >= self._forgotten + _FORGET_S:
            # The last one asks for no more than this of what lies before it.
            self._intake.forget(begun - TEMPERATURE_WINDOW_S)
            self._forgotten = begun
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
        if len(epochs) < ALIGN_S and len(np.unique(phases.dwell)) == 1:
            return False
        alignment = self._model.begun(first_attitude(epochs, phases, self.setup))
        self._on_the_way = LiveFilter(self._model, self._intake.interval_s, alignment)
        return True

    def _one_epoch(self, cycles: Cycles, epochs: Epochs, phases: Phases, k: int) -> EpochEstimate:
        assert self._on_the_way is not None
        self._on_the_way.take(cycles, epochs, phases, k, self._intake.temperature_log())
        self._count(self._on_the_way.nis, bool(phases.first[k]))
        return self._report(epochs, phases, k)

    def _count(self, nis: Floats, first: bool) -> None:
        """Add the squared innovations of an epoch (4,) to those so far; the `first` of a stop begins its own."""
        measured = np.isfinite(nis)
        self._nis_sum[measured] += nis[measured]
        self._nis_count[measured] += 3
        if first:
            self._stop_nis[:] = 0.0
        self._stop_nis[:, measured] += np.array([nis[measured], np.full(int(measured.sum()), 3.0)])

    def _report(self, epochs: Epochs, phases: Phases, k: int) -> EpochEstimate:
        origin_ns = self._intake.origin_ns
        assert origin_ns is not None
        assert self._on_the_way is not None
        frame, state = self.setup.model.body_frame, self._on_the_way.state
        values, covariance = self._model.coefficients(state)
        site = self.setup.site
        radius = 6.371e6 + site.height_m
        return EpochEstimate(
            ns=origin_ns + round(float(epochs.end[k]) * 1e9),
            t=float(epochs.end[k]),
            dwell=bool(phases.dwell[k]),
            used=bool(phases.used[k]),
            stop=int(phases.stop[k]),
            body_frame=frame,
            names=self._names,
            units=self._units,
            display_units=self._display_units,
            coefficients=body_frame.values_in_frame(self._names, values, frame),
            covariance=self._J @ covariance @ self._J.T,
            position_error_m=np.array(
                [
                    (state.position[0] - site.latitude_rad) * radius,
                    state.position[1] * radius * np.cos(site.latitude_rad),
                    site.height_m - state.position[2],
                ]
            ),
            velocity=state.velocity.copy(),
            q_nb=quaternion(state.C_nb),
            navigation_covariance=self._model.navigation_covariance(state),
            verdict=stop_verdict(*self._stop_nis),
            nis=_by_channel(self._nis_sum, self._nis_count),
            stop_nis=_by_channel(*self._stop_nis),
            counts={
                "samples": self._intake.taken,
                "late": self._intake.late,
                "lost": self._lost,
                "rejected": self._intake.rejected,
                "contradicted": self._contradicted,
            },
        )


def _by_channel(total: Floats, dof: Floats) -> dict[str, float]:
    """Mean squares of the channels that were measured."""
    return {c: float(t / d) for c, t, d in zip(NIS_CHANNELS, total, dof, strict=True) if d > 0}


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
    return "inconsistent: " + ", ".join(far) + " of 1" if far else Verdict.CONSISTENT
