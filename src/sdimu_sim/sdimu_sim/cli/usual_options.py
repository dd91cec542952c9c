"""Options of hidden effects beside those of the catalogue.

A file of its own: a simulated IMU must not read the catalogue, and `cli/options` is read by its node.
"""

from __future__ import annotations

from collections.abc import Iterable

from sdimu_calibration.core.data_error import DataError


def check_stated(texts: Iterable[str]) -> None:
    """Refuse a hidden effect without its options, with an example that has those of the catalogue.

    An estimate takes them by default. What is hidden must be stated: the simulator has no defaults.

    `texts`: effects as the option ``--effect`` has them.
    """
    from sdimu_calibration.core.effect_key import EffectKey, parse_key
    from sdimu_calibration.core.effects.selection import resolve
    from sdimu_sim.core.hidden import effect_names, size_unit

    for key in map(parse_key, texts):
        if key.options or key.name not in effect_names():
            continue
        try:
            usual = resolve(key.name).options
        except DataError:  # only the simulator knows it
            continue
        if usual:
            example = EffectKey(key.name, usual, key.size or f"1 {size_unit(key.name)}")
            raise DataError(
                f"effect '{key.name}': state {' and '.join(usual)}, such as '{example}' (as in the catalogue)"
            )
