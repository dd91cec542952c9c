"""The gauge: coefficients and their covariance in a named body frame.

Turning the body frame changes gyro misalignment, accelerometer misalignment and attitude together and changes no
measurement. The filter works in the frame of its prior; what is reported stands in a frame that the
sensors themselves define (doc/conventions.md).

Values turn exactly: with the matrices M_a = I + scale + misalignment, M_g likewise and the mass unbalance G, a body
frame turned by R has M_a R', M_g R', G R'. The covariance turns to first order, which for misalignments of
arcminutes is right to 1e-3 of a sigma.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError

FRAMES = ("accelerometer_triad", "prior")

# (row, column, sign) of each misalignment in the error matrix, from the equations of doc/conventions.md.
_MISALIGNMENT = {
    "xy": (0, 2, -1.0), "xz": (0, 1, 1.0),
    "yx": (1, 2, 1.0), "yz": (1, 0, -1.0),
    "zx": (2, 1, -1.0), "zy": (2, 0, 1.0),
}  # fmt: skip
_UNBALANCE = {"dx": (0, 0), "qx": (0, 1), "dy": (1, 1), "qy": (1, 0), "dz": (2, 2), "qz": (2, 1)}
_PINNED = ("xy", "xz", "yx")
_STEP = 1e-5
"""Step of central differences (SI of any coefficient): error 1e-10 by curvature, 1e-11 by rounding."""


def _places(triad: str) -> dict[str, tuple[int, int, float]]:
    """Coefficient name -> place and sign in the error matrix of a triad (``gyro`` or ``accel``)."""
    places = {f"{triad}_scale_{a}": (i, i, 1.0) for i, a in enumerate("xyz")}
    places.update({f"{triad}_misalignment_{pair}": place for pair, place in _MISALIGNMENT.items()})
    return places


def _matrix(places: dict[str, tuple[int, int, float]], names: Sequence[str], values: Floats) -> Floats:
    """Error matrix (3, 3) of coefficients (p,): those without a name here are zero."""
    E = np.zeros((3, 3))
    for name, (row, column, sign) in places.items():
        if name in names:
            E[row, column] = sign * values[list(names).index(name)]
    return E


def _read_back(E: Floats, places: dict[str, tuple[int, int, float]], names: Sequence[str], values: Floats) -> None:
    """Put the elements of an error matrix (3, 3) into the coefficients (p,) that have a name here, in place."""
    for name, (row, column, sign) in places.items():
        if name in names:
            values[list(names).index(name)] = sign * E[row, column]


def _turn_to_triad(M: Floats) -> Floats:
    """Rotation R for which ``M @ R.T`` is lower triangular with a positive diagonal."""
    Q, U = np.linalg.qr(M.T)
    sign = np.sign(np.diag(U))
    return np.asarray((Q * sign).T)


def values_in_frame(names: Sequence[str], values: Floats, frame: str) -> Floats:
    """Coefficients in a named body frame.

    With ``M_a.T = Q U`` (QR decomposition, diagonal of U positive) the turn R = Q' makes ``M_a R'`` lower triangular:
    that is what `accelerometer_triad` asks for. Without all three pinned misalignments in the model nothing is turned.

    Parameters
    ----------
    names : sequence of str, length p
    values : ndarray, shape (p,)
        In the frame of the prior, SI.
    frame : str
        One of `FRAMES`.

    Returns
    -------
    ndarray, shape (p,)
        In `frame`, SI. Coefficients other than scale, misalignment and mass unbalance are as given.

    Raises
    ------
    DataError
        When the frame has no such name.
    """
    _check(frame)
    out = np.array(values, dtype=float)
    if frame == "prior" or not set(pinned_names()) <= set(names):
        return out
    places = _places("accel")
    M_a = np.eye(3) + _matrix(places, names, out)
    R = _turn_to_triad(M_a)
    for triad in ("accel", "gyro"):
        places = _places(triad)
        M = np.eye(3) + _matrix(places, names, np.asarray(values, dtype=float))
        _read_back(M @ R.T - np.eye(3), places, names, out)
    unbalance = {f"gyro_mass_unbalance_{k}": (r, c, 1.0) for k, (r, c) in _UNBALANCE.items()}
    _read_back(_matrix(unbalance, names, np.asarray(values, dtype=float)) @ R.T, unbalance, names, out)
    return out


def frame_jacobian(names: Sequence[str], frame: str) -> Floats:
    """First-order map of coefficient errors from the prior's frame to another, about coefficients of zero.

    A turn of the body frame by a small angle t adds -[t x] to both error matrices; t is the combination of the
    pinned misalignments that makes them zero.

    Parameters
    ----------
    names : sequence of str, length p
    frame : str
        One of `FRAMES`.

    Returns
    -------
    ndarray, shape (p, p)
        Change of each coefficient in `frame` (row) per change of each in the prior's frame (column), SI; the identity
        where nothing turns.

    Raises
    ------
    DataError
        When the frame has no such name.
    """
    _check(frame)
    p = len(names)
    T = np.eye(p)
    if frame == "prior" or not set(pinned_names()) <= set(names):
        return T
    index = {n: i for i, n in enumerate(names)}
    turns = np.zeros((p, 3))
    for triad in ("accel", "gyro"):
        for name, (row, column, sign) in _places(triad).items():
            if name in index and row != column:
                for k in range(3):
                    turns[index[name], k] = -sign * _levi_civita(row, column, k)
    pinned = [index[n] for n in pinned_names()]
    return np.asarray(T - turns @ np.linalg.inv(turns[pinned]) @ T[pinned])


def jacobian_at(names: Sequence[str], values: Floats, frame: str) -> Floats:
    """Differentiate `values_in_frame` by central differences: `frame_jacobian` about coefficients that are not small.

    With misalignments of degrees the covariance must turn about the values themselves: about zero, the free turn of the
    prior's frame leaks into the scale factors and makes their sigmas many times too large.

    Parameters
    ----------
    names : sequence of str, length p
    values : ndarray, shape (p,)
        In the frame of the prior, SI.
    frame : str
        One of `FRAMES`.

    Returns
    -------
    ndarray, shape (p, p)
        Change of each coefficient in `frame` (row) per change of each in the prior's frame (column), SI; rows of pinned
        coefficients are zero.

    Raises
    ------
    DataError
        When the frame has no such name.
    """
    values = np.asarray(values, dtype=float)
    J = np.empty((len(values), len(values)))
    for j in range(len(values)):
        step = np.zeros(len(values))
        step[j] = _STEP
        ahead = values_in_frame(names, values + step, frame)
        J[:, j] = (ahead - values_in_frame(names, values - step, frame)) / (2.0 * _STEP)
    if frame != "prior" and set(pinned_names()) <= set(names):
        J[[list(names).index(name) for name in pinned_names()]] = 0.0  # by definition; rounding leaves 1e-11
    return J


def _levi_civita(row: int, column: int, k: int) -> float:
    """Entry (row, column) of the cross-product matrix of unit vector k."""
    return float(-np.linalg.det(np.eye(3)[[row, column, k]]))


def pinned_names(frame: str = FRAMES[0]) -> tuple[str, ...]:
    """Coefficients that a body frame makes zero by definition."""
    return () if frame == "prior" else tuple(f"accel_misalignment_{pair}" for pair in _PINNED)


def _check(frame: str) -> None:
    if frame not in FRAMES:
        raise DataError(f"unknown body_frame '{frame}' (there are: {', '.join(FRAMES)})")
