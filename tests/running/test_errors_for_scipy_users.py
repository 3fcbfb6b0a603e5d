"""Who brings keywords of SciPy's solve_ivp is told what they are called here."""

from __future__ import annotations

from inspect import Parameter, signature

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.model.checks.doubtful import warnings_of


@pytest.mark.parametrize(
    ("keyword", "value", "remedy"),
    [
        ("method", "RK45", "integrator="),
        ("events", [], "hs.Monitor"),
        ("args", (1,), "params="),
        ("dense_output", True, "sol(t)"),
        ("y0", [0, 0], "x0="),
        ("jac", None, "omit jac"),
        ("dt", 0.1, "max_step"),
        ("t_end", 1.0, "t_span"),
    ],
)
@pytest.mark.parametrize("model", [hs.load("dfcs"), hs.two_blocks_on_belt()], ids=["model", "arrays"])
def test_keywords_of_solve_ivp(
    model: hs.Model | hs.MechanicalSystem, keyword: str, value: object, remedy: str
) -> None:
    with pytest.raises(hs.UsageError) as caught:
        hs.simulate(model, (0, 0.01), **{keyword: value})
    assert repr(keyword) in str(caught.value) and remedy in str(caught.value.remedy)


@pytest.mark.parametrize(
    ("given", "remedy"),
    [
        (([0.0, 1.0],), "pass x0=[0.0, 1.0]"),
        ((np.array([0.0, 1.0]), "RK45"), "pass x0=array([0., 1.])"),
        (({"F0": 20},), "pass params={'F0': 20} for parameters, or x0={'F0': 20} for initial values"),
        (("RK45",), "pass integrator='RK45'"),
        ((1e-6,), "pass it as a keyword, such as x0=..., params=... or rtol=..."),
    ],
)
@pytest.mark.parametrize("model", ["dfcs", hs.two_blocks_on_belt()], ids=["model", "arrays"])
def test_what_solve_ivp_takes_by_its_place(
    model: str | hs.MechanicalSystem, given: tuple[object, ...], remedy: str
) -> None:
    with pytest.raises(hs.UsageError, match="only as a keyword argument") as caught:
        hs.simulate(model, (0, 1), *given)
    assert caught.value.remedy == remedy


def test_the_signature_shows_what_can_be_given() -> None:
    kinds = {p.kind for p in signature(hs.simulate).parameters.values()}
    assert kinds == {Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY, Parameter.VAR_KEYWORD}


def test_keywords_that_are_the_same() -> None:
    sol = hs.simulate(
        "dfcs", t_span=(0, 0.01), t_eval=[0.005], rtol=1e-8, atol=1e-9, max_step=1e-3, first_step=1e-6
    )
    assert sol.success and sol.t.tolist() == [0.005]


@pytest.mark.parametrize("keyword", ["params", "z0", "first_step"])
def test_what_a_mechanical_system_does_not_take(keyword: str) -> None:
    with pytest.raises(hs.UsageError, match=f"a MechanicalSystem does not support `{keyword}`\n"):
        hs.simulate(hs.two_blocks_on_belt(), (0, 0.01), **{keyword: {}})


def test_what_is_no_model_is_told_what_to_make_of_it() -> None:
    with pytest.raises(hs.UsageError) as fault:
        hs.simulate(lambda t, x: x, (0, 1))
    assert "hs.Model(" in str(fault.value)
    for ask in (hs.steady_state, hs.linearize):
        with pytest.raises(hs.UsageError) as fault:
            ask(hs.two_blocks_on_belt())
        assert "system.to_model()" in str(fault.value)
    with pytest.raises(hs.UsageError) as fault:
        hs.simulate("dfcs", [0.1 * k for k in range(50)])
    assert "50 numbers" in str(fault.value) and "t_eval" in str(fault.value)


def test_a_force_without_a_contact_is_told_where_it_comes_from() -> None:
    with pytest.raises(hs.ModelError) as fault:
        hs.Model("m", states=[hs.State("x", 0, "v"), hs.State("v", 0, "-x - friction")]).validate()
    assert "[contacts.NAME]" in str(fault.value)


def test_check_says_who_refuses_a_fractional_power_of_a_velocity() -> None:
    law = hs.FrictionLaw("power", slip="N*(0.3 + (abs(v)/0.1)**1.5)", stick="0.4*N")
    model = hs.Model(
        "m",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "-x - f")],
        contacts=[hs.Contact("f", "v", "10", law)],
    )
    told = [caution for caution in warnings_of(model) if "no Taylor series" in caution.message]
    assert told and all("moreau" in caution.remedy for caution in told)
