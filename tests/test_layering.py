"""The floors of the house: imports point down only, and each floor knows only what it is meant to know."""

from __future__ import annotations

import ast
import re
import runpy
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import hybridsim

PACKAGE = Path(hybridsim.__file__).parent
ROOT = Path(__file__).parents[1]
SOURCES = sorted(PACKAGE.rglob("*.py"))

MAP = runpy.run_path(str(ROOT / "docs" / "make" / "floors.py"))
# From the ground up. A module may import from its own floor and from the ones before it.
FLOORS: tuple[str, ...] = MAP["FLOORS"]

# The floors that may import a heavy or numerical library at all. A name stands for what is below it, too.
LIBRARIES = {
    "sympy": {"expr", "engine.lowering", "engine.series"},
    "numba": {"engine.native", "engine.system"},
    "llvmlite": {"engine.native"},
    "sksundae": {"integrators"},
    "scipy": {"engine.system", "engine.linear", "integrators", "mechanics", "analysis", "testing", "studies"},
    "pandas": {"presentation", "solution", "analysis"},
    "xarray": {"presentation", "solution", "analysis"},
    "numpy": set(FLOORS)
    - {"errors", "files", "calls", "forks", "expr", "model", "engine.lowering", "simulate", "cli"},
    "matplotlib": {"plot", "studies"},
}
# numba and llvmlite in the engine.system floor: only where functions of a user are compiled
COMPILES = ("engine/native/", "engine/system/user_functions/")

# Methods of what users hold, which import what does their work when they are called: each closes a circle.
FACES = {
    ("model.parts.model", "model.checks.validate"),  # Model.validate
    ("model.parts.model", "model.flattening.flatten"),  # Model(..., use=...)
    ("model.parts.model", "model.parts.use"),  # Use(..., model)
    ("model.parts.model", "model.smoothing.regularize"),  # Model.regularized
    ("model.parts.model", "model.smoothing.structure"),  # Model.structure
    ("model.parts.model", "model.toml.write"),  # Model.to_toml
    ("model.parts.model", "model.toml.read"),  # Model.from_toml
    ("model.parts.contact", "model.laws.law_with_states"),  # Contact.components, Contact.states
    ("model.parts.contact", "model.library"),  # Contact(law="name")
    ("model.toml.laws", "model.library"),  # law = "name" in a file
    ("model.parts.use", "model.library"),  # Use(model="name")
    ("model.toml.use", "model.library"),  # model = "name" in a file
    ("mechanics.declaration.system", "mechanics.declaration.as_model"),  # MechanicalSystem.to_model
    ("solution.solution", "solution.explain.explanation"),  # Solution.explain
    ("solution.solution", "solution.files.archive"),  # Solution.save
    ("solution.solution", "solution.resume"),  # Solution.resume
}
# A family of integrators takes nothing from another one, but these.
SHARED = {
    ("closed_form", "taylor"),  # where closed forms end
    ("fixed_step", "rosenbrock"),  # solves small linear systems
}

# Calls that run text as code, or that do so inside SymPy.
RUNS_TEXT = {"eval", "exec", "compile", "__import__", "sympify", "parse_expr", "lambdify", "S"}


def floor_of(path: Path) -> str:
    """Floor of a module of the package."""
    return str(MAP["floor_of"](path))


def tree_of(path: Path) -> ast.Module:
    """The parsed source of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path: Path) -> tuple[tuple[str, int], ...]:
    """Every module that a file imports, at its top or inside a function, types included, with the line."""
    found = []
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: imports name the whole path"
            found.append((node.module or "", node.lineno))
    return (*found, *MAP["imports"](path))


def named(path: Path) -> str:
    """Module of a file, without the package's own name."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


@cache
def imports_for_types(path: Path) -> set[int]:
    """Lines that only a type checker reads."""
    return {
        line
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }


@cache
def edges() -> frozenset[tuple[str, str]]:
    """Which module imports which, by any kind of import."""
    found = {
        (named(path), module.removeprefix("hybridsim").removeprefix("."))
        for path in SOURCES
        for module, _ in MAP["imports"](path)
    }
    return frozenset(pair for pair in found if pair[1] not in ("", pair[0]))


def import_graph(faces: set[tuple[str, str]]) -> dict[str, set[str]]:
    """The modules that each module imports, but for these exceptions."""
    graph: dict[str, set[str]] = {}
    for pair in edges():
        if pair not in faces:
            graph.setdefault(pair[0], set()).add(pair[1])
    return graph


def loading_graph() -> dict[str, set[str]]:
    """The modules that Python loads for the imports at the top of each module, with the folders they lie in."""
    graph: dict[str, set[str]] = {}
    for path in SOURCES:
        name, skipped = named(path), imports_for_types(path)
        tree = tree_of(path)
        at_top = {
            line for node in tree.body for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
        }
        inside = {
            line
            for node in tree.body
            if isinstance(node, ast.FunctionDef | ast.ClassDef)
            for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
        }
        for module, line in MAP["imports"](path):
            parts = module.removeprefix("hybridsim").removeprefix(".").split(".")
            if line not in at_top - inside - skipped:
                continue
            loaded = {".".join(parts[:count]) for count in range(1, len(parts) + 1)}
            # the folders of the importing module are being loaded already
            graph.setdefault(name, set()).update(
                one for one in loaded if one != name and not name.startswith(f"{one}.")
            )
    return graph


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Groups of modules that import each other."""
    order: list[str] = []
    seen: set[str] = set()

    def visit(name: str, edges: dict[str, set[str]], found: list[str]) -> None:
        stack = [(name, iter(edges.get(name, ())))]
        seen.add(name)
        while stack:
            for other in stack[-1][1]:
                if other not in seen:
                    seen.add(other)
                    stack.append((other, iter(edges.get(other, ()))))
                    break
            else:
                found.append(stack.pop()[0])

    for name in graph:
        if name not in seen:
            visit(name, graph, order)
    back: dict[str, set[str]] = {}
    for name, others in graph.items():
        for other in others:
            back.setdefault(other, set()).add(name)
    seen.clear()
    groups = []
    for name in reversed(order):
        if name not in seen:
            group: list[str] = []
            visit(name, back, group)
            groups.append(sorted(group))
    return [group for group in groups if len(group) > 1]


def identifiers(path: Path) -> Iterator[tuple[str, int]]:
    """Every name that a file's code uses: variables, attributes, functions, arguments, keywords."""
    for node in ast.walk(tree_of(path)):
        for field in ("id", "attr", "name", "arg", "asname"):
            value = getattr(node, field, None)
            if isinstance(value, str):
                yield value, getattr(node, "lineno", 0)


def test_every_module_has_its_floor() -> None:
    outside = {floor_of(path) for path in SOURCES} - set(FLOORS) - {"__init__", "__main__", "engine"}
    assert not outside, f"give these a place in FLOORS: {outside}"


def test_the_page_on_floors_is_up_to_date() -> None:
    page = ROOT / "docs" / "explanation" / "floors.md"
    assert page.read_text(encoding="utf-8") == MAP["page"](), "run: python docs/make/floors.py"


def test_the_picture_has_every_floor() -> None:
    below, sizes = MAP["graph"]()
    assert set(below) == set(FLOORS) == set(sizes)
    assert "engine.run" in below["integrators"] and not below["errors"]
    picture = ROOT / "docs" / "images" / "floors.png"
    if picture.exists():  # a source distribution leaves the pictures out
        assert MAP["drawn_from"]().encode() in picture.read_bytes(), "run: python docs/make/floors.py"


def test_imports_point_down_only() -> None:
    upward = [
        f"{path.relative_to(PACKAGE)}, line {line}, from {floor}: {module}"
        for path in SOURCES
        if (floor := floor_of(path))
        not in ("__init__", "__main__")  # the doors of the package open to every floor
        for module, line in imports(path)
        if module.startswith("hybridsim.")
        and (other := MAP["floor_of_module"](module)) in FLOORS
        and FLOORS.index(other) > FLOORS.index(floor)
    ]
    assert not upward


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Imports for types and inside functions count; the exceptions are the closed list above."""
    assert circles(import_graph(FACES)) == []


def test_every_module_can_be_loaded_first() -> None:
    """A module also loads the folders of what it imports, and these must not wait for the module itself."""
    assert circles(loading_graph()) == []


@pytest.mark.parametrize("face", sorted(FACES), ids=str)
def test_each_face_is_needed(face: tuple[str, str]) -> None:
    assert circles(import_graph(FACES - {face})), "take it off the list"


def test_a_circle_is_seen() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]


def test_independent_truths_know_no_engine() -> None:
    known = {
        MAP["floor_of_module"](module)
        for path in (PACKAGE / "reference").rglob("*.py")
        for module, _ in imports(path)
        if module.startswith("hybridsim.")
    }
    assert known <= {"errors", "expr", "model", "reference"}


def test_families_of_integrators_stay_apart() -> None:
    folder = PACKAGE / "integrators"
    families = {path.name for path in folder.iterdir() if path.is_dir()}
    crossed = {
        (path.relative_to(folder).parts[0], module.split(".")[2])
        for path in folder.rglob("*/*.py")
        for module, _ in imports(path)
        if module.startswith("hybridsim.integrators.") and module.split(".")[2] in families
    }
    assert {pair for pair in crossed if pair[0] != pair[1]} == SHARED


def test_the_engine_compiles_in_two_places() -> None:
    elsewhere = [
        path.name
        for path in SOURCES
        if not path.relative_to(PACKAGE).as_posix().startswith(COMPILES)
        if any(module.split(".")[0] in ("numba", "llvmlite") for module, _ in imports(path))
    ]
    assert elsewhere == []


def test_inner_parts_of_numba_stay_where_they_are_looked_up() -> None:
    """They are no public interface: engine/native/inner_parts looks them up, and does without what is not there."""
    inner, hidden = re.compile(r"numba\.(core|np|misc)\b"), re.compile(r"_nrt|_tm|_tm_features")
    native = PACKAGE / "engine" / "native"
    imported = [
        f"{path.name}:{line} {module}"
        for path in SOURCES
        for module, line in imports(path)
        if inner.match(module)
    ]
    named = [
        f"{path.name}:{node.lineno}"
        for path in SOURCES
        if path.parent != native
        for node in ast.walk(tree_of(path))
        if (isinstance(node, ast.Constant) and isinstance(node.value, str) and inner.fullmatch(node.value))
        or hidden.fullmatch(str(getattr(node, "attr", getattr(node, "arg", ""))))
    ]
    assert imported == named == []


def test_folders_are_small_and_say_what_they_are_for() -> None:
    """The long ones are a list that only gets shorter."""
    long = {"model/checks", "testing/catalogue"}
    folders = sorted({path.parent for path in SOURCES if path.parent != PACKAGE})
    found = {
        folder.relative_to(PACKAGE).as_posix() for folder in folders if len(list(folder.glob("*.py"))) > 18
    }
    assert found == long
    for folder in folders:
        first = MAP["first_sentence"](folder)
        assert first.endswith(".") and len(first) > 20, f"{folder} does not say what it is for: {first!r}"


def test_the_engine_is_nine_folders() -> None:
    folders = sorted(
        path.name for path in (PACKAGE / "engine").iterdir() if path.is_dir() and path.name[0] != "_"
    )
    listed = [
        name.split(".")[1] for name in FLOORS if name.startswith("engine.") and name != "engine.stepping"
    ]
    assert folders == sorted(listed) and len(listed) == 9
    said = MAP["first_sentence"](PACKAGE / "engine")
    docstring = (
        ast.get_docstring(ast.parse((PACKAGE / "engine" / "__init__.py").read_text(encoding="utf-8"))) or ""
    )
    assert re.findall(r"`(\w+)`", docstring) == listed and said.endswith(".")


def test_the_top_level_is_short() -> None:
    """Examples, studies and what makes pages lie below docs."""
    if not (ROOT / ".git").exists():
        pytest.skip("an unpacked copy may have more")
    tracked = {"docs", "hybridsim", "models", "tests"}
    there = {path.parent.name for path in ROOT.glob("*/*.py")} - {"build", "dist", "venv", "site"}
    assert there <= tracked


def test_libraries_stay_on_their_floors() -> None:
    misplaced = [
        f"{path.relative_to(PACKAGE)}, line {line}, of {floor}: {module}"
        for path in SOURCES
        for floor in (floor_of(path),)
        for module, line in imports(path)
        if floor not in LIBRARIES.get(module.split(".")[0], {floor})
    ]
    assert not misplaced


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


def test_no_text_is_run_as_code() -> None:
    calls = [
        f"{path.relative_to(PACKAGE)}, line {node.lineno}: {name}"
        for path in SOURCES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Call)
        and (name := getattr(node.func, "id", getattr(node.func, "attr", ""))) in RUNS_TEXT
        # re.compile and numba's compile methods make no code out of text
        and not (name == "compile" and isinstance(node.func, ast.Attribute))
    ]
    assert not calls
