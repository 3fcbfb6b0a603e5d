"""Names that pages showed under earlier paths are still found there, with a warning that says where they are now."""

from __future__ import annotations

import importlib

import pytest

from hybridsim.integrators import contract


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("hybridsim.integrators.base", "Integrator"),
        ("hybridsim.integrators.base", "CAPABILITIES"),
        ("hybridsim.engine.stepping", "Step"),
        ("hybridsim.engine.stepping", "Flow"),
        ("hybridsim.engine.stepping", "StepFailure"),
        ("hybridsim.engine.stepping", "Tolerances"),
    ],
)
def test_an_earlier_path_warns_and_works(path: str, name: str) -> None:
    module = importlib.import_module(path)
    with pytest.warns(DeprecationWarning, match=r"hybridsim\.integrators\.contract"):
        assert getattr(module, name) is getattr(contract, name)


@pytest.mark.parametrize("path", ["hybridsim.integrators.base", "hybridsim.engine.stepping"])
def test_what_was_never_there_is_not_there(path: str) -> None:
    module = importlib.import_module(path)
    with pytest.raises(AttributeError, match="no attribute 'Stepp'"):
        module.Stepp  # noqa: B018  # reading it is the test


def test_a_tableau_makes_a_method_from_where_the_page_takes_it() -> None:
    family = importlib.import_module("hybridsim.integrators.runge_kutta")
    assert {"RungeKuttaStepper", "Tableau"} <= set(family.__all__)
