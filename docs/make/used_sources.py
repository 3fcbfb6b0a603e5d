"""Which modules of the package a command can reach: those that its figures depend on.

    python docs/make/used_sources.py COMMAND...       (a script with its arguments, or a command line of hybridsim)

Imports are followed as text, at the top of a module and inside functions, types left out; a name that a package hands
on is followed to where it is defined, and the other names of that package are not.
"""

from __future__ import annotations

import ast
import shlex
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TypeGuard

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "hybridsim"
ENTRY = f"{PACKAGE}.cli.entry"  # which imports every command, and calls one


def modules_of(command: str) -> set[Path]:
    """Files of the package that a command line can reach."""
    words = shlex.split(command.replace("&&", ";").rpartition(";")[2])
    folder = ROOT / "tests" if command.startswith("cd tests") else ROOT
    if words[0] == PACKAGE:
        others = set(_of_command_line())
        chosen = f"{PACKAGE}.cli.commands.{words[1]}"
        return _reached({(ENTRY, ""), (chosen, "")}, others - {chosen})
    script = (
        folder.joinpath(*words[2].split(".")) if words[1] == "-m" else folder / words[1].removesuffix(".py")
    )
    return _reached({(str(script.with_suffix(".py")), "")}, set())


def _reached(first: set[tuple[str, str]], without: set[str]) -> set[Path]:
    """Everything that is imported from there on: (module, name in it), or (path of a script, nothing)."""
    found: set[Path] = set()
    seen: set[tuple[str, str]] = set()
    ahead = set(first)
    while ahead:
        module, name = ahead.pop()
        if (module, name) in seen or module in without:
            continue
        seen.add((module, name))
        file = _file(module)
        if file is None:
            continue
        if file.is_relative_to(ROOT / PACKAGE):
            found.add(file)
        if file.name == "__init__.py" and module.startswith(PACKAGE):
            ahead |= _handed_on(module, name)
        else:
            ahead |= set(_imports(file))
    return found


def _file(module: str) -> Path | None:
    """Of a module of this repository, or a script's own path."""
    if module.endswith(".py"):
        return Path(module)
    for folder in (ROOT, ROOT / "docs" / "studies", ROOT / "tests", ROOT / "docs" / "make"):
        place = folder.joinpath(*module.split("."))
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.is_file():
                return file
    return None


def _handed_on(package: str, name: str) -> set[tuple[str, str]]:
    """Where a package has a name from."""
    if not name or (package == PACKAGE and name.startswith("__")):  # __version__ is a text
        return set()
    if package == PACKAGE and name in _public():
        return {(_public()[name], name)}
    file = _file(package)
    assert file is not None
    handed = {one for one in _imports(file) if one[1] == name}
    # the package defines it, out of whatever it imports
    if not handed and _file(f"{package}.{name}") is None:
        return set(_imports(file))
    return handed | {(f"{package}.{name}", "")}  # a module and what it defines may have one name


@cache
def _imports(file: Path) -> tuple[tuple[str, str], ...]:
    """(module, name) of everything that a file imports, and of what it takes from the package itself."""
    return tuple(_walk(ast.parse(file.read_text(encoding="utf-8")), file))


def _walk(tree: ast.AST, file: Path) -> Iterator[tuple[str, str]]:
    short: set[str] = set()  # what the package is called here
    for node in _running(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ""
                if alias.name == PACKAGE:
                    short.add(alias.asname or PACKAGE)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                yield node.module, alias.name
                yield f"{node.module}.{alias.name}", ""
        elif isinstance(node, ast.Attribute) and _is_by_name(node.value):
            yield from ((module, node.attr) for module in _named(node.value))
        elif _is_by_name(node):
            yield from ((module, "") for module in _named(node))
    for node in _running(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in short:
            yield PACKAGE, node.attr


def _is_by_name(node: ast.AST) -> TypeGuard[ast.Call]:
    return isinstance(node, ast.Call) and getattr(node.func, "id", "") == "import_module"


def _named(call: ast.Call) -> list[str]:
    """Modules that are imported by their names: one, or with f"folder.{name}" all of a folder."""
    match call.args[0]:
        case ast.Constant(value=str(module)):
            return [module]
        case ast.JoinedStr(values=[ast.Constant(value=str(start)), *_]):
            folder = start.removesuffix(".")
            place = ROOT.joinpath(*folder.split("."))
            files = [path.relative_to(place).with_suffix("") for path in place.rglob("*.py")]
            return [".".join((folder, *file.parts)).removesuffix(".__init__") for file in files]
    return []


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but what only type checkers see."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            continue
        yield node
        yield from _running(node)


@cache
def _public() -> dict[str, str]:
    """The module of each public name."""
    tree = ast.parse((ROOT / PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "_HOME":
            return dict(ast.literal_eval(node.value))
    raise LookupError("no _HOME in the package")


@cache
def _of_command_line() -> tuple[str, ...]:
    """The modules of the commands."""
    file = _file(ENTRY)
    assert file is not None
    return tuple(
        f"{PACKAGE}.cli.commands.{name}"
        for module, name in _imports(file)
        if module == f"{PACKAGE}.cli.commands" and name
    )


if __name__ == "__main__":
    for path in sorted(modules_of(shlex.join(sys.argv[1:]))):
        print(path.relative_to(ROOT))
