"""Draws first lines of docstrings and messages of the package at random, for somebody to read afresh.

python docs/make/draw_texts.py [SEED] [PACKAGE]        (60 first lines and 40 messages)

What has to be read twice is marked by the reader. The aim is at most 3 of 100.
"""

from __future__ import annotations

import ast
import random
import sys
from collections.abc import Iterator
from pathlib import Path

FIRST_LINES, MESSAGES = 60, 40
SHORTEST = 12  # characters of a text that counts as a message


def first_lines(tree: ast.Module) -> Iterator[str]:
    """Yield the first line of each docstring."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and (
            text := ast.get_docstring(node)
        ):
            yield text.split("\n")[0]


def messages(tree: ast.Module) -> Iterator[str]:
    """Yield the texts of errors and warnings: arguments of what is raised, and of calls that warn or help."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            yield from texts(node.exc)
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if name in ("warn", "note", "complain", "_fault", "add_argument"):
                yield from texts(node)


def texts(call: ast.Call) -> Iterator[str]:
    """Yield the texts among the arguments of a call, with {...} for values."""
    for argument in [*call.args, *(keyword.value for keyword in call.keywords)]:
        text = ""
        if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
            text = argument.value
        elif isinstance(argument, ast.JoinedStr):
            text = "".join(
                str(part.value) if isinstance(part, ast.Constant) else "{" + ast.unparse(part.value) + "}"
                for part in argument.values
                if isinstance(part, (ast.Constant, ast.FormattedValue))
            )
        if len(text) >= SHORTEST and " " in text:
            yield text


def main(seed: int, package: Path) -> None:
    """Print the drawn texts, numbered."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in sorted(package.rglob("*.py"))]
    rng = random.Random(seed)
    drawn = rng.sample([line for tree in trees for line in first_lines(tree)], FIRST_LINES)
    drawn += rng.sample([text for tree in trees for text in messages(tree)], MESSAGES)
    for number, text in enumerate(drawn, 1):
        print(f"{number:3d}  {text}")


if __name__ == "__main__":
    home = Path(__file__).parents[2] / "hybridsim"
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0, Path(sys.argv[2]) if len(sys.argv) > 2 else home)
