"""The gauge: coefficients and their covariance in a named body frame.

Turning the body frame changes gyro misalignment, accelerometer misalignment and attitude together and changes no
measurement. What is reported stands in a frame that the sensors themselves define (doc/conventions.md); the passes work
in the accelerometers' frame where the model can turn, else in that of its priors.

Values turn exactly: with the matrices M_a = I + scale + misalignment, M_g likewise and the mass unbalance G, a body
frame turned by R has M_a R', M_g R', G R'. The covariance turns to first order, which for misalignments of
arcminutes is right to 1e-3 of a sigma.

With misalignments that are polynomials of the temperature the frame is that of the accelerometers at every temperature:
``M_a(T) R(T)'`` is lower triangular. It turns against the case while the temperature changes, and the gyros see that
turn as a bias that follows the rate of the temperature. Estimators work in the frame at T0, where nothing but the prior
holds that turn, and no square of it is lost; what they report is turned. A turn in the second power of the temperature
is seen as a bias that follows ``(T - T0) dT/dt``, one in the third as one that follows ``(T - T0)^2 dT/dt``.

Everywhere `names` are those of the p coefficients of a model, and `frame` is one of `FRAMES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import skew

FRAMES = ("accelerometer_triad", "prior")

# (row, column, sign) of each misalignment in the error matrix, from the equations of doc/conventions.md.
_MISALIGNMENT = {
    "xy": (0, 2, -1.0),
    "xz": (0, 1, 1.0),
    "yx": (1, 2, 1.0),
    "yz": (1, 0, -1.0),
    "zx": (2, 1, -1.0),
    "zy": (2, 0, 1.0),
}
_UNBALANCE = {"dx": (0, 0), "qx": (0, 1), "dy": (1, 1), "qy": (1, 0), "dz": (2, 2), "qz": (2, 1)}
_PINNED = ("xy", "xz", "yx")
_BY_TEMPERATURE = ("_temperature", "_temperature_squared", "_temperature_cubed")
"""Powers of the temperature, as they stand in the names of coefficients."""
_SEEN_AS_BIAS = tuple(f"gyro_bias_temperature_rate{power}" for power in ("", "_linear", "_quadratic"))
"""How gyros see a frame that turns with the temperature: biases that follow its rate, times powers of T - T0. The rate
of a turn in the second power of the temperature is linear in it, and so on."""
_STEP = 1e-5
"""Step of central differences (SI of any coefficient): error 1e-10 by curvature, 1e-11 by rounding."""


@cache
def _places(triad: str, power: str = "") -> dict[str, tuple[int, int, float]]:
    """Coefficient name -> place and sign in the error matrix of a triad (``gyro`` or ``accel``), or a power of it."""
    places = {f"{triad}_scale{power}_{a}": (i, i, 1.0) for i, a in enumerate("xyz")}
    places.update({f"{triad}_misalignment{power}_{pair}": place for pair, place in _MISALIGNMENT.items()})
    return places


@cache
def _unbalance_places(power: str = "") -> dict[str, tuple[int, int, float]]:
    """Coefficient name -> place in the matrix of the mass unbalance, or a power of it."""
    return {f"gyro_mass_unbalance{power}_{k}": (row, column, 1.0) for k, (row, column) in _UNBALANCE.items()}


_TRIADS = (partial(_places, "accel"), partial(_places, "gyro"))
TRIAD_NAMES = tuple(name for triad in _TRIADS for name in triad())
"""Coefficients that an exchange of axes turns into each other: scale factors and misalignments of both triads."""


def _matrix(places: dict[str, tuple[int, int, float]], names: Sequence[str], values: Floats) -> Floats:
    """Error matrices (..., 3, 3) of coefficients (..., p): those without a name here are zero."""
    E, at = np.zeros((*values.shape[:-1], 3, 3)), _found(tuple(places.items()), tuple(names))
    E[..., at.row, at.column] = at.sign * values[..., at.place]
    return E


class _Found(NamedTuple):
    """Coefficients that a model has: their places in it, and place and sign in an error matrix."""

    place: Ints
    row: Ints
    column: Ints
    sign: Floats


@cache
def _found(places: tuple[tuple[str, tuple[int, int, float]], ...], names: tuple[str, ...]) -> _Found:
    """Look the names of places up in those of a model, once: a test that runs asks every second."""
    index = {name: place for place, name in enumerate(names)}
    rows = [(index[name], *at) for name, at in places if name in index]
    place, row, column, sign = np.array(rows).reshape(-1, 4).T
    return _Found(place.astype(np.int64), row.astype(np.int64), column.astype(np.int64), sign)


def _read_back(E: Floats, places: dict[str, tuple[int, int, float]], names: Sequence[str], values: Floats) -> None:
    """Put the elements of error matrices (..., 3, 3) into the coefficients (..., p) that have a name here, in place."""
    at = _found(tuple(places.items()), tuple(names))
    values[..., at.place] = at.sign * E[..., at.row, at.column]


def _turned_to_triad(M: Floats) -> Floats:
    """Transpose R' of the rotation for which ``M R'`` (..., 3, 3) is lower triangular with a positive diagonal."""
    Q, U = np.linalg.qr(np.swapaxes(M, -1, -2))
    return np.asarray(Q * np.sign(np.diagonal(U, axis1=-2, axis2=-1))[..., None, :])


def values_in_frame(names: Sequence[str], values: Floats, frame: str) -> Floats:
    """Coefficients in a named body frame.

    With ``M_a.T = Q U`` (QR decomposition, diagonal of U positive) the turn R = Q' makes ``M_a R'`` lower triangular:
    that is what `accelerometer_triad` asks for. Without all three pinned misalignments in the model nothing is turned.

    Parameters
    ----------
    values : ndarray, shape (..., p)
        In the frame of the prior, SI.

    Returns
    -------
    ndarray, shape (..., p)
        In `frame`, SI. Coefficients other than scale, misalignment and mass unbalance, their polynomials, and what the
        gyros see of a frame that turns with the temperature are as given.
    """
    _check(frame)
    given = np.asarray(values, dtype=float)
    out = given.copy()
    if frame == "prior" or not set(pinned_names()) <= set(names):
        return out
    back = _turned_to_triad(np.eye(3) + _matrix(_places("accel"), names, given))
    for triad in ("accel", "gyro"):
        places = _places(triad)
        _read_back((np.eye(3) + _matrix(places, names, given)) @ back - np.eye(3), places, names, out)
    unbalance = _unbalance_places()
    _read_back(_matrix(unbalance, names, given) @ back, unbalance, names, out)
    for power in _turning_powers(names):
        for places in (_places("accel", power), _places("gyro", power), _unbalance_places(power)):
            _read_back(_matrix(places, names, given) @ back, places, names, out)
    return at_every_temperature(names, out)


def at_every_temperature(names: Sequence[str], values: Floats) -> Floats:
    """Go from the accelerometers' frame at T0 to that at every temperature.

    ``R(T)' = exp([theta(T) x])``, theta a polynomial of T - T0, so that ``M_a(T) R(T)'`` is lower triangular in every
    power of the model. Without the misalignments of both triads in a power, theta has not that power.

    Parameters
    ----------
    values : ndarray, shape (..., p)
        In the accelerometers' frame at T0 (SI).

    Returns
    -------
    ndarray, shape (..., p)
        SI; the given ones where the model has no turn with the temperature.
    """
    turning = _turning_powers(names)
    given = np.asarray(values, dtype=float)
    out = given.copy()
    if not turning:
        return out
    powers = ("", *_BY_TEMPERATURE)
    groups = [
        [_places("accel", power) for power in powers],
        [_places("gyro", power) for power in powers],
        [_unbalance_places(power) for power in powers],
    ]
    parts = [[_matrix(places, names, given) for places in group] for group in groups]
    for triad in (0, 1):
        parts[triad][0] = np.eye(3) + parts[triad][0]
    theta = np.zeros((len(powers), *given.shape[:-1], 3))
    turns = [np.broadcast_to(np.eye(3), parts[0][0].shape)]
    for k, power in enumerate(_BY_TEMPERATURE, start=1):
        turns.append(_products(theta, k))
        if power in turning:
            theta[k] = _pinning(parts[0][0], _of_power(parts[0], turns, k))
            turns[k] = turns[k] + _cross(theta[k])
        for group, part in zip(groups, parts, strict=True):
            _read_back(_of_power(part, turns, k), group[k], names, out)
    for k, seen in enumerate(_seen(parts[1], turns, theta)):
        for i, axis in enumerate("xyz"):
            name = f"{_SEEN_AS_BIAS[k]}_{axis}"
            if name in names:
                out[..., names.index(name)] -= seen[..., i]
    return out


def _seen(gyro: list[Floats], turns: list[Floats], theta: Floats) -> list[Floats]:
    """Powers of what the gyros see of the turning frame, ``M_g(T) R(T)' w``, per rate of the temperature, (..., 3).

    The frame turns with ``w = theta' - theta x theta' / 2`` per kelvin (Bortz 1971), to second order of theta.
    """
    rate = [theta[1], 2.0 * theta[2], 3.0 * theta[3] - 0.5 * np.cross(theta[1], theta[2])]
    return [
        np.asarray(sum(np.einsum("...ij,...j->...i", _of_power(gyro, turns, k - n), rate[n]) for n in range(k + 1)))
        for k in range(len(rate))
    ]


def _cross(theta: Floats) -> Floats:
    """Cross-product matrices (..., 3, 3) of vectors (..., 3)."""
    return np.asarray(np.einsum("...k,kij->...ij", theta, np.array([skew(axis) for axis in np.eye(3)])))


def _products(theta: Floats, k: int) -> Floats:
    """Power k of ``exp([theta(T) x])`` without what is linear in theta_k, (..., 3, 3); theta (4, ..., 3) by power."""
    one, two = _cross(theta[1]), _cross(theta[2])
    if k == 1:
        return np.zeros_like(one)
    return np.asarray(0.5 * one @ one if k == 2 else 0.5 * (one @ two + two @ one) + one @ one @ one / 6.0)


def _of_power(part: Sequence[Floats], turns: Sequence[Floats], k: int) -> Floats:
    """Power k of the product of two polynomials, (..., 3, 3)."""
    return np.asarray(sum(part[k - j] @ turns[j] for j in range(k + 1)))


def _pinning(constant: Floats, moved: Floats) -> Floats:
    """Return the theta (..., 3) for which ``moved + constant [theta x]`` (..., 3, 3) is lower triangular."""
    row, column = np.triu_indices(3, 1)
    columns = np.stack([(constant @ skew(axis))[..., row, column] for axis in np.eye(3)], axis=-1)
    return np.asarray(-np.linalg.solve(columns, moved[..., row, column][..., None])[..., 0])


def temperature_jacobian(names: Sequence[str], values: Floats) -> Floats:
    """Differentiate `at_every_temperature` by central differences.

    Parameters
    ----------
    values : ndarray, shape (p,)
        In the accelerometers' frame at T0 (SI).

    Returns
    -------
    ndarray, shape (p, p)
        Rows of pinned coefficients are zero; the identity where nothing turns with the temperature.
    """
    powers = _turning_powers(names)
    if not powers:
        return np.eye(len(values))
    J = _differences(lambda rows: at_every_temperature(names, rows), values)
    J[[names.index(name) for power in powers for name in _pinned(power)]] = 0.0
    return J


def _differences(of: Callable[[Floats], Floats], values: Floats) -> Floats:
    """Central differences of a map of rows (k, p), at values (p,), shape (p, p)."""
    steps = _STEP * np.eye(len(values))
    ahead, behind = (of(np.asarray(values, dtype=float) + sign * steps) for sign in (1.0, -1.0))
    return np.asarray((ahead - behind).T / (2.0 * _STEP))


def frame_jacobian(names: Sequence[str], frame: str, by_temperature: bool = True) -> Floats:
    """First-order map of coefficient errors from the prior's frame to another, about coefficients of zero.

    A turn of the body frame by a small angle t adds -[t x] to both error matrices; t is the combination of the
    pinned misalignments that makes them zero.

    Parameters
    ----------
    by_temperature : bool
        The frame at every temperature; else that at T0.

    Returns
    -------
    ndarray, shape (p, p)
        Change of each coefficient in `frame` (row) per change of each in the prior's frame (column), SI; the identity
        where nothing turns.
    """
    _check(frame)
    p = len(names)
    T = np.eye(p)
    if frame == "prior" or not set(pinned_names()) <= set(names):
        return T
    index = {n: i for i, n in enumerate(names)}
    out = T.copy()
    for power in ("", *(_turning_powers(names) if by_temperature else ())):
        turns = _turns(power, index)
        pinned = [index[n] for n in _pinned(power)]
        out -= turns @ np.linalg.inv(turns[pinned]) @ T[pinned]
    return out


def _turns(power: str, index: Mapping[str, int]) -> Floats:
    """Change of every coefficient (p,) per small turn of the body frame about its axes, or per power of it, (p, 3)."""
    turns = np.zeros((len(index), 3))
    for triad in ("accel", "gyro"):
        for name, (row, column, sign) in _places(triad, power).items():
            if name in index and row != column:
                for k in range(3):
                    turns[index[name], k] = -sign * _levi_civita(row, column, k)
    if power in _BY_TEMPERATURE:
        order = _BY_TEMPERATURE.index(power)
        for k, axis in enumerate("xyz"):
            if f"{_SEEN_AS_BIAS[order]}_{axis}" in index:
                turns[index[f"{_SEEN_AS_BIAS[order]}_{axis}"], k] = order + 1.0
    return turns


def jacobian_at(names: Sequence[str], values: Floats, frame: str) -> Floats:
    """Differentiate `values_in_frame` by central differences: `frame_jacobian` about coefficients that are not small.

    With misalignments of degrees the covariance must turn about the values themselves: about zero, the free turn of the
    prior's frame leaks into the scale factors and makes their sigmas many times too large.

    Parameters
    ----------
    values : ndarray, shape (p,)
        In the frame of the prior, SI.

    Returns
    -------
    ndarray, shape (p, p)
        Change of each coefficient in `frame` (row) per change of each in the prior's frame (column), SI; rows of pinned
        coefficients are zero.
    """
    J = _differences(lambda rows: values_in_frame(names, rows, frame), values)
    if pinned_in(names, frame):
        J[[list(names).index(name) for name in pinned_in(names, frame)]] = 0.0  # by definition; rounding leaves 1e-11
    return J


def read_in_axes(names: Sequence[str], values: Floats, sigma: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Scale factors and misalignments of a unit as they are once its axes are read as those of others.

    Error matrices M of both triads become ``P' M P``; then the frame is that of the accelerometers again.

    Parameters
    ----------
    names : sequence of str, length p
        `TRIAD_NAMES`, in any order.
    values, sigma : ndarray, shape (p,)
        In the accelerometers' frame (SI). Correlations are taken for zero.
    axes : ndarray, shape (3, 3)
        Signed permutation P: row i has the axis of the others that is axis i of the unit.

    Returns
    -------
    values, sigma : ndarray, shape (p,)
        SI; sigmas of pinned coefficients are zero.
    """

    def read(rows: Floats) -> Floats:
        out = rows.copy()
        for triad in _TRIADS:
            places = triad()
            _read_back(axes.T @ _matrix(places, names, rows) @ axes, places, names, out)
        return values_in_frame(names, out, FRAMES[0])

    J = _differences(read, values)
    J[[list(names).index(name) for name in pinned_in(names)]] = 0.0
    return read(np.asarray(values, dtype=float)), np.sqrt(J**2 @ np.asarray(sigma) ** 2)


def _levi_civita(row: int, column: int, k: int) -> float:
    """Entry (row, column) of the cross-product matrix of unit vector k."""
    return float(-np.linalg.det(np.eye(3)[[row, column, k]]))


def pinned_names(frame: str = FRAMES[0]) -> tuple[str, ...]:
    """Coefficients that a body frame makes zero by definition."""
    return () if frame == "prior" else _pinned("")


def pinned_in(names: Sequence[str], frame: str = FRAMES[0]) -> tuple[str, ...]:
    """Coefficients of a model that a body frame makes zero by definition, powers of the temperature with them.

    None where the model cannot turn: it has not all of `pinned_names`.
    """
    if frame == "prior" or not set(pinned_names()) <= set(names):
        return ()
    return tuple(name for power in ("", *_turning_powers(names)) for name in _pinned(power))


def check_priors(stated: Sequence[str], names: Sequence[str], frame: str) -> None:
    """Refuse priors of coefficients that a body frame makes zero; `stated` are those whose prior a model states."""
    for name in set(stated) & set(pinned_in(names, frame)):
        raise DataError(
            f"prior of {name}: the body frame of the accelerometers makes it zero by definition: state no prior of it"
        )


def turning_names(names: Sequence[str], frame: str) -> frozenset[str]:
    """Coefficients whose values depend on the body frame: a prior of one is stated in the frame of the report."""
    if not pinned_in(names, frame):
        return frozenset()
    powers = ("", *_BY_TEMPERATURE)
    matrices = [places(power) for power in powers for places in (*_TRIADS, _unbalance_places)]
    seen = {f"{bias}_{axis}" for bias in _SEEN_AS_BIAS for axis in "xyz"} if _turning_powers(names) else set()
    return frozenset(names) & (seen | {name for places in matrices for name in places})


def _pinned(power: str) -> tuple[str, ...]:
    return tuple(f"accel_misalignment{power}_{pair}" for pair in _PINNED)


def _turning_powers(names: Sequence[str]) -> tuple[str, ...]:
    """Find the powers of the temperature with which a common turn of both triads is free.

    Where the model holds the gyros' axes still, those of the accelerometers turn against them: nothing is free then.
    """
    return _free_powers(tuple(names))


@cache
def _free_powers(names: tuple[str, ...]) -> tuple[str, ...]:
    known = set(names)
    return tuple(
        power
        for power in _BY_TEMPERATURE
        if {*_pinned(power), *(f"gyro_misalignment{power}_{pair}" for pair in _MISALIGNMENT)} <= known
    )


def _check(frame: str) -> None:
    if frame not in FRAMES:
        raise DataError(f"unknown body_frame '{frame}' (there are: {', '.join(FRAMES)})")
