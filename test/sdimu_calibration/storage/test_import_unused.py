"""What a file holds beside the sensors is imported, or said to be left out: nothing is dropped without a word."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.importing.import_map import ImportMap
from sdimu_calibration.storage.importing.importer import read_files, write_imported
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_sim.core.by_hand import ByHand, by_hand_recording

MAP = {
    "format": "sdimu-import/1",
    "time": {"column": "t"},
    "accel": {"columns": ["acc"], "unit": "m/s^2"},
    "gyro": {"columns": ["gyr"], "unit": "rad/s"},
}
PHASED = {**MAP, "phase": {"column": "phase"}}


@pytest.fixture(scope="module")
def hand():
    """Eight attitudes by hand at 100 Hz, and which of its samples a rest of at least 2 s holds."""
    recording = by_hand_recording(ByHand(8, load_imu("mems_by_hand"), load_site("daejeon"), seed=3))[0]
    still = np.linalg.norm(recording.omega_ib_b - np.median(recording.omega_ib_b, axis=0), axis=1) < 0.02
    rest = np.convolve(still, np.ones(200), "same") > 190
    assert np.count_nonzero(np.diff(rest.astype(int)) == 1) > 4
    return recording, rest


def arrays(hand, **more):
    recording, _ = hand
    return {"t": recording.t, "acc": recording.f_ib_b, "gyr": recording.omega_ib_b, **more}


def read(path, content):
    return read_files([path], ImportMap.model_validate(content))


def labels(rest, kind):
    return {
        "words": np.where(rest, "dwell", "rotating"),
        "bytes": np.where(rest, b"dwell", b"rotating"),
        "truths": rest,
        "numbers": rest.astype(np.int8),
    }[kind]


@pytest.mark.parametrize("kind", ["words", "bytes", "truths", "numbers"])
def test_the_phase_of_an_npz_becomes_the_status_of_the_bag(tmp_path, hand, kind):
    recording, rest = hand
    np.savez(tmp_path / "a.npz", **arrays(hand, phase=labels(rest, kind)))
    found = read(tmp_path / "a.npz", PHASED)
    write_imported(tmp_path / "bag", found)
    phase = read_recording(tmp_path / "bag").phase
    begins = np.flatnonzero(rest & ~np.concatenate([[False], rest[:-1]]))
    # A rest begins with the interval of its first sample: at the stamp of the one before.
    np.testing.assert_allclose(
        phase.t[phase.dwell] + recording.t[0], recording.t[np.maximum(begins - 1, 0)], atol=recording.interval_s
    )
    assert not found.notes


def test_the_phase_of_a_mat_file_in_a_cell_array_of_words_is_read_as_that_of_an_npz(tmp_path, hand):
    _, rest = hand
    savemat(tmp_path / "a.mat", arrays(hand, phase=labels(rest, "words").astype(object)))
    np.savez(tmp_path / "a.npz", **arrays(hand, phase=labels(rest, "words")))
    one, other = (read(tmp_path / name, PHASED).status for name in ("a.mat", "a.npz"))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_arrays_that_no_map_names_are_told_in_one_note_with_their_sizes(tmp_path, hand):
    recording, rest = hand
    n = len(recording.t)
    more = {"phase": labels(rest, "words"), "mag": np.zeros((n, 3)), "fs": np.array(100.0)}
    np.savez(tmp_path / "a.npz", **arrays(hand, **more))
    (note,) = read(tmp_path / "a.npz", MAP).notes
    assert note.startswith(f"{tmp_path / 'a.npz'}: not used: phase ({n}), mag ({n} x 3), fs (")
    assert "phase, by the columns that the map names" in note


def test_columns_of_a_matrix_that_no_map_names_are_told_by_their_number(tmp_path, hand):
    recording, _ = hand
    data = np.column_stack([recording.f_ib_b, recording.omega_ib_b, np.zeros(len(recording.t))])
    np.savez(tmp_path / "a.npz", t=recording.t, data=data)
    parts = {key: {**MAP[key], "columns": [f"data[{k}]" for k in at]} for key, at in PLACES.items()}
    (note,) = read(tmp_path / "a.npz", {**MAP, **parts}).notes
    assert ": not used: data[7] (" in note


PLACES = {"accel": (1, 2, 3), "gyro": (4, 5, 6)}


@pytest.mark.parametrize(("heading", "told"), [("t,ax,ay,az,gx,gy,gz,what,T", "what, T"), ("", "column 8, column 9")])
def test_columns_of_a_text_are_told_by_heading_or_number_and_several_files_share_a_note(tmp_path, heading, told):
    rng = np.random.default_rng(2)
    files = [tmp_path / f"{k}.csv" for k in range(3)]
    for path in files:
        rows = np.column_stack([np.arange(1, 41) * 0.01, rng.standard_normal((40, 6)), np.ones((40, 2))])
        path.write_text("\n".join([heading, *(",".join(f"{x:.5f}" for x in row) for row in rows)]) + "\n")
    by_number = {
        **MAP,
        "time": {"column": 1},
        "accel": {"columns": [2, 3, 4], "unit": "m/s^2"},
        "gyro": {"columns": [5, 6, 7], "unit": "rad/s"},
    }
    notes = read_files(files, ImportMap.model_validate(by_number)).notes
    (note,) = [one for one in notes if "not used" in one]
    assert note.startswith(f"{files[0]} and 2 more files: not used: {told} (")


@pytest.mark.parametrize("kind", ["words", "truths", "numbers"])
def test_a_proposed_map_takes_a_column_that_says_what_is_a_rest_and_the_temperature(tmp_path, hand, kind):
    recording, rest = hand
    name = "phase" if kind == "words" else "is_static"
    heat = 20.0 + 0.01 * recording.t
    np.savez(tmp_path / "a.npz", **arrays(hand, **{name: labels(rest, kind), "temperature": heat}))
    rows = [
        ",".join([*(f"{x:.8g}" for x in (t, *f, *w, T)), str(word)])
        for t, f, w, T, word in zip(
            recording.t, recording.f_ib_b, recording.omega_ib_b, heat, labels(rest, kind), strict=True
        )
    ]
    (tmp_path / "a.csv").write_text("\n".join([f"t,ax,ay,az,gx,gy,gz,temp [degC],{name}", *rows]) + "\n")
    for file in ("a.npz", "a.csv"):
        (proposal,) = propose_maps([tmp_path / file])
        found = read(tmp_path / file, yaml.safe_load(proposal.text))
        assert found.status[1].sum() == np.count_nonzero(np.diff(rest.astype(int)) == 1) + rest[0]
        np.testing.assert_allclose(found.temperature[1], heat, atol=1e-4)
        assert any(word.startswith(f"phase: column {name} says a rest by") for word in proposal.words)
        assert not any("not used" in one for one in (*proposal.words, *found.notes))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("state", lambda rest: rest.astype(int)),
        ("moving", lambda rest: ~rest),
        ("motion", lambda rest: ~rest),
        ("label", lambda rest: np.where(rest, "pos", "turn")),
        ("phase", lambda rest: np.full(len(rest), "dwell")),
    ],
)
def test_a_column_whose_meaning_nobody_knows_is_not_taken_and_the_proposal_asks_for_it(tmp_path, hand, name, values):
    _, rest = hand
    np.savez(tmp_path / "a.npz", **arrays(hand, **{name: values(rest)}))
    (proposal,) = propose_maps([tmp_path / "a.npz"])
    assert "phase" not in yaml.safe_load(proposal.text)
    (word,) = [word for word in proposal.words if "not used" in word]
    assert f"{name} (" in word
    assert "name it in the map, phase" in word


@pytest.mark.parametrize(("heading", "value"), [("temp", 21000.0), ("T", 25.0), ("temperature [degC]", 400.0)])
def test_counts_of_a_converter_and_a_lone_t_are_no_temperature(tmp_path, hand, heading, value):
    recording, _ = hand
    columns = np.column_stack([recording.t, recording.f_ib_b, recording.omega_ib_b, np.full(len(recording.t), value)])
    np.savetxt(
        tmp_path / "a.csv", columns, fmt="%.7g", delimiter=",", header=f"t,ax,ay,az,gx,gy,gz,{heading}", comments=""
    )
    (proposal,) = propose_maps([tmp_path / "a.csv"])
    assert "temperature" not in yaml.safe_load(proposal.text)
    assert any(f"not used: {heading}" in word for word in proposal.words)


def test_objects_of_python_spoil_no_other_array_and_are_told_where_the_map_names_them(tmp_path, hand):
    _, rest = hand
    np.savez(tmp_path / "a.npz", **arrays(hand, phase=labels(rest, "words").astype(object)))
    (note,) = read(tmp_path / "a.npz", MAP).notes
    assert "not used: phase (an import" in note
    with pytest.raises(DataError, match=r"a\.npz: variable phase holds objects of Python.*phase\.astype\(str\)"):
        read(tmp_path / "a.npz", PHASED)


def text(path, heading, columns):
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=heading, comments="")
    return path


BY_NAME = {
    **MAP,
    "accel": {"columns": ["ax", "ay", "az"], "unit": "m/s^2"},
    "gyro": {"columns": ["gx", "gy", "gz"], "unit": "rad/s"},
}
SIX = "t,ax,ay,az,gx,gy,gz"


def test_times_that_go_back_are_told_with_line_and_way_out_and_single_late_ones_are_not(tmp_path, hand):
    recording, _ = hand
    t = recording.t[:600].copy()
    late, back = t.copy(), t.copy()
    late[[200, 201]] = late[[201, 200]]
    back[300:] -= 1.5
    six = recording.f_ib_b[:600], recording.omega_ib_b[:600]
    quiet = read(text(tmp_path / "late.csv", SIX, (late, *six)), BY_NAME)
    assert not quiet.notes
    (note,) = read(text(tmp_path / "back.csv", SIX, (back, *six)), BY_NAME).notes
    assert note.startswith(f"{tmp_path / 'back.csv'}: line 302, column t: the times go back by 1.49 s: ")
    assert "time.rate_hz" in note
    np.savez(tmp_path / "back.npz", t=back, acc=six[0], gyr=six[1])
    (note,) = read(tmp_path / "back.npz", MAP).notes
    assert "back.npz: row 301, column t: the times go back by 1.49 s" in note


def test_a_column_that_is_not_there_or_does_not_fit_is_told_with_what_the_map_names_it_for(tmp_path, hand):
    recording, rest = hand
    six = text(tmp_path / "a.csv", SIX, (recording.t, recording.f_ib_b, recording.omega_ib_b))
    np.savez(tmp_path / "a.npz", **{**arrays(hand), "t": recording.t[:50]})
    for path, changed, told in (
        (
            six,
            {"accel": {"columns": ["fx", "ay", "az"], "unit": "g"}},
            r"no column 'fx' .*; the map names it for accel x",
        ),
        (six, {"phase": {"column": "t"}}, "time and phase both name column 't'"),
    ):
        with pytest.raises(DataError, match=told):
            read(path, {**BY_NAME, **changed})
    for changed, told in (
        ({"accel": {"columns": ["f"], "unit": "g"}}, r"no variable 'f' .*; the map names it in accel\.columns"),
        ({}, rf"column t has 50 times, and there are {len(rest)} samples: name .*time\.column.*rate_hz"),
    ):
        with pytest.raises(DataError, match=told):
            read(tmp_path / "a.npz", {**MAP, **changed})


def test_a_file_without_gyros_is_refused_by_saying_so(tmp_path, hand):
    recording, _ = hand
    with pytest.raises(DataError, match=r"ax, ay, az are accelerometers, and no columns are called gyros"):
        propose_maps([text(tmp_path / "a.csv", "t,ax,ay,az", (recording.t, recording.f_ib_b))])
