"""What a click asks for: from the state of a page and what its controls hold to the next state."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report.workbench.state import State

Controls = Mapping[str, Any]
_INSIDE_S = 1e-3
"""What a span of time leaves of its epoch at either end (s): its neighbours are not touched."""


def step(now: State, what: str, controls: Controls) -> State:
    """Return the state that a click asks for; the same one when it asks for nothing.

    `what`: what was clicked: one of `STEPS`; `controls`: values of the controls of the page by their names.
    """
    return STEPS[what](now, controls) if what in STEPS else now


def _add(now: State, controls: Controls) -> State:
    return now.add(str(controls["candidate"])) if controls["candidate"] else now


def _add_own(now: State, controls: Controls) -> State:
    return now.add(str(controls["own"])) if controls["own"] else now


def _drop(now: State, controls: Controls) -> State:
    return now.drop(str(controls["added"])) if controls["added"] else now


def _hold(now: State, controls: Controls) -> State:
    return now.hold(tuple(int(stop) for stop in controls["held"] or ()))


def _toggle_stop(now: State, controls: Controls) -> State:
    """Leave the stop that is looked at out, or take it in again."""
    stop = controls["stop"]
    if stop is None:
        return now
    held = set(now.now.held) ^ {int(stop)}
    return now.hold(tuple(held))


def _leave_points(now: State, controls: Controls) -> State:
    setting = now.now
    for begin, end in _spans(controls["points"]):
        setting = setting.without_span(begin + _INSIDE_S, end - _INSIDE_S)
    return now.then(setting)


def _take_points(now: State, controls: Controls) -> State:
    setting = now.now
    for begin, end in _spans(controls["points"]):
        setting = setting.with_span(begin, end)
    return now.then(setting)


def _spans(points: Any) -> list[tuple[float, float]]:
    """Epochs (s) of the points that are selected."""
    chosen = (points or {}).get("points", ())
    return [(float(p["customdata"][0]), float(p["customdata"][1])) for p in chosen if p.get("customdata")]


def _fix(now: State, controls: Controls) -> State:
    mean = _quantity(controls, "mean")
    return now.then(now.now.with_prior(_coefficient(controls), mean, f"0 {mean.partition(' ')[2]}".strip()))


def _set_prior(now: State, controls: Controls) -> State:
    mean = _quantity(controls, "mean")
    return now.then(now.now.with_prior(_coefficient(controls), mean, _sigma(controls, mean)))


def _free(now: State, controls: Controls) -> State:
    return now.then(now.now.free(_coefficient(controls)))


def _coefficient(controls: Controls) -> str:
    if not controls["coefficient"]:
        raise DataError("choose a coefficient first")
    return str(controls["coefficient"])


_BEFORE_UNIT = re.compile(r"(?<=[\d.])(?=[A-Za-z%](?![-+]?\d))")
"""Between a number and the unit that touches it; an ``e`` before digits is an exponent."""


def _quantity(controls: Controls, name: str) -> str:
    """Text of a quantity, with one blank before its unit; an empty one is told when the model reads it."""
    return " ".join(_BEFORE_UNIT.sub(" ", str(controls[name] or "")).split())


def _sigma(controls: Controls, mean: str) -> str:
    """Text of a sigma; a bare number has the unit of the value."""
    text = _quantity(controls, "sigma")
    return text if " " in text or not text else f"{text} {mean.partition(' ')[2]}".strip()


def _open(now: State, controls: Controls) -> State:
    return now.open(str(controls["recording"])) if controls["recording"] else now


def _look(now: State, controls: Controls) -> State:
    point = controls["cell"]
    if not point:
        return now
    first = point["points"][0]
    return now.look(CHANNEL_NAMES.index(str(first["y"]).replace(" ", "_")), int(first["x"]))


def _look_at_channel(now: State, controls: Controls) -> State:
    if controls["channel"] is None or controls["stop"] is None:
        return now
    return replace(now, cell=(int(controls["channel"]), int(controls["stop"])))


STEPS: Mapping[str, Callable[[State, Controls], State]] = {
    "undo": lambda now, _: now.undo(),
    "redo": lambda now, _: now.redo(),
    "add": _add,
    "add-own": _add_own,
    "drop": _drop,
    "hold": _hold,
    "toggle-stop": _toggle_stop,
    "leave-points": _leave_points,
    "take-points": _take_points,
    "fix": _fix,
    "set-prior": _set_prior,
    "free": _free,
    "open": _open,
    "heat": _look,
    "channel": _look_at_channel,
}
"""Every step by the name of what is clicked."""
BUTTONS = tuple(name for name in STEPS if name not in {"heat", "channel"})
NOTHING = {
    "undo": "Nothing to undo.",
    "redo": "Nothing to redo.",
    "add": "Nothing added: choose an effect that is not in the model.",
    "add-own": "Nothing added: write an effect that is not in the model.",
    "drop": "Nothing taken out: choose an effect that was added.",
    "hold": "Nothing changed: these are the stops that are left out now.",
    "toggle-stop": "Nothing changed: click a cell of the heat map first.",
    "leave-points": "Nothing left out: click points of the residuals, or draw a box around them.",
    "take-points": "Nothing taken in: select points that are left out.",
    "fix": "Nothing changed: it is fixed at that value.",
    "set-prior": "Nothing changed: this is its prior.",
    "free": "Nothing changed: it has the prior of the IMU's file.",
}
"""What a click that asks for nothing is told."""
