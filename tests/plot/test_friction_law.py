"""The picture of a law shows the law."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError
from hybridsim.plot import friction_law


def test_a_set_valued_law_is_a_curve_and_a_range_at_rest() -> None:
    arguments = {"mu_forward": 0.5, "mu_backward": 0.3}
    (axes,) = friction_law("asymmetric", arguments, speed=2, normal=10)
    forward, backward, rest = (line.get_xydata() for line in axes.get_lines())
    assert forward[-1] == pytest.approx([2, 5])
    assert backward[-1] == pytest.approx([-2, -3])
    assert rest[:, 1] == pytest.approx([5, -3])


def test_a_law_with_states_is_a_loop_as_well() -> None:
    """The area of a Jenkins loop is 4 F_c (A - F_c/k)."""
    _, loop = friction_law("jenkins", {"mu": 0.5, "k": 4}, speed=1, amplitude=2)
    x, f = loop.get_lines()[0].get_xydata().T
    area = 0.5 * np.abs(np.sum(x * np.roll(f, -1) - f * np.roll(x, -1)))
    assert area == pytest.approx(4 * 0.5 * (2 - 0.5 / 4), rel=1e-4)


def test_a_picture_needs_a_speed() -> None:
    with pytest.raises(hs.UsageError, match="`speed` and `amplitude` cannot be 0 and 1"):
        friction_law("coulomb", {"mu": 0.5}, speed=0)


def test_a_law_does_not_know_how_fast_it_is_used() -> None:
    with pytest.raises(UsageError, match="set `speed` to the largest"):
        friction_law("coulomb", {"mu": 0.5})


def test_points_of_a_table_are_marked_and_loops_have_arrows() -> None:
    table = hs.LawTable("mu", [0, 0.5, 2], [0.6, 0.4, 0.5])
    law = hs.FrictionLaw("measured", slip="mu*N", stick="mu*N", tables=[table])
    (axes,) = friction_law(law, {}, speed=1)
    (points,) = (line for line in axes.get_lines() if line.get_marker() == "o")
    assert points.get_xydata().tolist() == [[0, 0.6], [0.5, 0.4]]  # the third is outside
    for axes in friction_law("dahl", {"mu": 0.5, "sigma": 2}, speed=1):
        (arrow,) = (text for text in axes.texts if text.arrow_patch)
        assert abs(arrow.xy[0]) < 0.95  # not at a turning point, where it would leave the curve


def test_a_small_effect_on_a_force_looks_small() -> None:
    arguments = {"mu_0": 0.6, "a": 0.01, "b": 0.015, "L": 0.2, "v_0": 1}
    axes, _ = friction_law("rate-and-state", arguments, speed=0.95, mean=1)
    low, high = axes.get_ylim()
    assert low == 0 and high > 0.6
