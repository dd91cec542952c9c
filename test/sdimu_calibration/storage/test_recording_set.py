"""Set files, the work on their bags, and what is kept of it."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import time
import zipfile
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions
from sdimu_calibration.core.joint.member import fitted, run
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set, job_of
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.joint.shared_function import SharedFunction
from sdimu_calibration.core.note import Note, Topic, topic_of, without_advice
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.files.model_choice import named_model
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_calibration.storage.kept_report import LONGEST, read_report, write_report
from sdimu_calibration.storage.recording_set import BagSource, KeptOpen, bags_below, load_set, set_of, write_set
from sdimu_calibration.storage.set_work import Pool, bag_checksum, job_number, set_runner
from sdimu_sim.bag_file import write_test
from sdimu_sim.core.scenario import Scenario, simulate_test

LIKE = BagSource(Path(), "daejeon", "dtg")
OPTIONS = SetOptions(named_model(None, []))


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    plan = load_plan("recommended")
    plan = replace(plan, dwell_s=(20.0,) * 12, turns=plan.turns[:11])
    for k in (1, 2):
        scenario = Scenario(
            plan, load_imu("dtg"), load_site("daejeon"), rate_hz=10.0, seed=k, unit=1, turn_on={"gyro_bias": 5e-8}
        )
        write_test(folder / f"run{k}", scenario, simulate_test(scenario), custom={"serial": "SN1", "power_on": str(k)})
    return folder


def test_a_first_set_file_is_read_back(bags):
    path = bags / "set.yaml"
    path.unlink(missing_ok=True)
    write_set(path, bags_below(bags))
    found = load_set(path, LIKE)
    assert [m.name for m in found.members] == ["run1", "run2"]
    assert [m.power_on for m in found.members] == ["1", "2"]
    assert {m.serial for m in found.members} == {"SN1"}
    with pytest.raises(DataError, match="is there already"):
        write_set(path, bags_below(bags))


def test_bags_say_unit_and_power_on(bags):
    found = set_of([bags / "run1", bags / "run2"], LIKE)
    assert [(m.serial, m.power_on) for m in found.members] == [("SN1", "1"), ("SN1", "2")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format: sdimu-set/1\nrecordings: []\n", "recordings"),
        ("format: sdimu-set/1\nrecordings:\n- bag: nowhere\n", r"nowhere: no such bag \(recording 'nowhere' of"),
        ("format: sdimu-set/1\nscopes: {gyro_scale: always}\nrecordings:\n- bag: run1\n", "scopes"),
        ("format: sdimu-set/1\nreference_temperature: 20 m\nrecordings:\n- bag: run1\n", "reference_temperature"),
    ],
)
def test_a_wrong_set_file_is_refused_in_one_line(bags, text, message):
    path = bags / "wrong.yaml"
    path.write_text(text)
    with pytest.raises(DataError, match=message) as error:
        load_set(path, LIKE)
    assert "\n" not in str(error.value)


def test_no_bag_below_a_folder(tmp_path):
    with pytest.raises(DataError, match="no bag in it"):
        bags_below(tmp_path)


def test_what_was_done_is_not_done_again(bags, tmp_path):
    members = set_of([bags / "run1", bags / "run2"], LIKE).members
    done: list[tuple[int, int]] = []
    with set_runner(2, 1, tmp_path, told=lambda k, n: done.append((k, n))) as work:
        first = fit_set(members, OPTIONS, work)
    assert done
    done.clear()
    with set_runner(2, 1, tmp_path, told=lambda k, n: done.append((k, n))) as work:
        again = fit_set(members, OPTIONS, work)
    assert not done
    np.testing.assert_array_equal(first.estimate.values, again.estimate.values)
    np.testing.assert_array_equal(first.estimate.covariance, again.estimate.covariance)
    # A file that was damaged is made again.
    for path in tmp_path.glob("*.reduction"):
        path.write_bytes(path.read_bytes()[:1000])
    with set_runner(2, 1, tmp_path, told=lambda k, n: done.append((k, n))) as work:
        fit_set(members, OPTIONS, work)
    assert done


def test_other_bytes_are_another_job(bags, tmp_path):
    copy = tmp_path / "run1"
    shutil.copytree(bags / "run1", copy)
    one, other = (set_of([path], LIKE).members[0] for path in (bags / "run1", copy))
    options = replace(OPTIONS, model=replace(OPTIONS.model, effects=("gyro_bias", "accel_bias")))
    assert job_number(job_of(one, options, None)) == job_number(job_of(other, options, None))
    with (copy / "metadata.yaml").open("a") as file:
        file.write("\n")
    changed = set_of([copy], replace(LIKE, measured_noise=True)).members[0]
    assert job_number(job_of(one, options, None)) != job_number(job_of(changed, options, None))


def test_every_question_is_another_job(bags):
    """Else an answer of an older question is taken from the folder of kept reports."""
    member = set_of([bags / "run1"], LIKE).members[0]
    options = replace(OPTIONS, model=replace(OPTIONS.model, effects=("gyro_bias", "accel_bias")))
    job = job_of(member, options, None)
    shared = SharedFunction(AttitudeFunctions(np.eye(3)), ("accel_x",), np.eye(3), {})
    with_it = replace(job, function=shared)
    asked = [
        job,
        replace(job, rivals=True),
        replace(job, stretches=True),
        replace(job, with_local=True),
        replace(job, noise=()),
        replace(job, scatter=np.ones(3)),
        with_it,
        replace(with_it, function=replace(shared, size={"accel_x": 1e-4})),
        replace(with_it, function=replace(shared, sensors=("accel_y",))),
        replace(with_it, function=replace(shared, functions=AttitudeFunctions(-np.eye(3)))),
    ]
    assert len({job_number(one) for one in asked}) == len(asked)


def test_a_report_is_read_back(bags, tmp_path):
    report = run(job_of(set_of([bags / "run1"], LIKE).members[0], OPTIONS, None))
    site = replace(report.site, latitude_sigma_rad=1e-3, magnetic_field_t=(2e-5, 0.0, 4e-5))
    # Words that nobody has written before: what a note is about is not told by them.
    said = (Note("it wanders", Topic.DIFFERS, "; look"), Note("it is one", Topic.INSEPARABLE), "a line")
    report = replace(report, site=site, warnings=said)
    write_report(tmp_path / "one", report, "7")
    back = read_report(tmp_path / "one", "7")
    assert back is not None
    assert [topic_of(line) for line in back.warnings] == [Topic.DIFFERS, Topic.INSEPARABLE, None]
    assert without_advice(back.warnings) == ("it wanders", "it is one", "a line")
    for name in ("A", "y", "point", "weight"):
        np.testing.assert_array_equal(getattr(back.reduction, name), getattr(report.reduction, name))
    # Every field that a report gets is in its file, but for what the member of the set says.
    by_member, by_array = {"serial", "power_on"}, {"reduction", "start", "values", "sigma", "data"}
    for own in fields(report):
        if own.name not in by_member | by_array:
            assert repr(getattr(back, own.name)) == repr(getattr(report, own.name)), own.name
    assert back.site == report.site
    np.testing.assert_array_equal(back.values, report.values)
    np.testing.assert_array_equal(back.start.C_nb, report.start.C_nb)
    assert read_report(tmp_path / "none", "7") is None


def test_a_report_of_another_job_or_of_other_numbers_is_not_believed(bags, tmp_path):
    report = run(job_of(set_of([bags / "run1"], LIKE).members[0], OPTIONS, None))
    path = tmp_path / "one"
    write_report(path, report, "7")
    whole = path.read_bytes()
    assert read_report(path, "8") is None
    line, content = whole.split(b"\n", 1)
    stuffed = io.BytesIO(content)
    with zipfile.ZipFile(stuffed, "a", zipfile.ZIP_DEFLATED) as members:
        members.writestr("dwell_start.npy", bytes(50 << 20))
    one_bit = bytearray(whole)
    one_bit[len(whole) // 2] ^= 1
    for other in (
        bytes(one_bit),
        content,
        line,
        b"",
        b"text",
        whole.replace(b" 7 ", b" 8 ", 1),
        whole + b"\0",
        line + b"\n" + stuffed.getvalue(),
    ):
        path.write_bytes(other)
        assert read_report(path, "7") is None
    with path.open("wb") as file:
        file.truncate(LONGEST + 1)
    assert read_report(path, "7") is None
    path.write_bytes(whole)
    assert read_report(path, "7") is not None


def test_a_bag_that_changes_in_place_is_another_one(bags, tmp_path):
    copy = tmp_path / "run1"
    shutil.copytree(bags / "run1", copy)
    before, source = bag_checksum(copy), replace(LIKE, bag=copy)
    opened = source()
    assert source() is opened
    (mcap,) = copy.glob("*.mcap")
    with mcap.open("r+b") as file:
        file.seek(1000)
        byte = file.read(1)
        file.seek(1000)
        file.write(bytes([byte[0] ^ 1]))
    assert bag_checksum(copy) != before
    shutil.rmtree(copy)
    shutil.copytree(bags / "run2", copy)
    assert source().recording.f_ib_b[0, 0] != opened.recording.f_ib_b[0, 0]


def test_workers_end_with_the_process_that_started_them():
    code = (
        "import os, time\nfrom concurrent.futures import ProcessPoolExecutor\n"
        "from multiprocessing import get_context\nfrom sdimu_calibration.storage.set_work import end_with\n"
        "if __name__ == '__main__':\n"
        "    pool = ProcessPoolExecutor(1, get_context('spawn'), initializer=end_with, initargs=(os.getpid(),))\n"
        "    print(pool.submit(os.getpid).result(), flush=True)\n"
        "    time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        os.kill(worker, 0)
        parent.kill()
    until = time.monotonic() + 10.0
    while _alive(worker) and time.monotonic() < until:
        time.sleep(0.05)
    assert not _alive(worker)


def _alive(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def test_processes_give_the_same_digits(bags):
    members = set_of([bags / "run1", bags / "run2"], LIKE).members
    # Told that there are four, the runner starts processes.
    with set_runner(4, 2, None) as work:
        pool = fit_set(members, OPTIONS, work)
    with set_runner(4, 1, None) as work:
        here = fit_set(members, OPTIONS, work)
    np.testing.assert_array_equal(pool.estimate.values, here.estimate.values)


class Process(Executor):
    """Does jobs at once, and remembers of which recordings they are; one that is broken does none."""

    def __init__(self, broken=False):
        self.asked, self.broken, self.ended = [], broken, None

    def submit(self, work, job):
        self.asked.append(job.member.name)
        done = Future()
        if self.broken:
            done.set_exception(BrokenProcessPool("killed"))
        else:
            done.set_result(f"{work.__name__} {job.member.name}")
        return done

    def shutdown(self, wait=True, *, cancel_futures=False):
        self.ended = wait, cancel_futures


@pytest.fixture
def four_jobs(bags):
    options = replace(OPTIONS, model=replace(OPTIONS.model, effects=("gyro_bias", "accel_bias")))
    job = job_of(set_of([bags / "run1"], LIKE).members[0], options, None)
    return [replace(job, member=replace(job.member, name=f"run{k}")) for k in range(1, 5)]


def test_each_process_has_recordings_of_its_own_and_none_more_than_its_share(four_jobs):
    """It keeps them open, and another one would open them again."""
    one, other = Process(), Process()
    pool = Pool([one, other], None)
    assert pool.do(four_jobs[:3]) == ["tried run1", "tried run2", "tried run3"]
    pool.do(four_jobs[::-1])
    assert one.asked == ["run1", "run3", "run3", "run1"]
    assert other.asked == ["run2", "run4", "run2"]
    # Both are of the first process, which would work while the other has nothing to do.
    pool.do([four_jobs[0], four_jobs[2]])
    assert (one.asked[-1], other.asked[-1]) == ("run1", "run3")


def test_where_the_system_ends_a_process_the_others_take_no_more_work(four_jobs):
    one, other = Process(broken=True), Process()
    with pytest.raises(DataError, match="memory is short"):
        Pool([one, other], None).do(four_jobs)
    assert one.ended == other.ended == (False, True)


def test_recordings_stay_open_while_memory_holds_them():
    opened: list[str] = []

    class Source:
        def __init__(self, name, samples):
            self.name, self.samples = name, samples

        def opened(self):
            opened.append(self.name)
            return SimpleNamespace(recording=SimpleNamespace(t=np.zeros(self.samples)))

    kept = KeptOpen(2, 10)
    one, other, long, short = Source("one", 4), Source("other", 6), Source("long", 30), Source("short", 1)
    for source in (one, other, one, other, long, long, one, one):
        kept.of(source, ())
    # A long one alone stays, and takes the place of all others.
    assert opened == ["one", "other", "long", "one"]
    kept.of(one, ("changed",))
    assert opened[-2:] == ["one", "one"]
    # So many, however short they are.
    for source in (short, other, one):
        kept.of(source, ())
    assert opened[-3:] == ["short", "other", "one"]


def test_a_recording_is_fitted_once_for_questions_about_one_fit(bags):
    job = job_of(set_of([bags / "run1"], LIKE).members[0], OPTIONS, None)
    fit = fitted(job)
    assert fitted(replace(job, candidates=("gyro_bias_ramp",), with_local=True, rivals=True, stretches=True)) is fit
    assert fitted(replace(job, local=("gyro_bias_ramp_x",))) is not fit
    test = job.member.open()
    assert test.with_imu(test.imu).last(job.of_fit, lambda: "of another test") == "of another test"
    about = replace(job, about=dict.fromkeys(fit.names, 0.0))
    assert fitted(about) is not fitted(replace(about, about=dict.fromkeys(fit.names, 1e-9)))


def test_a_result_of_a_set_is_read_back(bags, tmp_path):
    members = set_of([bags / "run1", bags / "run2"], LIKE).members
    with set_runner(2, 1, None) as work:
        result = set_outcome(fit_set(members, OPTIONS, work))
    write_result(tmp_path / "result.json", result)
    back = read_result(tmp_path / "result.json")
    assert back.of_set is not None
    assert back.of_set.turn_on == result.of_set.turn_on
    assert back.of_set.deviations == result.of_set.deviations
    for one, other in zip(back.of_set.recordings, result.of_set.recordings, strict=True):
        np.testing.assert_array_equal(one.deviate, other.deviate)
        assert (one.name, one.start_ns, one.power_on) == (other.name, other.start_ns, other.power_on)


def test_names_of_a_first_set_file_are_different(bags, tmp_path):
    for day in ("a", "b"):
        shutil.copytree(bags / "run1", tmp_path / day / "run")
    write_set(tmp_path / "set.yaml", bags_below(tmp_path))
    assert [m.name for m in load_set(tmp_path / "set.yaml", LIKE).members] == ["a/run", "b/run"]


def test_the_estimator_of_a_set_file_opens_its_bags(bags, tmp_path):
    path = tmp_path / "set.yaml"
    path.write_text(f"estimator: hand\nrecordings:\n- bag: {bags / 'run1'}\n")
    found = load_set(path, replace(LIKE, handheld=None))
    assert (found.estimator, found.members[0].open.handheld) == ("handheld", True)
    path.write_text(f"estimator: best\nrecordings:\n- bag: {bags / 'run1'}\n")
    with pytest.raises(DataError, match="estimator best: expected one of"):
        load_set(path, LIKE)


def test_a_recording_that_stands_twice_is_refused_and_a_folder_that_cannot_be_written_is_not(bags, tmp_path):
    (tmp_path / "again").symlink_to(bags / "run1")
    kept = tmp_path / "kept"
    kept.write_text("")
    with set_runner(2, 1, kept) as work, pytest.raises(DataError, match="are the same recording"):
        fit_set(set_of([bags / "run1", tmp_path / "again"], LIKE).members, OPTIONS, work)


def test_two_dask_workers_give_bitwise_what_this_process_gives(bags):
    distributed = pytest.importorskip("distributed")
    members = set_of([bags / "run1", bags / "run2"], LIKE).members
    jobs = [job_of(member, OPTIONS, None) for member in members]
    with set_runner(2, 1, None) as here:
        local = here(jobs)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        set_runner(2, 2, None, cluster.scheduler_address) as there,
    ):
        remote = there(jobs)
    for one, other in zip(local, remote, strict=True):
        assert one.name == other.name
        for name in ("A", "y", "point", "weight"):
            np.testing.assert_array_equal(getattr(one.reduction, name), getattr(other.reduction, name))
        np.testing.assert_array_equal(one.values, other.values)
