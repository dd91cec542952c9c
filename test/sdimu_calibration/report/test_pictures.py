"""Pictures are small, say the numbers of the diagnosis, and come out the same twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from PIL import Image

from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.design.palette import LIGHT, paint
from sdimu_calibration.report.evidence_figures import cell
from sdimu_calibration.report.may_be import classes_of
from sdimu_calibration.report.pictures import candidates, heat_maps, write_pictures


@pytest.fixture(scope="module")
def drawn(diagnosis, more, tmp_path_factory):
    return write_pictures(tmp_path_factory.mktemp("pictures"), diagnosis, more.trials)


def test_every_picture_is_small_and_opens(drawn):
    assert {path.stem for path in drawn} == {"heat-map", "candidates", "ladder", "in-use", "architecture"}
    for path in drawn:
        assert path.stat().st_size < 150_000
        with Image.open(path) as picture:
            picture.verify()
            assert min(picture.size) > 200


def test_pictures_of_one_diagnosis_are_the_same_bytes(drawn, diagnosis, more, tmp_path):
    again = write_pictures(tmp_path, diagnosis, more.trials)
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in drawn]


def test_cells_say_their_number_before_and_after(diagnosis):
    before, after = heat_maps(diagnosis).axes
    for axes, grid in (
        (before, data.where(diagnosis.consistency)),
        (after, data.stop_grid(data.residuals(diagnosis), after=True)),
    ):
        assert [text.get_text() for text in axes.texts] == [cell(float(v)) for v in grid.value.ravel()]


def test_what_was_found_is_marked_and_stands_first(diagnosis):
    (axes,) = candidates(diagnosis).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels[0].endswith(diagnosis.chosen[0].label)
    marked = [label for label in labels if label.startswith("\N{BLACK RIGHT-POINTING TRIANGLE}")]
    assert marked == labels[:1]


def test_the_bars_are_those_of_the_page_in_its_colours(diagnosis):
    told = classes_of(diagnosis.found_effects, diagnosis.probabilities)
    page = evidence_figures.ranking(data.scored(diagnosis), diagnosis.found.threshold, told)
    (axes,) = candidates(diagnosis).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == page.layout["yaxis"]["ticktext"]
    assert [to_hex(bar.get_facecolor()) for bar in axes.patches] == paint(page.data[0]["marker"]["color"], LIGHT)
    assert [bar.get_alpha() for bar in axes.patches] == page.data[0]["marker"]["opacity"]
    beside = [text.get_text().strip() for text in axes.texts]
    assert beside[0].endswith(", > 99 %")


def test_what_was_found_has_a_bar_however_few_there_are(diagnosis):
    """One whose score alone is small was left out, and nothing was marked as found."""
    entries = data.scored(diagnosis)
    weak = next(s.label for s in entries[len(entries) // 2 :] if s.z and "(" not in s.label)
    weakest = diagnosis.evidence.names.index(weak)
    chosen = replace(diagnosis.found, chosen=np.append(diagnosis.found.chosen, weakest))
    (axes,) = candidates(replace(diagnosis, found=chosen), 3).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert len(labels) == 3
    assert labels[-1] == f"\N{BLACK RIGHT-POINTING TRIANGLE} {weak}"


def test_a_right_model_has_no_ladder(diagnosis, tmp_path):
    quiet = replace(diagnosis, found=replace(diagnosis.found, steps=(), chosen=diagnosis.found.chosen[:0]))
    assert {path.stem for path in write_pictures(tmp_path, quiet)} == {"heat-map", "candidates", "architecture"}
