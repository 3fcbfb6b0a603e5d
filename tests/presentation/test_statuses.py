"""Every status and every warning in the code has an explanation, and each explanation has a use in the code."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.errors import UsageError
from hybridsim.presentation.statuses import explanation, explanations

PACKAGE = Path(hs.__file__).parent
RUNS = ("engine", "integrators", "mechanics", "solution", "simulator")


def trees(*folders: str) -> Iterator[ast.AST]:
    for folder in folders:
        for path in sorted((PACKAGE / folder).rglob("*.py")):
            yield from ast.walk(ast.parse(path.read_text(encoding="utf-8")))


def texts(node: ast.AST | None) -> Iterator[str]:
    """The texts that an expression may be, each with its changing parts left out."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        yield "".join(part.value for part in node.values if isinstance(part, ast.Constant))
    elif isinstance(node, ast.IfExp):
        yield from (*texts(node.body), *texts(node.orelse))
    elif isinstance(node, ast.ListComp):
        yield from texts(node.elt)
    elif isinstance(node, ast.List | ast.Tuple | ast.Dict):
        for part in node.keys if isinstance(node, ast.Dict) else node.elts:
            yield from texts(part)


def is_status(node: ast.expr) -> bool:
    return getattr(node, "attr", getattr(node, "id", "")) == "status"


def statuses() -> set[str]:
    found: set[str] = set()
    for node in trees(*RUNS):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                if is_status(target):
                    found.update(texts(node.value))
                elif isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = zip(target.elts, node.value.elts, strict=False)  # a starred part is no status
                    found.update(text for one, value in pairs if is_status(one) for text in texts(value))
                elif getattr(target, "id", "") == "STATUS" and isinstance(node.value, ast.Dict):
                    found.update(text for value in node.value.values for text in texts(value))
        elif isinstance(node, ast.FunctionDef) and "tuple[str, str]" in ast.unparse(
            node.returns or ast.Pass()
        ):
            for part in ast.walk(node):
                if isinstance(part, ast.Return) and isinstance(part.value, ast.Tuple):
                    found.update(texts(part.value.elts[0]))
        elif (
            isinstance(node, ast.Call)
            and getattr(node.func, "attr", "") in ("_stop", "stop_early")
            and node.args
        ):
            found.update(texts(node.args[0]))
    return found


def warnings() -> Iterator[str]:
    for node in trees(*RUNS):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith((".warn", "warnings.append")):
            yield from texts(node.args[0])
        elif isinstance(node, ast.FunctionDef) and node.name in ("warnings", "passed_unseen"):
            for part in ast.walk(node):
                if isinstance(part, ast.Return | ast.Assign):
                    yield from (text for text in texts(part.value) if text)
        elif isinstance(node, ast.FunctionDef) and node.name == "_contradictions":
            for part in ast.walk(node):
                if isinstance(part, ast.Assign):
                    yield from (text for text in texts(part.value) if "initial state" in text)


def test_every_status_in_the_code_has_a_section() -> None:
    found = statuses()
    assert {
        "finished",
        "cascade",
        "step-failure",
        "nonunique",
        "accumulation",
    } <= found  # it looks where they are
    assert found - set(explanations()) == set()


def test_every_warning_in_the_code_has_a_section() -> None:
    found = list(warnings())
    assert len(found) > 12
    assert [text for text in found if not any(phrase in text for phrase in explanations())] == []


def test_every_section_is_of_something_that_the_code_says() -> None:
    """A status or a phrase that no module contains any more loses its section."""
    constants = [node.value for node in trees("") if isinstance(node, ast.Constant)]
    said = "\n".join(text for text in constants if isinstance(text, str))
    assert [phrase for phrase in explanations() if phrase not in said] == []


@pytest.mark.parametrize(
    ("words", "start"),
    [
        ("cascade", "cascade\n"),
        ("Nonunique", "nonunique\n"),
        ("events of b follow each other ever faster; the run continues", "follow each other ever faster\n"),
        ("chattering: from t = 1, 200 of 200 events within 1 belong to u", "chattering\n"),
        ("undecided", "undecided at rounding\n"),
    ],
)
def test_a_section_is_found_by_the_words_that_somebody_saw(words: str, start: str) -> None:
    assert explanation(words).startswith(start)


def test_a_status_that_does_not_exist_is_refused_with_its_nearest() -> None:
    with pytest.raises(UsageError) as caught:
        explanation("cascede")
    assert "cascade" in str(caught.value)
