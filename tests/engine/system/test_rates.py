"""Tests that the rates of angles follow the parameters that they depend on."""

import math

import pytest

import hybridsim as hs
from hybridsim.engine.system.system import System


def rates(model):
    """Return the rates of a model as the sum of both parts."""
    return System(model.validate()).exact_rates.sum(axis=1).tolist()


def test_a_rate_follows_its_parameters_and_those_in_their_expressions():
    dfcs = hs.load("dfcs")
    for changes in ({}, {"k": 4e5}, {"F0": 31.0}, {"m": 0.05}, {}, {"omega": 7.0}, {"k": 4e5, "N": 1.0}):
        values = {"k": 1e5, "m": 0.2} | changes
        expected = changes.get("omega", 0.6 * math.sqrt(values["k"] / values["m"]))
        assert rates(dfcs.with_(**changes)) == [pytest.approx(expected, rel=1e-15)], changes


def test_a_rate_follows_the_parameters_of_a_defined_angle():
    model = hs.Model(
        "m",
        states=[hs.State("x", 0, "sin(angle)")],
        parameters={"a": 2, "b": 1},
        definitions={"angle": "3*a*t"},
    )
    assert [rates(model.with_(**c)) for c in ({}, {"a": 5}, {"b": 2}, {})] == [[6.0], [15.0], [6.0], [6.0]]


def test_a_rate_follows_the_period_of_a_wave():
    wave = hs.Input("u", "wave", shape="sine", amplitude=1, period="2*P")
    model = hs.Model("m", states=[hs.State("x", 0, "u")], parameters={"P": 3, "q": 1}, inputs=[wave])
    for changes in ({}, {"P": 7}, {"q": 2}, {"P": 0.1}, {}):
        period = 2 * changes.get("P", 3)
        assert rates(model.with_(**changes)) == [pytest.approx(2 * math.pi / period, rel=1e-15)], changes
