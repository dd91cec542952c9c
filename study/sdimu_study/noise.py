"""Noise with a memory: is the term named, is its size right, do the sigmas hold, is a hidden effect seen in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.noise_search import SEEN
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.coloured import KINDS, parse_noise
from sdimu_study.plans import PLANS
from sdimu_study.score import among, classes, errors
from sdimu_study.study import Group, Results, Study, head, rms_cell
from sdimu_study.worlds import OneTest, diagnosed, drawn_effect, drawn_place, rng_of, simulated_test, with_effects

WHITE = "white"
_INSTABILITY = {"gyro": to_si(0.01, "deg/h"), "accel": to_si(2.0, "ug")}
"""Bias instability (rad/s, m/s^2) where the IMU file states none: of navigation-grade sensors."""
_TAUS_S = (100.0, 1000.0)
"""Range of the time constant of Markov noise (s)."""
RATES_HZ = (20.0, 50.0)
"""Sample rates that are drawn (Hz)."""
_WALK_S = 1000.0
"""Averaging time (s) at which the Allan deviation of a random walk is the bias instability."""


@dataclass(frozen=True)
class NoiseCase:
    """Test of an IMU file in a kind of noise of `KINDS`, or in white noise alone.

    `sigmas` is the size of one effect to hide, in the sigma that the test gives it in the true noise; 0 hides none.
    """

    imu: str
    kind: str
    sigmas: float = 0.0


def world(case: NoiseCase, seed: int) -> OneTest:
    """Simulate a test in noise of data-sheet size."""
    rng, imu = rng_of(seed, case.imu, case.kind), load_imu(case.imu)
    (plan, site), rate_hz = drawn_place(rng, PLANS), float(rng.choice(RATES_HZ))
    noise = () if case.kind == WHITE else drawn_noise(imu, case.kind, rng)
    true = noise_terms(noise)
    span = (case.sigmas, case.sigmas)

    def simulated(effects: tuple[str, ...], noise: tuple[str, ...] = noise) -> Any:
        return simulated_test(case.imu, imu, plan, site, seed, effects, noise, rate_hz)

    return with_effects(
        simulated,
        load_model("baseline"),
        [lambda fit: drawn_effect(rng, fit, span, noise=true)] if case.sigmas else [],
        {"plan": plan, "rate_hz": rate_hz, "noise": list(noise)},
        clean=lambda: simulated((), ()),
    )


def score(world: OneTest, found: Diagnosis) -> dict[str, Any]:
    """Verdict, terms and effects that were found, errors over sigma of the coefficients."""
    truth = {key.triad: key.size for key in map(parse_noise, world.told["noise"])}
    named, stops = classes(found), found.evidence.times.stops
    right = [among(world.truth, one, stops) for one in named]
    terms = [
        {
            "triad": t.triad,
            "kind": t.kind,
            "size": t.size,
            "low": t.low,
            "high": t.high,
            "alike": list(t.alike),
            "true": truth.get(t.triad, 0.0),
        }
        for t in found.found.noise
    ]
    return {
        **world.told,
        "estimator": found.fit.estimator,
        "verdict": found.verdict,
        "terms": terms,
        "hidden": world.truth.text if world.truth else "",
        "named": any(right),
        "effects": [one[0] for one, true in zip(named, right, strict=True) if not true],
        **errors(found.after, world.sensor),
    }


def drawn_noise(imu: ImuSpecification, kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Noise of a kind for both triads, of the size that the IMU file states as bias instability."""
    if kind not in KINDS:
        raise ValueError(f"noise '{kind}': expected one of {', '.join(KINDS)}")
    stated = {"gyro": imu.gyro_bias_instability, "accel": imu.accel_bias_instability}
    out = []
    for triad, unit in (("gyro", "deg/h"), ("accel", "ug")):
        size, shown = stated[triad] or _INSTABILITY[triad], unit
        if kind == "random_walk":
            size, shown = 0.664 * size * math.sqrt(3.0 / _WALK_S), f"{unit}/sqrt(h)"
        tau = f"(tau={float(np.exp(rng.uniform(*np.log(_TAUS_S)))):.0f} s)" if kind == "markov" else ""
        out.append(f"{triad}_noise_{kind}{tau}={float(from_si(size, shown)):.5g} {shown}")
    return tuple(out)


def noise_terms(noise: Sequence[str]) -> list[NoiseTerm]:
    """Noise of a scenario as terms of the estimator, with their true sizes."""
    return [NoiseTerm(key.triad, key.kind, key.tau, key.size) for key in map(parse_noise, noise)]


def seen_noise(board: Board[LinearEvidence], true: Sequence[NoiseTerm]) -> list[NoiseTerm]:
    """Take the terms that a test of this noise can see. A term that gains less likelihood is left to its prior.

    Terms are added one by one, as a search adds them, with no effect estimated: whichever gains most beside those
    before it, down to a gain of `SEEN` in the mean over tests. The mean gain of log-likelihood is ``1/2 sum(l - log(1 +
    l))``, with l the eigenvalues of the covariance of the term times the information on the errors in the noise of the
    others.

    Parameters
    ----------
    board : Board
        Of a diagnosis of the test.
    true : sequence of NoiseTerm
        Noise of the test, with its true sizes.
    """
    if board.joint is None or board.wander is None:
        return list(true)
    J, cut, seen = board.joint.on_wander(*board.parameters(())).J, board.wander.cut, list[NoiseTerm]()
    while left := [term for term in true if term not in seen]:
        others = root_of(seen, cut)
        gain = [_mean_gain(J, root_of([term], cut), others) for term in left]
        best = int(np.argmax(gain))
        if gain[best] < SEEN:
            break
        seen.append(left[best])
    return seen


def _mean_gain(J: Floats, root: Floats, others: Floats) -> float:
    """Log-likelihood (1) that noise of a root gains in the mean beside that of other roots."""
    across = others.T @ J @ root
    taken = across.T @ np.linalg.solve(np.eye(others.shape[1]) + others.T @ J @ others, across)
    shown = np.maximum(np.linalg.eigvalsh(root.T @ J @ root - taken), 0.0)
    return 0.5 * float(np.sum(shown - np.log1p(shown)))


def _seen(g: Group) -> str:
    return f"{len({(k, t['triad']) for k, row in enumerate(g.good) for t in row['terms']})} of {2 * len(g.good)}"


def _terms(g: Group, own: bool = False) -> list[Any]:
    return [term for row in g.good for term in row["terms"] if not own or term["kind"] == g.key[1]]


def _named(g: Group) -> str:
    hidden = [row for row in g.good if row.get("hidden")]
    return f"{sum(row['named'] for row in hidden)} of {len(hidden)}"


def _false(g: Group) -> int:
    return g.count(lambda row: any(f"_{g.key[1]}_" not in label for label in row["effects"]))


STUDY = Study(
    "noise",
    world,
    diagnosed,
    score,
    (
        ("IMU file", lambda g: g.key[0]),
        ("noise", lambda g: g.key[1]),
        ("seen", _seen),
        ("class", lambda g: f"{sum(g.key[1] in (t['kind'], *t['alike']) for t in _terms(g))} of {len(_terms(g))}"),
        ("interval", lambda g: f"{sum(map(_inside, _terms(g, own=True)))} of {len(_terms(g, own=True))}"),
        ("named", _named),
        ("effects", lambda g: f"{_false(g)} of {len(g.good)}"),
        ("RMS z", lambda g: rms_cell(g.good)),
        ("refused", lambda g: str(len(g.rows) - len(g.good))),
    ),
)


def _inside(term: Any) -> bool:
    return bool(term["low"] <= term["true"] <= term["high"])


def page(results: Results, first: int) -> str:
    """Make the page, doc/noise.md, of results by IMU file and kind; `first` is the first seed."""
    return head("noise", runs=max(map(len, results.values())), first=first) + STUDY.table(results).markdown()
