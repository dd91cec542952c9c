"""Nothing outside of this machine can reach a node or a campaign."""

from __future__ import annotations

import os

import psutil
import pytest

from sdimu_calibration.storage.cluster import _client

from .conftest import CALIBRATION, FitSession

PORTS_A_DOMAIN, FIRST_PORT = 250, 7400


@pytest.mark.ros
def test_the_sockets_of_a_domain_are_bound_to_the_loopback_interface(bench: FitSession) -> None:
    bench.children.start("calibration", CALIBRATION, {"out": str(bench.folder)})
    first = FIRST_PORT + PORTS_A_DOMAIN * int(os.environ["ROS_DOMAIN_ID"])

    def receiving() -> set[str]:
        found = set()
        for process in psutil.Process().children(recursive=True):
            for socket in process.net_connections("udp"):
                if first <= socket.laddr.port < first + PORTS_A_DOMAIN:
                    found.add(socket.laddr.ip)
        return found

    # Multicast discovery and metadata come first, the data last: all of them after the node has warmed up.
    bench.wait(lambda: bool(receiving()), "sockets of the node")
    assert receiving() == {"127.0.0.1"}


def test_the_workers_of_a_campaign_listen_on_the_loopback_interface_alone() -> None:
    with _client(None, 1):
        me = psutil.Process()
        listening = {
            socket.laddr.ip
            for process in (me, *me.children(recursive=True))
            for socket in process.net_connections("tcp")
            if socket.status == psutil.CONN_LISTEN
        }
    assert listening == {"127.0.0.1"}
