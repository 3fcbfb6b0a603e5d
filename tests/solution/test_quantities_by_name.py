"""A quantity of a run by its name in brackets: states, outputs, forces, time, on both sides of events."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError

MU, N, M = 0.3, 20.0, 2.0  # the deceleration of a block that slides freely is mu N/m


def sliding(**keywords: object) -> hs.Solution:
    block = hs.Model(
        "block",
        states=[hs.State("x", 0, "v"), hs.State("v", 1.5, f"-f/{M}")],
        contacts=[hs.Contact("f", velocity="v", normal=N, law="coulomb", arguments={"mu": MU})],
        outputs=[hs.Output("power", "f*v")],
    )
    return hs.simulate(block, (0, 0.4), **keywords)


def test_brackets_read_a_quantity_at_the_times_of_the_run() -> None:
    sol = sliding()
    t = sol["t"]
    slowing = MU * N / M
    assert t is sol.t
    assert sol["x"] == pytest.approx(1.5 * t - 0.5 * slowing * t**2, rel=1e-12)
    assert sol["v"] == pytest.approx(1.5 - slowing * t, rel=1e-12)
    assert sol["f"] == pytest.approx(np.full(len(t), MU * N))
    assert sol["power"] == pytest.approx(MU * N * (1.5 - slowing * t), rel=1e-12)
    assert sol["v_rel(f)"].shape == t.shape


def test_brackets_follow_the_requested_times() -> None:
    sol = sliding(t_eval=[0.0, 0.1, 0.2])
    assert sol["t"].tolist() == [0.0, 0.1, 0.2]
    assert sol["v"] == pytest.approx([1.5, 1.2, 0.9])


def test_brackets_of_arrays_of_contacts() -> None:
    sol = hs.simulate(hs.two_blocks_on_belt(), (0, 1))
    assert (sol["q1"] == sol.y[0]).all() and sol["f1"].shape == sol["t"].shape


def test_an_unknown_name_is_answered_with_similar_ones() -> None:
    sol = sliding()
    assert "power" in sol and "t" in sol and "y" not in sol and 0 not in sol
    with pytest.raises(UsageError, match="no quantity 'powr'") as caught:
        sol["powr"]
    assert "power" in str(caught.value)
