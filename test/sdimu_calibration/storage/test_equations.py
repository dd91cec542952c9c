"""An equation is added by the words in which a diagnosis proposes it, or by a formula."""

from __future__ import annotations

import numpy as np
import pytest

from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.diagnosis.candidates import equations, periodic
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.effect_file import find_effects
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.temperature import TemperatureProfile

SITE = Site(latitude_rad=float(np.radians(36.4)))


@pytest.fixture(scope="module")
def motion():
    turns = tuple(Turn(a, np.radians(90.0), np.radians(15.0)) for a in "XYZX")
    scenario = Scenario(
        Plan("four turns", (20.0,) * 5, turns, np.radians(60.0)),
        load_imu("dtg"),
        SITE,
        rate_hz=20.0,
        seed=8,
        table=TableSpecification(axes=None),
        temperature=TemperatureProfile(rise=5.0, tau_s=100.0),
    )
    return solve(PreparedTest(generate(scenario)[0], load_imu("dtg"), SITE), load_model("baseline")).known.seen


def test_every_equation_that_a_diagnosis_can_propose_is_found_by_its_label(motion):
    for proposed in (*equations(has_temperature=True), *periodic(2980.0)):
        for k, parameter in enumerate(proposed.parameters):
            (found,) = find_effects(parameter.name)
            assert found.parameters == (parameter,)
            term = next(t for t in proposed.terms if t.parameter == k)
            assert [t.channel for t in found.terms] == [term.channel]
            np.testing.assert_array_equal(
                found.regressors(motion)[:, 0], proposed.regressors(motion)[:, proposed.terms.index(term)]
            )


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("gyro_x: ax * wty", lambda m: m.a[:, 0] * m.w_table[:, 1]),
        ("accel_z: ax^2 ay T", lambda m: m.a[:, 0] ** 2 * m.a[:, 1] * m.temperature),
        ("gyro_z: exp(-t / t) * (nx + ex)", lambda m: np.exp(-1.0) * (m.C_nb[:, 0, 0] + m.C_nb[:, 1, 0])),
    ],
)
def test_a_formula_of_ones_own_is_what_it_says(motion, text, value):
    (effect,) = find_effects(text)
    np.testing.assert_allclose(effect.regressors(motion)[:, 0], value(motion), rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("gyro_x: foo", "unknown name 'foo'"),
        ("gyro_x: ax + t", "not alike"),
        ("gyro_x: k * 1.0", "the coefficient of an equation is implied: write 'gyro_x: 1.0'"),
        ("accel_z: ax**2 * wty * k1", "write 'accel_z: ax**2 * wty'"),
        ("gyro_x:", "cannot read"),
        ("accel_y: __import__('os')", "not allowed"),
    ],
)
def test_a_formula_that_cannot_be_read_is_refused_with_its_text(text, reason):
    with pytest.raises(DataError, match="equation") as error:
        find_effects(text)
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["accel_x: az wty", "accel_x: az*wty"])
def test_an_equation_in_the_rate_may_be_as_large_in_a_turn_as_a_bias_is(text):
    (effect,) = find_effects(text)
    for grade, bias in registry.get("accel_bias").prior.items():
        assert effect.prior[grade] * np.radians(2.0) == pytest.approx(bias)


@pytest.mark.parametrize("formula", ["0 wx", "0", "wx - wx", "0 * ax^2"])
def test_an_equation_that_is_zero_is_refused(formula):
    with pytest.raises(DataError, match="is zero, whatever its variables are"):
        find_effects(f"gyro_x: {formula}")


def test_an_equation_that_is_zero_for_one_sign_alone_is_an_effect():
    assert len(find_effects("gyro_x: abs(wx) - wx")) == 1


def test_a_parameter_of_a_file_that_is_multiplied_by_zero_is_refused(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(
        "format: sdimu-effect/1\nname: mine\nexpressions: {gyro_x: k * wx + 0 * q * wy}\n"
        "parameters:\n  k: {unit: ppm, prior: 1 ppm}\n  q: {unit: ppm, prior: 1 ppm}\n"
    )
    with pytest.raises(DataError, match=r"mine\.yaml: parameters\.q: what it is multiplied by is zero"):
        find_effects(str(path))
