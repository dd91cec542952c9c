"""The live diagnosis without its topics."""

from types import SimpleNamespace

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.diagnosing import Diagnosing


def test_the_death_of_the_worker_is_told_once(monkeypatch):
    def answer():
        raise DataError("the process has ended")

    worker = SimpleNamespace(answer=answer, close=lambda: None)
    monkeypatch.setattr("sdimu_calibration.nodes.diagnosing.Worker", lambda *_: worker)
    told = []
    logger = SimpleNamespace(warning=None)
    node = SimpleNamespace(create_publisher=lambda *_: None, get_logger=lambda: logger)
    diagnosing = Diagnosing(node, SimpleNamespace(report=None), (), told.append)
    diagnosing.tick(1)
    diagnosing.tick(2)
    assert told == ["the process has ended"]
    assert diagnosing.idle
