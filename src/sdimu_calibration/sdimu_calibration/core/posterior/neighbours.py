"""Loops over the models one move away from a model: some thousand for each of some thousand models of a window."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled

_ROUNDING = 1e-6
"""Log Bayes factor (1): a negative information that is rounding makes the log determinant negative by less."""


@compiled
def odds_beside(log_odds: Floats, alike: Ints, repeats: Bools, members: Ints, kin: float, most_drifts: int) -> Floats:
    """Log odds of each of q candidates beside those of a model.

    Parameters
    ----------
    log_odds : ndarray, shape (q,)
        Of each as the next one of a model of that size (1).
    alike : ndarray of int, shape (q, 4)
        Numbers that candidates share: parameter, twin, cause, and the axis of a drift (-1 of what is none).
    repeats : ndarray of bool, shape (q,)
        Whether a model may have several variants of the parameter.
    members : ndarray of int, shape (k,)
        Candidates of the model.
    kin : float
        Log odds of what has a cause that the model has (1).
    most_drifts : int
        Drifts of one axis that a model has at most.

    Returns
    -------
    ndarray, shape (q,)
        (1); -inf for what the model cannot have.
    """
    out = np.empty(len(log_odds))
    for q in range(len(log_odds)):
        taken, related, drifts = False, False, 0
        for b in members:
            related |= alike[b, 2] == alike[q, 2]
            drifts += alike[q, 3] >= 0 and alike[b, 3] == alike[q, 3]
            taken |= b == q or alike[b, 1] == alike[q, 1] or (alike[b, 0] == alike[q, 0] and not repeats[b])
        out[q] = -np.inf if taken or drifts >= most_drifts else log_odds[q] + (kin if related else 0.0)
    return out


@compiled
def additions(
    information: Floats, odds: Floats, positive: Bools, widths: Floats, least: float
) -> tuple[Ints, Ints, Floats]:
    """Candidates that add more than a limit to the log posterior of a model.

    Parameters
    ----------
    information : ndarray, shape (q, 2)
        Of each beside the model, and its pull, in units of the prior sizes.
    odds : ndarray, shape (q,)
        Log odds of each beside the model (1).
    positive : ndarray of bool, shape (q,)
        Whose size cannot be negative.
    widths : ndarray, shape (w, 2)
        Prior information of each width (1), and the log of its share (1).
    least : float
        Limit (1).

    Returns
    -------
    candidate, width : ndarray of int, shape (f,)
    gain : ndarray, shape (f,)
        What each adds (1).
    """
    candidate, width, gain = [0 for _ in range(0)], [0 for _ in range(0)], [0.0 for _ in range(0)]
    for q in range(len(odds)):
        pull = information[q, 1]
        if positive[q] and pull < 0.0:
            continue
        for w in range(len(widths)):
            a = information[q, 0] + widths[w, 0]
            score = 0.5 * (pull * pull) / a + widths[w, 1] + odds[q]
            # The logarithm takes longer than all else: it is taken where it can matter.
            if score + _ROUNDING > least:
                score -= 0.5 * np.log(a / widths[w, 0])
                if score > least:
                    candidate.append(q)
                    width.append(w)
                    gain.append(score)
    return np.array(candidate, dtype=np.int64), np.array(width, dtype=np.int64), np.array(gain)
