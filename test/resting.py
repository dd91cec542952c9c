"""Raw messages of an IMU at rest, and how the node hands them over: for what waits in front of the live filter."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.live import NS
from sdimu_calibration.nodes.feed import Feed
from sdimu_calibration.storage.bags.cdr import encode_imu

START = 1_700_000_000 * NS
COUNT = 4000
_BLOCK = 20


def messages(seed: int = 1, start: int = START) -> list[bytes]:
    """Forty seconds at rest as raw messages."""
    rng = np.random.default_rng(seed)
    ns = start + (1 + np.arange(COUNT, dtype=np.int64)) * (NS // 100)
    omega = 4e-5 + 1e-6 * rng.standard_normal((COUNT, 3))
    return list(encode_imu(ns, omega, [0.0, 0.0, -9.8] + 1e-3 * rng.standard_normal((COUNT, 3))))


def give(feed: Feed, raw: list[bytes]) -> list[int]:
    """Hand over messages in blocks with a status every second, as the node does; stamps of the estimates."""
    told = []
    for k in range(0, len(raw), _BLOCK):
        for message in raw[k : k + _BLOCK]:
            feed.take_imu(message)
        reached = feed.decode()
        if reached:
            feed.take_status(reached - reached % NS, True, 0)
        told += [estimate.ns for estimate in feed.process(True, False)]
    return told
