"""An effect of one's own: read safely, held to its units, and as good as a built-in one."""

from __future__ import annotations

import importlib.metadata
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.compensation.compensator import resolved
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.storage.files import effect_file
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.effect_file import (
    added_to,
    effects_of_result,
    extended_model,
    find_effects,
    load_effect,
    si_unit,
    without_file,
)
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_sim.core.scenario import Scenario, generate

TWIN = """\
format: sdimu-effect/1
name: bent_force
expressions:
  accel_x: k * ax**2
parameters:
  k: {unit: ug/g^2, prior: 30 ug/g^2}
"""
TWO = TWIN.replace("k * ax**2", "k * ax**2 + m * ax * wtz").replace(
    "prior: 30 ug/g^2}", "prior: 30 ug/g^2}\n  m: {unit: ug*s/deg/g, prior: 5 ug*s/deg/g}"
)
SITE = Site(latitude_rad=float(np.radians(36.4)))


@pytest.fixture
def write(tmp_path):
    def make(text: str):
        path = tmp_path / "own.yaml"
        path.write_text(text)
        return path

    return make


@pytest.fixture(scope="module")
def recording():
    turns = tuple(Turn(a, np.radians(90.0), np.radians(15.0)) for a in "XYZXYZ")
    plan = Plan("six turns", (20.0,) * 7, turns, np.radians(60.0))
    table, hidden = TableSpecification(axes=None), ("accel_quadratic_x=200 ug/g^2",)
    return generate(Scenario(plan, load_imu("dtg"), SITE, table=table, rate_hz=20.0, seed=5, effects=hidden))[0]


def test_an_effect_by_file_gives_the_numbers_of_its_built_in_twin(write, recording):
    imu = load_imu("dtg")
    built_in = registry.get("accel_quadratic").only(("accel_quadratic_x",))
    prior = {"accel_quadratic": built_in.prior["navigation"], "bent_force": built_in.prior["navigation"]}
    imu = replace(imu, prior={**imu.prior, **prior})
    baseline = load_model("baseline")
    results = [
        calibrate(recording, SITE, imu, replace(baseline, effects=(*baseline.effects, effect)), held_out=False)
        for effect in (built_in, load_effect(write(TWIN))[0])
    ]
    sigma = np.sqrt(np.diag(results[0].covariance))
    np.testing.assert_allclose((results[1].values - results[0].values)[sigma > 0] / sigma[sigma > 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(results[1].covariance, results[0].covariance, rtol=1e-9, atol=1e-30)


def test_as_a_candidate_it_has_the_signature_of_its_twin(write, recording):
    fit = solve(PreparedTest(recording, load_imu("dtg"), SITE), load_model("baseline"))
    pair = [registry.get("accel_quadratic").only(("accel_quadratic_x",)), *load_effect(write(TWIN))]
    W = fit.evidence(pair).W[:, -2:]
    np.testing.assert_allclose(W[:, 1], W[:, 0], rtol=1e-9, atol=1e-9 * np.abs(W[:, 0]).max())


def test_each_parameter_has_its_own_name_unit_and_prior(write):
    k, m = load_effect(write(TWO))
    assert (k.parameters[0].name, m.parameters[0].name) == ("bent_force_k", "bent_force_m")
    assert k.parameters[0].unit == "m/g^2/s^2"
    assert m.prior["mems"] == pytest.approx(5e-6 * 9.80665 * 180.0 / np.pi)
    assert k.family == m.family == "bent_force"


@pytest.mark.parametrize("unit", ["deg/h/g", "ug/g^2", "ppm", "deg/h/sqrt(Hz)", "ms", "ug*s/deg", "deg/h/G"])
def test_si_units_keep_the_kind_and_have_factor_one(unit):
    si = parse_unit(si_unit(unit))
    assert si.dimension == parse_unit(unit).dimension
    assert si.factor == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("k * ax**2", "k * ax"), ("expressions.accel_x", "comes to", "m/s^2")),
        (("k * ax**2", "k * ax**2 + wz"), ("joins",)),
        (("k * ax**2", "k * ax**2 * exp(-t)"), ("exp takes a number",)),
        (("k * ax**2", "k * ax**2 * sin(k * 1e5)"), ("sin takes a number",)),
        (("k * ax**2", "k * ax**2 + 1"), ("joins",)),
        (("k * ax**2", "abs(k) * ax**2"), ("not linear in k",)),
        (("k * ax**2", "k * ax**2 * speed"), ("unknown name 'speed'", "known:")),
        (("k * ax**2", "k.__class__"), ("not allowed",)),
        (("k * ax**2", "__import__('os').system('x')"), ("not allowed",)),
        (("k * ax**2", "'[k][0] * ax**2'"), ("not allowed",)),
        (("k * ax**2", "k * ax**"), ("cannot read",)),
        (("k * ax**2", "k * ax**ay"), ("must be a",)),
        (("accel_x:", "accel_q:"), ("own.yaml", "expressions")),
        (("ug/g^2, prior", "furlong, prior"), ("furlong",)),
        (("prior: 30 ug/g^2", "prior: 30 deg/h"), ("parameters.k.prior",)),
        (("prior: 30 ug/g^2", "prior: 0 ug/g^2"), ("parameters.k.prior",)),
        (("name: bent_force", "name: gyro_bias"), ("registered",)),
        (("name: bent_force", "name: bent force"), ("name",)),
        (("  k: {", "  m: {unit: ppm, prior: 1 ppm}\n  k: {"), ("parameters.m", "no expression")),
        (("  k: {", "  t: {unit: s, prior: 1 s}\n  k: {"), ("parameters.t",)),
        (("sdimu-effect/1", "sdimu-effect/2"), ("format",)),
    ],
)
def test_every_mistake_in_a_file_is_one_clear_line(write, change, words):
    old, new = change
    assert old in TWIN
    path = write(TWIN.replace(old, new))
    with pytest.raises(DataError) as error:
        load_effect(path)
    text = str(error.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    for word in words:
        assert word in text


def test_constants_carry_units_into_a_formula(write):
    text = TWIN.replace("ax**2", "exp(-t / tau)").replace("ug/g^2", "ug") + "constants: {tau: 300 s}\n"
    (effect,) = load_effect(write(text))
    assert effect.parameters[0].unit == "m/s^2"


def test_an_absent_file_is_told_by_its_name(tmp_path):
    with pytest.raises(DataError, match=r"nowhere\.yaml"):
        find_effects(str(tmp_path / "nowhere.yaml"))


@pytest.mark.parametrize(
    ("model", "added"),
    [
        ("baseline", ["gyro_bias"]),
        ("baseline", ["accel_scale_y"]),
        ("hand", ["gyro_g_sensitivity_xx"]),
        ("baseline", ["accel_quadratic", "accel_quadratic_z"]),
        ("baseline", ["gyro_x: ey^2", "gyro_x: ey^2"]),
    ],
)
def test_adding_what_a_model_has_is_refused(model, added):
    with pytest.raises(DataError, match=re.escape(f"'{added[-1]}' is in the model already")):
        extended_model(model, added)


def test_what_came_to_a_model_is_told_by_its_names():
    result = (*load_model("baseline").effects, "accel_quadratic_z", "gyro_bias_warm_up_y(tau=600 s)", "gyro_x: ey^2")
    added = ["accel_quadratic_z", "gyro_bias_warm_up_y(tau=600 s)", "gyro_x: ey^2"]
    assert added_to("baseline", (*result, "of my own")) == added
    assert added_to("baseline", load_model("baseline").effects) == []


@pytest.mark.parametrize(("part", "names"), [("", ("bent_force_k", "bent_force_m")), (":m", ("bent_force_m",))])
def test_a_result_names_the_files_of_its_own_effects_by_which_they_are_added_again(
    write, recording, tmp_path, monkeypatch, part, names
):
    write(TWO)
    monkeypatch.chdir(tmp_path)  # named as seen from there, and found from anywhere
    begun = calibrate(recording, SITE, load_imu("dtg"), extended_model("baseline", [f"own.yaml{part}"]))
    write_result(tmp_path / "result.json", begun)
    result = read_result(tmp_path / "result.json")
    file = str(tmp_path / "own.yaml")
    assert result.origin.effect_files == (file,)
    added = added_to("baseline", result.model, result.origin.effect_files)
    assert added == [file + part]
    again = extended_model("baseline", added)
    assert tuple(p.name for e in again.found for p in e.parameters) == names
    assert without_file(result, again) == ""
    with pytest.raises(DataError, match=f"it was read from {re.escape(file)}$"):
        resolved(result)


@pytest.mark.parametrize("left", ["", TWIN.replace("bent", "other")], ids=["gone", "changed"])
def test_an_own_effect_without_its_file_is_told_and_not_added(write, tmp_path, left):
    file = write(left) if left else tmp_path / "own.yaml"
    names = tuple(q.name for e in extended_model("baseline", ()).effects for q in e.parameters)
    result = SimpleNamespace(names=(*names, "bent_force_k"), origin=Origin(effect_files=(str(file),)))
    added = added_to("baseline", (*load_model("baseline").effects, "bent_force_k"), result.origin.effect_files)
    assert added == []
    told = without_file(result, extended_model("baseline", added))
    assert told.startswith(f"bent_force_k: in result.json, but not in what was diagnosed: {file}: gone, or changed")


def test_what_a_model_has_is_not_added_twice():
    model = extended_model("baseline", ["accel_quadratic_x", "accel_quadratic"])
    names = [p.name for e in model.effects for p in e.parameters]
    assert len(names) == len(set(names)) == 33
    # Every added effect has a name that `--add` reads back.
    for effect in model.effects:
        assert find_effects(effect.name)[0].parameters == effect.parameters


class _Point:
    """Stands for an entry point of another package."""

    def __init__(self, name, answer):
        self.name, self.value, self._answer = name, f"elsewhere:{name}", answer

    def load(self):
        if isinstance(self._answer, Exception):
            raise self._answer
        return lambda: self._answer


@pytest.fixture
def installed(monkeypatch):
    """Let other packages offer an answer; what is installed is read again before and after."""

    def offer(answer):
        groups = []

        def entry_points(group):
            groups.append(group)
            return [_Point("p", answer)] if group == "sdimu_calibration.effects" else []

        monkeypatch.setattr(effect_file, "_LOADED", set())
        monkeypatch.setattr(effect_file, "entry_points", entry_points)
        return groups

    effect_file._installed.cache_clear()
    yield offer
    effect_file._installed.cache_clear()


def test_a_plug_in_becomes_part_of_the_catalogue(monkeypatch, installed):
    like = registry.get("gyro_scale_cubic")
    parameters = tuple(replace(p, name=f"plugged_in_{k}") for k, p in enumerate(like.parameters))
    effect = replace(like, name="plugged_in", parameters=parameters)
    monkeypatch.setattr(registry, "_EFFECTS", dict(registry._EFFECTS))
    asked = installed(effect)
    assert find_effects("plugged_in")[0].parameters == effect.parameters
    assert find_effects("plugged_in")[0].name == "plugged_in"
    assert "plugged_in" in registry.names()
    assert asked == ["sdimu_calibration.effects"]


@pytest.mark.parametrize("answer", [ImportError("gone"), "no effect", registry.get("gyro_bias")])
def test_a_bad_plug_in_is_one_line(installed, answer):
    installed(answer)
    with pytest.raises(DataError, match="plug-in 'p'"):
        find_effects("gyro_bias")


def test_the_group_of_plug_ins_is_read_from_installed_packages():
    assert effect_file.entry_points is importlib.metadata.entry_points


def test_an_equation_of_no_sensor_names_the_sensors():
    with pytest.raises(DataError, match=r"no such sensor.*accel_z"):
        find_effects("gyro_q: ey^2")


def test_a_result_states_its_equations_itself():
    (found,) = effects_of_result(("gyro_bias", "gyro_x: ey^2"), ())
    assert found.name == "gyro_x: ey^2"
    assert effects_of_result(("gyro_x: ey^2",), ("gyro_x: ey^2",))[0].name == found.name
    assert len(effects_of_result(("gyro_x: ey^2",), ("gyro_x: ey^2",))) == 1
