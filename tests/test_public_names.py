"""The explicit list of public names: all exist, type checkers see the same ones, and none is a module."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
from types import ModuleType

import pytest

import hybridsim


@pytest.mark.parametrize("name", hybridsim.__all__)
def test_name_exists(name: str) -> None:
    assert name in dir(hybridsim)
    assert not isinstance(getattr(hybridsim, name), ModuleType)


def test_the_stub_lists_the_same_names() -> None:
    stub = ast.parse(Path(hybridsim.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    listed = {
        alias.name: node.module
        for node in ast.walk(stub)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert listed == hybridsim._HOME | hybridsim._FORMER | dict.fromkeys(hybridsim._PACKAGES, "hybridsim")


def test_a_function_is_not_hidden_by_the_module_of_its_name() -> None:
    importlib.import_module("hybridsim.simulate")
    assert callable(hybridsim.simulate)


def test_unknown_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        hybridsim.simulat  # noqa: B018  # reading it is the test


def test_completion_offers_public_names_only() -> None:
    """`dir` of the package and of a model, which shells and notebooks complete from."""
    assert dir(hybridsim) == sorted([*hybridsim.__all__, "plot"])
    offered = {name for name in dir(hybridsim.load("dfcs")) if not name.startswith("_")}
    assert {"states", "with_", "regularized", "to_toml", "validate"} <= offered
    assert not offered & {"once", "structure", "place", "components_of", "with_values_of", "error"}


def test_answers_print_themselves_in_text_and_in_notebooks() -> None:
    """Each public answer has a text that is no list of fields, and notebooks show the same text."""
    hs = hybridsim
    run, orbit = hs.simulate("free-decay", (0, 1)), hs.steady_state("belt")
    (stuck,) = hs.equilibria("free-decay")
    shown = {
        "Steady state of belt": orbit,
        "Equilibrium (f stick)": stuck,
        "Linearization: not stable": hs.linearize("belt", "slip-"),
        "Sensitivities of a run": hs.sensitivities(run, ["mu"]),
        "transition f stick": hs.simulate("dfcs", (0, 0.1)).explain(0),
    }
    for head, answer in shown.items():
        assert repr(answer).startswith(head)
        assert answer._repr_html_().startswith(f"<pre>{head}")
        assert "array(" not in repr(answer)
    assert "-1, 0] to [1, 0]" in repr(stuck)
    assert "mu" in repr(hs.sensitivities(run, ["mu"]))


def test_an_integrator_prints_its_name_and_order() -> None:
    exact = next(each for each in hybridsim.list_integrators() if each.name == "exact")
    assert repr(exact) == "<integrator exact: linear modes in closed form, order exact>"
