"""The study of He et al. 2026: its measures against closed forms, its verdicts on data that are made up, the whole."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import threading

import numpy as np
import pytest

from hybridsim.files import plain
from hybridsim.reference.closed_forms.den_hartog import no_stops
from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator
from hybridsim.studies.he2026.measured import deviation, settings, step_study
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import LITERAL, SIGNS, ZEROED, Point
from hybridsim.studies.he2026.measured.steady import by_steps, exact
from hybridsim.studies.he2026.measured.verdicts import Verdict

STICKING = Point(0.6, 0.75)
SLIPPING = Point(1.0, 0.8)


def test_exact_amplitude_without_stops_is_the_closed_form() -> None:
    unit = SLIPPING.force / settings.STIFFNESS
    found, closed = exact(SLIPPING), no_stops(SLIPPING.r, settings.DAMPING_RATIO, SLIPPING.friction)
    assert closed.holds
    assert found.stops == 0
    assert found.stick == 0.0
    assert found.amplitude == pytest.approx(unit * closed.amplitude, rel=1e-12)


def test_exact_steady_state_with_stops_against_an_independent_run() -> None:
    """The same motion in closed form, event by event, sharing no code with the engine."""
    point, periods = STICKING, 200
    system = ForcedCoulombOscillator(
        settings.MASS,
        settings.DAMPING,
        settings.STIFFNESS,
        settings.MU * point.normal,
        settings.MU * point.normal,
        point.force,
        point.omega,
    )
    motion = system.motion(0.0, 0.0, (0.0, periods * point.period))
    changes = [c for c in motion.changes if c.t >= (periods - 1) * point.period]
    sticks = [b.t - a.t for a, b in itertools.pairwise(changes) if a.target == "stick"]
    t = np.linspace((periods - 1) * point.period, periods * point.period, 20_001)
    x = motion(t)[0]
    found = exact(point)
    assert found.stops == 2
    # a stop is flat: sampled well
    assert found.amplitude == pytest.approx(0.5 * (x.max() - x.min()), rel=1e-7)
    assert found.energy == pytest.approx(np.trapezoid(x**2, t), rel=1e-7)
    assert found.stick == pytest.approx(2.0 * sticks[0] / point.period, rel=1e-9)
    assert found.residual < 1e-10


def test_nothing_moves_below_the_threshold() -> None:
    found = exact(Point(0.7, 0.49))
    assert (found.amplitude, found.energy, found.stick, found.stops) == (0.0, 0.0, pytest.approx(1.0), 0)


@pytest.mark.parametrize("variant", [SIGNS[1], LITERAL, ZEROED], ids=str)
def test_periods_of_a_fixed_step_run(variant: settings.Variant) -> None:
    """Without stops every method gives the closed form, in each period; the step leaves 1e-4 at the reversals."""
    truth = exact(SLIPPING)
    found = by_steps(SLIPPING, variant, 150, 5)
    assert found.A.shape == found.E.shape == (5,)
    np.testing.assert_allclose(found.A, truth.amplitude, rtol=1e-4)
    np.testing.assert_allclose(found.E, truth.energy, rtol=1e-3)


def test_all_readings_are_told_apart() -> None:
    assert len({v.name for v in settings.DICHOTOMIES}) == 16
    assert {v.name for v in settings.MATTERING} <= {v.name for v in settings.DICHOTOMIES}
    assert dict(LITERAL.options)["stick_velocity"] == "kept"
    assert dict(ZEROED.options) == {**dict(LITERAL.options), "stick_velocity": "zero"}


class TestPool:
    def test_order_and_progress(self) -> None:
        seen: list[tuple[float, str]] = []
        pool = Pool({"a": 1.0, "b": 3.0}, lambda fraction, part: seen.append((fraction, part)), workers=3)
        pool.part("a")
        assert pool.map(lambda k: k * k, range(20)) == [k * k for k in range(20)]
        pool.part("b")
        pool.map(lambda k: k, range(5), 0.5, 1.0)
        fractions = [fraction for fraction, _ in seen]
        assert fractions == sorted(fractions)
        assert fractions[0] == 0.0
        assert fractions[-1] == pytest.approx(1.0)
        assert {part for _, part in seen} == {"a", "b"}

    def test_an_exception_ends_the_work(self) -> None:
        pool, done = Pool({"a": 1.0}, workers=1), []
        pool.part("a")

        def work(k: int) -> None:
            if k == 1:
                raise ValueError("no")
            done.append(threading.get_ident())

        with pytest.raises(ValueError, match="no"):
            pool.map(work, range(1000))
        assert len(done) < 1000


def a_ridge(height: float, ratios: np.ndarray, r: np.ndarray) -> np.ndarray:
    """A ridge along the published line that falls from `height` at F0/N = 0.54, as a factor on A."""
    line = 0.55 + (ratios - 0.54) * (0.94 - 0.55) / 0.09
    fall = height * np.exp(-(ratios - 0.54) / 0.05)
    return np.asarray(1.0 + fall[:, None] * np.exp(-(((r[None, :] - line[:, None]) / 0.05) ** 2)))


def made_up_maps(height: float) -> deviation.Maps:
    ratios, r = np.array(settings.FULL.ratios), np.array(settings.FULL.r)
    flat = np.ones((len(ratios), len(r)))
    tables = {v.name: {"A": flat, "E": flat} for v in (*settings.MATTERING,)}
    tables |= {v.name: {"A": (bumpy := a_ridge(height, ratios, r)), "E": bumpy**2} for v in SIGNS}
    tables["exact"] = {"A": flat, "E": flat}
    return deviation.Maps(ratios, r, tables, tables, tables, np.zeros_like(flat))


def made_up_steps(order: float) -> step_study.StepStudy:
    """Deviations that fall with the step to the given order."""
    h0 = np.array(step_study.STEPS, dtype=float)
    row = np.tile(0.1 * (1200.0 / h0) ** order, (len(step_study.LOADS_AND_RATIOS), 1))
    eps = np.tile(np.full(len(step_study.EPS), 0.1), (len(step_study.LOADS_AND_RATIOS), 1))
    return step_study.StepStudy(
        (),
        {v.name: {"A": row, "E": row} for v in SIGNS},
        {v.name: {"A": eps, "E": eps} for v in settings.MATTERING},
        {v.name: row for v in SIGNS},
    )


class TestVerdictOnARidge:
    def test_readings(self) -> None:
        reading = deviation.read(made_up_maps(0.2), "A", SIGNS[0].name, ZEROED.name)
        assert reading["maximum"] == pytest.approx(0.2, rel=0.05)
        assert reading["at"] == (0.54, 0.56) or reading["at"] == (0.54, 0.54)
        # 0.2 exp(-(F - 0.54)/0.05) = 0.1 at F = 0.575, 0.05 at 0.609; on a grid of 0.01
        assert reading["above 10 %"]["F0/N"] == pytest.approx(0.57)
        assert reading["above 5 %"]["F0/N"] in (0.59, 0.60)
        assert reading["near the threshold"] < 0.01

    def test_what_shrinks_with_the_step_is_an_artefact(self) -> None:
        claim = deviation.claim(made_up_maps(0.2), "A", made_up_steps(1.0))
        assert claim.verdict is Verdict.ARTEFACT
        assert claim.step_study["h0"] == list(step_study.STEPS)

    def test_what_stays_is_judged_by_its_shape(self) -> None:
        steps = made_up_steps(0.0)
        assert deviation.claim(made_up_maps(0.2), "A", steps).verdict in (Verdict.REPRODUCED, Verdict.SHAPE)
        assert deviation.claim(made_up_maps(0.001), "A", steps).verdict is Verdict.NOT

    def test_a_claim_is_plain_data(self) -> None:
        claim = deviation.claim(made_up_maps(0.2), "A", made_up_steps(1.0))
        text = json.dumps(plain(claim.to_plain(), 6), allow_nan=False)
        read = json.loads(text)
        assert read["verdict"] == "an artefact of discretization"
        assert set(read["ours"]) == {
            deviation.pair_name(p) for p in deviation.combinations() if p[1] != "exact"
        }
        assert read["closest"] in read["ours"]


def test_plain() -> None:
    given = {"a": np.array([1.0, math.nan]), 2: np.float64(1.23456789), "c": (True, None, "x", math.inf)}
    assert plain(given, digits=6) == {"a": [1.0, None], "2": 1.23457, "c": [True, None, "x", None]}


def test_full_is_finer_than_quick() -> None:
    full, quick = settings.FULL, settings.QUICK
    assert set(quick.ratios) < set(full.ratios)
    assert len(full.r) > len(quick.r)
    assert settings.EPS_V in full.eps
    assert settings.EPS_V in quick.eps
    assert full.eps == tuple(sorted(full.eps, reverse=True))
    assert settings.STEPS_PER_PERIOD in full.steps
    assert settings.STEPS_PER_PERIOD in quick.steps
    assert full.repeats == quick.repeats == 5  # the paper's mean of five
    assert dataclasses.asdict(full).keys() == dataclasses.asdict(quick).keys()
