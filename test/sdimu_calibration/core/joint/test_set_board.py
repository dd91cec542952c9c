"""A set in any noise of each recording: the same numbers as the evidence of the set, and as one recording alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.joint.rival_noises import rival_noises
from sdimu_calibration.core.joint.set_board import SetBoard
from sdimu_calibration.core.joint.set_evidence import set_evidence
from sdimu_calibration.core.joint.set_fit import SetOptions, asked_again, fit_set, with_reports
from sdimu_calibration.core.joint.set_noise import SetNoise
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.storage.files.config import load_model

from .conftest import here, short, unit_set

RAMP = "gyro_bias_ramp_x"
WALK = ("gyro_noise_random_walk=0.3 deg/h/sqrt(h)",)


def log_likelihood(one, weight, p):
    """Log likelihood of the coefficients in one noise, all other parameters left out."""
    A = one.J[:p, :p] + np.diag(weight)
    scale = 1.0 / np.sqrt(np.diag(A))
    A = A * np.outer(scale, scale)
    d = one.d[:p] * scale
    log_det = one.log_det + np.linalg.slogdet(A)[1] - 2.0 * np.sum(np.log(scale))
    return 0.5 * (one.explained + d @ np.linalg.solve(A, d) - log_det)


@pytest.mark.parametrize(("likeliest", "of_none", "chosen"), [(3, 20.0, 3), (14, 20.0, 14), (3, 90.0, 0)])
@pytest.mark.parametrize("begun", [0, 1, 12])
def test_a_size_far_from_that_of_the_fit_is_found_though_none_is_better_than_those_between(
    likeliest, of_none, chosen, begun
):
    board = object.__new__(SetBoard)
    board.rivals, board._counts = ((),), (1, 16)

    def score(choice):
        return of_none if choice[1] == 0 else 80.0 - 10.0 * abs(choice[1] - likeliest)

    assert board._best_at((0, begun), 1, score) == (0, chosen)


def test_noises_of_one_recording_are_as_likely_as_its_own_board_says():
    test = unit_set(35, [short()], noise=WALK).members[0].open()
    fit = solve(test, load_model("baseline"))
    evidence = fit.evidence([resolve(RAMP)])
    rivals = rival_noises(evidence, wander_in(evidence, fit.noise_terms))
    board = Board(evidence, np.empty(0, dtype=np.int64), frozenset(), Wander.of(evidence))
    p = evidence.coefficients
    white = log_likelihood(rivals[0], evidence.weight[:p], p)
    assert rivals[0].noise == NoiseModel()
    assert any(one.noise.terms for one in rivals)
    for one in rivals:
        # The prior of what the recording has for itself is common to all noises.
        assert log_likelihood(one, evidence.weight[:p], p) - white == pytest.approx(
            board.likelihood(one.noise), rel=1e-8, abs=1e-5
        )


@pytest.fixture(scope="module")
def full(options):
    """A fit of three recordings whose reports have the signature of a candidate, and their noises."""
    fit = fit_set(unit_set(35, [short()] * 3, noise=WALK).members, options, here)
    return with_reports(fit, asked_again(fit, here, candidates=(RAMP,), rivals=True))


def board_of(fit, candidate=RAMP):
    evidence = set_evidence(fit, split(resolve(candidate)))
    return SetBoard(fit, {}, evidence, np.array([len(evidence.weight)]), frozenset(), None)


def test_in_the_noise_of_the_reports_it_is_the_evidence_of_the_set(full):
    board = board_of(replace(full, reports=tuple(replace(r, rivals=()) for r in full.reports)))
    own, whole, keep = board.worked_out(NoiseModel()), board.evidence.information, board.keep
    unit = 1.0 / np.sqrt(np.diag(whole.J)[keep])
    np.testing.assert_allclose(
        own.J * np.outer(unit, unit), whole.J[np.ix_(keep, keep)] * np.outer(unit, unit), atol=1e-9
    )
    np.testing.assert_allclose(own.d * unit, whole.d[keep] * unit, atol=1e-7)
    assert not board.has_noises


def test_the_noise_of_each_recording_is_chosen_beside_those_of_the_others(full):
    board = board_of(full)
    ranked = board.noises(())
    score, best = ranked[0]
    assert isinstance(best, SetNoise)
    assert "gyro" in {t.triad for t in best.terms}
    assert len(best.own) == len(full.reports)
    offset, data = board.data(best)
    assert score == pytest.approx(offset + data.at(()).score)
    assert score > board.data(NoiseModel())[0] + 20.0
    assert all(score >= other for other, _ in ranked)


@pytest.fixture(scope="module")
def with_own_value(options):
    """A fit whose last recording has its own value of an effect that all have, and the noises of all."""
    members = unit_set(35, [short(stops=8)] * 3, (f"{RAMP}=10 deg/h/h",), noise=WALK).members
    model = replace(options.model, effects=(*options.model.effects, RAMP))
    wanted = SetOptions(model, local={"r2": (RAMP,)}, scopes={"gyro_bias_ramp": "unit"})
    fit = fit_set(members, wanted, here)
    return with_reports(fit, asked_again(fit, here, candidates=("accel_quadratic_x",), rivals=True))


def dense_likelihood(board, chosen):
    """Log likelihood of the model about zero, what differs from power-on to power-on as parameters of its own."""
    evidence, known = board.evidence, board.known
    first = len(known)
    weight = np.concatenate([evidence.weight, np.ones(len(board.rivals) * len(board._tau))])
    A, D, rest = np.diag(weight), np.zeros(len(weight)), 0.0
    for number, (rivals, place) in enumerate(zip(board.rivals, chosen, strict=True)):
        one = rivals[place]
        S = np.zeros((len(one.names), len(weight)))
        for row, name in enumerate(one.names):
            if name not in known:
                continue
            S[row, known.index(name)] = 1.0
            # The evidence has the value of one recording as its difference from that of all.
            shared = name.partition("@")[0]
            S[row, known.index(shared)] = 1.0
            for k, column in enumerate(board._varying):
                if known[column] == name:
                    S[row, first + number * len(board._tau) + k] = board._tau[k]
        J, d = one.J[np.ix_(one.columns, one.columns)], one.d[one.columns]
        A, D, rest = A + S.T @ J @ S, D + S.T @ d, rest + one.explained - one.log_det
    unit = 1.0 / np.sqrt(np.diag(A))
    A = A * np.outer(unit, unit)
    log_det = np.linalg.slogdet(A)[1] - 2.0 * np.sum(np.log(unit))
    return 0.5 * (rest + (D * unit) @ np.linalg.solve(A, D * unit) - log_det)


def test_a_noise_of_a_set_is_as_likely_as_all_its_parameters_at_once_say(with_own_value):
    board = board_of(with_own_value, "accel_quadratic_x")
    assert f"{RAMP}@r2" in board.known
    assert (board._tau > 0.0).any()
    white = dense_likelihood(board, board._white)
    noises = [noise for _, noise in board.noises(()) if isinstance(noise, SetNoise) and noise.chosen != board._white]
    assert noises
    for noise in noises:
        assert board.likelihood(noise) == pytest.approx(dense_likelihood(board, noise.chosen) - white, rel=1e-8)
