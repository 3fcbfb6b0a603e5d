"""What `compare` and `compare_suite` refuse: every fault names the argument and its value, before anything runs."""

from __future__ import annotations

from typing import Any

import pytest

import hybridsim as hs
from hybridsim.errors import UsageError


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"model": 5}, "model cannot be 5"),
        ({"t_span": 5}, "`t_span` cannot be 5"),
        ({"t_span": (0, "a")}, "`t_span` cannot be 'a'"),
        ({"t_span": (1, 0)}, "t_span"),
        ({"integrators": 5}, "`integrators` cannot be 5"),
        ({"integrators": [None]}, "`integrators` cannot contain None"),
        ({"integrators": [("dop853",)]}, r"`integrators` cannot contain \('dop853',\)"),
        ({"integrators": [("dop853", 5)]}, "options of dop853 cannot be 5"),
        ({"rtols": 5}, "`rtols` cannot be 5"),
        ({"rtols": "1e-3"}, "`rtols` cannot be '1e-3'"),
        ({"rtols": ["a"]}, "`rtols` cannot be 'a'"),
        ({"rtols": [-1]}, "`rtols` cannot be -1"),
        ({"steps": [0.5]}, "`steps` cannot be 0.5"),
        ({"params": 5}, "`params` cannot be 5"),
        ({"x0": 5}, "`x0` cannot be 5"),
        ({"repeat": "a"}, "`repeat` cannot be 'a'"),
        ({"repeat": 0}, "`repeat` cannot be 0"),
        ({"budget": None}, "`budget` cannot be None"),
        ({"progress": 5}, "`progress` cannot be 5"),
        ({"regularized": 5}, "`regularized` cannot be 5"),
        ({"regularized": "tanh", "v0": ["a"]}, "`v0` cannot be 'a'"),
        ({"regularized": "tanh", "integrators": [("dop853", {})]}, "`integrators` cannot contain"),
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
        ({"scenes": 5}, "`scenes` cannot be 5"),
        ({"scenes": [5]}, "`scenes` cannot contain 5"),
        ({"repeat": 1.5}, "`repeat` cannot be 1.5"),
        ({"budget": 0}, "`budget` cannot be 0"),
        ({"rtols": ["a"]}, "`rtols` cannot be 'a'"),
    ],
)
def test_the_suite_names_a_bad_argument(given: dict[str, Any], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        hs.compare_suite(**given)
