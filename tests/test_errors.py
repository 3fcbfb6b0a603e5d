"""Messages: where, what, the source with a caret, and what to do."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from hybridsim.errors import (
    ExpressionError,
    HybridsimError,
    ModelError,
    Place,
    SimulationError,
    UsageError,
    near,
    nearest,
)


def test_the_parts_of_a_message() -> None:
    error = HybridsimError("no good", place=Place("m.toml", 3, 4, "a + b"), remedy="write c.")
    assert str(error) == "m.toml:3: no good\n    a + b\n        ^\nwrite c."


@pytest.mark.parametrize(
    ("place", "head"),
    [(None, ""), (Place(), ""), (Place("a"), "a: "), (Place("a", 2), "a:2: "), (Place(line=2), "line 2: ")],
)
def test_what_is_not_known_is_not_shown(place: Place | None, head: str) -> None:
    assert str(HybridsimError("no good", place=place)) == head + "no good"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (np.float64(-2.5e-300), "-2.5e-300"), (np.float32(0.5), "0.5"), (np.int64(-3), "-3"), (np.True_, "True"),
        (np.float64("nan"), "nan"), (np.str_("a b"), "'a b'"), (np.float64(1), "1.0"), ("np.x", "'np.x'"),
        ((np.float64(0), np.int8(1)), "(0.0, 1)"),
    ],
)  # fmt: skip
def test_numbers_of_numpy_are_shown_as_numbers(value: object, shown: str) -> None:
    assert UsageError(f"a is {value!r}", remedy="r").message == f"a is {shown}"


@pytest.mark.parametrize(
    ("name", "meant"),
    [("rk45", "scipy-rk45"), ("BDF", "cvode-bdf"), ("Taylor", "taylor"), ("rk", ""), ("xyz", "")],
)
def test_a_part_of_a_name_may_mean_it(name: str, meant: str) -> None:
    known = ["scipy-rk45", "cvode-bdf", "taylor", "scipy-rk23"]
    assert near(name, known) == ([meant] if meant else [])


@pytest.mark.parametrize(
    ("kind", "code"),
    [(HybridsimError, 1), (SimulationError, 1), (UsageError, 2), (ModelError, 3), (ExpressionError, 3)],
)
def test_exit_codes(kind: type[HybridsimError], code: int) -> None:
    assert kind("x").exit_code == code
    assert isinstance(kind("x"), HybridsimError)


def test_bad_usage_is_a_value_error_for_those_who_know_scipy() -> None:
    with pytest.raises(ValueError, match="x"):
        raise UsageError("x")


def test_collected_errors() -> None:
    one, two = ModelError("first", place=Place("m", 1)), ExpressionError("second", place=Place("m", 2))
    both = ModelError.collect([two, one], "model m")
    assert both.errors == (one, two)
    assert str(both).splitlines() == ["model m: 2 errors", "m:1: first", "m:2: second"]
    assert ModelError.collect([one], "model m") is one
    assert one.errors == (one,)
    assert ModelError.collect([both, one], "more").errors == (one, two)  # a fault met twice is one


def test_errors_travel_between_processes_whole() -> None:
    error = ModelError.collect(
        [ExpressionError("a", place=Place("m", 1, 2, "text"), remedy="r"), ModelError("b")], "m"
    )
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert type(again.errors[-1]) is ExpressionError and again.errors[-1].place == Place("m", 1, 2, "text")


def test_nearest_names() -> None:
    assert nearest("omga", ["omega", "mu", "N"]) == "did you mean 'omega'?"
    assert nearest("n", ["N", "mu"]) == "did you mean 'N'?"
    assert nearest("zzz", ["b", "a"], kind="laws") == "known laws: a, b"
    assert nearest("zzz", [], kind="laws") == "there are no laws"
    assert "(40 in all)" in nearest("zzz", [f"parameter_{i}" for i in range(40)])
