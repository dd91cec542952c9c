"""From a joint fit to the result that is written, shown and used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.averaged import none_below_zero
from sdimu_calibration.core.effects.references import SITE_REFERENCES, told_of
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.fit_words import MISFIT
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.noise_estimate import not_of_sensors
from sdimu_calibration.core.estimation.outcome import doubted, effect_files, inseparable
from sdimu_calibration.core.estimation.prior_check import outside
from sdimu_calibration.core.evidence.information import conditioned
from sdimu_calibration.core.handheld.run_scatter import scatter_in_words
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.set_board import SetBoard
from sdimu_calibration.core.joint.set_evidence import SetEvidence, held_out
from sdimu_calibration.core.joint.set_fit import SetFit, power_on
from sdimu_calibration.core.joint.set_found import likeliest_alone
from sdimu_calibration.core.joint.shared_function import is_weight
from sdimu_calibration.core.joint.variation import Variation, variation
from sdimu_calibration.core.noise_term import may_be_an_effect, unexplained
from sdimu_calibration.core.note import Note, Topic, prefixed
from sdimu_calibration.core.origin import Origin, measured
from sdimu_calibration.core.plain_text import first_of, listing
from sdimu_calibration.core.posterior.coefficients import Averages
from sdimu_calibration.core.posterior.posterior import Posterior
from sdimu_calibration.core.results import (
    START_TEMPERATURE,
    Calibration,
    PowerOnDeviation,
    SetRecording,
    SetSummary,
    SetTrend,
    TurnOn,
    no_history,
)
from sdimu_calibration.core.site_reference import found
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Work

_LISTED = 4
"""Number of recordings that a line names: the table of the page has all."""
MANY = 3
"""Number of coefficients that differ above which one line tells of all: physics seldom moves so many."""
SCATTERS = 1e-3
"""Probability (1) below which a coefficient is told to differ from recording to recording: one set in a thousand does
so by chance."""


def averaged(result: Calibration, fit: SetFit, window: Posterior[SetEvidence]) -> Calibration:
    """Put coefficients and covariance over all probable models in the place of those of a joint fit.

    Parameters
    ----------
    result : Calibration
        Of `fit`.
    window : Posterior
        Of the models that the recordings leave probable, linear about the fit.
    """
    mean = over_all_models(fit, window)
    return doubted(result, *_reported(mean, fit.base, mean.estimate.covariance))


def set_outcome(fit: SetFit) -> Calibration:
    """Put the result of a joint fit together.

    Coefficients are those of the unit, a bias its mean over all power-ons that might be. What differs from power-on to
    power-on and from recording to recording stands in `of_set`.
    """
    base = fit.base
    values, covariance = _reported(fit, base, fit.estimate.covariance)
    places = [k for k, name in enumerate(fit.names) if name in SITE_REFERENCES]
    varied = variation(fit)
    predicted = held_out(fit)
    dof = sum(r.statistics.nis_dof for r in fit.reports)
    nis = sum(r.statistics.nis_mean * r.statistics.nis_dof for r in fit.reports)
    parameters = base.sensors.parameters
    names = tuple(p.name for p in parameters)
    # What the frame of the report pins differs in no recording.
    free = tuple(name for name, variance in zip(names, np.diag(covariance), strict=True) if variance > 0.0)
    at_site = conditioned(fit.estimate.covariance, np.array(places)) if places else fit.estimate.covariance
    warnings = (
        *_warnings(fit, varied, free),
        *_beyond(fit, base),
        *inseparable(names, _reported(fit, base, at_site)[1]),
    )
    off, sigma = [fit.names[k] for k in places], np.sqrt(np.diag(fit.estimate.covariance)[places])
    references = found(told_of(base.test.site, names), off, fit.estimate.values[places], sigma)
    return Calibration(
        body_frame=base.body_frame,
        model=tuple(e.key for e in base.sensors.effects),
        names=names,
        units=tuple(p.unit for p in parameters),
        display_units=tuple(p.display_unit for p in parameters),
        values=values,
        covariance=covariance,
        fit={
            "log_likelihood": fit.estimate.log_likelihood,
            "nis_mean": nis / max(dof, 1.0),
            "nis_dof": dof,
            "held_out_rms": None if predicted is None else predicted.rms,
            "passes": max(r.statistics.passes for r in fit.reports),
        },
        data=_data(fit.reports, base),
        notes=(*_notes(fit, base), *(r.note for r in references if r.name in off), *warnings),
        history=no_history(len(names)),
        warnings=warnings,
        estimator=base.estimator,
        estimator_reason=fit.reports[0].reason,
        drift_means=base.drift_means,
        of_set=_summary(fit, varied, names, base),
        origin=_origin(fit, base),
        imu_noise=base.test.imu.noise_alone,
        references=references,
    )


def _reported(fit: SetFit, base: Fit, covariance: Floats) -> tuple[Floats, Floats]:
    """Values and covariance of what all recordings share, in the frame of the report; `covariance` (P, P) of all."""
    names = base.bare.names[: base.bare.coefficients]
    places = [fit.names.index(n) for n in names]
    values, covariance = fit.estimate.values[places], covariance[np.ix_(places, places)]
    if isinstance(base, NavigationFit):
        # What only serves the fit of this recording, as the Earth rate in the place of its azimuth, is behind them.
        T = base.centring[: len(names), : len(names)]
        values, covariance = T @ values, T @ covariance @ T.T
    return base.reported_values(values), base.reported_covariance(covariance)


def _data(reports: Sequence[Report], base: Fit) -> dict[str, float]:
    """Entries of the data section: sums over the recordings."""
    summed = {
        key: float(sum(r.data.get(key, 0.0) for r in reports))
        for key in ("samples", "lost", "rejected", "contradicted_s", "duration_s", "stops")
    }
    start = base.data_counts().get(START_TEMPERATURE)
    return {"recordings": float(len(reports)), **summed} | ({} if start is None else {START_TEMPERATURE: start})


def _origin(fit: SetFit, base: Fit) -> Origin:
    """Say which unit a set is of, from when on, at which temperatures; rate and site are those of one recording."""
    own = measured(base.test.origin, base.test.recording, base.test.imu.name)
    serials = {r.serial for r in fit.reports if r.serial}
    heat = np.array([r.temperature_degc for r in fit.reports])
    heat = heat[np.isfinite(heat)]
    mean, low, high = (heat.mean(), heat.min(), heat.max()) if len(heat) else (np.nan,) * 3
    return replace(
        own,
        serial=serials.pop() if len(serials) == 1 else own.serial,
        power_on="",
        recording="",
        start_ns=min(r.start_ns for r in fit.reports),
        effect_files=effect_files(base),
        temperature_degc=float(mean),
        temperature_low_degc=float(np.fmin(low, own.temperature_low_degc)),
        temperature_high_degc=float(np.fmax(high, own.temperature_high_degc)),
    )


def _notes(fit: SetFit, base: Fit) -> tuple[str, ...]:
    of_one = [f"in {name} alone: {', '.join(keys)}" for name, keys in fit.local.items() if keys]
    scatter = [_scatter(t) for t in with_units(fit, base)]
    files = sorted({r.imu.name for r in fit.reports})
    mixed = [f"the recordings state different IMUs ({', '.join(files)}): a set is of one unit"] if files[1:] else []
    doubt = [fit.unit_doubt] if fit.unit_doubt else []
    by_hand = _scatter_by_hand(fit)
    return (*mixed, *doubt, *of_one, *_beside(fit), *scatter, *by_hand, *_told(fit, [r.notes for r in fit.reports]))


def _scatter_by_hand(fit: SetFit) -> list[str]:
    """Say by what runs by hand scatter beyond white noise, and which of them have a scatter of their own."""
    told: dict[tuple[float, ...], list[str]] = {}
    for k in fit.shown:
        report = fit.reports[k]
        if report.by_hand is not None:
            told.setdefault(tuple(report.by_hand.extra.tolist()), []).append(report.name)
    return [f"{', '.join(names)}: beyond white noise {scatter_in_words(extra)}" for extra, names in told.items()]


def _beside(fit: SetFit) -> list[str]:
    """Say beside which unknown function the coefficients were estimated, and how large it is."""
    if fit.function is None:
        return []
    told = fit.function.sensors if fit.function.told is None else fit.function.told
    if not told:
        return []
    sizes = [f"{s} of {_size(s, v)}" for s, v in fit.function.size.items() if s in told]
    return [f"estimated beside an unknown function of the attitude in {listing(sizes)} that all recordings share"]


def _size(sensor: str, size: float) -> str:
    """Size of an error of a sensor (SI) in the unit that people read."""
    unit = "deg/h" if sensor.startswith("gyro") else "ug"
    return f"{from_si(size, unit):.3g} {unit}"


def _told(fit: SetFit, lines: Sequence[Sequence[str]]) -> list[str]:
    """Put the name of each recording before its lines."""
    return [prefixed(fit.reports[k].name, text) for k in fit.shown for text in lines[k]]


def _scatter(t: TurnOn) -> str:
    size, low, high = (f"{from_si(v, t.display_unit):.3g}" for v in (t.sigma, t.low, t.high))
    return (
        f"{t.effect} differs from power-on to power-on by {size} ({low} to {high}, 95 %) {t.display_unit} in "
        f"{t.power_ons} power-ons; the value given is the mean over all possible power-ons"
    )


def with_units(fit: SetFit, base: Fit) -> list[TurnOn]:
    """Scatter of each effect from power-on to power-on, with the units of its coefficients."""
    by_name = {p.name: p for p in base.sensors.parameters}
    first = [by_name[names[0]] for names in fit.varying.values()] if fit.turn_on else []
    return [replace(t, unit=p.unit, display_unit=p.display_unit) for t, p in zip(fit.turn_on, first, strict=True)]


def _warnings(fit: SetFit, varied: Variation, names: Sequence[str]) -> tuple[str, ...]:
    """Coefficients that differ between recordings by more than chance, and what is wrong with the data."""
    odd = [
        (p, name)
        for name, p in zip(varied.names, varied.p_value.tolist(), strict=True)
        if name in names and p * len(names) < SCATTERS
    ]
    trends = {t.name: t for t in varied.trends if t.p_value < SCATTERS}
    lines = [_differing(name, p, trends.get(name)) for p, name in sorted(odd)]
    if len(odd) > MANY:
        lines = [_many_differ(fit, [name for _, name in sorted(odd)], len(names), sorted(odd)[0][0])]
    left_out = [f"{name} is left out: {why}" for name, why in fit.left_out]
    return (*left_out, *_misfit(fit), *lines, *_told(fit, [r.warnings for r in fit.reports]))


def _differing(name: str, p: float, trend: SetTrend | None) -> Note:
    """Say that a coefficient differs between recordings by more than chance, and what it follows."""
    follows = f"; it follows {trend.covariate}" if trend else ""
    chance = f"p {p:.1g}" if p > 0.0 else "p < 1e-300"
    return Note(
        f"{name} is not the same in all recordings ({chance}){follows}", Topic.DIFFERS, f"; run: {Work.DIAGNOSE}"
    )


def _many_differ(fit: SetFit, odd: Sequence[str], count: int, p: float) -> Note:
    """Say it of many coefficients at once: so many seldom differ by physics."""
    chance = f"p {p:.1g}" if p > 0.0 else "p < 1e-300"
    whose = "or not of one unit" if fit.unit_doubt else "or changed between the recordings"
    most = first_of(odd, _LISTED)
    return Note(
        f"{len(odd)} of {count} coefficients are not the same in all recordings ({chance}; most: {most}): their axes "
        f"or units are read otherwise, {whose}; calibrate each recording by itself, and compare the results with "
        f"{Work.FLEET}",
        Topic.DIFFERS,
        f"; run: {Work.DIAGNOSE}",
    )


def _beyond(fit: SetFit, base: Fit) -> list[str]:
    """Name the coefficient furthest outside the IMU's file, where one is."""
    sensors = base.setup.sensors if isinstance(base, NavigationFit) else base.sensors
    values = dict(zip(fit.names, fit.estimate.values.tolist(), strict=True))
    return outside(sensors, np.array([values.get(name, 0.0) for name in sensors.names]))[:1]


def _misfit(fit: SetFit) -> list[Note]:
    """Name the recordings that the model does not fit, as a recording by itself is judged, the worst first."""
    worst = {r.name: worst_figure(r) for r in fit.reports}
    bad = sorted((r for r in fit.reports if worst[r.name] > MISFIT), key=lambda r: -worst[r.name])
    if not bad:
        odd = [(r.name, unexplained(r.noise, r.fault_kinds, r.notes)) for r in fit.reports]
        return [not_of_sensors(terms, name) for name, terms in odd if terms][:_LISTED]
    told = "; ".join(f"{r.name}: {_figures(r)}" for r in bad[:_LISTED]) + ("; others" if bad[_LISTED:] else "")
    return [
        Note(
            f"the model in white noise does not fit ({told}; 1 is right): physics is missing, or the noise has "
            "a memory",
            Topic.MISFIT,
            f"; run: {Work.DIAGNOSE}",
        )
    ]


def worst_figure(report: Report) -> float:
    """Give the worse of NIS and held-out error (1), as a recording by itself is judged: above `MISFIT` no fit.

    A run by hand learns its scatter, alone or with the others, and is not judged by what is left over its scatter.
    """
    if report.by_hand is not None:
        return 0.0
    figures = report.statistics.judged(may_be_an_effect(report.noise))
    return max((x for x in figures if x is not None and not np.isnan(x)), default=0.0)


def _figures(report: Report) -> str:
    held_out = report.statistics.held_out_rms
    return f"NIS {report.statistics.nis_mean:.3g}" + ("" if held_out is None else f", held-out error {held_out:.3g}")


def _summary(fit: SetFit, varied: Variation, names: Sequence[str], base: Fit) -> SetSummary:
    where = {name: k for k, name in enumerate(varied.names)}

    def in_order(row: Floats) -> Floats:
        return np.array([row[where[n]] if n in where else np.nan for n in names])

    listed = [(k, fit.reports[k]) for k in fit.shown]
    recordings = tuple(
        SetRecording(
            r.name,
            r.serial,
            r.power_on,
            r.start_ns,
            r.temperature_degc,
            r.data.get("duration_s", float("nan")),
            r.data.get("samples", float("nan")),
            r.statistics.nis_mean,
            *_own(r, names),
            in_order(varied.z[k]),
        )
        for k, r in listed
    )
    rows = [fit.power_ons.index(name) for name in dict.fromkeys(power_on(r) for _, r in listed)]
    deviations = tuple(
        PowerOnDeviation(fit.power_ons[row], name, float(value), float(sigma))
        for row in rows
        for name, value, sigma in zip(
            fit.varying_names, fit.estimate.deviation[row], fit.estimate.deviation_sigma[row], strict=True
        )
    )
    return SetSummary(
        recordings, tuple(with_units(fit, base)), deviations, in_order(varied.p_value), varied.trends, fit.left_out
    )


def _own(report: Report, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Values and sigmas of a recording's own fit in the order of the set."""
    known = dict(zip(report.names, zip(report.values, report.sigma, strict=False), strict=False))
    pairs = np.array([known.get(n, (np.nan, np.nan)) for n in names])
    return pairs[:, 0], pairs[:, 1]


def over_all_models(fit: SetFit, window: Posterior[SetEvidence]) -> SetFit:
    """Return a fit with what was found, its coefficients and their covariance those of all probable models.

    A bias is that in the mean over the dwells of the recording in whose frame the result stands.

    Parameters
    ----------
    fit : SetFit
        With what was found; the window is linear about it. A fit of another model is returned as it is.
    """
    board = window.board
    if not isinstance(board, SetBoard):
        return fit
    columns = zip(window.told.members, board.columns(window.told.members), strict=True)
    told = tuple(member for member, column in columns if column < len(board.known))
    # Weights of functions may be common in the window, and of single recordings in the fit.
    same = {n for n in board.known if not is_weight(n)} == {n for n in fit.names if not is_weight(n)}
    if not same or len(told) < len(board.known) - len(board.evidence.weight):
        return fit
    # Both in the linear model: that the scatter of power-ons is hardly known stays in the fit alone.
    likeliest = likeliest_alone(window) if fit.has_own_functions else None
    noise = board.noise_of(fit, likeliest or window.told.noise)
    means = fit.base.dwell_means
    one = Averages(board.as_stated, means).of_model(told, noise)
    all_ = Averages(board, means).of(window)
    own = np.array([fit.names.index(name) for name in board.known[: board.evidence.coefficients]], dtype=np.int64)
    values, covariance = fit.estimate.values.copy(), fit.estimate.covariance.copy()
    values[own] += all_.mean - one.mean
    covariance[np.ix_(own, own)] += none_below_zero(all_.covariance - one.covariance, np.sqrt(np.diag(one.covariance)))
    return replace(fit, estimate=replace(fit.estimate, values=values, covariance=covariance))
