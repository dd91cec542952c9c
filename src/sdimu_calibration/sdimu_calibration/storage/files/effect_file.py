"""A user's own effects: YAML files (format ``sdimu-effect/1``) and plug-ins; and any effect by what people write.

A file holds formulas by sensor, the parameters in which they are linear, and fixed quantities: doc/diagnosis.md.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, cast

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.candidates import USUAL_TURN, own_equation, without
from sdimu_calibration.core.effect_key import EffectKey, parse_key
from sdimu_calibration.core.effects import registry, selection
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.effect import CHANNELS, Effect, Parameter, Term
from sdimu_calibration.core.effects.formula_variables import VALUES
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.expression import (
    TEMPERATURE_NAMES,
    VARIABLES,
    Expression,
    equation_text,
    parse_expression,
    reciprocal_unit,
)
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.units import UnitError, parse_unit
from sdimu_calibration.storage.files.config import find_config, load_model
from sdimu_calibration.storage.files.effect_schema import (
    FORMAT,
    VARIABLE_UNITS,
    EffectFile,
    constants_of,
    formulas_of,
    prior_of,
    read_effect_file,
    si_unit,
    vanishes,
)

ENTRY_POINTS = "sdimu_calibration.effects"
"""Group of entry points that name callables without arguments, each returning an `Effect`."""
_GRADES = ("navigation", "tactical", "mems")


def load_effect(path: Path) -> tuple[Effect, ...]:
    """Read an effect of one's own.

    `path`: YAML file of format ``sdimu-effect/1``. Gives one effect a parameter, all of one family: each has a prior of
    its own. Parameters are named ``NAME_PARAMETER``.
    """
    file = read_effect_file(path)
    if file.name in registry.names():
        raise DataError(f"{path}: name: '{file.name}' is a registered effect (choose another)")
    try:
        return tuple(replace(effect, file=str(path)) for effect in _effects(file))
    except (DataError, UnitError) as error:
        raise DataError(f"{path}: {error}") from error


def find_effects(text: str) -> tuple[Effect, ...]:
    """Find effects by a canonical key: a registered name, a coefficient, one with options, an equation, or a file.

    An equation is ``SENSOR: FORMULA``, as a diagnosis proposes it (``gyro_x: ey^2``) or in the names of an effect
    file (``accel_z: ax * wty``); its one parameter is the factor before it. ``my.yaml`` gives all parameters of a file,
    ``my.yaml:k`` one.
    """
    key = parse_key(text)
    selection.refuse_size(key)
    if key.file:
        return _of_file(*key.file)
    if key.equation:
        return (_equation(*key.equation),)
    register_plugins()
    return (selection.resolve(text),)


def effect_files(keys: Iterable[str]) -> list[Path]:
    """Return the files that keys of effects name."""
    return [Path(file[0]) for key in keys if (file := parse_key(key).file)]


def _of_file(path: str, parameter: str) -> tuple[Effect, ...]:
    effects = load_effect(Path(path))
    if not parameter:
        return effects
    chosen = tuple(e for e in effects if e.name == f"{e.family}_{parameter}")
    if not chosen:
        known = ", ".join(e.name.removeprefix(f"{e.family}_") for e in effects)
        raise DataError(f"{path}: parameters.{parameter}: no such parameter (there are: {known})")
    return chosen


def effects_of_result(model: Sequence[str], named: Sequence[str]) -> tuple[Effect, ...]:
    """Effects of a result (their keys: `model`) that are in no catalogue: those `named`, and equations it states."""
    register_plugins()
    equations = [text for text in model if parse_key(text).equation and text not in named]
    return tuple(effect for text in (*named, *equations) for effect in find_effects(text))


def _equation(sensor: str, formula: str) -> Effect:
    """Effect ``d(sensor) = k formula``; k as large as a bias may be where the formula comes to its usual size."""
    text = str(EffectKey(f"{sensor}: {formula}"))
    proposed = own_equation(text)
    if proposed:
        return proposed
    _refuse_coefficient(sensor, formula)
    bias = GYRO_BIAS if sensor.startswith("gyro") else ACCEL_BIAS
    shown = bias.parameters[0].display_unit
    try:
        about = parse_expression(equation_text(formula), frozenset(VARIABLES))
        dimension = about.dimension(VARIABLE_UNITS)
        if vanishes(about, {}):
            raise DataError("is zero, whatever its variables are; name what the error grows with")
        below = reciprocal_unit(dimension)
        usual = USUAL_TURN ** max(0, -int(dimension.get("s", 0))) if "m" not in dimension else 1.0
        file = EffectFile.model_validate(
            {
                "format": FORMAT,
                "name": "equation",
                "expressions": {sensor: f"k * ({about.text})"},
                "parameters": {"k": {"unit": shown + below, "prior": f"1 {shown}{below}"}},
            }
        )
        (effect,) = _effects(file)
    except (DataError, UnitError) as error:
        raise DataError(f"equation '{text}': {error}") from error
    prior = {grade: size / usual for grade, size in bias.prior.items()}
    parameter = replace(effect.parameters[0], name=text)
    return replace(effect, name=text, family=text, parameters=(parameter,), prior=prior)


def _refuse_coefficient(sensor: str, formula: str) -> None:
    """Refuse an equation with its coefficient written before or behind the formula, and say what to write."""
    for pattern in _WITH_COEFFICIENT:
        found = pattern.fullmatch(formula)
        if found and found["name"] not in VARIABLES:
            raise DataError(
                f"equation '{sensor}: {formula}': '{found['name']}' is none of the variables; the coefficient of an "
                f"equation is implied: write '{sensor}: {found['rest']}' (several coefficients: an effect file, as in "
                "doc/diagnosis.md)"
            )


_WITH_COEFFICIENT = (
    re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*\*\s*(?P<rest>[^*].*?)\s*"),
    re.compile(r"\s*(?P<rest>.*[^*\s])\s*\*\s*(?P<name>[A-Za-z_]\w*)\s*"),
)
"""A name times a formula, and a formula times a name."""


def extended_model(name: str, added: Sequence[str]) -> Model:
    """Read a model and add effects to it; what it has of one already is not added twice.

    `name`: model by name or path; its effects may be paths of YAML files too, seen from the folder of the model.
    `added`: as for `find_effects`.
    """
    model = load_model(name)
    folder = find_config("model", name).parent
    effects: list[Effect] = []
    for text in model.effects:
        effects += _parts(find_effects(_beside(folder, text)), effects)
    begun = len(effects)
    for text in added:
        effects += new_parts(find_effects(text), effects, text)
    # A model names its effects; `imu_model.build` takes an effect itself as well.
    whole = cast("tuple[str, ...]", tuple(effects))
    return replace(model, effects=whole, found=whole[begun:])


def added_to(name: str, effects: Sequence[str], files: Sequence[str] = ()) -> list[str]:
    """Effects, equations and files that came to the model with which a result began.

    `name`: that model; `effects`: keys of all effects of the result; `files`: of the user's own among them
    (`Origin.effect_files`). What no file has any more is left out: nothing else knows its equation.
    """
    begun = {label for effect in extended_model(name, ()).effects for label in selection.resolve(effect).labels}
    own = _adding(files, effects)
    added: dict[str, None] = {}
    for key in effects:
        with suppress(DataError):
            text = own.get(key, key)
            labels = {label for effect in find_effects(text) for label in effect.labels}
            added |= {} if labels <= begun else {text: None}
    return list(added)


def without_file(result: Calibration, model: Model) -> str:
    """Say which coefficients of a result a model lacks, as no file has them any more (`added_to`); empty for none."""
    has = {name for effect in model.effects for name in (p.name for p in selection.resolve(effect).parameters)}
    lost = [name for name in result.names if name not in has]
    if not lost:
        return ""
    return (
        f"{', '.join(lost)}: in result.json, but not in what was diagnosed: {' '.join(result.origin.effect_files)}: "
        "gone, or changed since; put it back, then run sdimu diagnose with --add"
    )


def _adding(files: Sequence[str], keys: Sequence[str]) -> dict[str, str]:
    """Say by coefficient what adds it: its file where all coefficients of the file are among `keys`, or it alone."""
    out: dict[str, str] = {}
    for file in files:
        with suppress(DataError):
            effects = load_effect(Path(file))
            whole = all(effect.name in keys for effect in effects)
            names = {e.name: e.name.removeprefix(f"{e.family}_") for e in effects}
            out |= {name: file if whole else f"{file}:{parameter}" for name, parameter in names.items()}
    return out


def _beside(folder: Path, text: str) -> str:
    """Path of an effect file that a model names, so that the two can be moved together; other names as they are."""
    file = parse_key(text).file
    return str(folder / text) if file and (folder / file[0]).is_file() else text


def new_parts(effects: Sequence[Effect], model: Sequence[Effect], name: str) -> list[Effect]:
    """Return of some effects what a model does not have yet. `name`: of what is added, for the error."""
    new = _parts(effects, model)
    if not new:
        raise DataError(f"'{name}' is in the model already")
    return new


def _parts(effects: Sequence[Effect], model: Sequence[Effect]) -> list[Effect]:
    have = {label for e in model for label in e.labels}
    new: list[Effect] = []
    for effect in effects:
        for part in without(effect, have):
            if len(part.parameters) in (1, len(effect.parameters)):
                new.append(part if len(part.parameters) < len(effect.parameters) else effect)
            else:
                # One by one, because a name of several joined could not be read back from a result.
                new += [effect.only((p.name,)) for p in part.parameters]
        have.update(effect.labels)
    return new


def register_plugins() -> tuple[str, ...]:
    """Register the effects that other packages offer; return the names that are new."""
    new = []
    for point in _installed():
        if point.name in _LOADED:
            continue
        try:
            effect = point.load()()
        except Exception as error:
            raise DataError(f"effect plug-in '{point.name}' ({point.value}) does not load: {error}") from error
        if not isinstance(effect, Effect):
            raise DataError(f"effect plug-in '{point.name}' ({point.value}) must return an Effect")
        try:
            registry.register(effect)
        except ValueError as error:
            raise DataError(f"effect plug-in '{point.name}' ({point.value}): {error}") from error
        _LOADED.add(point.name)
        new.append(effect.name)
    return tuple(new)


_LOADED: set[str] = set()


@cache
def _installed() -> tuple[EntryPoint, ...]:
    """Plug-ins of the installed packages, read once: every reading opens the metadata of all packages."""
    return tuple(entry_points(group=ENTRY_POINTS))


def _effects(file: EffectFile) -> tuple[Effect, ...]:
    constants, formulas = constants_of(file), formulas_of(file)
    return tuple(_one(file, name, formulas, constants) for name in file.parameters)


def _one(file: EffectFile, name: str, formulas: Mapping[str, Expression], constants: Mapping[str, float]) -> Effect:
    """Effect of one parameter: the formulas with it at one and the others at zero."""
    about = file.parameters[name]
    shown = about.display_unit or about.unit
    if dict(parse_unit(shown).dimension) != dict(parse_unit(about.unit).dimension):
        raise DataError(f"parameters.{name}: display_unit '{shown}' is not of the kind of '{about.unit}'")
    prior = prior_of(file, name)
    sensors = [s for s in CHANNELS if s in formulas and name in formulas[s].names]
    chosen = {p: float(p == name) for p in file.parameters}
    own = f"{file.name}_{name}"
    return Effect(
        name=own,
        family=file.name,
        title=file.title or file.name.replace("_", " "),
        equation="; ".join(f"d{s} = {formulas[s].text}" for s in sensors),
        description=file.description,
        parameters=(Parameter(own, si_unit(about.unit), shown),),
        terms=tuple(Term(CHANNELS.index(s), 0) for s in sensors),
        regressors=_regressors([formulas[s] for s in sensors], {**constants, **chosen}),
        prior=dict.fromkeys(_GRADES, prior),
        needs="temperature" if any(formulas[s].names & TEMPERATURE_NAMES for s in sensors) else "",
    )


def _regressors(formulas: Sequence[Expression], fixed: Mapping[str, float]) -> Callable[[Motion], Floats]:
    def columns(motion: Motion) -> Floats:
        n = len(motion.t)
        out = np.empty((n, len(formulas)))
        for k, formula in enumerate(formulas):
            values: dict[str, Any] = {v: VALUES[v](motion) for v in formula.names if v in VALUES}
            out[:, k] = formula.evaluate({**values, **fixed})
        return out

    return columns
