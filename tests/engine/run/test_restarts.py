"""Restarts on and near guards against exact arithmetic, the study of restarts in small, and the rule inside bounds."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from reference.random_restarts import Searches, Verdicts, friction_restarts, held, searched, smooth_restarts
from reference.releases import MODEL

import hybridsim as hs


@pytest.mark.parametrize("restarts", [smooth_restarts, friction_restarts])
def test_verdicts_are_true_or_inside_the_bound(restarts) -> None:
    """The bounds bound, what is beyond them is judged rightly, what is inside follows the rule."""
    tally = Verdicts()
    for restart in islice(restarts(1500, 3), 1500):
        held(tally, restart)
    assert tally.faults == []
    assert sum(n for (_, what), n in tally.counts.items() if what == "clear") > 1000
    assert sum(n for (_, what), n in tally.counts.items() if what == "by a higher derivative") > 50


def test_the_search_after_a_restart_finds_what_sturm_counts() -> None:
    rng, tally = np.random.default_rng(5), Searches()
    for _ in range(3000):
        searched(tally, rng)
    assert tally.faults == []
    assert sum(n for (_, what), n in tally.counts.items() if what == "leaves") > 1500


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5"])
def test_a_start_that_rounding_alone_would_decide_keeps_its_mode_and_says_so(integrator: str) -> None:
    """A dead load within an ulp of the limit: k x is rounded, nothing moves, no derivative tells."""
    model = MODEL.with_(F0=0.0, k=0.7, mu_s=0.3, mu_k=0.3, N=0.9)
    border = 0.3 * 0.9 / 0.7
    for x in (border, np.nextafter(border, 0), np.nextafter(border, 1)):
        sol = hs.simulate(model, (0, 1), x0={"x": x, "v": 0.0}, z0={"f": "stick"}, integrator=integrator)
        assert sol.warnings == ("undecided at rounding: f keeps mode stick",)
        assert [interval.mode for interval in sol.modes["f"]] == ["stick"]
    clear = hs.simulate(
        model, (0, 1), x0={"x": border * (1 + 1e-13), "v": 0.0}, z0={"f": "stick"}, integrator=integrator
    )
    assert not clear.warnings
    assert clear.modes["f"][-1].mode == "slip-"
