"""Declared dependencies are those that the package, its tests and its pages import, at the versions that are tested."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]

# Names of packages that are imported by another name than "-" written as "_".
IMPORTED_AS = {"scikit-sundae": "sksundae", "pillow": "PIL"}
# What is used without an import, and by what.
IF_THERE = {"gymnasium", "ipywidgets", "jax", "torch"}  # examples and pages use them where they are installed
NOT_IMPORTED = {
    "pytest-xdist": "-n auto of pytest",
    "pytest-randomly": "the order of the tests",
    "ruff": "a program",
    "mypy": "a program",
    "myst-parser": "an extension of Sphinx that docs/conf.py names",
    "pydata-sphinx-theme": "the theme that docs/conf.py names",
}
# Calls that import what their argument names.
IMPORTING = {"import_module", "importorskip", "library", "find_spec"}


def named(requirement: str) -> str:
    """The package of a requirement."""
    found = re.match(r"[a-z0-9-]+", requirement)
    assert found, requirement
    return found.group()


def modules(requirements: Iterable[str]) -> set[str]:
    """What is imported of these requirements."""
    names = map(named, requirements)
    return {IMPORTED_AS.get(name, name.replace("-", "_")) for name in names if name not in NOT_IMPORTED}


def imported(text: str) -> Iterator[str]:
    """The top-level modules that a text imports, at its top, inside functions or by name."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module or ""
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if called in IMPORTING and isinstance(node.args[0].value, str):
                yield node.args[0].value


def of_others(folder: str) -> set[str]:
    """The modules that the Python files below a folder import and that are neither Python's nor in this repository."""
    files = list((ROOT / folder).rglob("*.py"))
    own = {path.stem for part in ("docs", "tests") for path in (ROOT / part).rglob("*.py")}
    own |= {path.name for part in ("docs", "tests") for path in (ROOT / part).iterdir()} | {
        "hybridsim",
        "rivals",
    }
    found = {name.partition(".")[0] for path in files for name in imported(path.read_text(encoding="utf-8"))}
    return found - set(sys.stdlib_module_names) - own - IF_THERE


def test_the_package_imports_what_it_declares() -> None:
    assert of_others("hybridsim") == modules([*PROJECT["dependencies"], *EXTRAS["tables"]])


def test_the_tests_import_what_the_package_and_their_extra_declare() -> None:
    needed = of_others("tests")
    assert needed <= modules([*PROJECT["dependencies"], *EXTRAS["test"]])
    assert modules(EXTRAS["test"]) <= needed | of_others("hybridsim")


def test_the_pages_import_what_the_extras_declare() -> None:
    needed = of_others("docs")
    beside = [*EXTRAS["docs"], *EXTRAS["rivals"], *EXTRAS["cluster"]]
    assert needed <= modules([*PROJECT["dependencies"], *beside])
    assert modules(beside) <= needed | of_others("tests") | IF_THERE


def test_each_extra_is_known() -> None:
    assert set(EXTRAS) == {"tables", "cluster", "rivals", "docs", "test"}
    declared = {
        named(each)
        for each in [*PROJECT["dependencies"], *(each for extra in EXTRAS.values() for each in extra)]
    }
    assert NOT_IMPORTED.keys() | IMPORTED_AS.keys() <= declared


def version(text: str) -> tuple[int, ...]:
    """A version as numbers, without zeros at its end."""
    numbers = [int(part) for part in text.split(".")]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)


@pytest.mark.parametrize("part", ["dependencies", "tables", "cluster", "test", "docs"])
def test_the_lowest_versions_are_those_that_are_tested(part: str) -> None:
    text = (ROOT / ".ci" / "lowest.txt").read_text(encoding="utf-8")
    tested = dict(re.findall(r"^([a-z0-9-]+)==([0-9.]+)$", text, re.MULTILINE))
    for requirement in PROJECT["dependencies"] if part == "dependencies" else EXTRAS[part]:
        lowest = re.search(r">=([0-9.]+)", requirement)
        assert lowest, f"{requirement} has no lowest version"
        assert version(tested[named(requirement)]) == version(lowest.group(1)), requirement


def test_the_classifiers_name_the_versions_of_python_that_are_tested() -> None:
    run = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    claimed = re.findall(r":: Python :: (3\.\d+)'", str(PROJECT["classifiers"]))
    assert claimed == re.findall(r"3\.\d+", re.search(r"^pythons=\"(.*)\"$", run, re.MULTILINE)[1])  # type: ignore[index]  # a None fails here
    assert PROJECT["requires-python"] == f">={claimed[0]}"
    assert not any("OS Independent" in each for each in PROJECT["classifiers"])
