"""What was written before a kill is read after it, to the last bit; a torn end costs only itself."""

from __future__ import annotations

import os

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.journal import Journal, Samples, Status, Temperature, digest

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
    records = tuple(records)
    for record, seed in zip((records[0], records[3])[:number], (1, 2), strict=False):
        for found, written in zip((record.ns, record.omega_ib_b, record.f_ib_b), block(seed), strict=True):
            np.testing.assert_array_equal(found, written)
    assert records[1:3] == (Status(5, True, 3), Temperature(6, 20.5))


def test_records_are_with_the_system_when_the_call_returns(tmp_path):
    write(tmp_path / "j")  # never closed, as after a kill
    journal = Journal(tmp_path / "j", OPTIONS)
    assert journal.before == (14, 1, 1)
    check(journal.records(), 2)


@pytest.mark.parametrize("torn", [1, 4, 100])
def test_a_torn_record_is_cut_off_and_the_next_one_follows(tmp_path, torn):
    path = tmp_path / "j"
    write(path).close()
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size - torn)
    journal = Journal(path, OPTIONS)
    assert journal.before == (7, 1, 1)
    journal.samples(*block(2))
    journal.close()
    records = tuple(Journal(path, OPTIONS).records())
    assert isinstance(records[0], Samples)
    check(records, 2)


def test_a_journal_of_other_options_or_of_something_else_is_not_gone_on_with(tmp_path):
    write(tmp_path / "j").close()
    assert not any(Journal(tmp_path / "j", digest("another site", "imu")).before)
    (tmp_path / "k").write_bytes(b"no journal")
    assert not any(Journal(tmp_path / "k", OPTIONS).before)


def test_a_journal_of_other_options_is_kept_beside_the_new_one(tmp_path):
    write(tmp_path / "j").close()
    was = (tmp_path / "j").read_bytes()
    (tmp_path / "j.1").write_bytes(b"of an earlier restart")
    other = Journal(tmp_path / "j", digest("another site", "imu"))
    assert other.set_aside == tmp_path / "j.2"
    assert other.set_aside.read_bytes() == was
    assert (tmp_path / "j.1").read_bytes() == b"of an earlier restart"
    other.close()
    again = Journal(tmp_path / "j", OPTIONS)
    assert again.set_aside is None  # it held no record


def test_an_ended_journal_is_gone(tmp_path):
    write(tmp_path / "j").remove()
    assert not (tmp_path / "j").exists()


def test_everything_comes_back_as_arrays_in_the_order_of_arrival(tmp_path):
    journal = write(tmp_path / "j")
    for _ in range(2):
        raw = journal.raw()
        for found, first, second in zip((raw.ns, raw.omega_ib_b, raw.f_ib_b), block(1), block(2), strict=True):
            np.testing.assert_array_equal(found, np.concatenate([first, second]))
        assert [column.tolist() for column in raw.status] == [[5], [True], [3]]
        assert [column.tolist() for column in raw.temperature] == [[6], [20.5]]
        journal.close()
        journal = Journal(tmp_path / "j", OPTIONS)


def test_a_journal_without_side_topics_says_so(tmp_path):
    journal = Journal(tmp_path / "j", OPTIONS)
    journal.samples(*block(1))
    assert journal.raw().status is None
    assert journal.raw().temperature is None


def test_records_larger_than_what_is_read_at_once_come_back(tmp_path):
    many = block(3, 40_000)
    journal = Journal(tmp_path / "j", OPTIONS)
    journal.samples(*many)
    journal.samples(*block(1))
    journal.close()
    first, second = Journal(tmp_path / "j", OPTIONS).records()
    np.testing.assert_array_equal(first.f_ib_b, many[2])
    np.testing.assert_array_equal(second.ns, block(1)[0])


@pytest.mark.parametrize("kind", [b"X", b"S"])
def test_a_damaged_record_ends_the_journal(tmp_path, kind):
    path = tmp_path / "j"
    journal = Journal(path, OPTIONS)
    journal.samples(*block(1))
    place = path.stat().st_size
    journal.temperature(6, 20.5)
    journal.samples(*block(2))
    journal.close()
    with path.open("r+b") as file:
        file.seek(place)
        file.write(kind)
    was = path.read_bytes()
    again = Journal(path, OPTIONS)
    assert again.before == (7, 0, 0)
    assert path.stat().st_size == place
    # What stands behind the damage is whole, and nothing else has it.
    assert again.set_aside == tmp_path / "j.1"
    assert again.set_aside.read_bytes() == was
    assert f"damaged after {place} bytes" in again.why_aside


def test_a_torn_end_leaves_no_copy(tmp_path):
    path = tmp_path / "j"
    write(path).close()
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size - 4)
    assert Journal(path, OPTIONS).set_aside is None
    assert list(tmp_path.iterdir()) == [path]


def a_folder(place):
    (place / "j").mkdir()
    return place / "j"


def a_pipe(place):
    os.mkfifo(place / "j")
    return place / "j"


def below_a_file(place):
    (place / "out").write_text("a file")
    return place / "out" / "j"


@pytest.mark.parametrize(
    ("made", "lasting"), [(a_folder, True), (a_pipe, True), (below_a_file, True), (below_a_file, False)]
)
def test_a_place_that_takes_no_journal_is_told_with_the_way_out(tmp_path, made, lasting):
    path = made(tmp_path)
    with pytest.raises(DataError, match=rf"{path}: .*name another .*'out'"):
        Journal(path, OPTIONS, lasting=lasting)


def test_two_that_live_write_no_journal_together(tmp_path):
    first = write(tmp_path / "j")
    was = (tmp_path / "j").read_bytes()
    with pytest.raises(DataError, match="another calibration node that lives"):
        Journal(tmp_path / "j", OPTIONS)
    with pytest.raises(DataError, match="another calibration node that lives"):
        Journal(tmp_path / "j", digest("other options"))
    assert (tmp_path / "j").read_bytes() == was
    assert not (tmp_path / "j.1").exists()
    first.close()
    check(Journal(tmp_path / "j", OPTIONS).records(), 2)


def test_a_journal_that_need_not_last_has_no_name(tmp_path):
    journal = Journal(tmp_path / "j", OPTIONS, lasting=False)
    journal.samples(*block(1))
    assert not list(tmp_path.iterdir())
    np.testing.assert_array_equal(journal.raw().ns, block(1)[0])
    journal.restart()
    journal.samples(*block(2))
    np.testing.assert_array_equal(journal.raw().ns, block(2)[0])
    journal.remove()


def test_a_full_disk_is_said_and_not_a_record_cut_in_silence(tmp_path):
    journal = Journal(tmp_path / "j", OPTIONS)
    journal.close()
    journal._file = open("/dev/full", "ab", buffering=0)  # noqa: SIM115, PTH123
    with pytest.raises(OSError, match="No space left"):
        journal.samples(*block(1))
    journal.close()
