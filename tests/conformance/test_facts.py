"""The scenes' own truth: files are models, facts and recomputation agree, every case is a scene or left out."""

from __future__ import annotations

import pytest

import hybridsim as hs
from conformance import recompute
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.facts import CASES, TRUTHS
from hybridsim.testing.measuring import SCENES as FOLDER
from hybridsim.testing.measuring import load

DIGITS = 2e-11  # the facts are printed with twelve or thirteen digits


def test_every_case_is_a_scene() -> None:
    named = {scene.name for scene in SCENES}
    covered = {case for case in CASES if case in named or any(name.startswith(f"{case}-") for name in named)}
    assert covered == set(CASES)


def test_names_are_unique() -> None:
    assert len({scene.name for scene in SCENES}) == len(SCENES)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_scene_files_are_models_that_are_used(path: object) -> None:
    hs.load(str(path))
    assert any(str(path).endswith(f"/{scene.file}.toml") for scene in SCENES)


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_truths_name_what_the_model_has(scene: object) -> None:
    model = load(scene)
    width = len(model.states)
    assert all(len(values) == width for _, values in scene.truth.states)
    names = {f"{c.name}:{mode.name}" for c in model.all_components() for mode in c.modes}
    names |= {monitor.name for monitor in model.monitors} | {schedule.name for schedule in model.schedules}
    assert {label for _, label in scene.truth.events or ()} <= names


@pytest.mark.parametrize("name", sorted(set(TRUTHS) & set(CASES)))
def test_recomputed_truths_agree_with_the_facts(name: str) -> None:
    truth, fact = TRUTHS[name], CASES[name]["expected"]
    states = {row[0]: row[1:] for row in truth["states"]}
    for t, values in fact.get("samples", {}).items():
        assert states[float(t)] == pytest.approx(values, abs=DIGITS)
    for row, event in zip(truth["events"], fact.get("events", ()), strict=False):
        assert row[0] == pytest.approx(event[0], abs=DIGITS)
    if "n_events" in fact:
        assert len(truth["events"]) == fact["n_events"]
    if name == "NOS-blocks0":
        assert [row[0] for row in truth["events"]] == pytest.approx(fact["events_t"], abs=DIGITS)
        assert states[1.0] == pytest.approx(fact["q_at_1"] + fact["v_at_1"], abs=DIGITS)
        assert states[12.0][:3] == pytest.approx(fact["q_final"], abs=DIGITS)
    if name == "MSL-elastogap":
        for t, s in fact["s"].items():
            # found with a step by its source
            assert states[float(t)] == pytest.approx((s, fact["v"][t]), abs=1e-10)
    if name == "SIC-relayosc":
        times = [row[0] for row in truth["events"]]
        assert times[:4] == pytest.approx(fact["switch_times_first"], abs=DIGITS)
        assert times[-1] - times[-2] == pytest.approx(fact["limit_half_period"], abs=1e-12)
    if name == "FMI-vdp":
        assert states[20.0] == pytest.approx(fact["x_end"], abs=1e-8)


def test_tanh_agrees_with_the_facts() -> None:
    states = {row[0]: row[1:] for row in TRUTHS["TANH-1e-3"]["states"]}
    fact = CASES["TANH"]["expected"]["eps_1e_3"]
    assert states[5.0] == pytest.approx(fact["5"], abs=3e-8)
    assert (states[16.0][0], states[20.0][0]) == pytest.approx((fact["16"], fact["20"]), abs=1e-10)


def test_a_truth_is_what_its_recomputation_gives() -> None:
    fresh = recompute.truth(recompute.relay(), "plus", (0, 0.6752372371178297, 0), (0, 10), (1, 10))
    assert fresh["events"] == TRUTHS["SIC-relayosc"]["events"][: len(fresh["events"])]
    assert fresh["states"] == TRUTHS["SIC-relayosc"]["states"][:2]
