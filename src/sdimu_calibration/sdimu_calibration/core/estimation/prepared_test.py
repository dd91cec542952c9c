"""A test that is ready for an estimator: a recording in SI on one clock, the IMU's file, the site."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from typing import Any, TypeVar, cast

from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, reduce
from sdimu_calibration.core.alignment.without import without
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.blocks import let_go
from sdimu_calibration.core.data.imu_class import KnownImus
from sdimu_calibration.core.data.why_handheld import why_handheld
from sdimu_calibration.core.handheld.handheld import PreparedRun, Told, prepare_run
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import EPOCH_S, LONGEST_EPOCH_S, MOST_EPOCHS, ImuSpecification, Site

A = TypeVar("A")


@dataclass(frozen=True, repr=False)
class PreparedTest:
    """What every estimate of one test begins with; its ``repr`` says what it is of, in a notebook as HTML.

    Attributes
    ----------
    recording : Recording
        In SI, right-handed axes and one clock, with the dwells where they are known.
    site : Site or None
        None where no site is stated: only a handheld run does without.
    held_out : tuple of int
        Stops whose measurements no fit takes.
    excluded : tuple of (float, float)
        Spans of time (s) whose measurements no fit takes; the samples in them are still navigated.
    assumed_site : str
        Name of the site where nobody stated one.
    whole_turns : float
        Of a run by hand: how well the IMU was put back after whole turns about the vertical (rad); 0 for none.
    rests : tuple of (float, float)
        Of a run by hand: when the IMU rested (s), as stated; without any the rests are found.
    scatter : ndarray, shape (3,), optional
        Of a run by hand: sigmas beyond white noise, as of `RunScatter.sigmas`, where other recordings tell them; None
        learns them.
    origin : Origin
        What the bag and the user say of the unit; an outcome adds what the recording says.
    known_imus : callable
        Gives the files of IMUs of which one may be named where the stated one is of another grade.
    """

    recording: Recording
    imu: ImuSpecification
    site: Site | None = None
    held_out: tuple[int, ...] = ()
    excluded: tuple[tuple[float, float], ...] = ()
    assumed_site: str = ""
    whole_turns: float = 0.0
    rests: tuple[tuple[float, float], ...] = ()
    scatter: Floats | None = None
    origin: Origin = field(default_factory=Origin)
    known_imus: KnownImus = tuple
    _prepared: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def words(self) -> tuple[tuple[str, str], ...]:
        """What the test is of, as (heading, text): recording, samples, duration, stops, IMU, site."""
        r, end = self.recording, float(self.recording.t[-1])
        where = self.origin.site or self.assumed_site
        return (
            ("recording", ", ".join((self.origin.recording or "unnamed", *self.origin.words))),
            ("samples", f"{len(r.t)} at {1.0 / r.interval_s:.4g} Hz"),
            ("duration", f"{end:.1f} s ({end / 60.0:.1f} min)"),
            ("stops", "none stated: the fit finds them" if r.phase is None else self._stops(r.phase.dwells)),
            ("IMU", self.imu.name),
            ("site", "none" if self.site is None else _place(self.site, where, bool(self.assumed_site))),
        )

    def _stops(self, number: int) -> str:
        without = f", without {', '.join(map(str, self.held_out))}" if self.held_out else ""
        return f"{number}{without}"

    def __repr__(self) -> str:
        """List recording, samples, duration, stops, IMU and site, one a line."""
        return "\n".join(f"{heading}: {text}" for heading, text in self.words)

    def _repr_html_(self) -> str:
        """List recording, samples, duration, stops, IMU and site as an HTML table."""
        lines = "".join(f"<tr><th>{escape(head)}</th><td>{escape(text)}</td></tr>" for head, text in self.words)
        return f"<table>{lines}</table>"

    def without_stops(self, stops: tuple[int, ...]) -> PreparedTest:
        """Hold stops out of all fits."""
        return replace(self, held_out=tuple(stops))

    def without_times(self, spans: tuple[tuple[float, float], ...]) -> PreparedTest:
        """Take no measurement within spans of time (s)."""
        return replace(self, excluded=tuple(spans))

    def counted_from(self, degc: float | None) -> PreparedTest:
        """Let temperature effects count from a temperature (deg C); from that at the start where None is given."""
        log = self.recording.temperature
        if log is None or degc is None:
            return self
        return replace(self, recording=replace(self.recording, temperature=replace(log, reference_degc=degc)))

    def with_imu(self, imu: ImuSpecification) -> PreparedTest:
        """Take other white noise or priors for the fits; phases and data faults stay as they were decided."""
        return replace(self, imu=imu)

    def data(self, setup: TestSetup) -> PreparedData:
        """Cycles, epochs and phases for the navigation, made once."""
        key = (setup.model.settle_s, setup.model.zero_velocity, setup.epoch_s)
        if key not in self._prepared:
            self._prepared[key] = reduce(self.recording, setup)
            let_go(self.recording.t, self.recording.omega_ib_b, self.recording.f_ib_b)
        return without(self._prepared[key], self.held_out, self.excluded)

    def last(self, question: str, answer: Callable[[], A]) -> A:
        """Give the answer to the question that was asked of this test last; work out that to another one, and keep it.

        Parameters
        ----------
        question : str
            All that the answer hangs on, but for the test.
        """
        of, asked, known = self._prepared.get("last", (None, "", None))
        # Tests that were made of one another share what is prepared, and no answers.
        if of is self and asked == question:
            return cast("A", known)
        found = answer()
        self._prepared["last"] = self, question, found
        return found

    @cached_property
    def why_handheld(self) -> str:
        """Why nothing can be navigated in this test; empty where it can."""
        return why_handheld(self.recording, self.imu)

    def epoch_s(self, settle_s: float) -> float:
        """Length of an epoch at rest (s): what quantisation and a long test ask for, no longer than the usual dwell.

        Parameters
        ----------
        settle_s : float
            What settling takes from a dwell (s).
        """
        log, end = self.recording.phase, float(self.recording.t[-1])
        wanted = max(self.imu.epoch_s, min(end / MOST_EPOCHS, LONGEST_EPOCH_S))
        usual = None if log is None else log.usual_dwell_s(end)
        return wanted if usual is None else max(min(usual - settle_s, wanted), EPOCH_S)

    @property
    def run(self) -> PreparedRun:
        """Rests and turns of a handheld run, made once."""
        key = ("run", self.excluded)
        if key not in self._prepared:
            told = Told(self.whole_turns, self.rests, self.excluded)
            self._prepared[key] = prepare_run(self.recording, self.imu, self.site, told)
        done: PreparedRun = self._prepared[key]
        return done


def _place(site: Site, name: str, assumed: bool) -> str:
    """Name a site, with its latitude and height."""
    where = f"latitude {math.degrees(site.latitude_rad):.4f} deg, height {site.height_m:.0f} m"
    named = f"{name} (assumed), " if assumed else f"{name}, " if name else ""
    return f"{named}{where}"
