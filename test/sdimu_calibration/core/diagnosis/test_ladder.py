"""The ladder of refits: every model in one noise, so that their log-likelihoods compare."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest

from sdimu_calibration.core.diagnosis import ladder as module
from sdimu_calibration.core.diagnosis.ladder import Rung, figures_in_words, ladder
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.progress import silent

FLICKER = NoiseTerm("gyro", "flicker", size=1e-7)


@dataclass(frozen=True)
class FakeFit:
    """A fit that only knows in which noise it is."""

    noise: str
    learns_scatter: bool = False


def test_models_between_the_ends_are_in_the_noise_that_was_found(monkeypatch):
    """They learned a noise each, and their log-likelihoods stood hundreds from those of their neighbours."""
    monkeypatch.setattr(module, "extend", lambda *_, learn=True, **__: FakeFit("its own" if learn else "white"))
    monkeypatch.setattr(module, "in_found_noise", lambda _request, fit, _terms: replace(fit, noise="found"))
    monkeypatch.setattr(module, "outcome", lambda fit, **_: fit)
    monkeypatch.setattr(module, "held_out", lambda _: 1.0)
    monkeypatch.setattr(module, "Problem", lambda _: None)
    monkeypatch.setattr(module, "_rung", lambda _, fit, *__: fit)
    chosen = tuple(SimpleNamespace(effect=name, label=name) for name in ("a", "b", "c"))
    done = SimpleNamespace(chosen=chosen, evidence=None, found=SimpleNamespace(chosen=(0, 1, 2), noise=(FLICKER,)))
    rungs = ladder(None, FakeFit("found"), FakeFit("found"), done, silent)
    assert [fit.noise for fit in rungs] == ["found"] * 4


@pytest.mark.parametrize(
    ("scatter", "noise", "told"),
    [
        (None, (), "log-likelihood, nis and held-out: in white noise"),
        (
            None,
            (FLICKER,),
            "log-likelihood: of every model in the noise that was found (gyro bias instability (flicker))",
        ),
        ((1.0, 1.0, 1.0), (), "log-likelihood: with the scatter that each model learned"),
    ],
)
def test_it_is_said_in_which_noise_a_log_likelihood_is(scatter, noise, told):
    rung = Rung("", True, "", -10.0, 0.0, 1.5, 2.4, 8.0, 0.01, (), scatter)
    assert figures_in_words([rung], noise).startswith(told)
