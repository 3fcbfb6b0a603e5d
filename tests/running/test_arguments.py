"""What `simulate` refuses: every fault names the argument, its value and the remedy."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

SPAN = (0.0, 0.01)


@pytest.mark.parametrize(
    ("given", "says", "remedy"),
    [
        ({"atol": "a"}, "`atol` cannot be 'a'", "one for each of x, v"),
        ({"atol": {"x": "a"}}, "`atol` of x cannot be 'a'", "number"),
        ({"atol": [1, "b"]}, "`atol` cannot be 'b'", "number"),
        ({"atol": [[1], [1, 2]]}, r"`atol` cannot be \[1\]", "number"),
        ({"atol": [1e-9]}, "`atol` cannot be", "one for each of x, v"),
        ({"atol": -1}, "`atol` cannot be -1", ">= 0"),
        ({"rtol": "x"}, "`rtol` cannot be 'x'", "below 1"),
        ({"rtol": True}, "`rtol` cannot be True", "below 1"),
        ({"rtol": 1j}, "`rtol` cannot be 1j", "below 1"),
        ({"rtol": 0}, "`rtol` cannot be 0", "below 1"),
        ({"max_step": "1"}, "`max_step` cannot be '1'", "positive number"),
        ({"max_step": None}, "`max_step` cannot be None", "positive number"),
        ({"max_step": np.ones(2)}, "`max_step` cannot be array", "positive number"),
        ({"first_step": "a"}, "`first_step` cannot be 'a'", "positive number"),
        ({"first_step": -1}, "`first_step` cannot be -1", "positive number"),
        ({"x0": 5}, "`x0` cannot be 5", "dict"),
        ({"x0": "ab"}, "`x0` cannot be 'ab'", "dict"),
        ({"x0": [1, "a"]}, "`x0` cannot be 'a'", "number"),
        ({"x0": {"x": "1"}}, "`x0` of x cannot be '1'", r"with_start\(x="),
        ({"x0": {"x": math.nan}}, "`x0` of x cannot be nan", "finite"),
        ({"x0": {5: 1}}, "`x0` contains 5", "known states"),
        ({"z0": 5}, "`z0` cannot be 5", "dict"),
        ({"z0": {"f": 5}}, "`z0` of f is 5", "slip"),
        ({"z0": {5: "stick"}}, "`z0` contains 5", "known components"),
        ({"params": 5}, "`params` cannot be 5", "dict"),
        ({"params": "N=3"}, "`params` cannot be 'N=3'", "dict"),
        ({"params": {"N": None}}, "parameter N cannot be None", "number or an expression"),
        ({"params": {5: 1}}, "`params` cannot be {5: 1}", "dict"),
        ({"integrator": None}, "`integrator` cannot be None", "list_integrators"),
        ({"t_eval": "a"}, "`t_eval` cannot be 'a'", "times from t0 to t1"),
        ({"t_eval": 5}, "`t_eval` cannot be 5", "times from t0 to t1"),
        ({"t_eval": [[0, 1]]}, r"`t_eval` cannot be \[0, 1\]", "times from t0 to t1"),
        ({"rtoll": 1e-9}, "no option 'rtoll'", "did you mean 'rtol'"),
        ({"tspan": SPAN, "integrator": "taylor"}, "no option 'tspan'", "ends of the run as t_span"),
        ({"maxstep": 1, "integrator": "moreau"}, "no option 'maxstep'", "did you mean 'max_step'"),
        ({"integrator": "rk45"}, "no integrator 'rk45'", "'scipy-rk45'.*hybridsim integrators"),
        ({"rtol": np.float64(2)}, r"`rtol` cannot be 2\.0", "below 1"),
        ({"progress": 5}, "`progress` cannot be 5", "function"),
        ({"t_span": 5}, "`t_span` cannot be 5", "two numbers"),
        ({"t_span": None}, "`t_span` cannot be None", "two numbers"),
        ({"t_span": "12"}, "`t_span` cannot be '12'", "two numbers"),
        ({"t_span": (0, "a")}, "`t_span` cannot be 'a'", "two numbers"),
        ({"t_span": (0, 1, 2)}, r"`t_span` cannot be \(0, 1, 2\)", "two numbers"),
        ({"t_span": (0, math.inf)}, "`t_span` cannot be", "finite"),
        ({"model": 5}, "model cannot be 5", "name or a path"),
        ({"model": None}, "model cannot be None", "name or a path"),
    ],
)
def test_a_bad_argument_is_named(given: dict[str, Any], says: str, remedy: str) -> None:
    arguments = {"model": "dfcs", "t_span": SPAN} | given
    with pytest.raises(UsageError, match=says) as caught:
        hs.simulate(**arguments)
    assert caught.match(remedy)


def test_the_smallest_rtol_is_told_as_it_is() -> None:
    """A bound that were rounded would be refused with itself as the remedy."""
    with pytest.raises(UsageError, match=r"`rtol` cannot be 2\.2e-14") as caught:
        hs.simulate("dfcs", SPAN, rtol=2.2e-14)
    bound = float(str(caught.value.remedy).split()[4])
    assert bound == 100 * np.finfo(float).eps
    assert hs.simulate("dfcs", SPAN, rtol=bound).success


def test_numbers_of_all_kinds_are_numbers() -> None:
    plain = hs.simulate(
        "dfcs", SPAN, rtol=1e-6, atol=[1e-9, 1e-9], x0=[0, 0], max_step=0.001, first_step=2.0**-20
    )
    other = hs.simulate(
        "dfcs",
        np.array(SPAN),
        rtol=np.float64(1e-6),
        atol=np.array([1e-9, 1e-9]),
        x0=(Fraction(0), np.int64(0)),
        max_step=np.array(0.001),
        first_step=np.float32(2.0**-20),
        params={"N": np.float64(40), "mu": np.array(0.5)},
    )
    assert (plain.y == other.y).all()


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign"])
@pytest.mark.parametrize("name", ["rtol", "atol"])
def test_a_fixed_step_refuses_tolerances(integrator: str, name: str) -> None:
    with pytest.raises(UsageError, match=f"{integrator} does not accept {name}: its step is fixed"):
        hs.simulate("dfcs", SPAN, integrator=integrator, **{name: 1e-9})
    assert hs.simulate("dfcs", SPAN, integrator=integrator).success


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign"])
def test_a_fixed_step_is_not_above_the_longest(integrator: str) -> None:
    with pytest.raises(
        UsageError, match=f"`max_step` is 0.0001, but the fixed step of {integrator} is 0.0002"
    ):
        hs.simulate("dfcs", SPAN, integrator=integrator, step=2e-4, max_step=1e-4)
    assert hs.simulate("dfcs", SPAN, integrator=integrator, step=1e-4, max_step=1e-4).success


@pytest.mark.parametrize(
    ("value", "said"), [(float("nan"), "F0: nan is not finite"), ("22 N", "F0: invalid expression")]
)
def test_a_value_that_is_none_is_said_of_its_parameter(value: object, said: str) -> None:
    with pytest.raises(hs.ModelError, match=said) as caught:
        hs.simulate("dfcs", (0.0, 0.1), params={"F0": value})
    assert "finite" in str(caught.value) or "set the unit in the field 'unit'" in str(caught.value)


def test_events_of_what_does_not_exist_are_refused() -> None:
    sol = hs.simulate("dfcs", (0.0, 0.01))
    assert len(sol.event_times("f")) == len(sol.events)
    with pytest.raises(hs.UsageError, match="no component, monitor or schedule 'g'"):
        sol.event_times("g")
