"""The impact law against impulses worked out by hand, in fractions where several contacts take part, and its energy."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from reference.random_impact_problems import random_impact_problem

from hybridsim.engine.events.jumps.impulse import ImpactProblem, answers, count, energy


def frictionless(effects, before, restitution):
    k = len(before)
    nothing = np.zeros((0, k))
    return ImpactProblem(
        np.array(effects, dtype=float),
        np.array(before, float),
        np.array(restitution, float),
        nothing,
        nothing,
    )


def rubbing(effects, before, restitution, mu):
    """One normal contact and one tangential one, friction mu both ways."""
    limit = np.array([[float(mu)]])
    return ImpactProblem(
        np.array(effects, dtype=float), np.array(before, float), np.array([restitution]), limit, limit
    )


def only(problem):
    (answer,) = answers(problem)
    return answer


def test_a_single_contact_rebounds_by_newtons_law():
    answer = only(frictionless([[0.5]], [-3.0], [0.7]))  # m = 2
    assert answer.impulses == pytest.approx([2 * 1.7 * 3.0], rel=1e-15)
    assert answer.after == pytest.approx([2.1], rel=1e-15)
    assert not answer.zero.any()


def test_without_rebound_the_rate_is_zero_by_the_law():
    answer = only(frictionless([[1.0]], [-3.0], [0.0]))
    assert answer.after[0] == 0.0 and answer.zero[0]


def test_newtons_cradle_of_three_is_not_what_the_law_says():
    # equal masses, e = 1, the first hits two that touch: by fractions P = G^-1 (2, 0) with G = (2, -1; -1, 2)
    answer = only(frictionless([[2, -1], [-1, 2]], [-1, 0], [1, 1]))
    third = Fraction(1, 3)
    assert answer.impulses == pytest.approx([float(4 * third), float(2 * third)], rel=1e-15)
    velocities = [1 - answer.impulses[0], answer.impulses[0] - answer.impulses[1], answer.impulses[1]]
    assert velocities == pytest.approx([-float(third), float(2 * third), float(2 * third)], rel=1e-14)
    assert list(answer.zero) == [False, True]


def test_a_contact_that_is_thrown_open_takes_no_impulse():
    # a beam on two feet, hit at one: the other lifts off as its effect is positive (Housner's block, slender)
    answer = only(frictionless([[1.0, 0.5], [0.5, 1.0]], [-1.0, 0.0], [0.0, 0.0]))
    assert answer.impulses[1] == 0.0
    assert answer.after == pytest.approx([0.0, 0.5], rel=1e-15)


def test_friction_stops_a_slip_or_slows_it_down():
    # a block of unit mass thrown on a rough floor: u loses mu (1 + e) w, and no more than itself
    slips = only(rubbing([[1, 0], [0, -1]], [-2.0, 3.0], 0.5, 0.3))
    assert slips.after == pytest.approx([1.0, 3.0 - 0.3 * 1.5 * 2.0], rel=1e-15)
    backward = only(rubbing([[1, 0], [0, -1]], [-2.0, -3.0], 0.5, 0.3))
    assert backward.after[1] == pytest.approx(-3.0 + 0.3 * 1.5 * 2.0, rel=1e-15)
    stops = only(rubbing([[1, 0], [0, -1]], [-2.0, 0.5], 0.5, 0.3))
    assert stops.after[1] == 0.0 and stops.zero[1]
    assert stops.impulses[1] == pytest.approx(0.5, rel=1e-15)


def test_the_order_of_the_contacts_does_not_matter():
    rng = np.random.default_rng(5)
    for _ in range(50):
        problem = random_impact_problem(rng, normal=3, tangential=2)
        first = answers(problem)
        order = rng.permutation(3)
        rows = np.array([*order, 3, 4])
        turned = ImpactProblem(
            problem.effects[np.ix_(rows, rows)],
            problem.before[rows],
            problem.restitution[order],
            problem.up[:, order],
            problem.down[:, order],
        )
        second = answers(turned)
        assert len(first) == len(second)
        if len(first) == 1:
            size = np.abs(problem.before).max()
            assert np.abs(second[0].after - first[0].after[rows]).max() <= 1e-9 * size


@pytest.mark.parametrize("common", [True, False])
def test_without_friction_there_is_one_answer_and_it_solves_the_complementarity_problem(common):
    rng = np.random.default_rng(1)
    for _ in range(300):
        problem = random_impact_problem(rng, normal=int(rng.integers(1, 5)), tangential=0, common=common)
        answer = only(problem)
        gap = answer.after - problem.restitution * np.maximum(-problem.before, 0.0)
        assert (answer.impulses >= 0).all() and (gap >= -1e-12).all()
        assert np.abs(answer.impulses * gap).max() <= 1e-11 * max(1.0, np.abs(answer.impulses).max())
        assert not answer.reduced
        lost = (1 - problem.restitution) / 2 * answer.impulses @ np.abs(problem.before)
        assert energy(problem, answer.impulses)[0] == pytest.approx(-lost, rel=1e-9, abs=1e-13)


def test_energy_does_not_grow_in_any_of_many_random_impacts():
    rng = np.random.default_rng(2)
    reduced = several = 0
    for _ in range(6_000):
        problem = random_impact_problem(
            rng, normal=int(rng.integers(1, 4)), tangential=int(rng.integers(0, 3))
        )
        found = answers(problem)
        several += len(found) != 1  # such a run stops and says so
        for answer in found[: len(found) == 1]:
            before, work = (
                problem.before,
                answer.impulses * np.where(np.arange(len(problem.before)) < problem.normal, 1.0, -1.0),
            )
            gained = work @ (before + answer.after) / 2  # the rates after it as the answer has them
            assert gained <= 1e-11 * np.abs(work) @ np.abs(before), (problem, answer)
            reduced += answer.reduced
    assert reduced > 0, "no case in which Newton's law would have gained energy: the rule was not tried"
    assert several < 60


def test_a_blow_in_which_newtons_law_would_gain_energy_rebounds_less():
    # Kane's paradox: a rod that slips fast hits a rough floor under an angle; effects of a rod of unit mass, inertia j,
    # at (a, -b) off its middle: gap and slip are coupled by -a b/j
    j, a, b, mu = 1 / 12, 0.35, 0.35, 0.6
    effects = np.array([[1 + a * a / j, -(a * b / j)], [a * b / j, -(1 + b * b / j)]])
    gaining = None
    for slip in np.linspace(0.05, 3.0, 60):
        for side in (-1.0, 1.0):
            problem = rubbing(effects * [[1, side], [side, 1]], [-1.0, slip], 0.9, mu)
            for answer in answers(problem):
                gaining = answer if answer.reduced else gaining
                if answer.reduced:
                    work, bound = energy(problem, answer.impulses)
                    assert -1e-9 <= work <= bound
                    assert 0.0 <= answer.after[0] < 0.9
    assert gaining is not None


def test_combinations_are_counted():
    assert count(rubbing([[1, 0], [0, -1]], [-2.0, 0.5], 0.5, 0.3)) == 6
