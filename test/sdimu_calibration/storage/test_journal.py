"""What was written before a kill is read after it, to the last bit; a torn end costs only itself."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.storage.journal import Journal, Samples, Status, Temperature, digest

OPTIONS = digest("site", "imu")


def block(seed, n=7):
    rng = np.random.default_rng(seed)
    ns = 1_700_000_000_000_000_000 + np.arange(n, dtype=np.int64) * 10_000_000 + seed
    return ns, rng.standard_normal((n, 3)), rng.standard_normal((n, 3))


def write(path):
    journal = Journal(path, OPTIONS)
    journal.samples(*block(1))
    journal.status(5, True, 3)
    journal.temperature(6, 20.5)
    journal.samples(*block(2))
    return journal


def check(records, number):
    for record, seed in zip((records[0], records[3])[:number], (1, 2), strict=False):
        for found, written in zip((record.ns, record.omega_ib_b, record.f_ib_b), block(seed), strict=True):
            np.testing.assert_array_equal(found, written)
    assert records[1:3] == (Status(5, True, 3), Temperature(6, 20.5))


def test_records_are_with_the_system_when_the_call_returns(tmp_path):
    write(tmp_path / "j")  # never closed, as after a kill
    check(Journal(tmp_path / "j", OPTIONS).before, 2)


@pytest.mark.parametrize("torn", [1, 4, 100])
def test_a_torn_record_is_cut_off_and_the_next_one_follows(tmp_path, torn):
    path = tmp_path / "j"
    write(path).close()
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size - torn)
    journal = Journal(path, OPTIONS)
    assert len(journal.before) == 3
    journal.samples(*block(2))
    journal.close()
    records = Journal(path, OPTIONS).before
    assert isinstance(records[0], Samples)
    check(records, 2)


def test_a_journal_of_other_options_or_of_something_else_is_not_gone_on_with(tmp_path):
    write(tmp_path / "j").close()
    assert Journal(tmp_path / "j", digest("another site", "imu")).before == ()
    (tmp_path / "k").write_bytes(b"no journal")
    assert Journal(tmp_path / "k", OPTIONS).before == ()


def test_an_ended_journal_is_gone(tmp_path):
    write(tmp_path / "j").remove()
    assert not (tmp_path / "j").exists()
