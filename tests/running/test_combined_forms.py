"""Random models that combine forms, against a judge of their own; `docs/studies/combined_forms.py` runs thousands."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import pytest
from reference.combined import compare
from reference.combined.compare import judged
from reference.combined.forms import TIME, Abstract, Contact, Impact, Node, abs_, node, sin, var
from reference.combined.parts import PARTS, alone
from reference.combined.roots import first_negative
from reference.combined.shrink import shrunk
from reference.combined.trial import QUIET, features, single_runs, trials
from reference.combined.values import Digits

import hybridsim as hs

STRUCTURES = (101506, 100424, 17, 6, 7, 101032, 23, 101567, 11, 22, 100830, 101294, 3, 5, 26)
ALONE = ("thermostat", "twins", "two_discs")  # parts that are in none of these


def test_the_sample_has_every_part_and_form() -> None:
    """Those of the sample are all that the first 400 structures of the study have."""
    every = set().union(*map(features, range(400)))
    sample = [features(seed) for seed in STRUCTURES] + [alone(part, 1).m.features for part in ALONE]
    assert {f"part: {part.__name__}" for _, part in PARTS} <= every
    assert set().union(*sample) >= every


@pytest.fixture(autouse=True)
def _limits_that_no_load_of_the_machine_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compare, "LIMITS", {"steps": 100_000, "events": 5000})


@pytest.mark.parametrize("seed", STRUCTURES)
def test_a_structure_moves_as_the_judge_says(seed: int) -> None:
    found = list(trials(seed, 2))
    assert Counter(record["kind"] for record in found)["agrees"] >= 2
    assert [record for record in found if record["kind"] not in QUIET] == []


@pytest.mark.parametrize("part", ALONE)
def test_a_part_alone_moves_as_the_judge_says(part: str) -> None:
    found = list(single_runs(alone(part, 1).m, 1, 2))
    assert Counter(record["kind"] for record in found)["agrees"] >= 2
    assert [record for record in found if record["kind"] not in QUIET] == []


@pytest.mark.parametrize("method", ["exact", "taylor", "dop853"])
def test_a_corner_over_a_contacts_own_speed_stays_in_its_load(method: str) -> None:
    """v' = 0.48 min(-v, 0.85) - 2 from v = -0.2: the load grows with the speed until that is 0.85."""
    law = {"law": "coulomb", "arguments": {"mu": 0.48}}
    contact = hs.Contact("f", velocity="v", normal="min(abs(v), 0.85)", **law)
    model = hs.Model("own-speed", states=[hs.State("v", -0.2, "-f - 2")], contacts=[contact])
    reached = math.log((2 / 0.48 - 0.2) / (2 / 0.48 - 0.85)) / 0.48
    speed = 0.85 + (2 - 0.48 * 0.85) * (0.6 - reached)
    assert hs.simulate(model, (0.0, 1.0), integrator=method)(0.6)[0] == pytest.approx(-speed, rel=1e-9)


# -- the judge -----------------------------------------------------------------------------------------------------


def value(motion, time: float, model: Abstract) -> dict[str, float]:  # type: ignore[no-untyped-def]  # any motion
    return motion.at(time, list(model.states))


def test_the_judge_knows_a_ball_that_bounces_to_rest() -> None:
    model = Abstract(duration=3.0)
    model.states = {"h": (node(1), var("w")), "w": (node(0), var("p") - node("9.81"))}
    model.impacts = {"p": Impact(var("h"), node("0.5"))}
    motion, _, certain = judged(model, {})
    first = math.sqrt(2 / 9.81)
    assert motion.status == "finished" and certain == 3
    assert motion.jumps[0] == pytest.approx(first, abs=1e-12)
    assert motion.jumps[2] == pytest.approx(
        2 * first, abs=1e-12
    )  # each instant is noted by its blow and by the step
    assert value(motion, 2.5, model)["h"] == pytest.approx(0, abs=1e-9)
    assert max(t for t, who, _ in motion.events if who == "p") == pytest.approx(3 * first, abs=1e-5)


def test_the_judge_knows_a_block_that_stops_and_is_pulled_loose() -> None:
    model = Abstract(duration=3.0)
    model.states = {"v": (node(1), TIME - var("f"))}
    model.contacts = {"f": Contact(var("v"), node(4), node("0.5"))}
    motion, _, _ = judged(model, {})
    stop = 2 - math.sqrt(2)  # 1 - 2 t + t^2/2 = 0
    assert [(round(t, 9), what) for t, who, what in motion.events] == [
        (round(stop, 9), "stick"),
        (2.0, "slip+"),
    ]
    assert value(motion, 3.0, model)["v"] == pytest.approx(0.5, abs=1e-12)


def test_the_judge_keeps_energy_and_angular_momentum_inside_a_circle() -> None:
    model = Abstract(duration=20.0)
    x, y, p = var("x"), var("y"), var("p")
    r = Node("sqrt", (x * x + y * y,))
    model.states = {
        "x": (node("0.3"), var("u")),
        "y": (node(0), var("w")),
        "u": (node("0.4"), -(p * x) / r),
        "w": (node("0.9"), -(p * y) / r),
    }
    model.impacts = {"p": Impact(1 - r, node(1))}
    motion, _, _ = judged(model, {})
    end = value(motion, 20.0, model)
    assert end["x"] * end["w"] - end["y"] * end["u"] == pytest.approx(0.27, abs=1e-9)
    assert end["u"] ** 2 + end["w"] ** 2 == pytest.approx(0.97, abs=1e-9)
    assert [end[k] for k in "xyuw"] == pytest.approx(
        [0.08174826, 0.64156937, -0.30136915, 0.93764419], abs=1e-7
    )


def test_the_judge_names_two_motions_where_there_are_two() -> None:
    model = Abstract()
    f, p = var("f"), var("p")
    model.states = {
        "h": (node(0), var("w")),
        "w": (node(0), 1 + p + 2 * f),
        "u": (node(-1), -(5 * f) - 2 * p),
    }
    model.impacts = {"p": Impact(var("h"), node(0))}
    model.contacts = {"f": Contact(var("u"), p, node(1))}
    assert judged(model, {})[0].status == "nonunique"


def test_the_judge_is_the_same_in_doubles_and_in_forty_digits() -> None:
    model = Abstract(duration=4.0)
    model.states = {
        "q": (node("0.3"), var("v")),
        "v": (node(0), 2 * sin(3 * TIME) - 4 * abs_(var("q")) - var("f")),
    }
    model.contacts = {"f": Contact(var("v"), node(1), node("0.4"), node("0.2"))}
    one, two = judged(model, {})[0], judged(model, {}, Digits())[0]
    assert [(who, what) for _, who, what in one.events] == [(who, what) for _, who, what in two.events]
    assert value(one, 3.9, model)["q"] == pytest.approx(value(two, 3.9, model)["q"], abs=1e-11)


def test_what_the_disagreement_does_not_need_is_taken_away() -> None:
    model = alone("walls", 1).m
    small = shrunk(model, lambda m: len(m.impacts) > 0 and m.duration > 0)
    assert len(small.impacts) == 1 and not small.states and not small.contacts


@pytest.mark.parametrize("dip", [0.25, 0.3])
def test_the_judge_sees_a_touch_wherever_its_samples_are(dip: float) -> None:
    """(s - dip)^2 on an interval of 1, with one of the 48 samples at a quarter of it exactly, and none at 0.3."""
    row = [Fraction(dip) ** 2, -2 * Fraction(dip), Fraction(1)]
    zero, touch = first_negative(row, Fraction(1), 1e-30)
    assert zero is None and touch == pytest.approx(dip, abs=1e-12)
