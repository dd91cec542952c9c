"""Times and time constants between those of the scan: a model that has one near the right one asks for it."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.models import Members
from sdimu_calibration.core.posterior.noise_models import NoiseModel

_HOPED = 8.0
"""Log posterior (1) that a candidate may be short of a place in the model for its time constant to be sharpened:
between two of a scan it may gain as much."""
_MOST_HOPED = 3
"""Number of candidates outside the model that are sharpened at most: each takes signatures of its own."""


def sharpened(board: Board[E], members: Members, noise: NoiseModel) -> tuple[Board[E], list[Members]] | None:
    """Put a time or time constant between those of the scan into a model; None where none is worth it.

    Returns
    -------
    board : Board
        With the finer variant.
    starts : list of tuple of (int, int)
        The model with it in the place of the one that it is a variant of; and without others on the same sensor that
        have variants, too: beside a wrong time constant they stand for the difference.
    """
    columns = board.columns(members)
    first = len(board.evidence.weight)
    effects = [board.evidence.candidates[column - first].effect for column in columns]
    worth = -board.data(noise)[1].at(members).drops()
    for place in [int(k) for k in np.argsort(-worth)]:
        if columns[place] in board.finer or effects[place].nearer is None:
            continue
        sensors = {term.channel for term in effects[place].terms}
        apart = [
            k
            for k, effect in enumerate(effects)
            if k == place or effect.nearer is None or not sensors & {term.channel for term in effect.terms}
        ]
        beside = tuple(members[k] for k in apart)
        effect = board.finer_variant(beside, apart.index(place), noise)
        if effect is None or effect.labels[0] in board.evidence.names:
            continue
        finer, added = _with_finer(board, effect)
        places = {int(k): i for i, k in enumerate(finer.use.tolist())}
        if added not in places:
            continue
        columns[place] = added
        both = [range(len(members)), apart] if len(apart) < len(members) else [range(len(members))]
        return finer, [tuple(sorted((places[columns[k]], members[k][1]) for k in kept)) for kept in both]
    return None


def hoped(
    board: Board[E], members: Members, noise: NoiseModel, asked: set[str]
) -> tuple[Board[E], list[Members]] | None:
    """Put a time or time constant between those of the scan beside a model that its neighbours nearly enter.

    `asked` are the labels of those that were looked at; board and starts as of `sharpened`, None where none is worth
    it.
    """
    gains = board.data(noise)[1].at(members).gains()
    first = len(board.evidence.weight)
    for number in np.argsort(-gains.max(axis=1)).tolist():
        if not gains[number].max() > -_HOPED or len(asked) >= _MOST_HOPED:
            break
        column = int(board.use[number])
        candidate = board.evidence.candidates[column - first]
        if candidate.effect.nearer is None or column in board.finer or candidate.label in asked:
            continue
        asked.add(candidate.label)
        own = (number, int(np.argmax(gains[number])))
        effect = board.finer_variant((*members, own), len(members), noise)
        if effect is None or effect.labels[0] in board.evidence.names:
            continue
        finer, added = _with_finer(board, effect)
        places = {int(k): i for i, k in enumerate(finer.use.tolist())}
        if added in places:
            kept = [(places[c], m[1]) for c, m in zip(board.columns(members), members, strict=True)]
            return finer, [tuple(sorted((*kept, (places[added], own[1])))), tuple(sorted(kept))]
    return None


def _with_finer(board: Board[E], effect: Effect) -> tuple[Board[E], int]:
    """Add a variant between those of the scan: the board with it, and its column."""
    evidence = board.evidence.with_effects([effect])
    added = len(evidence.names) - 1
    return Board(evidence, np.append(board.allowed, added), board.finer | {added}, board.wander, board.joint), added
