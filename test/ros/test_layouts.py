"""Every topic and field that the layouts of Foxglove and PlotJuggler name is in the bag of a real run, as numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from rosbags.highlevel import AnyReader

from sdimu_calibration.storage.files.config import config_folder

from .conftest import Run

pytestmark = pytest.mark.ros

FOXGLOVE = config_folder() / "foxglove" / "sdimu.json"
PLOTJUGGLER = config_folder() / "plotjuggler" / "sdimu.xml"
_STEP = re.compile(r'\.(?P<field>\w+)|\[(?P<index>-?\d+|:)\]|\{(?P<key>\w+)==(?P<value>"[^"]*"|[\w.]+)\}')


@pytest.fixture(scope="module")
def messages(whole_run: Run) -> dict[str, list[Any]]:
    """Some hundred messages of every topic, spread over the run, the last ones included."""
    return read(whole_run.folder / "bag")


def read(bag: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    with AnyReader([bag]) as reader:
        for connection in reader.connections:
            raw = [data for _, _, data in reader.messages([connection])]
            kept = raw[:: max(1, len(raw) // 100)] + raw[-3:]
            found[connection.topic] = [reader.deserialize(data, connection.msgtype) for data in kept]
    return found


def foxglove_values(message: Any, path: str) -> list[Any]:
    """Values at a message path of Foxglove: fields, indices, slices of everything, filters."""
    at, place = [message], 0
    for step in _STEP.finditer(path):
        assert step.start() == place, f"{path}: not understood from {place}"
        place = step.end()
        if step["field"]:
            at = [getattr(value, step["field"]) for value in at]
        elif step["index"] == ":":
            at = [entry for value in at for entry in value]
        elif step["index"]:
            at = [value[int(step["index"])] for value in at if len(value) > int(step["index"])]
        else:
            wanted = step["value"].strip('"')
            at = [value for value in at if str(getattr(value, step["key"])) == wanted]
    assert place == len(path), f"{path}: not understood from {place}"
    return at


def split(path: str) -> tuple[str, str]:
    match = re.match(r"(/[\w/]+)(.*)", path)
    assert match, path
    return match.group(1), match.group(2)


def foxglove_paths() -> list[tuple[str, str, str]]:
    """Panel, path and label of everything that the layout draws."""
    panels = json.loads(FOXGLOVE.read_text(encoding="utf-8"))["configById"]
    return [(name, path["value"], path["label"]) for name, panel in panels.items() for path in panel.get("paths", ())]


def plotjuggler_series(topic: str, message: Any) -> Iterator[tuple[str, float]]:
    """Series that PlotJuggler makes of a message (its ParserROS): names as it spells them."""
    kind = message.__msgtype__
    if kind == "diagnostic_msgs/msg/DiagnosticArray":
        for status in message.status:
            hardware = f"{status.hardware_id}/" if status.hardware_id else ""
            for entry in status.values:
                if re.fullmatch(r"[-+.\deE]+", entry.value):
                    yield f"{topic}/{hardware}{status.name}/{entry.key}", float(entry.value)
    elif kind == "sensor_msgs/msg/JointState":
        for what in ("position", "velocity", "effort"):
            for name, value in zip(message.name, getattr(message, what), strict=False):
                yield f"{topic}/{name}/{what}", float(value)
    else:
        yield from _fields(topic, message)


def _fields(prefix: str, value: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, int | float):
        yield prefix, float(value)
    elif hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            if not name.startswith("__"):
                yield from _fields(f"{prefix}/{name}", getattr(value, name))


@pytest.mark.parametrize(("panel", "path", "label"), foxglove_paths())
def test_foxglove_finds_what_it_draws(messages: dict[str, list[Any]], panel: str, path: str, label: str) -> None:
    topic, rest = split(path)
    assert topic in messages, f"{topic} is not in the bag"
    values = [value for message in messages[topic] for value in foxglove_values(message, rest)]
    assert values, f"{path} is never there"
    if panel.startswith("Plot!"):
        assert all(isinstance(float(value), float) for value in values)  # texts are drawn as the numbers they say
    index = re.fullmatch(r"\.(?:position|effort)\[(\d+)\]", rest)
    if index:
        assert messages[topic][-1].name[int(index.group(1))] == label


def test_foxglove_places_every_panel_once() -> None:
    content = json.loads(FOXGLOVE.read_text(encoding="utf-8"))

    def leaves(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else [*leaves(part["first"]), *leaves(part["second"])]

    assert sorted(leaves(content["layout"])) == sorted(content["configById"])


def test_foxglove_topics_of_other_panels_are_there(messages: dict[str, list[Any]]) -> None:
    panels = json.loads(FOXGLOVE.read_text(encoding="utf-8"))["configById"]
    named = [panel[key] for panel in panels.values() for key in ("topicPath", "topicToRender") if panel.get(key)]
    named += [panel["imageMode"]["imageTopic"] for panel in panels.values() if "imageMode" in panel]
    assert named
    for path in named:
        topic, rest = split(path)
        assert foxglove_values(messages[topic][-1], rest), path
    frames = {t.child_frame_id for m in messages["/tf"] for t in m.transforms} | {"site"}
    assert {p["followTf"] for name, p in panels.items() if name.startswith("3D!")} <= frames


def test_plotjuggler_finds_what_it_draws(messages: dict[str, list[Any]]) -> None:
    there = {
        name for topic, some in messages.items() for message in some for name, _ in plotjuggler_series(topic, message)
    }
    curves = {curve.attrib["name"] for curve in ElementTree.parse(PLOTJUGGLER).iter("curve")}
    assert len(curves) > 30
    assert curves - there == set()


def test_every_plot_says_its_unit() -> None:
    panels = json.loads(FOXGLOVE.read_text(encoding="utf-8"))["configById"]
    assert all(panel["yAxisLabel"] for name, panel in panels.items() if name.startswith("Plot!"))
    areas = [area.attrib["name"] for area in ElementTree.parse(PLOTJUGGLER).iter("DockArea")]
    without = [name for name in areas if not re.search(r"\(.+\)$", name)]
    assert all(re.match("Stop|Samples|Squared", name) for name in without)
