"""A coefficient of the unit that has another value in one recording: after a shock, a repair, at another temperature.

In the rows of the recording a change shows as the coefficient itself does, in all others not at all. Without such a
candidate a search takes what physics it has for it: ramps and steps of one recording.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import REFERENCES, Effect
from sdimu_calibration.core.effects.imu_model import prior_size
from sdimu_calibration.core.evidence.candidate import OWN, Candidate
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.same_unit import SHARE
from sdimu_calibration.core.joint.scope import split_tag, tagged
from sdimu_calibration.core.specification import ImuSpecification, Model

_CHANGE = "_change"
"""End of the name of the family of the changes of an effect's coefficients."""


def stable_effects(model: Model, varying: Collection[str]) -> list[Effect]:
    """Effects of a model whose coefficients are those of the unit in all recordings.

    Parameters
    ----------
    varying : collection of str
        Names of the effects that may differ from power-on to power-on.
    """
    effects = [selection.resolve(e) for e in model.effects]
    stable = [e for e in effects if e.scope == "unit" and (e.family or e.name) not in varying]
    # The key of a coefficient alone is what a recording is fitted with.
    return [e for e in stable if e.group != REFERENCES and not e.file and e.title != OWN]


def change_of(label: str, imu: ImuSpecification) -> Candidate:
    """Candidate of a coefficient that is another one in a recording.

    Parameters
    ----------
    label : str
        Key of the coefficient, with the name of the recording behind it.
    """
    key, recording = split_tag(label)
    effect = selection.resolve(key)
    size = prior_size(effect, imu)
    changed = replace(
        effect,
        family=f"{effect.family or effect.name}{_CHANGE}",
        title=f"{effect.title}, changed",
        prior={} if size is None else {imu.grade: SHARE * size},
        scope="recording",
        nearer=None,
    )
    return Candidate(changed, changed.family, label, recording)


def is_change(key: str) -> bool:
    """Whether an effect that was found in one recording is the change of a coefficient: it is one of the unit."""
    return selection.resolve(key).scope == "unit"


def with_changes(reports: Sequence[Report], stable: Sequence[Effect]) -> tuple[list[Report], list[str]]:
    """Give recordings the columns of coefficients that may have changed in them.

    Of two recordings the second one alone: that a coefficient is another one in the first shows the same.

    Parameters
    ----------
    stable : sequence of Effect
        Effects whose coefficients are the same in all recordings.

    Returns
    -------
    reports : list of Report
        In the same order.
    labels : list of str
        Of the changes, with the names of the recordings.
    """
    keys = {p.name: label for e in stable for p, label in zip(e.parameters, e.labels, strict=True)}
    out, labels = [], []
    for place, report in enumerate(reports):
        if len(reports) == 2 and not place:
            out.append(report)
            continue
        own = [(k, keys[n]) for k, n in enumerate(report.reduction.names) if n in keys]
        new = [tagged(label, report.name) for _, label in own]
        rows = report.reduction
        same = [k for k, _ in own]
        A = np.hstack([rows.A, rows.A[:, same]])
        rivals = [
            replace(one, names=(*one.names, *new), columns=np.concatenate([one.columns, one.columns[same]]))
            for one in report.rivals
        ]
        changed = replace(rows, A=A, labels=(*rows.labels, *new))
        out.append(replace(report, reduction=changed, rivals=tuple(rivals)))
        labels += new
    return out, labels
