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
    ],
)
def test_keywords_of_solve_ivp(keyword: str, value: object, remedy: str) -> None:
    with pytest.raises(hs.UsageError) as caught:
        hs.simulate("dfcs", (0, 0.01), **{keyword: value})
    assert remedy in str(caught.value.remedy)
