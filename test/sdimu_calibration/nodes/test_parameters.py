"""Parameters refuse nonsense where they are set, and those that are read once refuse to be set."""

from __future__ import annotations

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.parameters import Declare


@pytest.fixture
def make():
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes = []

    def made(**given):
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        nodes.append(Node("tested", context=context, parameter_overrides=overrides))
        return nodes[-1]

    yield made
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize(
    ("given", "words"),
    [({"speed": -1.0}, "speed"), ({"speed": "fast"}, "speed"), ({"peers": 1.5}, "peers"), ({"peers": -3}, "peers")],
)
def test_a_value_of_another_type_or_out_of_its_range_is_one_line_at_the_start(make, given, words):
    declare = Declare(make(**given))

    def start():
        declare.number("speed", 0.0, "what it is", least=0.0)
        declare.integer("peers", 0, "what it is", least=0)

    with pytest.raises(DataError, match=f"parameter {words}: .*what it is") as caught:
        start()
    assert "\n" not in str(caught.value)


def test_set_refuses_what_is_out_of_range_or_read_only_and_takes_the_rest(make):
    node = make()
    declare = Declare(node)
    assert declare.number("tolerance", 0.1, "how close", least=0.0, most=5.0, live=True) == 0.1
    declare.text("out", "here", "folder")
    declare.flag("allow", False, "may it", live=True)

    def taken(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0].successful

    assert not any([taken("tolerance", 7.0), taken("tolerance", "x"), taken("out", "there"), taken("allow", 3)])
    assert taken("tolerance", 2.0)
    assert taken("allow", True)
    assert node.describe_parameter("tolerance").description == "how close"
    assert node.describe_parameter("out").read_only


def test_an_empty_list_keeps_its_type(make):
    assert Declare(make()).texts("add", [], "effects") == []
    assert Declare(make(add=["one", ""])).texts("add", [], "effects") == ["one"]
