"""Figures are plain data: laid out as the Python package would, written so that the browser reads them back."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest
from plotly.subplots import make_subplots

from sdimu_calibration.report import evidence_figures
from sdimu_calibration.report.design.palette import LIGHT, palette
from sdimu_calibration.report.drawing import Figure, html, lay_out
from sdimu_calibration.report.fleet.figures import _panel
from sdimu_calibration.report.workbench import figures as workbench_figures


@pytest.mark.parametrize(("rows", "cols"), [(1, 1), (4, 3), (6, 2)])
@pytest.mark.parametrize(("share_x", "share_y"), [(False, False), (True, False), (True, True)])
def test_panels_lie_where_the_python_package_puts_them(rows, cols, share_x, share_y):
    titles = [f"panel {k}" for k in range(rows * cols)]
    figure = Figure(rows, cols, titles=titles, share_x=share_x, share_y=share_y, gap_x=0.08, gap_y=0.05)
    expected = make_subplots(
        rows,
        cols,
        subplot_titles=titles,
        shared_xaxes=share_x,
        shared_yaxes=share_y,
        horizontal_spacing=0.08,
        vertical_spacing=0.05,
    ).to_plotly_json()["layout"]
    for key in (key for key in expected if "axis" in key):
        axis = figure.layout[key]
        assert axis.pop("domain") == pytest.approx(expected[key].pop("domain"), abs=1e-12), key
        assert axis == expected[key], key
    for written, by_package in zip(figure.layout["annotations"], expected["annotations"], strict=True):
        assert [written.pop(k) for k in "xy"] == pytest.approx([by_package.pop(k) for k in "xy"], abs=1e-12)
        assert written == by_package


def test_lines_and_words_belong_to_their_panel():
    figure = Figure(2, 2)
    figure.shape("line", row=2, col=1, x0=3.0, x1=3.0)
    figure.annotate("here", row=1, col=2, x=1.0, y=2.0)
    (line,), (words,) = figure.layout["shapes"], figure.layout["annotations"]
    assert (line["xref"], line["yref"], line["x0"], line["y0"], line["y1"]) == ("x3", "y3 domain", 3.0, 0, 1)
    assert (words["xref"], words["yref"], words["text"]) == ("x2", "y2", "here")


def test_numbers_and_words_read_back_from_the_page():
    figure = lay_out(Figure(), 300)
    y = np.array([1.0 / 3.0, np.nan, -2e9])
    figure.add("scatter", x=np.arange(3), y=y, error_y={"array": y}, text=["</script>", "b", "\u2212"])
    figure.add("heatmap", z=np.eye(2))
    found = re.search(r'id="figure-2".*<script type="application/json">(.*)</script>', html(figure, 2))
    trace, grid = json.loads(found[1].replace("<\\/", "</"))["data"]
    assert "</script>" not in found[1]
    assert trace["x"] == [0, 1, 2]
    assert trace["text"] == ["</script>", "b", "\u2212"]
    for spec in (trace["y"], trace["error_y"]["array"]):
        assert spec["dtype"] == "f4"
        read = np.frombuffer(base64.b64decode(spec["bdata"]), "<f4")
        assert read == pytest.approx(y, rel=1e-7, nan_ok=True)
    assert grid["z"]["shape"] == "2, 2"


def test_a_notebook_gets_a_figure_of_the_python_package():
    figure = lay_out(Figure(), 300)
    figure.add("scatter", x=np.arange(3), y=np.ones(3))
    shown = figure.as_plotly()
    assert shown.data[0].type == "scatter"
    assert shown.layout.template.layout.font.color == palette(LIGHT)["ink"]


def test_a_page_does_without_the_objects_of_the_python_package():
    code = (
        "import sys\n"
        "from sdimu_calibration.report import page\n"
        "from sdimu_calibration.report.design.sheet import document\n"
        "from sdimu_calibration.report.drawing import Figure, html, lay_out\n"
        "assert 'id=\"library\"' in document('x', html(lay_out(Figure(), 300), 1))\n"
        "sys.exit('plotly is loaded' if 'plotly' in sys.modules else 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_serial_number_is_shown_as_it_is_and_not_as_markup():
    """Plotly reads `<b>` and links in labels."""
    one = SimpleNamespace(name="gyro_bias_x", control_limits=(-1.0, 1.0), between=SimpleNamespace(mean=0.0))
    serials = ("<b>7</b>", '<a href="https://evil.example">8</a>', "9 & 10")
    measured = SimpleNamespace(names=("gyro_bias_x",), values=np.zeros((3, 1)), sigmas=np.ones((3, 1)), serials=serials)
    figure = Figure()
    _panel(figure, measured, one, "rad/s", [1, 2, 3], {})
    shown = figure.data[0]["text"]
    assert not [text for text in shown if "<" in text]
    assert tuple(unescape(text) for text in shown) == serials


def test_marks_in_names_of_the_user_are_shown_and_not_obeyed():
    """Names of folders, effect files, coefficients and joints come from files of others."""
    name = 'own <b>bold</b> <a href="https://elsewhere">here</a>'
    figures = (
        evidence_figures.correlation([name, "gyro_bias_x"], np.eye(2)),
        workbench_figures.ladder(["as given", name], [2.0, 1.0], [None, None]),
    )
    for figure in figures:
        said = repr((figure.data, figure.layout))
        assert "&lt;b&gt;" in said
        assert "<b>bold" not in said
        assert "<a href" not in said


def test_every_row_of_a_heat_map_has_its_name():
    drawn = evidence_figures.deviates(
        ["1", "2"], [f"row {k}" for k in range(9)], np.ones((9, 2)), "stop", "channel", 200
    )
    assert drawn.layout["yaxis"]["dtick"] == 1
    # They have the size of the page, which grows with its screen.
    assert "tickfont" not in drawn.layout["yaxis"]
