"""What `compare` and `compare_suite` refuse: every fault names the argument and its value, before anything runs."""

from __future__ import annotations

from typing import Any

import pytest

import hybridsim as hs
from hybridsim.errors import UsageError


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"model": 5}, "model is 5"),
        ({"t_span": 5}, "t_span is 5"),
        ({"t_span": (0, "a")}, "t_span is 'a'"),
        ({"t_span": (1, 0)}, "t_span"),
        ({"integrators": 5}, "integrators is 5"),
        ({"integrators": [None]}, "integrators holds None"),
        ({"integrators": [("dop853",)]}, r"integrators holds \('dop853',\)"),
        ({"integrators": [("dop853", 5)]}, "options of dop853 is 5"),
        ({"rtols": 5}, "rtols is 5"),
        ({"rtols": "1e-3"}, "rtols is '1e-3'"),
        ({"rtols": ["a"]}, "rtols is 'a'"),
        ({"rtols": [-1]}, "rtols is -1"),
        ({"steps": [0.5]}, "steps is 0.5"),
        ({"params": 5}, "params is 5"),
        ({"x0": 5}, "x0 is 5"),
        ({"repeat": "a"}, "repeat is 'a'"),
        ({"repeat": 0}, "repeat is 0"),
        ({"budget": None}, "budget is None"),
        ({"progress": 5}, "progress is 5"),
        ({"regularized": 5}, "regularized is 5"),
        ({"regularized": "tanh", "v0": ["a"]}, "v0 is 'a'"),
        ({"regularized": "tanh", "integrators": [("dop853", {})]}, "integrators holds"),
    ],
)
def test_compare_names_a_bad_argument(given: dict[str, Any], says: str) -> None:
    arguments: dict[str, Any] = {"model": "dfcs", "t_span": (0, 1e-3), "integrators": ["dop853"]}
    with pytest.raises(UsageError, match=says) as caught:
        hs.compare(**(arguments | given))
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"scenes": 5}, "scenes is 5"),
        ({"scenes": [5]}, "scenes holds 5"),
        ({"repeat": 1.5}, "repeat is 1.5"),
        ({"budget": 0}, "budget is 0"),
        ({"rtols": ["a"]}, "rtols is 'a'"),
    ],
)
def test_the_suite_names_a_bad_argument(given: dict[str, Any], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        hs.compare_suite(**given)
