"""Docstrings: shape and unit of every array that goes in or out; quantity, unit and reason of every constant.

What the signature says is not said again: an entry has a shape or a description, and a method that overrides another
inherits its sections.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
from numpydoc.docscrape import NumpyDocString, Parameter

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "doc" / "extensions"))

from constants_page import numeric_constants  # noqa: E402 (an extension of the book is on no path)

SOURCE = ROOT / "src" / "sdimu_calibration" / "sdimu_calibration"
ARRAY = re.compile(r"\b(Floats|Ints|Bools|NDArray|Stamps)\b")
FLOATING = re.compile(r"\b(Floats|NDArray\[np\.float64\])")
SHAPE = re.compile(r"(?i)\bshapes? \(|\blength [a-z]\b")
PURE_NUMBER = re.compile(r"(?i)\b(share|ratio|factor|multiple|number|percentile|weight|probability|count)s?\b")
BARE = re.compile(r"^\S[^\n]* : [^\n]*(\n(?!    )|\Z)", re.MULTILINE)
PROPERTIES = {"property", "cached_property"}
SECTION = re.compile(r"^\w+\n-+$", re.MULTILINE)
UNIT = re.compile(r"\b(rad|m/s|deg|degC|Hz|SI|units?|dimensionless|whitened|normalised|customary)\b|\((s|m|g|1)\)")


@dataclass(frozen=True)
class Documented:
    """A public function, method or class, where its units may be declared, and the bases of a method's class."""

    name: str
    node: ast.FunctionDef | ast.ClassDef
    module_doc: str
    bases: tuple[str, ...] = ()

    @property
    def doc(self) -> str:
        return ast.get_docstring(self.node) or ""

    @property
    def sections(self) -> NumpyDocString:
        return NumpyDocString(self.doc)


def modules() -> dict[str, Path]:
    """All files of the core and of the interface to Python, by name."""
    paths = [*SOURCE.glob("*.py"), *(SOURCE / "core").rglob("*.py")]
    return {".".join(p.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): p for p in sorted(paths)}


def public(path: Path) -> Iterator[Documented]:
    """Public functions, classes and methods of a file."""
    tree = ast.parse(path.read_text())
    package = ast.get_docstring(ast.parse((path.parent / "__init__.py").read_text())) or ""
    above = f"{package}\n{ast.get_docstring(tree) or ''}"
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield Documented(node.name, node, above)
            if isinstance(node, ast.ClassDef):
                whole = "\n".join([above, ast.get_docstring(node) or "", *said_beside(node).values()])
                for part in node.body:
                    if isinstance(part, ast.FunctionDef) and not part.name.startswith("_"):
                        yield Documented(f"{node.name}.{part.name}", part, whole, names_of_bases(node))


def said_beside(node: ast.ClassDef) -> dict[str, str]:
    """What is said of the fields of a class beside them: below one, or below several that it names first."""
    said = {}
    for field, after in pairwise(node.body):
        if isinstance(field, ast.AnnAssign) and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            text = " ".join(str(after.value.value).split())
            several = re.match(r"`\w+`(, `\w+`)+:", text)
            for name in re.findall(r"\w+", several[0]) if several else [ast.unparse(field.target)]:
                said[name] = text
    return said


def names_of_bases(node: ast.ClassDef) -> tuple[str, ...]:
    return tuple(ast.unparse(base).split("[")[0].split(".")[-1] for base in node.bases)


@cache
def classes() -> dict[str, tuple[set[str], tuple[str, ...]]]:
    """Methods with a docstring, and names of the bases, of every class of the core, by name."""
    nodes = [node for path in modules().values() for node in ast.walk(ast.parse(path.read_text()))]
    return {
        node.name: (
            {part.name for part in node.body if isinstance(part, ast.FunctionDef) and ast.get_docstring(part)},
            names_of_bases(node),
        )
        for node in nodes
        if isinstance(node, ast.ClassDef)
    }


def inherits(method: str, bases: tuple[str, ...]) -> bool:
    """Whether a base, or a base of it, documents the method."""
    known = [classes()[base] for base in bases if base in classes()]
    return any(method in methods or inherits(method, above) for methods, above in known)


def faults(one: Documented) -> Iterator[str]:
    """What is missing in one docstring."""
    if isinstance(one.node, ast.ClassDef):
        entries_of_fields = entries_of(one, "Attributes") | said_beside(one.node)
        yield from faults_of_entries(one, "Attributes", array_fields(one.node), entries_of_fields)
        return
    if inherits(one.node.name, one.bases):
        return
    yield from faults_of_entries(one, "Parameters", array_arguments(one.node), entries_of(one, "Parameters"))
    given = ast.unparse(one.node.returns) if one.node.returns else ""
    if not ARRAY.search(given):
        return
    if any(isinstance(d, ast.Name) and d.id in PROPERTIES for d in one.node.decorator_list):
        yield from () if SHAPE.search(one.doc) else ("a property that is an array: no shape",)
        return
    entries = one.sections["Returns"]
    said = [text(entry) for entry in entries] or [SECTION.split(one.doc)[0]]
    if not any(SHAPE.search(words) for words in said):
        yield "Returns: no shape" if entries else "no Returns section"
    elif FLOATING.search(given) and not UNIT.search(f"{one.doc}\n{one.module_doc}"):
        yield "Returns: no unit"


def entries_of(one: Documented, section: str) -> dict[str, str]:
    return {name.strip("* "): text(e) for e in one.sections[section] for name in e.name.split(",")}


def faults_of_entries(one: Documented, section: str, arrays: dict[str, str], entries: dict[str, str]) -> Iterator[str]:
    """What is missing for arrays (annotation by name) among what is said of each."""
    if not arrays:
        return
    if not entries:
        yield f"no {section} section"
        return
    for name, annotation in arrays.items():
        if name not in entries:
            yield f"{section}: '{name}' is not listed"
        elif not SHAPE.search(entries[name]):
            yield f"{section}: '{name}' has no shape"
        elif FLOATING.search(annotation) and not UNIT.search("\n".join([*entries.values(), one.doc, one.module_doc])):
            yield f"{section}: '{name}' has no unit, and neither the module nor the package declares one"


def empty_entries(path: Path) -> Iterator[str]:
    """Entries without a shape and without a description."""
    for node in ast.walk(ast.parse(path.read_text())):
        # Taking a docstring apart takes milliseconds: those with an entry that nothing is indented below are looked at.
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and BARE.search(doc := ast.get_docstring(node) or ""):
            sections = NumpyDocString(doc)
            for entry in [*sections["Parameters"], *sections["Attributes"]]:
                if not entry.desc and not SHAPE.search(text(entry)) and "ndarray" not in entry.type:
                    yield f"{node.name}: '{entry.name}' says no more than the signature: describe it, or leave it out"


def text(entry: Parameter) -> str:
    return " ".join([entry.name, entry.type, *entry.desc])


def array_arguments(node: ast.FunctionDef) -> dict[str, str]:
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    written = {a.arg: ast.unparse(a.annotation) for a in every if a.annotation}
    return {name: annotation for name, annotation in written.items() if ARRAY.search(annotation)}


def array_fields(node: ast.ClassDef) -> dict[str, str]:
    """Public fields of a dataclass or a named tuple that hold arrays."""
    fields = [part for part in node.body if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)]
    written = {f.target.id: ast.unparse(f.annotation) for f in fields if isinstance(f.target, ast.Name)}
    return {n: a for n, a in written.items() if ARRAY.search(a) and not n.startswith("_") and "Callable" not in a}


def faults_of_constant(doc: str) -> Iterator[str]:
    """What is missing: quantity and unit (or that it is a pure number) before the colon, the reason after it."""
    quantity, _, reason = doc.partition(":")
    if not quantity:
        yield "no docstring"
    elif not (UNIT.search(quantity) or PURE_NUMBER.search(quantity) or re.search(r"\(\S.*\)", quantity)):
        yield "no unit before the colon"
    elif not reason.strip():
        yield "no reason after a colon"


def faults_of(path: Path) -> list[str]:
    found = [f"{one.name}: {fault}" for one in public(path) for fault in faults(one)]
    return found + [f"{name}: {fault}" for name, _, doc in numeric_constants(path) for fault in faults_of_constant(doc)]


@pytest.mark.parametrize("module", sorted(modules()))
def test_arrays_have_shape_and_unit_and_constants_a_reason(module):
    assert faults_of(modules()[module]) == []


@pytest.mark.parametrize("path", sorted((ROOT / "src").iterdir()), ids=lambda path: path.name)
def test_an_entry_says_more_than_the_signature(path):
    assert [f"{file.name}: {fault}" for file in sorted(path.glob("*/**/*.py")) for fault in empty_entries(file)] == []


def test_an_entry_that_says_no_more_than_the_signature_is_found(tmp_path):
    path = tmp_path / "core.py"
    path.write_text(
        'def change(a: Floats, b: int, c: int) -> None:\n    """Change.\n\n    Parameters\n    ----------\n'
        '    a : ndarray, shape (n,)\n    b : int\n    c : int\n        Hz.\n    """\n'
    )
    assert list(empty_entries(path)) == ["change: 'b' says no more than the signature: describe it, or leave it out"]


def test_a_method_inherits_the_sections_of_the_one_it_overrides(tmp_path):
    (tmp_path / "__init__.py").touch()
    (tmp_path / "core.py").write_text(
        "class Other(LinearEvidence):\n"
        '    def signature(self) -> Ints:\n        """Give none."""\n'
        '    def own(self) -> Ints:\n        """Give another."""\n'
    )
    assert faults_of(tmp_path / "core.py") == ["Other.own: no Returns section"]


def test_what_comes_back_may_be_said_in_a_sentence_with_its_shape(tmp_path):
    (tmp_path / "__init__.py").touch()
    (tmp_path / "core.py").write_text(
        'def rate() -> Floats:\n    """Give the rate in b (rad/s), shape (n, 3)."""\n\n\n'
        'def other() -> Floats:\n    """Give something of shape (n, 3)."""\n\n\n'
        'def change(a: Floats) -> Ints:\n    """Change.\n\n    Parameters\n    ----------\n'
        '    a : ndarray, shape (n,)\n        As read (rad).\n    """\n'
    )
    assert faults_of(tmp_path / "core.py") == ["other: Returns: no unit", "change: no Returns section"]


def test_what_is_said_below_a_field_counts(tmp_path):
    (tmp_path / "__init__.py").touch()
    (tmp_path / "core.py").write_text(
        'class Held:\n    """Held."""\n\n    a: Floats\n    b: Floats\n    """`a`, `b`: As read (rad), shape (n,)."""\n'
        '    c: Floats\n    """As read (rad)."""\n    d: Floats\n'
    )
    assert faults_of(tmp_path / "core.py") == [
        "Held: Attributes: 'c' has no shape",
        "Held: Attributes: 'd' is not listed",
    ]


def test_what_is_missing_is_found(tmp_path):
    (tmp_path / "__init__.py").touch()
    (tmp_path / "core.py").write_text(
        'LIMIT = 3.0\n"""Limit: high."""\n\n\n'
        "class Held:\n    field: Floats\n\n\n"
        'def change(a: Floats, b: Floats) -> Floats:\n    """Change.\n\n    Parameters\n    ----------\n'
        '    a : ndarray, shape (n, m)\n    """\n'
    )
    assert faults_of(tmp_path / "core.py") == [
        "Held: no Attributes section",
        "change: Parameters: 'a' has no unit, and neither the module nor the package declares one",
        "change: Parameters: 'b' is not listed",
        "change: no Returns section",
        "LIMIT: no unit before the colon",
    ]
