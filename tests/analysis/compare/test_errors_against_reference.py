"""Errors of runs whose errors are known: shifted and scaled copies of closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plot.fake_solution import ball, ball_model, oscillator, oscillator_model

from hybridsim.analysis.compare.errors_against_reference import Yardstick
from hybridsim.analysis.compare.mode_sequence import SequenceVerdict
from hybridsim.analysis.compare.resets import resets_of
from hybridsim.analysis.compare.trajectory import trajectory_of
from hybridsim.model import Model, Monitor, Schedule, State
from hybridsim.reference.trajectory import Trajectory

PERIOD = 2 * math.pi / oscillator_model().parameter_values()["omega"]


def yardstick_of(solution, period: float | None = None) -> Yardstick:
    return Yardstick(trajectory_of(solution), resets_of(solution.model), (1.0, 1.0), period)


def test_the_reference_itself_has_no_error() -> None:
    for solution, period in ((oscillator(20), PERIOD), (ball(), None)):
        errors = yardstick_of(solution, period).measure(trajectory_of(solution))
        assert (errors.state, errors.event_time) == (0, 0)
        assert errors.sequence.right
        assert errors.state_last_period == (0 if period else None)


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-9])
def test_late_events_and_scaled_states_are_measured(size: float) -> None:
    """A run late by size * T in which everything is larger by the factor 1 + size."""
    errors = yardstick_of(oscillator(20), PERIOD).measure(trajectory_of(oscillator(20, error=size)))
    assert errors.event_time == pytest.approx(size * PERIOD, rel=1e-6)
    # The velocity is off the most: it goes through zero at about 3 pi amplitudes a period.
    assert size * 2 * math.pi < errors.state < size * 12
    assert errors.sequence.right


def test_the_last_period_sees_only_itself() -> None:
    good = trajectory_of(oscillator(20))

    def states(t, side):
        return good.states(t, side) * np.where(t < 5 * PERIOD, 1.5, 1 + 1e-7)

    errors = yardstick_of(oscillator(20), PERIOD).measure(replace(good, states=states))
    assert errors.state == pytest.approx(0.5, rel=0.1)
    assert errors.state_last_period == pytest.approx(1e-7, rel=0.01)


def test_between_the_steps_of_a_round_grid_is_seen_too() -> None:
    good = trajectory_of(oscillator(20))

    def states(t, side):
        return good.states(t, side) + 1e-3 * np.sin(math.pi * t * 1200 / PERIOD) ** 2 * [[0], [1]]

    assert yardstick_of(oscillator(20), PERIOD).measure(replace(good, states=states)).state > 4e-3


@pytest.mark.parametrize("shift", [1e-3, 1e-6, -1e-6])
def test_around_a_reset_the_same_side_is_compared(shift: float) -> None:
    """A ball that bounces a little late or early is off by what it moves meanwhile, not by the whole jump."""
    exact = trajectory_of(ball())

    def states(t, side):
        return exact.states(np.clip(t - shift, *exact.t_span), side)

    events = tuple(replace(event, t=event.t + shift) for event in exact.events)
    yardstick = yardstick_of(ball())
    errors = yardstick.measure(replace(exact, states=states, events=events))
    assert errors.event_time == pytest.approx(abs(shift), rel=1e-6)
    speed = math.sqrt(2 * 9.81)
    assert abs(shift) < errors.state <= 1.01 * abs(shift) * max(speed / 0.5, 9.81 / yardstick.amplitude[1])
    # Without the matching, the jump itself would be taken for an error.
    blind = replace(exact, states=states, events=())
    assert yardstick.measure(blind).state > 1.5


def test_a_missed_reset_shows_in_full() -> None:
    lossless = trajectory_of(ball(t_end=1.0))

    def states(t, side):
        return np.array([1 - 9.81 * t**2 / 2, -9.81 * t])

    errors = yardstick_of(ball(t_end=1.0)).measure(replace(lossless, states=states, events=()))
    assert errors.sequence == SequenceVerdict(missed=1)
    assert errors.event_time is None
    assert errors.state > 1


def test_a_state_that_rests_is_measured_by_its_nominal_size() -> None:
    still = Trajectory(lambda t, side: np.zeros((1, len(t))), (0.0, 1.0))
    moved = Trajectory(lambda t, side: np.full((1, len(t)), 0.02), (0.0, 1.0))
    model = Model("still", states=[State("x", 0, "0", nominal=10)])
    assert Yardstick(still, resets_of(model), (10.0,), None).measure(moved).state == pytest.approx(0.002)


def test_a_run_that_was_ended_earlier_is_compared_up_to_there() -> None:
    errors = yardstick_of(oscillator(20), PERIOD).measure(trajectory_of(oscillator(10)))
    assert errors.state == 0 and errors.sequence.right


def test_resets_go_by_the_declaration() -> None:
    resets = resets_of(ball_model())
    bounce, *_, rest = ball().events
    assert bounce in resets and rest in resets
    assert not any(event in resets_of(oscillator_model()) for event in oscillator(2).events)
    model = replace(
        ball_model(),
        monitors=(Monitor("top", "w", action="reset", reset={"w": "-w"}), Monitor("half", "h - 0.5")),
        schedules=(Schedule("kick", times=(1,), reset={"w": "1"}),),
    )
    assert resets_of(model).names == {"top", "kick"}
