"""The frame of every page that this machine serves: an application in the look of the reports, well guarded."""

from __future__ import annotations

from importlib.resources import files

from dash import Dash, Input, Output

from sdimu_calibration.report.design.library import PRINT
from sdimu_calibration.report.design.sheet import EARLY
from sdimu_calibration.report.design.sheet import SCRIPT as DESIGN_SCRIPT
from sdimu_calibration.report.design.sheet import STYLE as DESIGN_STYLE
from sdimu_calibration.report.workbench.guard import guard, tell_error

_PAGE = """<!doctype html><html lang="en"><head>{%metas%}<title>{%title%}</title><script>EARLY</script>
{%css%}<style>STYLE</style></head><body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}
<script>SCRIPT</script></footer></body></html>"""

_SERVED = files("sdimu_calibration.report.workbench").joinpath("served.js").read_text(encoding="utf-8")


def application(name: str, host: str, style: str, script: str) -> Dash:
    """Make an application of one page, without its layout.

    Parameters
    ----------
    name : str
        Of the program; also the title of the page.
    host : str
        Address of this machine that it is served at.
    style, script : str
        What the page has beyond the look of all pages and what `served.js` does on each: a page has the elements
        ``lost``, which is shown when its command answers no more, and ``look``.
    """
    app = Dash(name, title=name, update_title="", serve_locally=True, assets_ignore=".*", on_error=tell_error)
    guard(app.server, host)
    page = _PAGE.replace("EARLY", EARLY).replace("STYLE", f"{DESIGN_STYLE}\n{style}")
    app.index_string = page.replace("SCRIPT", f"{DESIGN_SCRIPT}\n{PRINT}\n{_SERVED}\n{script}")
    app.clientside_callback("function(_) { return window.benchLook(); }", Output("look", "data"), Input("page", "data"))
    return app
