"""Ask the calibration node, from another node, to take effects into its model."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

ANSWER_S = 20.0
"""Wall time in which a node answers (s): one that fits a block of samples answers after it."""


def ask_to_add(node: Node, effects: Sequence[str], seconds: float = ANSWER_S) -> Iterator[str | None]:
    """Let the calibration node take effects into the model, beside those that were added before.

    Ask again while the node spins: gives None until the calibration node has answered, then why it refused, or empty
    text where it did not. `effects`: names, equations or files; `seconds`: wall time in which it must answer.
    """
    until = time.monotonic() + seconds
    client = AsyncParameterClient(node, "calibration")
    while not client.services_are_ready():
        if time.monotonic() > until:
            yield "no calibration node answers in this domain"
            return
        yield None
    known = client.get_parameters(["add"])
    while not known.done():
        if time.monotonic() > until:
            yield _SILENT
            return
        yield None
    before = [text for text in known.result().values[0].string_array_value if text]
    value = Parameter("add", Parameter.Type.STRING_ARRAY, list(dict.fromkeys([*before, *effects])))
    answer = client.set_parameters([value])
    while not answer.done():
        if time.monotonic() > until:
            yield _SILENT
            return
        yield None
    response = answer.result().results[0]
    yield "" if response.successful else str(response.reason)


_SILENT = "the calibration node does not answer"
