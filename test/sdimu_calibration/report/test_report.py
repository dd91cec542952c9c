"""The page of a diagnosis says what the diagnosis says, brings everything along, and is legible without colour."""

from __future__ import annotations

import csv
import io
import json
import re
import warnings
from dataclasses import replace
from html import escape

import numpy as np
import pytest
import yaml

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.ladder import Rung, error_ladder
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.error_figures import held_out
from sdimu_calibration.core.posterior.told import Share
from sdimu_calibration.report import (
    data,
    evidence_figures,
    measured,
    measured_figures,
    residual_figures,
    sections,
    use_section,
)
from sdimu_calibration.report.coefficients import as_csv, as_yaml, grouped_table
from sdimu_calibration.report.cost import in_use, in_use_entry, metres
from sdimu_calibration.report.evidence_figures import heat_maps
from sdimu_calibration.report.first_screen import ladder_strip
from sdimu_calibration.report.markup import grid, prose, section, signs
from sdimu_calibration.report.may_be import MayBe, classes_of
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.report.report_extras import ReportExtras, report_extras
from sdimu_calibration.report.sections import confused, found_table
from sdimu_calibration.report.table import rows
from sdimu_calibration.report.traceability import recorded, traceability
from sdimu_calibration.storage.trace import Trace


@pytest.fixture(scope="module")
def text(diagnosis: Diagnosis, more: ReportExtras) -> str:
    return page(diagnosis.after, Contents("A test", summary=summarise(diagnosis), more=more))


def all_figures(diagnosis: Diagnosis, more: ReportExtras) -> dict[str, object]:
    found = data.residuals(diagnosis)
    return {
        "ranking": evidence_figures.ranking(data.scored(diagnosis), diagnosis.found.threshold),
        "heat map": evidence_figures.heat_map(data.where(diagnosis.consistency)),
        "explained": evidence_figures.explained(data.explained(diagnosis)),
        "innovations": residual_figures.innovations(found, two=True),
        "measured": measured_figures.overlay(measured.overlay(diagnosis, found)),
        "variables": residual_figures.against_variables(
            found, data.variables(diagnosis), data.VARIABLES, range(8), two=True
        ),
        "jumps": measured_figures.jumps(measured.jumps(diagnosis, found), two=True),
        "in use": use_section.figure(more.trials),
        "free inputs": residual_figures.free_inputs(data.free_inputs(diagnosis), two=True),
    }


def test_a_channel_that_was_never_measured_leaves_its_panel_empty_without_a_warning(diagnosis):
    """One rest and no turn: nothing says what the velocity was after one."""
    found = data.residuals(diagnosis)
    never = np.arange(12) < 6
    gone = [np.where(never, np.nan, values) for values in (found.sigma, found.before, found.after)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = residual_figures.innovations(data.Residuals(found.t, found.stop, *gone), two=True)
    assert "NaN" not in json.dumps(figure.layout, default=str)


def test_the_verdict_stands_first(text, diagnosis):
    body = text.partition("<body>")[2]
    (found,) = diagnosis.chosen
    assert body.index(found.effect.title) < body.index("<h2>")
    assert prose(diagnosis.sentence) in body


def test_a_page_with_the_coefficients_of_the_model_as_given_calls_them_no_means(text, diagnosis):
    means = "are means over these models"
    assert means in text
    of_run = page(diagnosis.before, Contents("x", summary=summarise(diagnosis)))
    assert means not in of_run
    assert "The table of coefficients is of one model" in of_run
    # Where nothing was found the names are the same, and the values need not be.
    moved = replace(diagnosis.after, values=diagnosis.after.values + 1e-9)
    assert means not in page(moved, Contents("x", summary=summarise(diagnosis)))


def test_the_contents_name_every_card_of_the_page_in_its_order(text):
    links = re.findall(r'<li><a href="#([\w-]+)">(.*?)</a>', text)
    cards = re.findall(r'<section class="card" id="([\w-]+)"><h2>(.*?)</h2>', text)
    assert len(cards) > 5
    assert links == [("verdict", "Verdict"), *((place, words.partition(":")[0]) for place, words in cards)]


def test_a_card_tells_its_heading_as_text():
    card = section("Errors & what they cost", "<p>much</p>")
    assert card.heading == "Errors & what they cost"
    assert "<h2>Errors &amp; what they cost</h2>" in card


def test_the_page_brings_its_library_once_and_asks_no_network(text):
    assert text.count('id="library"') == 1
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    assert len(text.encode()) < 6e6


def test_the_ladder_tells_the_fall_of_the_held_out_error(text, diagnosis):
    (first, before), (last, after) = error_ladder(diagnosis)
    assert (before, after) == (held_out(diagnosis.before), held_out(diagnosis.after))
    assert after < before
    # The same figure in the ladder of the first screen and in the table.
    verdict = text[text.index('<section id="verdict">') : text.index('id="coefficients"')]
    for name, value in ((first, before), (last, after)):
        assert re.search(rf"{re.escape(name)}</td><td>[\d.]+ k?m</td><td>{value:.3f}</td>", verdict)
    assert f"{before:.3f} \u2192 {after:.3f}" in text


def test_cells_of_the_heat_map_say_their_sign_without_colour(diagnosis):
    grid = data.where(diagnosis.consistency)
    cells = evidence_figures.heat_map(grid).data[0]["text"]
    for row, values in zip(cells, grid.value, strict=True):
        for cell, value in zip(row, values, strict=True):
            sign = "+" if value >= 0.0 else "\N{MINUS SIGN}"
            assert cell == "" or cell[0] == sign or (cell == "0.0" and abs(value) < 0.05)


def test_before_and_after_differ_in_more_than_colour(diagnosis, more):
    figure = all_figures(diagnosis, more)["innovations"]
    symbols = {trace["name"]: trace["marker"]["symbol"] for trace in figure.data if "legendgroup" in trace}
    assert len(symbols) == 2
    assert len(set(symbols.values())) == 2


CATEGORIES = {"stop", "channel", "candidate", "model", "coefficient"}
UNITS = {*data.CHANNEL_UNITS, *measured.UNITS}


def test_every_axis_says_its_quantity_and_unit(diagnosis, more):
    """An axis may leave the words to one whose scale it shares, or the unit to the first of its row, never both."""
    for name, figure in all_figures(diagnosis, more).items():
        for letter in "xy":
            axes = {key: axis for key, axis in figure.layout.items() if key.startswith(f"{letter}axis")}
            said = {key: axis.get("title", {}).get("text") for key, axis in axes.items()}
            for key, axis in axes.items():
                title = said[key]
                shared = "matches" in axis or axis.get("showticklabels") is False or _shares(axes, key)
                shared = shared or any(said[k] in UNITS for k in axes if letter == "y" and _in_row(axes[k], axis))
                assert title or shared, (name, key)
                if title:
                    bare = title.replace("<br>", " ")
                    assert bare in CATEGORIES | UNITS or re.search(r"\(.+\)", bare), (name, title)
            assert any(said.values()), name


def _shares(axes, key):
    return any(other.get("matches") == key.replace("axis", "") for other in axes.values())


def _in_row(one, other):
    return one.get("domain") == other.get("domain")


def test_dashes_tell_compensations_apart(more):
    dashes = {trace["name"]: trace["line"]["dash"] for trace in use_section.figure(more.trials).data}
    drawn = {dashes[drift.name] for drift in more.trials[0].drifts}
    assert len(drawn) == len(more.trials[0].drifts) == 3


def test_the_page_says_what_it_means_in_use(text, more):
    for trial in more.trials:
        assert escape(use_section.trial_sentence(trial)) in text
        assert f"{trial.segment.length_s / 60.0:.1f} min" in use_section.trial_sentence(trial)


def test_the_page_says_why_nothing_was_navigated(diagnosis):
    text = page(diagnosis.after, Contents("x", summary=summarise(diagnosis), more=ReportExtras(no_trial="too short")))
    assert "Not tried: too short." in text


def test_the_ladder_of_refits_tells_every_rung(diagnosis):
    rungs = (
        Rung("", True, "", -10.0, 0.0, 1.5, 2.4, 8.0, 0.01, ()),
        Rung("some_effect", True, "", 20.0, 30.0, 1.01, 0.98, 1.0, 0.001, (("gyro_bias_x", 7.1),)),
        Rung("other_effect", False, "does not lower it", 21.0, 1.0, 1.01, 0.99, 1.0, 0.001, ()),
    )
    text = page(diagnosis.after, Contents("x", summary=summarise(replace(diagnosis, rungs=rungs))))
    for word in ("+ some_effect", "+30.0", "gyro_bias_x +7.1", "held-out RMS falls"):
        assert word in text
    # Whether the error falls is told of each, and nothing is called accepted: of a class it is open which it is.
    told = [re.findall(r"<td[^>]*>(yes|no)</td>", line) for line in text.split("<tr>") if "_effect</td>" in line]
    assert [one for one in told if one] == [["yes"], ["no"]]
    assert "accepted" not in text


@pytest.fixture(scope="module")
def grown(diagnosis: Diagnosis) -> Diagnosis:
    """A ladder of three models: the one between is that with what was found."""
    numbers = (True, "", 20.0, 30.0, 1.01, 0.98, 1.0, 0.001, ())
    fits = {"": diagnosis.fit, "one": diagnosis.extended, "other": diagnosis.extended}
    return replace(diagnosis, rungs=tuple(Rung(added, *numbers, fit=fit) for added, fit in fits.items()))


def test_every_rung_has_its_metres(grown):
    """Those between the ends had none: a reader saw an error fall of which nobody said what it is worth."""
    more = report_extras(grown)
    last = metres(in_use(more).distance[-1])
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", ladder_strip(summarise(grown), more))
    assert cells[cells.index("+ one") + 1] == cells[cells.index("+ other") + 1] == last
    told = {one["model"]: one["rms_m"] for one in in_use_entry(more)["position"]}
    assert list(told) == ["not compensated", "model as given", "+ one", "with what was found"]
    assert told["+ one"] == pytest.approx(told["with what was found"], rel=1e-9)
    assert told["model as given"] != pytest.approx(told["+ one"], rel=1e-3)


def test_the_figure_in_use_shows_the_ends_of_a_ladder(grown):
    """It has ink and dashes for three."""
    names = {trace["name"] for trace in use_section.figure(report_extras(grown).trials).data}
    assert {"model as given", "with what was found"} <= names
    assert "+ one" not in names


def test_the_threshold_is_drawn(diagnosis, more):
    figure = all_figures(diagnosis, more)["ranking"]
    (line,) = figure.layout["shapes"]
    assert line["x0"] == line["x1"] == diagnosis.found.threshold
    assert line["line"]["width"] > 0
    assert line["opacity"] == 1.0


def test_no_size_of_a_candidate_is_written_over_the_line_of_the_noise(diagnosis, more):
    figure = all_figures(diagnosis, more)["ranking"]
    (sizes,) = (trace for trace in figure.data if trace["type"] == "scatter" and trace["mode"] == "text")
    assert min(sizes["x"]) >= diagnosis.found.threshold


def test_a_diagnosis_of_a_right_model_makes_a_page_too(diagnosis):
    found = diagnosis.found
    empty = type(found)((), found.chosen[:0], found.first, found.threshold, diagnosis.evidence)
    quiet = replace(diagnosis, found=empty, found_effects=(), adequate=True, verdict="consistent")
    text = page(diagnosis.before, Contents("x", summary=summarise(quiet)))
    assert "No candidate stands out" in text
    assert 'class="verdict good"' in text


def test_a_ladder_without_steps_does_not_deny_the_candidates_that_stand_out(diagnosis):
    empty = replace(diagnosis.found, steps=(), chosen=diagnosis.found.chosen[:0])
    text = sections.ladder(replace(diagnosis, found=empty, adequate=False))
    assert "No candidate" not in text
    assert "stand out of the noise" in text


def test_copies_read_back_as_the_table(diagnosis):
    table = rows(diagnosis.after)
    copied = yaml.safe_load(as_yaml(table, "accelerometer_triad"))["coefficients"]
    listed = {line["name"]: line for line in csv.DictReader(io.StringIO(as_csv(table)))}
    for row in table:
        assert copied[row.name]["value"] == pytest.approx(row.value, rel=1e-8, abs=1e-12)
        assert copied[row.name]["unit"] == listed[row.name]["unit"] == row.unit
        assert float(listed[row.name]["sigma"]) == pytest.approx(row.sigma, rel=1e-3)


def test_what_looks_the_same_shares_the_bar_of_what_was_found(diagnosis):
    entries = data.scored(diagnosis)
    (found,) = (one for one in entries if one.chosen)
    other = next(one.label for one in entries if not one.chosen and one.z and "(" not in one.label)
    alone = evidence_figures.ranking(entries, 4.0).data[0]
    assert other in alone["y"]
    shares = {found.coefficient: MayBe("98 %", {found.coefficient: "82 %", other: "18 %"})}
    figure = evidence_figures.ranking(entries, 4.0, shares)
    folded, axis = figure.data[0], figure.layout["yaxis"]
    assert [text.partition(", ")[2] for text in figure.data[1]["text"] if "%" in text] == ["98 %"]
    assert other not in folded["y"]
    (words,) = (text for text in folded["customdata"] if "82 %" in text)
    assert words.startswith(f"{found.coefficient} 82 %<br>")
    assert words.endswith(f"<br>or {other} 18 %")
    (name,) = (text for text in axis["ticktext"] if text.startswith("\N{BLACK RIGHT-POINTING TRIANGLE}"))
    assert name.endswith(f" {evidence_figures.with_look_alikes([found.coefficient, other])}")
    assert axis["tickvals"] == folded["y"]


@pytest.mark.parametrize(
    ("others", "told"),
    [
        ((), "gyro_bias_ramp_x"),
        (("gyro_bias_warm_up_x",), "gyro_bias_ramp_x or \N{HORIZONTAL ELLIPSIS}warm_up_x"),
        (("accel_cubic_x",), "gyro_bias_ramp_x or accel_cubic_x"),
        (
            ("gyro_bias_warm_up_x", "gyro_bias_wrap_xx", "gyro_bias_step_x"),
            "gyro_bias_ramp_x or \N{HORIZONTAL ELLIPSIS}warm_up_x and 2 more",
        ),
        (("gyro_mass_unbalance_ramp_qx(tau=2400 s)",) * 2, "gyro_bias_ramp_x and 2 more"),
    ],
)
def test_a_bar_names_its_look_alikes_as_far_as_there_is_room(others, told):
    assert evidence_figures.with_look_alikes(["gyro_bias_ramp_x", *others]) == told


def test_a_bar_of_a_class_says_how_probable_its_own_effect_is(diagnosis):
    """The likeliest of a class stood there, whichever effect had the bar."""
    (one,) = summarise(diagnosis).found
    own = one.candidate.coefficient
    open_ = replace(one, may_be=(Share("other_effect", 0.7), Share(own, 0.3)), probability=0.97)
    (told,) = classes_of([open_]).values()
    assert list(told.shares.items()) == [(own, "30 %"), ("other_effect", "70 %")]
    assert told.probability == "97 %"


def test_a_bar_of_an_effect_that_is_certain_says_so(diagnosis):
    summary = summarise(diagnosis)
    (told,) = classes_of(summary.found, diagnosis.probabilities).values()
    assert told.probability == "> 99 %"
    assert not told.shares


def test_a_map_of_rests_does_not_call_them_stops():
    figure = heat_maps([data.Grid(np.arange(3), np.zeros((1, 3)))], ["gyro_x"], "rest")
    assert figure.layout["xaxis"]["title"]["text"] == "rest"
    assert "at rest %{x}" in figure.data[0]["hovertemplate"]


def test_a_column_stands_where_it_has_something_to_say(diagnosis):
    """Only refits know a held-out error, and only what was named by a path is said again beside its name."""
    summary = summarise(diagnosis)
    assert "held-out error" in found_table(summary)
    unfitted = [replace(one, held_out_before=np.nan, held_out_after=np.nan) for one in summary.found]
    assert "held-out error" not in found_table(replace(summary, found=tuple(unfitted)))
    made = Trace("2026-01-01 00:00 UTC", "sdimu", stated=(("site", "daejeon"), ("imu", "/lab/dtg.yaml")))
    told = replace(diagnosis.after, origin=replace(diagnosis.after.origin, site="daejeon", imu="dtg"))
    page = traceability(told, made)
    assert page.count("daejeon") == 1
    assert "/lab/dtg.yaml" in page


def test_what_looks_like_nothing_else_is_not_among_what_is_confused(diagnosis):
    (one,) = summarise(diagnosis).found
    alone = replace(one, alike=(), together=(("gyro_bias_ramp_x", "gyro_bias_step_x", 0.0),))
    assert confused(replace(summarise(diagnosis), found=(alone,))) == ""


def test_tables_of_many_columns_stand_below_each_other(diagnosis):
    fit = diagnosis.after
    narrow = grouped_table(rows(fit))
    broad = grouped_table(rows(fit, truth=dict.fromkeys(fit.names, 0.0), prior=dict.fromkeys(fit.names, 1.0)))
    assert 'class="triads"' in narrow
    assert 'class="triads broad"' in broad


def test_a_stamp_that_counts_from_a_start_is_no_date():
    assert recorded(101_200_000_000) == ""
    assert recorded(1_700_000_000_000_000_000) == "2023-11-14 22:13:20 UTC"


def test_a_coefficient_that_is_confused_has_no_time_constant_beside_the_probability_of_all_of_them(diagnosis):
    one = summarise(diagnosis).found[0]
    alike = ("accel_bias_warm_up_x(tau=2400 s)", "accel_bias_warm_up_x(tau=1200 s)")
    open_ = replace(one, alike=alike, together=(), may_be=(Share("accel_bias_warm_up_x", 0.16),))
    told = confused(replace(summarise(diagnosis), found=(open_,)))
    assert "accelerometer warm-up transient, x" in told
    assert " 16 %" in told
    assert "tau=" not in told


@pytest.mark.parametrize("text", ["of 2026-11-28", "stops 3-5", "1e-05 rad", "held-out", "gyro_x: ey^2-ez^2"])
def test_a_hyphen_that_begins_no_number_stays(text):
    assert signs(text) == text


@pytest.mark.parametrize("text", ["-9.1 sigma", "turn X -180 deg", "gyro_bias_y (-3.0 deg/h)", "by -.5 ug"])
def test_a_hyphen_that_begins_a_number_is_a_sign_of_minus(text):
    assert signs(text) == text.replace("-", "\N{MINUS SIGN}")


def test_numbers_of_a_grid_have_the_sign_of_print_and_words_are_as_they_are():
    table = grid(("unit -1", "mean"), [["unit -1", "-0.5"]], {0})
    assert '<th class="text">unit -1</th>' in table
    assert '<td class="text">unit -1</td><td>\N{MINUS SIGN}0.5</td>' in table


def test_sizes_of_the_table_of_probabilities_have_one_sign_of_minus(diagnosis):
    """Those of effects that were found had the hyphen of a terminal, the others the sign of print."""
    summary = summarise(diagnosis)
    minus = replace(summary, found=tuple(replace(one, value=-abs(one.value)) for one in summary.found))
    text = page(diagnosis.after, Contents("x", summary=minus))
    table = text.partition('<table class="odds">')[2].partition("</table>")[0]
    sizes = re.findall(r"<td>([^<]*\N{PLUS-MINUS SIGN}[^<]*)</td>", table)
    assert any(size.startswith("\N{MINUS SIGN}") for size in sizes)
    assert not [size for size in sizes if "-" in size]
