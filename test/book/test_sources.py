"""The sources of the book: links lead somewhere, functions that are named exist, all that is public is there."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

import sdimu_calibration

from .pages import ROOT

DOC = ROOT / "doc"
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOC.rglob("*.md")])
GENERATED = DOC / "generated"
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
ROLE = re.compile(r"\{py:(?:func|class|meth)\}`~?([\w.]+)`")
DIRECTIVE = re.compile(r"^\.\. auto(?:function|class|exception):: ([\w.]+)", re.MULTILINE)
EQUATION = re.compile(r"^\$\$ \(([\w-]+)\)", re.MULTILINE)


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def found(name: str) -> object:
    """Import what a dotted name means: a module, or something in one."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            thing: object = import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for part in parts[cut:]:
            thing = getattr(thing, part)
        return thing
    raise AttributeError(name)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_every_link_leads_to_a_file(page):
    links = [link for link in LINK.findall(page.read_text(encoding="utf-8")) if "://" not in link]
    missing = [link for link in links if not (page.parent / link).exists()]
    assert [link for link in missing if not (page.parent / link).resolve().is_relative_to(GENERATED)] == []


def test_every_function_that_a_page_names_exists():
    names = {
        name
        for page in DOC.rglob("*.md")
        for pattern in (ROLE, DIRECTIVE)
        for name in pattern.findall(page.read_text(encoding="utf-8"))
        if "." in name
    }
    assert len(names) > 50
    for name in names:
        assert (getattr(found(name), "__doc__", "") or "").strip(), name


def test_every_function_that_a_page_links_to_is_shown_on_one():
    texts = [page.read_text(encoding="utf-8") for page in DOC.rglob("*.md")]
    shown = {name for text in texts for name in DIRECTIVE.findall(text)}
    for name in {name for text in texts for name in ROLE.findall(text)}:
        assert name in shown or name.rpartition(".")[0] in shown, name


def test_every_public_name_of_the_interface_is_in_the_reference():
    shown = set(DIRECTIVE.findall((DOC / "reference" / "api.md").read_text(encoding="utf-8")))
    assert set(sdimu_calibration.__all__) <= shown


def test_equations_have_one_name_each():
    names = [name for page in DOC.rglob("*.md") for name in EQUATION.findall(page.read_text(encoding="utf-8"))]
    assert len(names) == len(set(names)) > 30


def test_every_page_stands_in_the_contents():
    index = (DOC / "index.md").read_text(encoding="utf-8")
    pages = {str(p.relative_to(DOC).with_suffix("")) for p in DOC.rglob("*.md") if not p.is_relative_to(GENERATED)}
    pages = {name for name in pages if not name.startswith("decisions/0")} - {"index"}
    assert {name for name in pages if f"\n{name}\n" not in index} == set()
