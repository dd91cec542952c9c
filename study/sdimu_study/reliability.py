"""Do probabilities come true? Of what is told with probability p, p must be there: effects, families, noise, nothing.

Worlds of none to twelve effects of two to fifty sigma, in white noise or in noise with a memory, on any plan at any
site. Each diagnosis makes statements; the truth says which are right.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.family import family_of
from sdimu_calibration.core.posterior.told import of_coefficients
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.coloured import KINDS as NOISES
from sdimu_study.ahead import MISSED, ahead
from sdimu_study.believed import BelievedEffects, believed_count, believed_noise
from sdimu_study.noise import drawn_noise, noise_terms, seen_noise
from sdimu_study.plans import PLANS, study_plan
from sdimu_study.score import errors
from sdimu_study.study import Group, Results, Rows, Study, Table, head, of, rms_z
from sdimu_study.worlds import (
    HANDHELD,
    OneTest,
    Truth,
    diagnosed,
    drawn_effect,
    drawn_site,
    model_of,
    rng_of,
    simulated_test,
    with_effects,
)

CLEAN, NOISE, ONE, MANY, MIXED, BELIEVED = "clean", "noise", "one", "many", "mixed", "believed"
KINDS = (CLEAN, NOISE, ONE, MANY, MIXED, BELIEVED)
"""Nothing hidden in white noise; noise with a memory alone; it with one effect of 5 or 10 sigma; 5 to 12 effects in
white noise; none to twelve in either; effects and noise as the prior of the diagnosis has them."""
RATES_HZ = (20.0, 50.0, 100.0)
"""Sample rates that are drawn (Hz)."""
_TELLING = ("kim18_signed", "recommended")
"""Plans that show most of the catalogue, for many effects at once."""
_SPAN = {ONE: (5.0, 10.0), MANY: (3.0, 50.0), MIXED: (2.0, 50.0)}
"""Least and largest size of an effect, in the sigma of the clean test."""
_LEAST_SIGMAS = 2.0
"""Least size (sigma of the clean test) of an effect that counts as missing: smaller ones cannot be seen, and no window
of models holds them with the probability that they have before the data."""
_TOLD_BEFORE = frozenset({"gyro_lost_data"})
"""What the screening of the samples finds, takes for missing data and notes before any model is weighed."""
_MOST_BY_HAND = 3
"""Number of effects (1) of a run by hand at most: its dozen rests tell no more of them apart."""
_COLOURS = ("#444444", "#0060a8", "#c04000", "#3a8a3a")
_BINS = 10
"""Number of bins of the probabilities: each a tenth."""
WHATS = ("nothing", "families", "effects", "noise")
"""What statements are of."""


@dataclass(frozen=True)
class ReliabilityCase:
    """Tests of an IMU file of one of `KINDS`."""

    imu: str
    kind: str


def world(case: ReliabilityCase, seed: int) -> OneTest:
    """Draw plan, site, rate, noise and effects, and simulate the test."""
    rng, imu = rng_of(seed, "reliability", case.imu, case.kind), load_imu(case.imu)
    handheld = case.imu == HANDHELD
    plan = "by hand" if handheld else str(rng.choice(_TELLING if case.kind == MANY else PLANS))
    site, rate_hz, own = drawn_site(rng), float(rng.choice(RATES_HZ)), int(rng.integers(2**31))
    coloured = not handheld and (case.kind in {NOISE, ONE} or (case.kind == MIXED and rng.random() < 0.5))
    noise = drawn_noise(imu, str(rng.choice(sorted(NOISES))), rng) if coloured else ()
    if case.kind == BELIEVED:
        noise = () if handheld else believed_noise(imu, study_plan(plan, own).duration_s, rng)
    true = noise_terms(noise)
    count = _count(case.kind, rng, handheld)
    sizes = _SPAN.get(case.kind, (1.0, 1.0))
    spans = [(float(rng.choice(sizes)),) * 2 if case.kind == ONE else sizes for _ in range(count)]
    draws: list[Callable[[Fit], Truth | None]] = [partial(_drawn, rng, span, true) for span in spans]
    if case.kind == BELIEVED:
        draws = [BelievedEffects(rng, true, _TOLD_BEFORE)] * count

    def simulated(effects: tuple[str, ...], noise: tuple[str, ...] = noise) -> Any:
        return simulated_test(case.imu, imu, plan, site, own, effects, noise, rate_hz)

    return with_effects(
        simulated,
        model_of(case.imu),
        draws,
        {"plan": plan, "latitude_deg": math.degrees(site.latitude_rad), "rate_hz": rate_hz, "coloured": list(noise)},
        clean=lambda: simulated((), ()),
    )


def _drawn(rng: np.random.Generator, span: tuple[float, float], noise: Sequence[NoiseTerm], fit: Fit) -> Truth:
    while True:
        truth = drawn_effect(rng, fit, span, options=True, noise=noise)
        if truth.family not in _TOLD_BEFORE:
            return truth


def _count(kind: str, rng: np.random.Generator, handheld: bool) -> int:
    if kind in {CLEAN, NOISE}:
        return 0
    if kind == ONE:
        return 1
    if kind == BELIEVED:
        return believed_count(rng)
    if kind == MANY:
        return int(rng.integers(5, 13))
    return int(rng.integers(1, _MOST_BY_HAND + 1 if handheld else 13)) if rng.random() < 0.7 else 0


def run(world: OneTest) -> tuple[Diagnosis, float]:
    """Diagnose, and take the processor's time (s)."""
    began = time.process_time()
    return diagnosed(world), time.process_time() - began


def score(world: OneTest, outcome: tuple[Diagnosis, float]) -> dict[str, Any]:
    """Every statement with its probability and whether it is right; what was found; errors over sigma."""
    found, seconds = outcome
    told, window = found.probabilities, found.found.posterior
    if told is None or window is None:
        raise ValueError("a diagnosis without probabilities")
    if found.verdict == Verdict.DATA_FAULT:
        raise DataError(f"no statement on physics: {found.sentence}")
    missing = [t for t in world.truths if t.sigmas >= _LEAST_SIGMAS]
    there, names = {_family(t) for t in missing}, {t.name for t in missing}
    noise = {
        f"{term.triad} {term.kind}" for term in seen_noise(window.board.as_stated, noise_terms(world.told["coloured"]))
    }
    p_family = {(f.family, f.sensor): f.probability for f in told.families}
    return {
        **world.told,
        "verdict": found.verdict,
        "sentence": found.sentence,
        "nothing": [(told.nothing, not missing)],
        "families": [(p, key in there) for key, p in p_family.items()],
        "effects": [(one.probability, one.name in names) for one in of_coefficients(window)],
        "noise": [(one.probability, f"{one.triad} {one.kind}" in noise) for one in told.noise],
        "wrong": [("/".join(key), p) for key, p in p_family.items() if key not in there and p > 0.5],
        "hidden": [
            {"text": t.text, "sigmas": t.sigmas, "p": p_family.get(_family(t), 0.0), "class": _of_class(found, t)}
            for t in world.truths
        ],
        "ahead": ahead(window, [t.name for t in world.truths]),
        "seconds": seconds,
        **errors(found.after, world.sensor),
    }


def _family(truth: Truth) -> tuple[str, str]:
    """Family and sensor of a hidden effect."""
    effect = resolve(truth.text.rpartition("=")[0])
    return family_of(next(c for c in split(effect) if c.parameter.name == truth.name))


def _of_class(found: Diagnosis, truth: Truth) -> float:
    """Probability of the told class that holds a hidden effect; 0 where none does."""
    shares = [found.may_be(int(column)) for column in found.found.chosen]
    return max((p for p, names in shares if any(s.name == truth.name for s in names)), default=0.0)


def bins(rows: Rows, what: str) -> list[tuple[int, float, float, float, float]]:
    """Hold statements against the truth, a tenth of probability at a time.

    Returns
    -------
    list of (int, float, float, float, float)
        Number of statements, mean of what was told, share that is right, and the ends of the 95 % interval of the share
        that what was told lets expect (1); of each bin that has statements.
    """
    every = np.array([one for row in rows for one in row.get(what, ())], dtype=float).reshape(-1, 2)
    out = []
    for k in range(_BINS):
        inside = (every[:, 0] >= k / _BINS) & ((every[:, 0] < (k + 1) / _BINS) | (k == _BINS - 1))
        p, right = every[inside].T
        if len(p):
            spread = 1.96 * float(np.sqrt(np.sum(p * (1.0 - p)))) / len(p)
            mean = float(p.mean())
            out.append((len(p), mean, float(right.mean()), max(mean - spread, 0.0), min(mean + spread, 1.0)))
    return out


def reliability_table(rows: Rows) -> Table:
    """One line a kind of statement and bin."""
    lines = [
        [what, str(n), f"{told:.3f}", f"{true:.3f}", f"{low:.2f} to {high:.2f}", _held(true, told, low, high)]
        for what in WHATS
        for n, told, true, low, high in bins(rows, what)
    ]
    return Table(("statement", "number", "told", "true", "expected (95 %)", "held"), lines)


def _held(true: float, told: float, low: float, high: float) -> str:
    return "yes" if low <= true <= high or abs(true - told) <= 0.05 else "no"


def _hits(low: float, high: float) -> Any:
    def cell(g: Group) -> str:
        told = [max(h["p"], h["class"]) for row in g.good for h in row["hidden"] if low <= h["sigmas"] < high]
        return of(sum(p > 0.5 for p in told), told)

    return cell


def _wrong(least: float) -> Any:
    return lambda g: of(sum(p > least for row in g.good for _, p in row["wrong"]), len(g.good))


def _missed(g: Group) -> str:
    return of(g.count(lambda row: row["ahead"] > MISSED), len(g.good))


def _beyond(g: Group) -> str:
    return of(g.count(lambda row: row["largest_z"] > 6.0), len(g.good))


STUDY = Study(
    "reliability",
    world,
    run,
    score,
    (
        ("IMU file", lambda g: g.key[0]),
        ("worlds", lambda g: g.key[1]),
        ("runs", lambda g: of(len(g.good), g.rows)),
        ("nothing > .5", lambda g: of(g.count(lambda row: row["nothing"][0][0] > 0.5), len(g.good))),
        ("8 sigma or more, told", _hits(8.0, np.inf)),
        ("5 to 8", _hits(5.0, 8.0)),
        ("below", _hits(0.0, 5.0)),
        ("wrong > .5", _wrong(0.5)),
        ("wrong > .9", _wrong(0.9)),
        ("RMS z", lambda g: f"{rms_z(g.good):.2f}" if g.good else ""),
        ("beyond 6", _beyond),
        ("missed", _missed),
        ("s", lambda g: f"{np.median([row['seconds'] for row in g.good]) if g.good else np.nan:.1f}"),
    ),
)


def kinds_of(imu: str, asked: Sequence[str]) -> list[str]:
    """Kinds of worlds of an IMU file: runs by hand are clean, mixed or believed, as no noise is drawn for them."""
    return [kind for kind in asked if imu != HANDHELD or kind in {CLEAN, MIXED, BELIEVED}]


def _rows(results: Results) -> list[Mapping[str, Any]]:
    return [row for each in results.values() for row in each if "error" not in row]


def picture(results: Results) -> str:
    """Draw told against true, all statements, as SVG."""
    rows = _rows(results)
    size, edge = 320.0, 40.0
    span = size - 2.0 * edge

    def at(x: float, y: float) -> tuple[float, float]:
        return edge + span * x, size - edge - span * y

    marks = []
    for what, colour in zip(WHATS, _COLOURS, strict=True):
        for n, told, true, low, high in bins(rows, what):
            (x, y), (_, bottom), (_, top) = at(told, true), at(told, low), at(told, high)
            ends = f'x1="{x:.1f}" y1="{bottom:.1f}" x2="{x:.1f}" y2="{top:.1f}"'
            marks.append(f'<line {ends} stroke="{colour}" opacity=".35"/>')
            marks.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"><title>{what}: {n}</title></circle>')
    for share in (0.0, 0.5, 1.0):
        x, y = at(share, share)
        marks.append(f'<text x="{x:.1f}" y="{size - edge + 14:.1f}" text-anchor="middle">{share:g}</text>')
        marks.append(f'<text x="{edge - 5:.1f}" y="{y + 4:.1f}" text-anchor="end">{share:g}</text>')
    (x0, y0), (x1, y1) = at(0.0, 0.0), at(1.0, 1.0)
    legend = "".join(
        f'<text x="{edge + 8}" y="{edge + 14 + 14 * k}" fill="{colour}">{what}</text>'
        for k, (what, colour) in enumerate(zip(WHATS, _COLOURS, strict=True))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size:.0f} {size:.0f}" font-family="sans-serif" '
        f'font-size="11"><rect width="{size}" height="{size}" fill="white"/>'
        f'<rect x="{x0}" y="{y1}" width="{span}" height="{span}" fill="none" stroke="#888"/>'
        f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="#888" stroke-dasharray="4 3"/>'
        f'{"".join(marks)}{legend}<text x="{size / 2}" y="{size - 10}" text-anchor="middle">probability told</text>'
        f'<text x="12" y="{size / 2}" text-anchor="middle" transform="rotate(-90 12 {size / 2})">share that is true'
        "</text></svg>\n"
    )


def page(results: Results, first: int) -> str:
    """Make the page, reliability.md, of results by IMU file and kind of worlds; `first` is the first seed."""
    rows = _rows(results)
    number = sum(len(row[what]) for row in rows for what in WHATS)
    top = head("reliability", runs=len(rows), first=first, statements=number)
    return top + STUDY.table(results, ("**all**", "")).markdown() + "\n" + reliability_table(rows).markdown()
