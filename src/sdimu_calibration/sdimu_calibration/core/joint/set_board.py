"""The board of a set: its candidates in any noise of each recording, and the noises beside any choice of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
from scipy.linalg import solve_triangular

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.taken import nothing_taken
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.joint.function_prior import OF_FIT, FunctionPrior, OwnWeights
from sdimu_calibration.core.joint.rival_noises import InOneNoise, in_its_noise
from sdimu_calibration.core.joint.set_evidence import SetEvidence, own_values
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.set_noise import Layout, SetNoise
from sdimu_calibration.core.joint.unit_noise import kind_of, log_prior_of_set
from sdimu_calibration.core.noise_term import DRAWN, NoiseTerm
from sdimu_calibration.core.posterior.board import Board, InNoise
from sdimu_calibration.core.posterior.models import Members, gains
from sdimu_calibration.core.posterior.noise_models import NoiseModel, usual_sizes
from sdimu_calibration.core.posterior.prior import Prior, prior_of, twins

_NEAR = 6.0
"""Log posterior (1) behind the best noises up to which others are kept: effects beside them may change that much."""
_HOPELESS = 10.0
"""Log posterior (1) behind nothing from which a candidate of one recording is left out: a window holds what is within 7
of the best model, and all that is left out weighs a hundredth together."""
_MOST_KEPT = 100
"""Number of shares of power-ons that are kept at most: each is a matrix of all parameters, some megabytes."""
_SWEEPS = 4
"""Number of times that the noise of each recording is chosen in turn: they hang on each other by the coefficients
alone, which each recording knows well."""


@dataclass(frozen=True)
class Share:
    """What some recordings say in their noises, of parameters of the set.

    Attributes
    ----------
    J : ndarray, shape (k, k)
        Information on them (1/SI^2).
    d : ndarray, shape (k,)
        With all of them at zero (1/SI).
    explained, log_det : float
        As of `InOneNoise` (1).
    """

    J: Floats
    d: Floats
    explained: float
    log_det: float


class SetBoard(Board[SetEvidence]):
    """Evidence of a set in any noise of each recording, and what may be in a model.

    White noise in all recordings is `NoiseModel()`. What differs from power-on to power-on scatters as in the fit.

    Parameters
    ----------
    fit : SetFit
        Its reports have all columns of the evidence.
    told : mapping of str to str
        Names that the fit has for the first candidates of the evidence, which an earlier search told, by their labels.
    evidence, allowed, finer, wander, earlier : object
        As of `Board`; the noises are those of the reports.

    Attributes
    ----------
    known : tuple of str
        Coefficients of the fit in the order of the first columns of the evidence: of its model, then what was told.
    """

    def __init__(
        self,
        fit: SetFit,
        told: Mapping[str, str],
        evidence: SetEvidence,
        allowed: Ints,
        finer: frozenset[int],
        wander: Wander | None,
        earlier: Joint | None = None,
    ) -> None:
        super().__init__(evidence, allowed, finer, wander, earlier)
        self.rivals = tuple(r.rivals or (in_its_noise(r.reduction),) for r in fit.reports)
        self._groups = fit.groups
        self._names = tuple(told.get(name, name) for name in evidence.names)
        column = {name: k for k, name in enumerate(self._names)}
        self._own = [(column[fit.names[own]], column[fit.names[shared]]) for own, shared in own_values(fit.names)]
        self._varying = np.array([column[name] for name in fit.varying_names], dtype=np.int64)
        self._tau = np.array([t for own, t in zip(fit.varying.values(), fit.tau, strict=False) for _ in own])
        self.functions = FunctionPrior(fit.function, evidence, usual_sizes(evidence.imu))
        self._layout = Layout(len(self.rivals), len(self.functions.counts))
        # In a single rest a function is a bias.
        self._moves = [len(r.times.stops) > 1 for r in fit.reports]
        counts = self.functions.counts
        own = [counts if moves else (1,) * len(counts) for moves in self._moves]
        self._counts = self._layout.choice([*map(len, self.rivals)], counts, own)
        self._white = (0,) * len(self._counts)
        self._found: dict[Members, dict[tuple[int, ...], float]] = {}
        self._kept: dict[Hashable, tuple[Ints, Share]] = {}
        self._usual = usual_sizes(evidence.imu)
        self._told = len(evidence.weight) + np.arange(len(told))
        self.known = self._names[: len(evidence.weight) + len(told)]

    @property
    def has_noises(self) -> bool:
        """Whether noise with a memory, or a function, may be in a model."""
        return any(count > 1 for count in self._counts)

    @cached_property
    def use(self) -> Ints:
        """Columns of the evidence that may weigh in a model, in the order of the candidates of `data`.

        Of what may be in one recording alone, thousands, most are far behind in any noise, beside nothing as well as
        beside what was told.

        Returns
        -------
        ndarray of int, shape (u,)
        """
        return self.testable[self._hopeful]

    @cached_property
    def prior(self) -> Prior:
        """Prior of the candidates at `use`: as unlikely as they are among all that are testable."""
        J = self.evidence.information.given(self.evidence.model, self.evidence.weight).J[np.ix_(self.use, self.use)]
        return replace(self._prior_of_all.of(np.flatnonzero(self._hopeful)), twin=twins(J))

    @cached_property
    def _prior_of_all(self) -> Prior:
        first = len(self.evidence.weight)
        at = self.testable.tolist()
        return prior_of(
            [self.evidence.candidates[k - first] for k in at],
            [i for i, k in enumerate(at) if k in self.finer],
            found=self.evidence.found,
        )

    @cached_property
    def _hopeful(self) -> Bools:
        """Tell the testable candidates that may weigh in a model; shape of `testable`."""
        evidence, columns = self.evidence, self.testable
        first, odds = len(evidence.weight), self._prior_of_all.log_more([])
        recording = np.array([evidence.candidates[k - first].recording for k in columns.tolist()])
        size, none = self.sizes_of(columns), np.zeros(0)
        keep: Bools = (recording == "") | np.isin(columns, self._told)
        for known, free in ((evidence.model, none), (np.append(evidence.model, self._told), np.zeros(len(self._told)))):
            weight = np.concatenate([evidence.weight, free])
            for chosen in {self._white, self._likeliest(known, weight)}:
                for name in np.unique(recording[~keep]):
                    at = np.flatnonzero((recording == name) & ~keep)
                    one = self._total(chosen, np.concatenate([known, columns[at]]))
                    one.d[:first] += evidence.weight * evidence.shift
                    J, d = Information(one.J, one.d).diagonal_given(np.arange(len(known)), weight)
                    c, r = np.maximum(J[len(known) :], 0.0) * size[at] ** 2, d[len(known) :] * size[at]
                    gain = gains(c, r, np.zeros(len(c), dtype=bool)).max(axis=1) + odds[at]
                    keep[at[gain > -_HOPELESS]] = True
        return keep

    def _likeliest(self, columns: Ints, weight: Floats) -> tuple[int, ...]:
        """Choose the noise of each recording in turn until all stand, with some parameters in the model."""
        return max(self._tried(columns, weight).items(), key=lambda one: one[1])[0]

    def _tried(self, columns: Ints, weight: Floats) -> dict[tuple[int, ...], float]:
        """Log posterior (1) of the noises that were tried until that of each recording stood, over white noise.

        A common function and functions of each recording alone exclude each other, and no single change leads from one
        to the other: each is begun with.
        """
        self._kept = {}
        white = self._likelihood(self._white, columns, weight)
        found: dict[tuple[int, ...], float] = {}

        def score(chosen: tuple[int, ...]) -> float:
            if chosen not in found:
                found[chosen] = self._likelihood(chosen, columns, weight) - white + self._noise(chosen).log_prior
            return found[chosen]

        def swept(best: tuple[int, ...]) -> tuple[int, ...]:
            for _ in range(_SWEEPS):
                before = best
                for k in range(len(self._counts)):
                    best = self._best_at(best, k, score)
                if best == before:
                    break
            return best

        best = max(map(swept, self._begun()), key=score)
        # No single recording may ask for noise that all of them have: one kind after another.
        while True:
            together = max(self._of_unit(best), key=score, default=best)
            if not score(together) > score(best):
                return found
            best = swept(together)

    def _best_at(self, now: tuple[int, ...], place: int, score: Callable[[tuple[int, ...]], float]) -> tuple[int, ...]:
        """Choose the best for one place: any noise of a recording; of sizes none, or where those next to it are worse.

        The likelihood has one maximum in the size.
        """
        count = self._counts[place]
        if place < len(self.rivals) or count == 1:
            return max((_changed(now, place, other) for other in range(count)), key=score)
        best = now if now[place] else _changed(now, place, OF_FIT)
        for step in (-1, 1):
            # A size that none is better than may be far from the likeliest one.
            while 1 <= best[place] + step < count:
                next_one = _changed(best, place, best[place] + step)
                if score(next_one) <= score(best):
                    break
                best = next_one
        return max(best, _changed(now, place, 0), key=score)

    def _begun(self) -> list[tuple[int, ...]]:
        """Choices to begin with: white noise, beside no function, a common one, and one of each recording."""
        white, none = self._layout.noises(self._white), self._layout.common(self._white)
        if not none:
            return [self._white]
        of_fit = (OF_FIT,) * len(none)
        own = [of_fit if moves else none for moves in self._moves]
        common = self._layout.choice(white, of_fit, [none] * len(own))
        return [self._white, common, self._layout.choice(white, none, own)]

    def _of_unit(self, best: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Choices in which one kind of noise is in all recordings; each recording else as near `best` as it can."""
        kinds = [[{kind_of(t) for t in one.noise.terms if t.kind not in DRAWN} for one in own] for own in self.rivals]
        out = []
        for kind in sorted(set.intersection(*(set().union(*own) for own in kinds))):
            chosen = []
            for own, place in zip(kinds, best, strict=False):
                having = [j for j, one in enumerate(own) if kind in one]
                chosen.append(min(having, key=lambda j: (len(own[j] ^ (own[place] | {kind})), j)))
            out.append((*chosen, *best[len(self.rivals) :]))
        return out

    def squares(self, noise: NoiseModel) -> tuple[float, int]:
        """Sum of the squared residuals with no effect added, in a noise (1), and their number."""
        return (
            sum(own[0].squares for own in self.rivals)
            - self._total(self._chosen(noise), self.evidence.model).explained,
            sum(own[0].rows for own in self.rivals),
        )

    def worked_out(self, noise: NoiseModel) -> InNoise:
        """Work out the information in a noise as its model states it."""
        evidence, one = self.evidence, self._total(self._chosen(noise), self.keep)
        one.d[: len(evidence.weight)] += evidence.weight * evidence.shift
        return InNoise(one.J, one.d, np.zeros((0, 0)), nothing_taken(len(one.d)))

    def likelihood(self, noise: NoiseModel) -> float:
        """Log likelihood (1) of no effect in a noise, over that in white noise."""
        columns, weight = self.parameters(())
        return self._likelihood(self._chosen(noise), columns, weight) - self._likelihood(self._white, columns, weight)

    def noises(
        self, members: Members, tried: Sequence[NoiseTerm] | None = None, rival: float = -np.inf, brief: bool = False
    ) -> list[tuple[float, NoiseModel]]:
        """Noises that are probable beside a set of effects, each with the log posterior of both (1).

        That of each recording is chosen in turn until all stand; others are one change away from these.
        """
        del tried, rival, brief
        alone = self.data(NoiseModel())[1].at(members).of_any_sign
        if members not in self._found:
            self._found[members] = self._tried(*self.parameters(members))
        ranked = sorted(self._found[members].items(), key=lambda one: -one[1])
        every = [(alone + gain, self._noise(chosen)) for chosen, gain in ranked]
        near = [one for one in every if one[0] > every[0][0] - _NEAR]
        wanders = any(noise.wanders_alone for _, noise in near)
        return near if wanders else [*near, next(one for one in every if one[1].wanders_alone)]

    def instead_of(self, likeliest: NoiseModel, others: Sequence[NoiseModel]) -> Sequence[NoiseModel]:
        """None: each recording has the noises that were found in it by itself."""
        del likeliest, others
        return ()

    def noise_of(self, fit: SetFit, likeliest: NoiseModel) -> NoiseModel:
        """Find the noise in which a fit stands: of each recording that with the terms it has learned, near in size.

        Parameters
        ----------
        likeliest : NoiseModel
            Where a recording has learned terms that are not among its noises here, its noise in this one; functions of
            single recordings, where the fit has some.
        """
        chosen = list(self._chosen(likeliest))
        for k, report in enumerate(fit.reports):
            wanted = {term.identity: np.log(term.size) for term in report.noise}
            every = [{t.identity: np.log(t.size) for t in one.noise.terms} for one in self.rivals[k]]
            same = [j for j, one in enumerate(every) if one.keys() == wanted.keys()]
            chosen[k] = min(same, key=lambda j: sum(abs(every[j][i] - wanted[i]) for i in wanted), default=chosen[k])
        if fit.has_own_functions:
            alone = self._layout.own(self._chosen(likeliest))
            return self._noise(self._layout.choice(chosen[: len(self.rivals)], self._layout.common(self._white), alone))
        if fit.function is not None:
            none, size = self._layout.common(self._white), self.functions.nearest(fit.function.size)
            return self._noise(self._layout.choice(chosen[: len(self.rivals)], size, [none] * len(self.rivals)))
        return self._noise(tuple(chosen))

    def _noise(self, chosen: tuple[int, ...]) -> NoiseModel:
        own = tuple(rivals[place].noise for rivals, place in zip(self.rivals, chosen, strict=False))
        terms = tuple(t for noise in own for t in noise.terms)
        common, alone = self._layout.common(chosen), self._layout.own(chosen)
        prior = log_prior_of_set(own, self._usual) + sum(map(self.functions.log_prior, (common, *alone)))
        return SetNoise(terms, (), chosen, own, common, alone, prior)

    def _chosen(self, noise: NoiseModel) -> tuple[int, ...]:
        return noise.chosen if isinstance(noise, SetNoise) else self._white

    def _likelihood(self, chosen: tuple[int, ...], columns: Ints, weight: Floats) -> float:
        """Log likelihood (1) of some parameters in a noise, up to what is common to all noises."""
        evidence, one = self.evidence, self._total(chosen, columns)
        A, d = one.J + np.diag(weight), one.d
        d[: len(evidence.weight)] += evidence.weight * evidence.shift
        scale = 1.0 / np.sqrt(np.diag(A))
        L = np.linalg.cholesky(A * np.outer(scale, scale))
        z = solve_triangular(L, d * scale, lower=True)
        log_det = one.log_det + 2.0 * float(np.sum(np.log(np.diag(L)) - np.log(scale)))
        return 0.5 * (one.explained + float(z @ z) - log_det)

    def _total(self, chosen: tuple[int, ...], columns: Ints) -> Share:
        """Put together what all recordings say of the model's parameters and more columns, about the estimate."""
        # What is eliminated, and what stands for two parameters, is needed besides.
        more = [*self._varying.tolist(), *chain.from_iterable(self._own)]
        every = np.concatenate([columns, np.setdiff1d(more, columns)]).astype(np.int64)
        place = {self._names[column]: k for k, column in enumerate(every.tolist())}
        J, d = np.zeros((len(every), len(every))), np.zeros(len(every))
        explained = log_det = 0.0
        for number in range(len(self._groups)):
            at, one = self._of_group(number, chosen, place)
            J[np.ix_(at, at)] += one.J
            d[at] += one.d
            explained, log_det = explained + one.explained, log_det + one.log_det
        about = self._about(Share(J, d, explained, log_det), place, len(columns))
        return self._in_sizes(about, self._layout.common(chosen), columns)

    def _of_group(self, number: int, chosen: tuple[int, ...], place: Mapping[str, int]) -> tuple[Ints, Share]:
        """Put together what a power-on says in a choice, kept while the parameters are the same."""
        group, alone = self._groups[number], self._layout.own(chosen)
        own = tuple(alone[k] if alone else () for k in group)
        key = (number, tuple(chosen[k] for k in group), own, tuple(place))
        if key not in self._kept:
            if len(self._kept) >= _MOST_KEPT:
                self._kept.pop(next(iter(self._kept)))
            noises = [self.rivals[k][chosen[k]] for k in group]
            self._kept[key] = self._of_power_on(noises, [self.functions.own(sizes) for sizes in own], place)
        return self._kept[key]

    def _of_power_on(
        self, recordings: Sequence[InOneNoise], functions: Sequence[OwnWeights], place: Mapping[str, int]
    ) -> tuple[Ints, Share]:
        """Put together what the recordings of one power-on say of parameters.

        Parameters
        ----------
        functions : sequence of OwnWeights
            Of each recording alone.

        Returns
        -------
        at : ndarray of int, shape (w,)
            Places of those that these recordings know: of the thousands of a set a few hundred.
        share : Share
            On them; what the power-on may differ by is eliminated.
        """
        parts = [one.places(place) for one in recordings]
        at = np.unique(np.concatenate([wanted for wanted, _ in parts]))
        J, d = np.zeros((len(at), len(at))), np.zeros(len(at))
        explained = log_det = 0.0
        for k, (one, (wanted, own)) in enumerate(zip(recordings, parts, strict=True)):
            here = np.searchsorted(at, wanted)
            said = Share(one.J[np.ix_(own, own)], one.d[own], one.explained, one.log_det)
            if functions[k].labels:
                behind = {column: n for n, column in enumerate(wanted.tolist())}
                said = beside_own(
                    said, np.array([behind[place[label]] for label in functions[k].labels]), functions[k].size
                )
            J[np.ix_(here, here)] += said.J
            d[here] += said.d
            explained, log_det = explained + said.explained, log_det + said.log_det
        varying = np.array([place[self._names[column]] for column in self._varying.tolist()], dtype=np.int64)
        # A recording that has a value of its own does not know that of the others.
        known = np.isin(varying, at)
        v, tau = np.searchsorted(at, varying[known]), self._tau[known]
        if not len(v):
            return at, Share(J, d, explained, log_det)
        B, y = tau[:, None] * J[v], tau * d[v]
        M = np.eye(len(v)) + B[:, v] * tau
        X = np.linalg.solve(M, np.column_stack([B, y]))
        explained, log_det = explained + float(y @ X[:, -1]), log_det + float(np.linalg.slogdet(M)[1])
        return at, Share(J - B.T @ X[:, :-1], d - B.T @ X[:, -1], explained, log_det)

    def _about(self, one: Share, place: Mapping[str, int], count: int) -> Share:
        """Take the first parameters alone, about the estimate of the set, in the coordinates of its evidence."""
        J, d = one.J, one.d
        names = self._names
        for own, shared in ((place[names[own]], place[names[shared]]) for own, shared in self._own):
            J[shared] += J[own]
            J[:, shared] += J[:, own]
            d[shared] += d[own]
        J, d, point = J[:count, :count], d[:count], np.zeros(count)
        point[: len(self.evidence.weight)] = -self.evidence.shift
        moved = J @ point
        return Share(J, d - moved, one.explained + float(2.0 * d @ point - point @ moved), one.log_det)

    def _in_sizes(self, one: Share, sizes: Sequence[int], columns: Ints) -> Share:
        """Give the weights of the function the prior of some sizes; all of them are among the columns."""
        change = self.functions.change(sizes)
        place = {column: k for k, column in enumerate(columns.tolist())}
        at = np.array([place[k] for k in change.columns.tolist()], dtype=np.int64)
        one.J[at, at] += change.more
        one.d[at] -= change.more * change.values
        squares = float(change.more @ change.values**2)
        return Share(one.J, one.d, one.explained - squares, one.log_det + change.log_det)


def beside_own(said: Share, at: Ints, size: Floats) -> Share:
    """Integrate parameters that one recording has for itself: they add to those at some places.

    Parameters
    ----------
    at : ndarray of int, shape (m,)
        Places of the parameters to which they add.
    size : ndarray, shape (m,)
        One-sigma of each (SI).
    """
    B, y = size[:, None] * said.J[at], size * said.d[at]
    M = np.eye(len(at)) + B[:, at] * size
    L = np.linalg.cholesky(M)
    X = solve_triangular(L, np.column_stack([B, y]), lower=True)
    z, log_det = X[:, -1], 2.0 * float(np.log(np.diag(L)).sum())
    X = X[:, :-1]
    return Share(said.J - X.T @ X, said.d - X.T @ z, said.explained + float(z @ z), said.log_det + log_det)


def _changed(chosen: tuple[int, ...], place: int, other: int) -> tuple[int, ...]:
    return (*chosen[:place], other, *chosen[place + 1 :])
