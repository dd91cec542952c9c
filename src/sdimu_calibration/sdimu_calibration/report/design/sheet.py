"""The sheet and the script of every page, and the frame of a static one."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.resources import files

from sdimu_calibration.report.design.library import library
from sdimu_calibration.report.design.palette import DARK, LIGHT, palette

_HERE = files("sdimu_calibration.report.design")


def _tokens(theme: str) -> str:
    colours = "; ".join(f"--{name}: {colour}" for name, colour in palette(theme).items())
    return f"{{ color-scheme: {theme}; {colours}; }}"


STYLE = "\n".join(
    [
        f":root {_tokens(LIGHT)}",
        f"@media (prefers-color-scheme: dark) {{ :root:not([data-theme=light]) {_tokens(DARK)} }}",
        f":root[data-theme=dark] {_tokens(DARK)}",
        f"@media print {{ :root:root:root {_tokens(LIGHT)} }}",
        (_HERE / "style.css").read_text(encoding="utf-8"),
    ]
)
"""Sheet of every page; `data-theme` of the root element decides, else what the system prefers; paper is light."""
SCRIPT = (_HERE / "page.js").read_text(encoding="utf-8")
"""Behaviour of every page. `sdimuTheme()` is the theme; the event ``sdimu-theme`` says that it changed."""
EARLY = "try{var t=localStorage.getItem('sdimu-theme');if(t)document.documentElement.dataset.theme=t}catch(e){}"
"""Stands in the head, so that a dark page does not flash."""
THEME_BUTTON = '<button type="button" data-switch-theme>Dark page</button>'


def document(
    title: str,
    body: str,
    *,
    under: str = "",
    contents: Sequence[tuple[str, str]] = (),
    style: str = "",
    script: str = "",
) -> str:
    """Make a static page.

    Parameters
    ----------
    title : str
        Also stands in the bar that stays.
    body : str
        HTML of the main part.
    under : str
        HTML beside the title: what the page is of.
    contents : sequence of (str, str)
        Anchor and words of each section; without them there are no contents on the left.
    style, script : str
        What this page alone needs.
    """
    links = "".join(f'<li><a href="#{escape(anchor)}">{escape(words)}</a></li>' for anchor, words in contents)
    drawn = library() if 'class="figure"' in body else ""
    nav = f'<nav class="contents" aria-label="Contents"><ul>{links}</ul></nav>' if contents else ""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><script>{EARLY}</script><style>{STYLE}{style}</style></head><body>\n"
        '<a class="skip" href="#main">To the content</a>'
        f'<header class="bar"><h1>{escape(title)}</h1><span class="about grow">{under}</span>{THEME_BUTTON}</header>\n'
        f'<div class="frame">{nav}<main id="main">\n{body}\n</main></div>\n'
        f"<script>{SCRIPT}{script}</script>{drawn}</body></html>\n"
    )
