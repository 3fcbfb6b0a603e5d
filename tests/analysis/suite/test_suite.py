"""The comparison suite: its scenes are what they claim, its references agree, its verdicts and files are right."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.compare.errors_against_reference import Errors
from hybridsim.analysis.compare.mode_sequence import SequenceVerdict
from hybridsim.analysis.compare.rows import NOT_STARTED, Cost, Row
from hybridsim.analysis.suite.scenes import SCENES
from hybridsim.analysis.suite.verdict import Verdict, verdict
from hybridsim.engine.system.period import forcing_period
from hybridsim.errors import UsageError
from hybridsim.integrators.contract import CAPABILITIES
from hybridsim.reference.closed_forms.coulomb_model import recognise

SCENE = {scene.name: scene for scene in SCENES}
CHEAP = ("P1", "grazing", "static-kinetic", "bouncing-ball")


@cache
def suite() -> hs.SuiteComparison:
    return hs.compare_suite(
        scenes=CHEAP,
        integrators=["dop853", ("scipy-dop853", {"events": "native"}), "rk4-sign"],
        rtols=[1e-4, 1e-8, 1e-12],
        steps=[1200],
        repeat=1,
        budget=2000.0,  # never reached, also on a busy machine
    )


def result_of(name: str):
    return next(result for result in suite().results if result.scene.name == name)


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_a_scene_is_declared_in_full(scene) -> None:
    model = hs.load(scene.model).with_(**scene.params).validate()
    assert (scene.periods is None) == (forcing_period(model) is None)
    assert (scene.t_end is None) == (scene.periods is not None)
    assert set(scene.needs) <= CAPABILITIES.keys()
    assert scene.title and scene.why


def test_the_near_grazing_scene_grazes_as_it_says() -> None:
    """Follow each slip of the closed form beyond its end: its velocity would dip by what the declaration says."""
    scene = SCENE["grazing"]
    model = hs.load(scene.model).with_(**scene.params)
    period = forcing_period(model)
    motion = recognise(model).system.motion(0.0, 0.0, (0.0, scene.periods * period))
    largest = np.abs(motion(np.linspace(0, scene.periods * period, 4001))[1]).max()
    dips = []
    # Left out: the first swing, and the second halves of those that a short stop cuts in two.
    for segment, before in zip(motion.segments[1:], motion.segments):
        cut_in_two = bool(dips) and segment.start - before.start < 0.05 * period
        if segment.slip is None or segment.start < 0.4 * period or cut_in_two:
            continue
        s = np.linspace(0.15 * period, 0.26 * period, 200_001)
        dips.append(float((segment.slip.direction * segment.slip.derivative(1, s)).min() / largest))
    assert dips[:3] == pytest.approx([-5.2e-4, -1.0e-4, -1.2e-5], rel=0.05)
    assert all(7e-6 < dip < 1e-5 for dip in dips[3:]) and len(dips) == 6


@pytest.mark.parametrize(
    "name, state, time",
    [
        ("P1", 1e-12, 1e-13),
        ("grazing", 1e-12, 1e-11),
        ("static-kinetic", 1e-11, 1e-12),
        ("bouncing-ball", 1e-12, 1e-12),
    ],
)
def test_two_references_of_different_kind_agree(name: str, state: float, time: float) -> None:
    """A closed form or 32 digits, and the most accurate integrator."""
    found = result_of(name).comparison
    assert not found.warnings
    assert found.second_reference == "run with dop853 at rtol 1e-13"
    assert found.difference.sequence.right
    assert found.difference.state < state
    assert found.scaled(found.difference, "event_time") < time


def test_who_is_right() -> None:
    verdicts = suite().verdicts()
    assert list(verdicts) == list(CHEAP)
    assert {name: found["dop853"] for name, found in verdicts.items()} == dict.fromkeys(CHEAP, Verdict.RIGHT)
    assert verdicts["P1"]["rk4-sign"] is Verdict.WRONG
    assert verdicts["grazing"]["rk4-sign"] is Verdict.LACKS
    assert verdicts["bouncing-ball"]["scipy-dop853 (events=native)"] is Verdict.RIGHT


def row(
    error: float, sequence: SequenceVerdict | None, rtol: float = 1e-8, integrator: str = "dop853"
) -> Row:
    errors = Errors(error, None, None, sequence)
    cost = Cost((1.0,), 1, 1, 1)
    return Row(integrator, "line", ("rtol", rtol), {"rtol": rtol}, "finished", errors=errors, cost=cost)


def test_verdicts() -> None:
    right, wrong = SequenceVerdict(), SequenceVerdict(missed=1)
    scene, grazing = SCENE["P1"], SCENE["grazing"]
    assert verdict(scene, [row(0.05, right)]) is Verdict.RIGHT
    assert verdict(scene, [row(0.2, right)]) is Verdict.OFF
    assert verdict(scene, [row(0.2, wrong)]) is Verdict.WRONG
    assert verdict(grazing, [row(0.2, wrong)]) is Verdict.WRONG
    assert verdict(grazing, [row(0.2, wrong, integrator="rk4-sign")]) is Verdict.LACKS
    assert (
        verdict(scene, [row(0.2, wrong, 1e-4), row(1e-9, right, 1e-9), row(1.0, wrong, 1e-12)])
        is Verdict.RIGHT
    )
    for status, expected in (
        ("refused", Verdict.REFUSED),
        ("step-failure", Verdict.FAILED),
        (NOT_STARTED, Verdict.TOO_SLOW),
    ):
        lost = replace(row(1.0, right), errors=None, cost=None, status=status)
        assert verdict(scene, [lost]) is expected


def test_the_cheapest_is_right_and_accurate_enough() -> None:
    for name, found in suite().cheapest((1e-3, 1e-11)).items():
        for accuracy, cheapest in found.items():
            rows = result_of(name).comparison.rows
            good = [
                row
                for row in rows
                if row.errors and row.errors.state <= accuracy and row.errors.sequence.right
            ]
            assert cheapest.cost.wall_time == min(row.cost.wall_time for row in good)
    assert suite().cheapest((1e-30,))["P1"] == {1e-30: None}


def test_graphs_are_compared_where_states_jump() -> None:
    graphs = {
        result.scene.name: [row.errors.graph for row in result.comparison.rows] for result in suite().results
    }
    assert all(value < 1e-6 for value in graphs.pop("bouncing-ball"))
    assert all(value is None for values in graphs.values() for value in values)


def test_table_and_files(tmp_path) -> None:
    table = suite().table()
    for part in ("Correct runs", "Cheapest", "References", "compared with", "wrong modes", "1e-11"):
        assert part in table
    suite().to_csv(tmp_path / "table.csv")
    with open(tmp_path / "table.csv", encoding="utf-8") as file:
        records = list(csv.DictReader(file))
    assert len(records) == sum(len(result.comparison.rows) for result in suite().results) == 4 * 7
    assert {record["scene"] for record in records} == set(CHEAP)
    suite().to_json(tmp_path / "suite.json")
    content = json.loads((tmp_path / "suite.json").read_text(encoding="utf-8"))
    assert content["verdicts"]["P1"]["rk4-sign"] == "wrong modes"
    assert content["cheapest"]["P1"]["1e-11"]["label"] == suite().cheapest((1e-11,))["P1"][1e-11].label
    assert content["scenes"]["bouncing-ball"]["rows"][0]["graph_error"] is not None
    assert {"numpy", "scipy", "cpus"} <= content["provenance"].keys()


def test_what_was_left_out_is_said() -> None:
    whole = result_of("P1")
    rows = tuple(
        replace(row, errors=None, cost=None, status=NOT_STARTED) if row.setting[1] == 1e-12 else row
        for row in whole.comparison.rows
    )
    cut = replace(
        suite(), results=(replace(whole, comparison=replace(whole.comparison, rows=rows)),), repeat=99
    )
    assert cut.notes == (
        "dop853, skipped because of its run time: P1 at rtol 1e-12",
        "scipy-dop853 (events=native), skipped because of its run time: P1 at rtol 1e-12",
        "5 of 5 runs were timed fewer than 99 times, 0 runs only while they warmed up",
    )
    assert all(note in cut.table() for note in cut.notes)


def test_a_reference_that_takes_too_long_is_replaced_and_that_is_said() -> None:
    hurried = hs.compare_suite(
        scenes=["stribeck"], integrators=["dop853"], rtols=[1e-6], repeat=1, budget=2.0
    ).results[0]
    assert "the reference is a run instead" in hurried.comparison.warnings[-1]
    assert hurried.comparison.reference == "run with scipy-dop853 at rtol 1e-13"


@pytest.mark.parametrize(
    "keywords, message",
    [
        ({"scenes": ["P3"]}, "no scene 'P3'"),
        ({"scenes": []}, "the list of scenes is empty"),
        ({"budget": 0.0}, "`budget` cannot be 0.0"),
        ({"repeat": 0}, "`repeat` cannot be 0"),
        ({"integrators": ["cvode-bfd"]}, "cvode-bfd"),
    ],
)
def test_bad_requests(keywords: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        hs.compare_suite(**keywords)
