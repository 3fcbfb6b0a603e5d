"""Who brings keywords of SciPy's solve_ivp is told what they are called here."""

from __future__ import annotations

import pytest

import hybridsim as hs


@pytest.mark.parametrize(
    ("keyword", "value", "remedy"),
    [
        ("method", "RK45", "integrator="),
        ("events", [], "hs.Monitor"),
        ("args", (1,), "params="),
        ("dense_output", True, "sol(t)"),
        ("y0", [0, 0], "x0="),
        ("jac", None, "leave it out"),
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


def test_keywords_that_are_the_same() -> None:
    sol = hs.simulate(
        "dfcs", t_span=(0, 0.01), t_eval=[0.005], rtol=1e-8, atol=1e-9, max_step=1e-3, first_step=1e-6
    )
    assert sol.success and sol.t.tolist() == [0.005]


@pytest.mark.parametrize("keyword", ["params", "z0", "first_step", "limits"])
def test_what_a_mechanical_system_does_not_take(keyword: str) -> None:
    with pytest.raises(hs.UsageError, match=f"a MechanicalSystem takes no {keyword}\n"):
        hs.simulate(hs.two_blocks_on_belt(), (0, 0.01), **{keyword: {}})
