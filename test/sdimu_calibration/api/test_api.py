"""The Python interface does what the verbs do, with the same digits, and says in one line what it cannot do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from plans import quick_plan

import sdimu_calibration as sdimu
from sdimu_calibration.core.plan_search import search
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import find_config, load_imu, load_plan, load_site
from sdimu_calibration.storage.files.plan_file import write_plan
from sdimu_calibration.storage.files.result_file import read_result

HIDDEN = "accel_quadratic_x"


@pytest.fixture(scope="module")
def bag(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("api")
    write_plan(folder / "plan.yaml", quick_plan(), [])
    return sdimu.simulate(
        folder / "bag", plan=str(folder / "plan.yaml"), rate=20.0, seed=5, effect=[f"{HIDDEN}=40 ug/g^2"]
    )


@pytest.fixture(scope="module")
def fit(bag):
    return sdimu.calibrate(sdimu.open(bag, site="daejeon", imu="dtg"))


@pytest.fixture(scope="module")
def found(fit):
    return sdimu.diagnose(fit)


def test_a_coefficient_knows_its_units(fit):
    bias = fit["gyro_bias_x"]
    value, sigma = bias.to("deg/h")
    assert value == pytest.approx(np.degrees(bias.value) * 3600.0)
    assert sigma == pytest.approx(np.degrees(bias.sigma) * 3600.0)
    assert "deg/h" in repr(bias)
    with pytest.raises(DataError, match="another kind"):
        bias.to("ug")
    with pytest.raises(KeyError, match="no coefficient 'gyro_bias_q'"):
        fit["gyro_bias_q"]


def test_a_fit_is_shown_as_a_table_with_units(fit):
    text = repr(fit)
    assert "gyro_bias_x" in text
    assert "deg/h" in text
    assert len(text) < 10_000
    assert "<table>" in fit._repr_html_()
    frame = fit.to_dataframe()
    assert list(frame.columns) == ["value", "sigma", "unit"]
    assert frame.loc["accel_scale_y", "unit"] == "ppm"
    assert frame.loc["accel_scale_y", "value"] == pytest.approx(1e6 * fit["accel_scale_y"].value)


@pytest.fixture
def notebook(monkeypatch):
    """What rich shows by itself where it takes the program for a notebook's kernel."""
    import builtins

    class ZMQInteractiveShell:
        """The name by which rich knows one."""

    shown: list[object] = []
    monkeypatch.setattr(builtins, "get_ipython", ZMQInteractiveShell, raising=False)
    monkeypatch.setattr("rich.jupyter.display", lambda *what: shown.append(what))
    return shown


def test_a_notebook_shows_a_table_once(fit, notebook):
    from rich.console import Console

    assert Console().is_jupyter
    ladder = sdimu.compare(fit, fit)
    for thing in (fit, ladder):
        assert "gyro_bias_x" in repr(thing) or "model 1" in repr(thing)
        assert "<table>" in thing._repr_html_()
    assert notebook == []


def test_an_opened_test_says_what_it_is_of(bag):
    test = sdimu.open(bag, site="daejeon", imu="dtg")
    text = repr(test)
    assert len(text) < 400
    assert f"samples: {len(test.recording.t)} at 20 Hz" in text
    for word in ("recording: bag", "duration: 1000.0 s (16.7 min)", "stops: 19", "IMU: dtg", "site: daejeon"):
        assert word in text
    assert all(line.partition(": ")[2] in test._repr_html_() for line in text.splitlines())
    assert "stops: 19, without 3, 7" in repr(test.without_stops((3, 7)))
    assert "(assumed)" in repr(sdimu.open(bag, imu="dtg"))


def test_what_was_found_is_added_and_the_error_falls(fit, found):
    assert not found.adequate
    assert HIDDEN in {found.best.label, *found.found[0].alike}
    better = fit.add(found.best)
    assert better.result.fit["held_out_rms"] < fit.result.fit["held_out_rms"]
    # A warm start ends where a cold one does.
    cold = sdimu.calibrate(fit.test, add=[found.best.label])
    sigma = np.sqrt(np.diag(cold.covariance))
    assert np.max(np.abs(better.values - cold.values)[sigma > 0] / sigma[sigma > 0]) < 0.05
    ladder = sdimu.compare(fit, better)
    assert f"+ {found.best.label}" in repr(ladder)
    assert "<table>" in ladder._repr_html_()
    assert float(np.std(better.residuals)) == pytest.approx(1.0, abs=0.05)
    with pytest.raises(DataError, match="in the model already"):
        better.add(found.best)


def test_a_diagnosis_is_drawn_and_told(found):
    assert found.plot_ranking().data
    assert found.plot_heat_map().data
    assert found.verdict in repr(found)
    assert not any("--" in line or "sdimu diagnose" in line for line in found.advice)


def test_what_may_be_missing_is_a_table_with_units(found):
    table = found.to_dataframe()
    members = [m for family in found.probabilities.families for m in family.members]
    assert sorted(table.index) == sorted(m.label for m in members)
    assert list(table["probability"]) == sorted((m.probability for m in members), reverse=True)
    row = table.loc[HIDDEN]
    assert row["unit"] == "ug/g^2"
    assert abs(row["value"] - 40.0) < 5.0 * row["sigma"]


def test_matplotlib_draws_a_diagnosis_in_the_same_colours(found):
    pytest.importorskip("matplotlib")
    assert [axes.get_xlabel() for axes in found.plot_heat_map(library="matplotlib").axes][-1] == "stop"
    assert found.plot_ranking(library="matplotlib").axes[0].get_xlabel() == "score |z| (sigma)"
    with pytest.raises(DataError, match=r"expected 'plotly' or 'matplotlib'$"):
        found.plot_ranking(library="bokeh")
    with pytest.raises(DataError, match=r"did you mean 'matplotlib'\?"):
        found.plot_ranking(library="matplot")


def test_files_are_those_of_the_verbs(fit, found, tmp_path):
    saved = read_result(fit.save(tmp_path / "fit"))
    np.testing.assert_array_equal(saved.values, fit.values)
    assert (tmp_path / "fit" / "report.html").is_file()
    found.save(tmp_path / "diagnosis")
    assert {p.name for p in (tmp_path / "diagnosis").iterdir()} == {"diagnosis.json", "result.json", "report.html"}


def test_samples_are_freed_of_the_errors(bag, fit):
    test = sdimu.open(bag, site="daejeon")
    done = fit.compensate(test)
    assert done.f_ib_b.shape == test.recording.f_ib_b.shape
    assert np.abs(done.f_ib_b - test.recording.f_ib_b).max() > 1e-5


def test_a_plan_is_predicted():
    prediction = sdimu.predict("kim18", "dtg")
    assert prediction.duration_s == pytest.approx(2980.0, rel=0.01)
    # The filter is within 10 % of the bound, the project's limit; the three elements that define the frame are 0.
    np.testing.assert_allclose(prediction.sigma, prediction.bound, rtol=0.1)
    assert np.count_nonzero(prediction.bound) == len(prediction.bound) - 3


def test_the_package_shows_its_functions_and_no_more():
    public = [name for name in dir(sdimu) if not name.startswith("_")]
    assert public == ["calibrate", "compare", "diagnose", "open", "open_set", "plan", "predict", "simulate"]
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        _ = sdimu.calibrat


def test_what_cannot_be_used_is_one_line(fit, tmp_path):
    with pytest.raises(DataError, match="no such"):
        sdimu.open(tmp_path / "nothing", site="daejeon")
    with pytest.raises(DataError, match="two results"):
        sdimu.compare(fit)
    with pytest.raises(DataError, match="unknown effect"):
        fit.add("gyro_bias_wram_up_x")


def test_a_handheld_fit_takes_no_assumed_site(bag):
    with pytest.raises(DataError, match=r"assumed site daejeon.*handheld=True"):
        sdimu.calibrate(sdimu.open(bag), estimator="handheld")
    opened = sdimu.calibrate(sdimu.open(bag, handheld=True), estimator="handheld")
    assert opened.core.estimator == "handheld"


def test_words_for_estimators_and_models_are_those_of_the_shell(bag):
    opened = sdimu.open(bag, handheld=True)
    given = sdimu.calibrate(opened, estimator="handheld")
    for model in ("hand", "handheld"):
        assert sdimu.calibrate(opened, model=model, estimator="hand").core.model == given.core.model
    with pytest.raises(DataError, match="estimator by_hand: expected one of auto, filter"):
        sdimu.calibrate(opened, estimator="by_hand")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sdimu.plan("kim18", minutes=-3.0), "minutes=-3: a plan takes more than 0 minutes"),
        (lambda: sdimu.plan("kim18", slack=-1.0), "expected numbers above 0"),
        (lambda: sdimu.plan(Path("kim18")), "kim18: no such plan file"),
        (lambda: sdimu.plan(3), r"plan\(start=...\): expected a name in config/plan, a path, or a plan, not 3"),
        (lambda: sdimu.plan(after="known"), r"plan\(after=...\): expected what `known` of a diagnosis is"),
        (lambda: sdimu.plan(site=3), r"plan\(site=...\): expected a name in config/site"),
        (lambda: sdimu.predict(Path("kim18")), "kim18: no such plan file"),
        (lambda: sdimu.predict(sdimu.plan), r"predict\(plan=...\): expected a name in config/plan"),
        (lambda: sdimu.predict(imu=7), r"predict\(imu=...\): expected a name in config/imu"),
        (lambda: sdimu.open_set([]), "no bag is named"),
        (lambda: sdimu.open("bag", imu=7), r"open\(imu=...\): expected a name in config/imu"),
    ],
)
def test_arguments_that_mean_nothing_are_refused_in_one_line(call, said):
    with pytest.raises(DataError, match=said):
        call()


def test_one_effect_is_added_at_a_time(fit):
    with pytest.raises(DataError, match=r"add\(effect=...\): expected one effect"):
        fit.add(["accel_quadratic"])


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory) -> Path:
    """A site with another height: gravity differs by less than the accelerometers tell."""
    path = tmp_path_factory.mktemp("site") / "hill.yaml"
    path.write_text(find_config("site", "daejeon").read_text().replace("height_m: 0.0", "height_m: 10.0"))
    assert load_site(path) != load_site("daejeon")
    return path


def test_a_plan_after_a_recording_is_for_its_imu_at_its_site(bag, elsewhere, tmp_path, monkeypatch):
    known = sdimu.diagnose(sdimu.calibrate(sdimu.open(bag, site=str(elsewhere), imu="fog_tactical"))).known
    asked = []

    def note(first, question, able, goal, tries, progress):
        asked.append((question.imu, question.site))
        return search(first, question, able, goal, tries, progress)

    monkeypatch.setattr("sdimu_calibration.api.functions.search", note)
    monkeypatch.chdir(tmp_path)
    fog, dtg, here, there = load_imu("fog_tactical"), load_imu("dtg"), load_site("daejeon"), load_site(elsewhere)
    for stated, meant in (
        ({}, (fog, there)),
        ({"imu": "dtg"}, (dtg, there)),
        ({"site": "daejeon"}, (fog, here)),
        ({"imu": dtg, "site": here}, (dtg, here)),
    ):
        sdimu.plan(quick_plan(), tries=1, after=known, **stated)
        assert asked.pop() == meant


def test_a_plan_after_nothing_is_for_the_usual_imu_at_the_usual_site(monkeypatch):
    monkeypatch.setattr("sdimu_calibration.api.functions.search", lambda _first, question, *_: question)
    asked = sdimu.plan(quick_plan())
    assert (asked.imu, asked.site) == (load_imu("dtg"), load_site("daejeon"))


def test_a_prediction_takes_names_and_objects_alike():
    named = sdimu.predict("kim18", imu="fog_tactical")
    given = sdimu.predict(load_plan("kim18"), imu=load_imu("fog_tactical"), site=load_site("daejeon"))
    np.testing.assert_array_equal(given.sigma, named.sigma)
