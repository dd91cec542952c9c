"""A recording of another unit is told as that before any physics is sought."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects.body_frame import FRAMES, TRIAD_NAMES, read_in_axes
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.joint.member import Job, Member, Report
from sdimu_calibration.core.joint.same_unit import check_one_unit
from sdimu_calibration.core.joint.set_fit import fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import draw_coefficients, in_body_frame

from .conftest import SITE, InMemory, here, short, unit_set

AS_GIVEN = np.eye(3)
TURNED = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Axes x, y, z of a recording are y, -x, z of the unit."""
SIDEWAYS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""The axis of the turns is another one: what both recordings tell of the unit are few coefficients."""


@pytest.fixture(scope="module")
def reports():
    """Three recordings of one unit, and one of another, each by its own fit."""
    own, other = unit_set(31, [short()] * 3).members, unit_set(32, [short()]).members

    return here([Job(m, load_model("baseline")) for m in (*own, replace(other[0], name="strange"))])


def test_one_unit_passes(reports):
    check_one_unit(reports[:3])
    check_one_unit(reports[:1])


def test_the_recording_of_another_unit_is_named(reports):
    with pytest.raises(
        DataError, match=r"'strange' is of another unit than the others.*(ppm|arcmin|deg/h/g) \(\d+ sigma\)"
    ):
        check_one_unit(reports)


def test_of_two_recordings_none_is_the_stranger(reports):
    with pytest.raises(DataError, match="'r0' and 'strange' are of two units"):
        check_one_unit([reports[0], reports[3]])


def test_temperatures_far_apart_may_change_a_unit_as_much(reports):
    cold, warm = (replace(r, temperature_degc=t) for r, t in ((reports[0], -20.0), (reports[3], 50.0)))
    check_one_unit([cold, warm])


def test_a_set_is_refused_before_physics_is_sought(options):
    own, other = unit_set(31, [short()] * 2).members, unit_set(32, [short()]).members
    with pytest.raises(DataError, match="'strange' is of another unit"):
        fit_set((*own, replace(other[0], name="strange")), options, here)


def in_axes(member: Member, axes=TURNED) -> Member:
    """Return a recording whose samples are in turned axes."""
    test = member.open()
    r = test.recording
    turned = replace(r, omega_ib_b=r.omega_ib_b @ axes.T, f_ib_b=r.f_ib_b @ axes.T)
    return replace(member, name="strange", open=InMemory(PreparedTest(turned, test.imu, test.site)))


def test_turned_axes_are_named(reports):
    strange = here([Job(in_axes(unit_set(31, [short()] * 3).members[2]), load_model("baseline"))])[0]
    with pytest.raises(DataError, match="'strange' are turned against the others: its x, y, z are y, -x, z of the"):
        check_one_unit([reports[0], strange, reports[1]])
    with pytest.raises(DataError, match=r"axes of '(strange|r0)' are turned against '(r0|strange)'"):
        check_one_unit([reports[0], strange])


def test_a_difference_that_no_exchange_of_axes_makes_is_that_of_another_unit(reports):
    """What axes do not turn here, the mass unbalance, may be all that differs."""
    values = reports[2].values.copy()
    values[[k for k, name in enumerate(reports[2].names) if "mass_unbalance" in name]] *= -9.0
    with pytest.raises(DataError, match="'r2' is of another unit than the others"):
        check_one_unit([*reports[:2], replace(reports[2], values=values)])


def test_coefficients_whose_spread_the_imu_file_does_not_state_say_nothing(reports):
    """Units that have nothing of an effect agree in it, and are no more one unit for that."""
    stated = {name: size for name, size in reports[0].imu.prior.items() if "unbalance" not in name}
    bare = [replace(r, imu=replace(r.imu, prior=stated)) for r in reports]
    with pytest.raises(DataError, match=r"'strange' is of another unit.*most (gyro|accel)_(scale|misalignment)"):
        check_one_unit(bare)
    values = bare[2].values.copy()
    values[[k for k, name in enumerate(bare[2].names) if "mass_unbalance" in name]] *= -9.0
    check_one_unit([*bare[:2], replace(bare[2], values=values)])


def test_a_prior_that_one_recording_widened_tells_no_units_apart(reports):
    """A short test about one axis may end at a hundred times the prior, and state a small sigma there."""
    short_one, name = reports[2], "gyro_mass_unbalance_dx"
    own, rows = short_one.names.index(name), short_one.reduction.names.index(name)
    values, sigma, weight = short_one.values.copy(), short_one.sigma.copy(), short_one.reduction.weight.copy()
    values[own], sigma[own] = 200.0 / np.sqrt(weight[rows]), 2.0 / np.sqrt(weight[rows])
    far = replace(short_one, values=values, sigma=sigma)
    with pytest.raises(DataError, match=f"two units.*most {name}"):
        check_one_unit([reports[0], far])
    weight[rows] = (3.0 * values[own]) ** -2.0
    check_one_unit([reports[0], replace(far, reduction=replace(far.reduction, weight=weight), widened=True)])


def as_calibrated(like: Report, imu: str, unit: int, recording: int, axes=AS_GIVEN) -> Report:
    """Report of a unit of an IMU file whose heading stays open: its truth with errors of a hundredth of the priors."""
    spec = load_imu(imu)
    true = in_body_frame(draw_coefficients(spec, unit), FRAMES[0])
    values = np.array([true[name] for name in like.names])
    prior = np.array([spec.prior[name.rpartition("_")[0]] for name in like.names])
    places = [like.names.index(name) for name in TRIAD_NAMES]
    values[places] = read_in_axes(TRIAD_NAMES, values[places], np.zeros(len(places)), axes.T)[0]
    sigma = np.where(like.sigma > 0.0, 0.01 * prior, 0.0)
    values += sigma * np.random.default_rng((unit, recording)).standard_normal(len(values))
    weight = dict(zip(like.names, prior**-2.0, strict=True))
    rows = replace(like.reduction, weight=np.array([weight[name] for name in like.reduction.names]))
    return replace(like, name=f"r{recording}", reduction=rows, values=values, sigma=sigma, heading_rad=0.1)


@pytest.mark.parametrize("imu", ["mems_consumer", "mems_industrial", "fog_tactical"])
@pytest.mark.parametrize("unit", range(51, 61))
def test_recordings_whose_heading_stays_open_are_compared_too(reports, imu, unit):
    own = [as_calibrated(reports[0], imu, unit, k) for k in range(3)]
    check_one_unit(own)
    with pytest.raises(DataError, match="'r3' is of another unit than the others"):
        check_one_unit([*own, as_calibrated(reports[0], imu, unit + 500, 3)])
    with pytest.raises(DataError, match="'r3' are turned against the others: its x, y, z are y, -x, z of the others"):
        check_one_unit([*own, as_calibrated(reports[0], imu, unit, 3, TURNED)])


def test_a_set_of_a_cheap_imu_is_refused_before_physics_is_sought(options):
    """Nothing but its heading is open in each of these recordings, and no wide prior hides another unit."""
    imu = load_imu("mems_industrial")
    plan = load_plan("kim18")
    turns = tuple(replace(turn, rate_rad_s=np.radians(4.0)) for turn in plan.turns[:7])
    unit = Scenario(replace(plan, dwell_s=(15.0,) * 8, turns=turns), imu, SITE, rate_hz=10.0, seed=61)
    tests = [
        PreparedTest(generate(replace(unit, seed=seed, start_ns=seed * 10**15))[0], imu, SITE) for seed in (61, 62)
    ]
    members = [Member(f"r{k}", InMemory(test)) for k, test in enumerate(tests)]
    with pytest.raises(DataError, match="'r0' and 'r1' are of two units"):
        fit_set(members, options, here)


@pytest.fixture(scope="module")
def three_stops():
    """Recordings of one unit with two turns about one axis each, and one more in turned axes."""
    own = unit_set(34, [short(stops=3)] * 3).members
    return here([Job(m, load_model("baseline")) for m in (*own, in_axes(own[0], SIDEWAYS))])


def test_what_the_data_do_not_tell_of_the_axes_is_said(three_stops):
    assert check_one_unit(three_stops[:3]) == ""
    told = check_one_unit([three_stops[0], three_stops[3], three_stops[2]])
    assert told.startswith("the data do not tell whether 'strange' is of the unit that the others are of")


def test_a_set_says_that_its_axes_are_not_told(options):
    own = unit_set(34, [short(stops=3)] * 3).members
    fit = fit_set((own[1], own[2], in_axes(own[0], SIDEWAYS)), options, here)
    assert "whether 'strange' is of the unit" in fit.unit_doubt
    assert fit.unit_doubt in set_outcome(fit).notes
