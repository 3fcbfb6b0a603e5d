"""The floors of the house: imports point down only, and each floor knows only what it is meant to know."""

from __future__ import annotations

import ast
import re
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

import hybridsim

PACKAGE = Path(hybridsim.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))

# From the ground up. A module may import from its own floor and from the ones before it.
FLOORS = (
    "errors",
    "files",
    "calls",
    "forks",
    "expr",
    "model",
    "engine",
    "integrators",
    "tables",
    "colours",
    "notebook",
    "readable",
    "arguments",
    "solution",
    "preparation",
    "mechanics",
    "simulate",
    "ivp",
    "analysis",
    "testing",
    "plot",
    "cli",
)

# The floors that may import a heavy or numerical library at all.
LIBRARIES = {
    "sympy": {"expr", "engine"},
    "numba": {"engine"},
    "llvmlite": {"engine"},
    "sksundae": {"integrators"},
    "scipy": {"engine", "integrators", "solution", "mechanics", "analysis", "testing"},
    "pandas": {"tables", "solution"},
    "xarray": {"tables", "solution", "analysis"},
    "numpy": {
        "engine",
        "integrators",
        "tables",
        "solution",
        "arguments",
        "preparation",
        "mechanics",
        "ivp",
        "analysis",
        "testing",
        "plot",
    },
    "matplotlib": {"plot"},
}

# Calls that run text as code, or that do so inside SymPy.
RUNS_TEXT = {"eval", "exec", "compile", "__import__", "sympify", "parse_expr", "lambdify", "S"}


def floor_of(path: Path) -> str:
    """Floor of a module of the package: its top-level folder or file."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """Every module that a file imports, at its top or inside a function, with the line."""
    package = ["hybridsim", *path.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield module, node.lineno
            if module == "hybridsim":  # `from hybridsim import plot` imports a floor
                for alias in node.names:
                    yield f"hybridsim.{alias.name}", node.lineno


def identifiers(path: Path) -> Iterator[tuple[str, int]]:
    """Every name that a file's code uses: variables, attributes, functions, arguments, keywords."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for field in ("id", "attr", "name", "arg", "asname"):
            value = getattr(node, field, None)
            if isinstance(value, str):
                yield value, getattr(node, "lineno", 0)


def test_every_module_has_its_floor() -> None:
    outside = {floor_of(path) for path in SOURCES} - set(FLOORS) - {"__init__", "__main__"}
    assert not outside, f"give these a place in FLOORS: {outside}"


def test_the_page_on_floors_has_them_all_in_this_order() -> None:
    page = (Path(__file__).parents[1] / "docs" / "explanation" / "floors.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE)
    assert tuple(name.strip("`") for row in rows for name in row.split(", ")) == FLOORS


def test_the_picture_has_every_floor() -> None:
    script = Path(__file__).parents[1] / "docs" / "make" / "floors_graph.py"
    below, sizes = runpy.run_path(str(script))["graph"]()
    assert set(below) == set(FLOORS) == set(sizes)
    assert "engine" in below["integrators"] and not below["errors"]


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_down_only(path: Path) -> None:
    floor = floor_of(path)
    if floor in ("__init__", "__main__"):  # the doors of the package open to every floor
        return
    upward = [
        f"line {line}: {module}"
        for module, line in imports(path)
        if module.startswith("hybridsim.")
        and module.split(".")[1] in FLOORS
        and FLOORS.index(module.split(".")[1]) > FLOORS.index(floor)
    ]
    assert not upward, f"{path.name} reaches up from {floor}: {upward}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_libraries_stay_on_their_floors(path: Path) -> None:
    floor = floor_of(path)
    misplaced = [
        f"line {line}: {module}"
        for module, line in imports(path)
        if floor not in LIBRARIES.get(module.split(".")[0], {floor})
    ]
    assert not misplaced, f"{floor} is not to know {misplaced}"


def test_which_files_of_the_expressions_know_sympy() -> None:
    knowing = {
        path.name
        for path in (PACKAGE / "expr").rglob("*.py")
        if any(module.split(".")[0] == "sympy" for module, _ in imports(path))
    }
    assert knowing <= {"symbolic.py", "hyperbolic.py", "simplify.py", "slope.py"}


def test_the_engine_knows_no_friction() -> None:
    mechanics = re.compile(r"friction|contact|(?<![a-z])(stick|slip)(?![a-z])", re.IGNORECASE)
    found = [
        f"{path.name}:{line} {name}"
        for path in (PACKAGE / "engine").rglob("*.py")
        for name, line in identifiers(path)
        if mechanics.search(name)
    ]
    assert not found


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_text_is_run_as_code(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    calls = [
        f"line {node.lineno}: {name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and (name := getattr(node.func, "id", getattr(node.func, "attr", ""))) in RUNS_TEXT
        # re.compile and numba's compile methods make no code out of text
        and not (name == "compile" and isinstance(node.func, ast.Attribute))
    ]
    assert not calls
