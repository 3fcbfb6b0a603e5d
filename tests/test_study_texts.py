"""The texts in the scripts of the studies are those on their pages, so that a change of words reaches both."""

from __future__ import annotations

import ast
import re
import runpy
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
LEAST = 12  # words of a text that is looked for on the page
FURTHER = {  # sources of a page besides the script that its command names
    "studies/speed.md": [DOCS / "studies" / "rivals" / "page_text.txt"],
    "studies/cost-of-stick.md": [DOCS / "studies" / "rivals" / "cost_text.txt"],
    "studies/he2026.md": sorted((ROOT / "hybridsim/studies/he2026/measured").glob("*.py")),
}
SKIPPED = ("print", "add_argument", "ArgumentParser", "SystemExit")  # calls whose texts are for the terminal
# fields of nodes whose texts need not be on the page
LEFT_OUT = (
    (ast.If, "body"),
    (ast.If, "orelse"),
    (ast.IfExp, "body"),
    (ast.IfExp, "orelse"),
    (ast.Subscript, "slice"),
    (ast.Dict, "keys"),
)
FIELD = re.compile(r"(?<!\{)\{[^{}]*\}(?!\})")


def sources() -> dict[str, list[Path]]:
    """The files with the texts of each page of a study."""
    table = tomllib.loads((DOCS / "figures.toml").read_text(encoding="utf-8"))
    found = {page: list(FURTHER.get(page, [])) for page in table if page.startswith("studies/")}
    for page, files in found.items():
        for command in table[page]["commands"]:
            files += [ROOT / script for script in re.findall(r"docs/studies/\w+\.py", command)]
    return found


def texts(path: Path) -> Iterator[list[str]]:
    """Yield each text of a file as its fixed parts, between which there are figures."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".txt":
        yield FIELD.split(text)
        return
    for node in literals(ast.parse(text)):
        if isinstance(node, ast.JoinedStr):
            parts = [str(value.value) if isinstance(value, ast.Constant) else "\0" for value in node.values]
            yield "".join(parts).split("\0")
        else:
            yield [part.replace("{{", "{").replace("}}", "}") for part in FIELD.split(str(node.value))]


def literals(node: ast.AST) -> Iterator[ast.Constant | ast.JoinedStr]:
    """Yield the texts below a node, except docstrings, keys, texts for the terminal and those under a condition."""
    if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        yield node
        return
    if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in SKIPPED:
        return
    for name, value in ast.iter_fields(node):
        if (type(node), name) in LEFT_OUT:
            continue
        for child in value if isinstance(value, list) else [value]:
            is_docstring = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
            if isinstance(child, ast.AST) and not is_docstring:
                yield from literals(child)


def follows(parts: list[str], page: str) -> bool:
    """Whether the parts are on the page in this order."""
    place = 0
    for part in (" ".join(part.split()) for part in parts):
        found = page.find(part, place)
        if found < 0:
            return False
        place = found + len(part)
    return True


@pytest.mark.parametrize("page", sources())
def test_the_words_of_a_script_are_on_its_page(page: str) -> None:
    shown = " ".join((DOCS / page).read_text(encoding="utf-8").split())
    found = [parts for path in sources()[page] for parts in texts(path) if not parts[0].startswith("|")]
    long = [parts for parts in found if sum(len(part.split()) for part in parts) >= LEAST]
    missing = [" ... ".join(parts)[:200] for parts in long if not follows(parts, shown)]
    assert not missing, f"{page} and its script differ: change both, or run the script"


def test_the_index_has_the_openings_of_the_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS / "make")
    index = runpy.run_path(str(DOCS / "make" / "study_index.py"))
    listed = {name for names in index["SECTIONS"].values() for name in names}
    assert listed | {"index"} == {page.stem for page in (DOCS / "studies").glob("*.md")}
    shown = (DOCS / "studies" / "index.md").read_text(encoding="utf-8")
    assert shown == index["written"](), "run python docs/make/study_index.py"
