"""A set of effects as one error model: layout of the state, prior, regressors, sensor error."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.body_frame import frame_jacobian
from sdimu_calibration.core.effects.effect import Effect, Parameter
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import get
from sdimu_calibration.core.effects.registry import names as registered
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, StatedPrior
from sdimu_calibration.core.units import parse_unit


@dataclass(frozen=True)
class ImuModel:
    """The sensor error model that a filter estimates; it shows the filter numbers only."""

    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    """Length p."""
    channel: Ints
    parameter: Ints
    """`channel`, `parameter`: sensor axis (0-2 gyro, 3-5 accelerometer) and state of each regressor column, shape (m,).
    """
    prior: Floats
    """Shape (p,). One-sigma (SI) that the filter starts from; zero for a coefficient that is known."""
    mean: Floats
    """Mean of the prior (SI), shape (p,)."""
    restated: Bools
    """Shape (p,). The model states the prior of this coefficient by itself: it is taken as it is."""
    stated: Floats
    """Shape (p,). One-sigma (SI) of the specification; `prior` where it was not found too narrow."""
    decay_rate: Floats
    """Shape (p,). 1/s; zero for constants and random walks."""
    drive: Floats
    """Shape (p,). Variance that a random walk adds per second (SI^2/s); zero for all other parameters."""
    correlation: Floats
    """Of the priors (dimensionless), shape (p, p)."""
    serving: int = 0
    """How many of the parameters, the last ones, are no coefficients of a sensor: they are estimated along, as
    attitudes are, and not reported."""

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficient names in the order of the state."""
        return tuple(p.name for p in self.parameters)

    @property
    def fixed(self) -> Bools:
        """Coefficients that are known, shape (p,)."""
        return np.asarray(self.prior == 0.0)

    @property
    def weight(self) -> Floats:
        """Prior information of each coefficient (1/SI^2), shape (p,): finite for those that are known, too."""
        return np.asarray(self._sigma**-2.0)

    @property
    def prior_covariance(self) -> Floats:
        """Covariance of the priors (SI), shape (p, p); rows and columns of known coefficients are zero."""
        return np.asarray(self.correlation * np.outer(self.prior, self.prior))

    @property
    def prior_information(self) -> Floats:
        """Inverse of the covariance of the priors (1/SI^2), shape (p, p): finite for known coefficients, too."""
        return np.asarray(np.linalg.inv(self.correlation) / np.outer(self._sigma, self._sigma))

    @property
    def _sigma(self) -> Floats:
        """One-sigma of each coefficient in a least squares (SI), shape (p,)."""
        return np.where(self.fixed, _KNOWN * self.stated, self.prior)

    def regressors(self, motion: Motion) -> Floats:
        """Regressor columns of all effects.

        Parameters
        ----------
        motion : Motion
            n cycles.

        Returns
        -------
        ndarray, shape (n, m)
            Change of sensor axis `channel` (rad/s or m/s^2) per SI unit of parameter `parameter`.
        """
        none = np.empty((len(motion.t), 0))
        return np.concatenate([none, *(effect.regressors(motion) for effect in self.effects)], axis=1)

    def errors(self, values: Floats, coefficients: Floats) -> Floats:
        """Sensor errors in b, measured minus true: gyros (rad/s), then accelerometers (m/s^2), shape (n, 6).

        Parameters
        ----------
        values : ndarray, shape (n, m)
            As `regressors` gives them.
        coefficients : ndarray, shape (p,)
            SI.
        """
        return np.asarray(_errors(np.ascontiguousarray(values), self.channel, coefficients[self.parameter]))

    def sized(self, coefficients: Floats) -> list[tuple[Effect, Floats]]:
        """List the effects that have a coefficient, each with what its regressors do to the sensor axes.

        Parameters
        ----------
        coefficients : ndarray, shape (p,)
            SI.

        Returns
        -------
        list of (Effect, ndarray of shape (k, 6))
            The map takes the k terms of the effect to its errors (rad/s, m/s^2).
        """
        out, first = [], 0
        for effect in self.effects:
            terms = np.arange(first, first + len(effect.terms))
            first += len(terms)
            size = coefficients[self.parameter[terms]]
            if size.any():
                to_axes = np.zeros((len(terms), 6))
                to_axes[np.arange(len(terms)), self.channel[terms]] = size
                out.append((effect, to_axes))
        return out


def errors_along(sized: Sequence[tuple[Effect, Floats]], motion: Motion) -> Floats:
    """Sensor errors in b, without the regressors of all effects beside each other: those take most of the time.

    Parameters
    ----------
    sized : sequence of (Effect, ndarray of shape (k, 6))
        As `ImuModel.sized` gives them (rad/s, m/s^2).
    motion : Motion
        n cycles.

    Returns
    -------
    ndarray, shape (n, 6)
        As of `ImuModel.errors` (rad/s, m/s^2).
    """
    out = np.zeros((len(motion.t), 6))
    for effect, to_axes in sized:
        out += effect.regressors(motion) @ to_axes
    return out


_KNOWN = 1e-6
"""Sigma of a known coefficient in a least squares, a multiple of the specification's: data never say that much."""


@compiled
def _errors(values: Floats, channel: Ints, size: Floats) -> Floats:
    """Sum of the columns (n, m) of each sensor axis, each times its size (m,)."""
    out = np.zeros((values.shape[0], 6))
    for k in range(values.shape[0]):
        for j in range(values.shape[1]):
            out[k, channel[j]] += values[k, j] * size[j]
    return out


def build(effects: Sequence[str | Effect], imu: ImuSpecification) -> ImuModel:
    """Put effects together.

    `effects`: registered names, or effects of one's own; `imu`: gives the priors: by effect name, else the effect's own
    for the IMU's grade.
    """
    chosen = told_apart([selection.resolve(e) for e in effects])
    _check_priors(chosen, imu)
    seen: set[str] = set()
    channel: list[int] = []
    parameter: list[int] = []
    parameters: list[Parameter] = []
    prior: list[float] = []
    decay: list[float] = []
    drive: list[float] = []
    for effect in chosen:
        for p in effect.parameters:
            if p.name in seen:
                raise DataError(f"'{p.name}' of effect '{effect.name}' stands twice in the model")
            seen.add(p.name)
        channel += [t.channel for t in effect.terms]
        parameter += [len(parameters) + t.parameter for t in effect.terms]
        parameters += effect.parameters
        for size in prior_sizes(effect, imu):
            if size is None or not size > 0:
                raise DataError(f"{imu.place}: no prior for effect '{effect.name}': add it under prior:")
            prior.append(size)
        decay += [1.0 / effect.decay_s if effect.decay_s else 0.0] * len(effect.parameters)
        drive += [effect.random_walk.get(imu.grade, 0.0) ** 2] * len(effect.parameters)
    return ImuModel(
        chosen,
        tuple(parameters),
        np.array(channel, dtype=np.int64),
        np.array(parameter, dtype=np.int64),
        np.array(prior),
        np.zeros(len(prior)),
        np.zeros(len(prior), dtype=bool),
        np.array(prior),
        np.array(decay),
        np.array(drive),
        np.eye(len(prior)),
    )


def restate(sensors: ImuModel, priors: Sequence[StatedPrior]) -> ImuModel:
    """Take the priors that a model states of single coefficients."""
    prior, mean, restated = sensors.prior.copy(), sensors.mean.copy(), sensors.restated.copy()
    for one in priors:
        if one.name not in sensors.names:
            near = difflib.get_close_matches(one.name, sensors.names, n=1)
            hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(sensors.names[:3])}, ..."
            raise DataError(f"prior of {one.name}: the model has no such coefficient ({hint})")
        k = sensors.names.index(one.name)
        unit = sensors.parameters[k].display_unit
        _check_unit(f"prior of {one.name}", one.unit, unit)
        if not one.sigma >= 0.0 or not np.isfinite([one.mean, one.sigma]).all():
            raise DataError(f"prior of {one.name}: expected a value, and a sigma above zero, or zero to fix it")
        if restated[k]:
            raise DataError(f"prior of {one.name}: stands twice (state it once)")
        prior[k], mean[k], restated[k] = one.sigma, one.mean, True
    return replace(sensors, prior=prior, mean=mean, restated=restated)


def with_references(sensors: ImuModel, references: Sequence[tuple[Effect, float]]) -> ImuModel:
    """Put what the test believes of its site behind the coefficients, as parameters that serve.

    `references`: of one parameter each, with the sigma that is stated of it (SI); those that the model has are passed
    over.
    """
    new = [(effect, sigma) for effect, sigma in references if effect.parameters[0].name not in sensors.names]
    if not new:
        return sensors
    sigmas = np.array([sigma for _, sigma in new])
    return with_serving(sensors, [effect for effect, _ in new], sigmas, np.zeros(len(new)), np.zeros(len(new)))


def with_serving(
    sensors: ImuModel, effects: Sequence[Effect], sigmas: Floats, decay_rate: Floats, drive: Floats
) -> ImuModel:
    """Put effects behind the coefficients, as parameters that serve.

    Parameters
    ----------
    effects : sequence of Effect
        With n parameters in all.
    sigmas, decay_rate, drive : ndarray, shape (n,)
        Prior (SI), decay (1/s) and variance that a second adds (SI^2/s) of each parameter.
    """
    first = len(sensors.parameters) + np.cumsum([0, *(len(effect.parameters) for effect in effects)])
    terms = [(t.channel, at + t.parameter) for at, effect in zip(first, effects, strict=False) for t in effect.terms]
    channel, parameter = np.array(terms, dtype=np.int64).T
    count, before = len(sigmas), len(sensors.prior)
    correlation = np.eye(before + count)
    correlation[:before, :before] = sensors.correlation
    return ImuModel(
        (*sensors.effects, *effects),
        (*sensors.parameters, *(parameter for effect in effects for parameter in effect.parameters)),
        np.concatenate([sensors.channel, channel]),
        np.concatenate([sensors.parameter, parameter]),
        np.concatenate([sensors.prior, sigmas]),
        np.concatenate([sensors.mean, np.zeros(count)]),
        np.concatenate([sensors.restated, np.ones(count, dtype=bool)]),
        np.concatenate([sensors.stated, sigmas]),
        np.concatenate([sensors.decay_rate, decay_rate]),
        np.concatenate([sensors.drive, drive]),
        correlation,
        sensors.serving + count,
    )


def prior_sigmas(sensors: ImuModel, frame: str) -> dict[str, float]:
    """Sigmas (SI) before the data by coefficient, as they are published: in a body frame.

    Misalignments of both triads add up there.
    """
    J = frame_jacobian(sensors.names, frame)
    sigma = np.sqrt(np.diag(J @ sensors.prior_covariance @ J.T))
    return dict(zip(sensors.names, sigma.tolist(), strict=True))


def prior_size(effect: Effect, imu: ImuSpecification) -> float | None:
    """One-sigma (SI) of an effect, of which nothing is known parameter by parameter; None where nothing states it.

    The IMU file states it of the effect, of a larger one that contains it, or of a smaller one that has all of its
    parameters; else the grade does.
    """
    return next((imu.prior[name] for name in _stating(effect) if name in imu.prior), effect.prior.get(imu.grade))


def prior_sizes(effect: Effect, imu: ImuSpecification) -> list[float | None]:
    """One-sigma (SI) of each parameter of an effect, as of `prior_size`: a smaller one may have some of them alone."""
    return [prior_size(one, imu) for one in _each(effect)]


def has_stated_priors(effect: Effect, imu: ImuSpecification) -> list[bool]:
    """Whether the IMU's own file, and not its grade, states the prior of each parameter of an effect."""
    return [any(name in imu.prior for name in _stating(one)) for one in _each(effect)]


def _each(effect: Effect) -> Sequence[Effect]:
    """Each parameter as an effect of its own; the same effect as often where it has no parts that differ."""
    return effect.singles if effect.parts else (effect,) * len(effect.parameters)


def _stating(effect: Effect) -> tuple[str, ...]:
    """Names under which an IMU file may state the prior of all parameters of an effect, the first one first."""
    smaller = {effect.parts.get(p.name, "") for p in effect.parameters}
    return (effect.family or effect.name, effect.contained_in, *(smaller if len(smaller) == 1 else ()))


def _check_priors(chosen: Sequence[Effect], imu: ImuSpecification) -> None:
    """Refuse a prior that no effect would read, and one in a unit that is not its effect's."""
    units = {e.family or e.name: e.parameters[0].display_unit for e in (*map(get, registered()), *chosen)}
    for name, unit in imu.prior_units.items():
        if name not in units:
            near = difflib.get_close_matches(name, units, n=1)
            hint = f"did you mean {near[0]}?" if near else "the prior of an effect of your own stands in its own file"
            raise DataError(f"{imu.place}: prior.{name}: no effect of this name ({hint})")
        _check_unit(f"{imu.place}: prior.{name}", unit, units[name])


def _check_unit(where: str, unit: str, expected: str) -> None:
    """Refuse a wrong unit, and none where the expected one is more than a number: 40 is not 40 ppm."""
    if not unit and expected != "1":
        raise DataError(f"{where}: has no unit (expected something like '1 {expected}')")
    if parse_unit(unit or "1").dimension != parse_unit(expected).dimension:
        raise DataError(f"{where}: '{unit}' is a wrong unit (expected something like '1 {expected}')")


def told_apart(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Give parameters a name of their own where two variants of one effect have the same.

    Of two steps of one bias, say: the later one takes the name with the variant behind it.
    """
    out: list[Effect] = []
    names: set[str] = set()
    labels: set[str] = set()
    for effect in effects:
        # The same variant once more keeps its name, for `build` to refuse.
        parameters = tuple(
            replace(p, name=label) if p.name in names and label not in labels else p
            for p, label in zip(effect.parameters, effect.labels, strict=True)
        )
        names |= {p.name for p in parameters}
        labels |= set(effect.labels)
        out.append(replace(effect, parameters=parameters))
    return tuple(out)
