"""Is the model adequate, where does it fail, which effect is missing? The order of work is that of the files here.

Screen of the data; noise scale; consistency; one scan over all candidates; search step by step with held-out score;
free-input remainder; equations outside the catalogue; refit of what was found. Design: doc/diagnosis.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.alignment.prepared import SKIP, PreparedData, TestSetup, reduce, set_up
from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.calibrate import NOT_CONVERGED, assemble
from sdimu_calibration.core.diagnosis.candidates import Candidate
from sdimu_calibration.core.diagnosis.consistency import SLOW_S, Consistency, check
from sdimu_calibration.core.diagnosis.evidence import Evidence
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest
from sdimu_calibration.core.diagnosis.rounds import UNEXPLAINED_P, Round, settle
from sdimu_calibration.core.diagnosis.screen import Finding, beyond_specification, screen
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, MOST_STEPS, Search
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.filter.passes import solve
from sdimu_calibration.core.probability import normal_tail
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

STILL_WRONG = 1.25
"""Held-out error (1 is right) beyond which a model is not called explained, whatever it fits."""
NOISE_OFF = 0.05
"""Least deviation of the noise from its specification that is worth telling."""


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis found.

    Attributes
    ----------
    verdict : str
        ``consistent``, ``noise model wrong``, ``one effect``, ``class of effects``, ``several effects``,
        ``own equation``, ``unexplained``, ``data fault``.
    sentence : str
        The verdict for people.
    adequate : bool
    p_value : float
        Of the model that was asked about, from scan, remainder and noise together.
    findings : tuple of Finding
        Of the data screen.
    noise : tuple of str
        What is wrong with the noise model, one line each.
    consistency : Consistency
    before, after : Calibration
        With the model as given, and with what was found added (the same object when nothing was).
    found : Search
        Of the catalogue, or of own equations where those explain it.
    evidence : Evidence
    free_inputs_before, remainder_after : FreeInputTest
    free : ndarray of int
        Columns of the free inputs in `evidence`.
    own : bool
        What was found are own equations, not registered effects.
    unexplained : bool
    """

    verdict: str
    sentence: str
    adequate: bool
    p_value: float
    findings: tuple[Finding, ...]
    noise: tuple[str, ...]
    consistency: Consistency
    before: Calibration
    after: Calibration
    found: Search[Evidence]
    evidence: Evidence
    free_inputs_before: FreeInputTest
    free_inputs_after: FreeInputTest
    free: Ints
    own: bool
    unexplained: bool

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What was found, accepted and kept, in the order of the search."""
        p = len(self.evidence.weight)
        return tuple(self.evidence.candidates[i - p] for i in self.found.chosen)

    @property
    def explained(self) -> float:
        """Share of the misfit that what was found removes."""
        before = max(self.free_inputs_before.chi2 - self.free_inputs_before.dof, 1e-9)
        after = max(self.free_inputs_after.chi2 - self.free_inputs_after.dof, 0.0)
        return float(np.clip(1.0 - after / before, 0.0, 1.0))


def diagnose(
    recording: Recording,
    site: Site,
    imu: ImuSpecification,
    model: Model,
    extra: Sequence[Effect] = (),
    alpha: float = FALSE_ALARM,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find what the model is missing.

    Parameters
    ----------
    recording, site, imu, model
        As for `calibrate`.
    extra : sequence of Effect
        Effects of the user's own, tried with the catalogue.
    alpha : float
        False-alarm probability of a whole scan.
    progress : callable, optional

    Raises
    ------
    DataError
        When the recording or the options cannot be used.
    """
    tell = progress or silent
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    findings = screen(recording, prepared)
    solution = solve(setup, prepared, tell, keep=True)
    consistency = check(solution.last, prepared)
    noise, setup = _mend_noise(consistency, setup, prepared)
    if noise:
        solution = solve(setup, prepared, tell, keep=True)
    look = settle(solution, extra, alpha, tell)
    findings += beyond_specification(look.solution)
    if not look.solution.converged:
        findings += (Finding(NOT_CONVERGED, True),)
    tell("report", 0.9)
    base = assemble(recording, solution, held_out=True)
    final = assemble(recording, look.solution, held_out=True) if look.chosen else base
    own = any(c.family == "own" for c in look.chosen)
    # What was added must also predict: an effect that only mimics the missing one fits here and fails elsewhere.
    # The free inputs are constant in a dwell and in a turn; what changes within one shows in the NIS alone.
    loud = misfit(final, consistency, imu, setup.imu) > largest_misfit(float(final.fit["nis_dof"] or 1.0))
    unexplained = look.after.p_value < UNEXPLAINED_P or _rms(final) > STILL_WRONG or loud or patched(look)
    p_value = _p_value(look.found, look.before, consistency, bool(noise) or loud)
    verdict = _verdict(look, own, unexplained, noise, findings)
    adequate = verdict == "consistent"
    tell("done", 1.0)
    partial = Diagnosis(
        verdict, "", adequate, p_value, findings, noise, consistency, base, final, look.found, look.evidence,
        look.before, look.after, look.free, own, unexplained,
    )  # fmt: skip
    return replace(partial, sentence=_sentence(partial))


def misfit(final: Calibration, consistency: Consistency, stated: ImuSpecification, mended: ImuSpecification) -> float:
    """Excess of the NIS over what the noise of the recording itself explains, outliers and all.

    Differences of neighbouring seconds say what that noise is, whatever is slow.
    """
    gyro = consistency.gyro.spread * stated.gyro_white_noise / mended.gyro_white_noise
    accel = consistency.accel.spread * stated.accel_white_noise / mended.accel_white_noise
    return float((final.fit["nis_mean"] or 0.0) / (0.5 * (gyro**2 + accel**2)) - 1.0)


def largest_misfit(dof: float) -> float:
    """Excess of the NIS that a right model stays below.

    The NIS and the differences of neighbours are two estimates of one variance, the second with an efficiency of 2/3
    (Rice, Ann. Stat. 12, 1984): their ratio scatters by ``1/sqrt(dof)``.
    """
    return max(_MISFIT, _MISFIT_SIGMAS / float(np.sqrt(dof)))


_MISFIT = 0.05
"""What is smaller matters to no sigma."""
_MISFIT_SIGMAS = 5.0


def patched(look: Round) -> bool:
    """Whether the choice is a patchwork: the search ran out of steps, or one bias drifts by three effects at once.

    Steps and transients in a row can follow any drift, and say nothing of its cause.
    """
    steps = look.found.steps
    drifts = {(c.family, c.label if not c.family.endswith("random_walk") else "", _sensor(c)) for c in look.chosen}
    of_sensor = [sensor for family, _, sensor in drifts if family.endswith(_DRIFTS)]
    many = any(of_sensor.count(sensor) >= _PATCHES for sensor in of_sensor)
    return many or (len(steps) == MOST_STEPS and steps[-1].accepted)


def _sensor(candidate: Candidate) -> int:
    return candidate.effect.terms[0].channel


_DRIFTS = ("bias_ramp", "bias_step", "bias_warm_up", "bias_random_walk")
_PATCHES = 3


def _mend_noise(
    consistency: Consistency, setup: TestSetup, prepared: PreparedData
) -> tuple[tuple[str, ...], TestSetup]:
    """Put measured noise in place of a specification that is wrong.

    Noise with heavy tails is taken at its standard deviation, outliers and all. To leave the outliers out of the
    measurements instead would be wrong: the same samples drive the navigation, and it is the measurement that
    tells the filter what they did to it.
    """
    told: list[str] = []
    scales = {"gyro": 1.0, "accel": 1.0}
    for triad, noise in (("gyro", consistency.gyro), ("accel", consistency.accel)):
        if abs(noise.ratio - 1.0) > max(NOISE_OFF, 4.0 * noise.sigma):
            scales[triad] = noise.ratio
            told.append(f"{triad} white noise is {noise.ratio:.2f} +- {noise.sigma:.2f} times the specification")
        if noise.kurtosis > _KURTOSIS:
            scales[triad] = noise.spread
            told.append(
                f"{triad} noise has heavy tails: kurtosis {noise.kurtosis:.1f} (3 is Gaussian), "
                f"{100 * len(noise.outliers) / max(1, int((prepared.kind != SKIP).sum())):.1f} % of the seconds are "
                f"outliers, with them it is {noise.spread:.2f} times the specification"
            )
    if not told:
        return (), setup
    imu = replace(
        setup.imu,
        gyro_white_noise=setup.imu.gyro_white_noise * scales["gyro"],
        accel_white_noise=setup.imu.accel_white_noise * scales["accel"],
    )
    return tuple(told), replace(setup, imu=imu)


_KURTOSIS = 4.0
"""Of the differences of neighbouring seconds; Gaussian noise in a test of an hour stays below 3.3."""


def _p_value(found: Search[Evidence], before: FreeInputTest, consistency: Consistency, noise: bool) -> float:
    """Bonferroni over the three tests that can call a model inadequate."""
    largest = float(np.max(np.abs(found.first.z), initial=0.0))
    count = int(np.isfinite(found.first.sigma).sum())
    of_scan = min(1.0, count * 2.0 * normal_tail(float(largest)))
    of_noise = consistency.nis_p_value if noise else 1.0
    return float(min(1.0, 3.0 * min(of_scan, before.p_value, of_noise)))


def _verdict(
    look: Round, own: bool, unexplained: bool, noise: tuple[str, ...], findings: tuple[Finding, ...]
) -> str:
    if any(f.grave for f in findings):
        return "data fault"
    if unexplained:
        return "unexplained"
    if look.chosen:
        if own:
            return "own equation"
        if len(look.chosen) > 1:
            return "several effects"
        if look.chosen[0].effect.run_local:
            return "data fault"
        return "class of effects" if _alike(look.found, look.chosen[0].label) else "one effect"
    if noise:
        return "noise model wrong"
    if look.found.steps:
        # Something stood out of the noise and was refused or did not last.
        return "unexplained"
    return "consistent"


def _alike(found: Search[Evidence], label: str) -> tuple[str, ...]:
    """Name what the data cannot tell from a chosen effect."""
    return next((s.alike for s in found.steps if s.label == label), ())


def _sentence(d: Diagnosis) -> str:
    """Put the verdict into one sentence."""
    names = " and ".join(c.label for c in d.chosen)
    if d.verdict == "consistent":
        odd = "; ".join(f.text for f in d.findings)
        return "The model explains the recording: nothing stands out of the noise" + (f"; but {odd}." if odd else ".")
    if d.verdict == "noise model wrong":
        return f"The noise model is wrong, the physics is not: {'; '.join(d.noise)}."
    if d.verdict == "data fault":
        faults = [f.text for f in d.findings if f.grave] or [f"{names} (a fault of this recording)"]
        return f"The data have a fault: {'; '.join(faults)}."
    if d.verdict == "unexplained":
        tail = f"; {names} would take {100 * d.explained:.0f} % of it" if names else ""
        if names and _rms(d.after) > STILL_WRONG:
            tail += f", but the error at stops held out is then still {_rms(d.after):.2f} (1 is right)"
        return f"Something is missing that no effect of the catalogue explains{tail}{_coloured(d.consistency)}."
    if d.verdict == "own equation":
        return f"Something is missing that is not in the catalogue; it follows {names}."
    rest = f"error at stops held out, a third at a time: {_rms(d.before):.3f} -> {_rms(d.after):.3f}"
    if d.verdict == "class of effects":
        others = ", ".join(_alike(d.found, d.chosen[0].label)[:4])
        return f"One effect is missing: {names}, or what looks the same here ({others}); {rest}."
    return f"{'One effect is' if d.verdict == 'one effect' else 'Several effects are'} missing: {names}; {rest}."


def _coloured(consistency: Consistency) -> str:
    """Say whose noise is not white: it passes for drifts that no effect has."""
    told = [
        f"{triad} scatters {noise.slow:.1f} times more over {SLOW_S} s than white noise of its seconds would"
        for triad, noise in (("gyro", consistency.gyro), ("accel", consistency.accel))
        if noise.slow > _COLOURED
    ]
    return f"; coloured noise would do it: {' and '.join(told)}" if told else ""


_COLOURED = 1.2
"""Five sigma of a test of fifty minutes."""


def _rms(calibration: Calibration) -> float:
    value = calibration.fit.get("held_out_rms")
    return float("nan") if value is None else float(value)
