"""Models of many equal parts: the work before and during a run grows in proportion to the number of parts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import hybridsim as hs
from hybridsim.engine.lowering.emit import emit
from hybridsim.engine.system.programs.growing_rows import GrowingArray, GrowingLists
from hybridsim.engine.system.programs.mode_tables import tape_cache_of
from hybridsim.engine.system.system_cache import runs_of, system_of

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples" / "parts"


def chain(folder: Path, n: int) -> hs.Model:
    """The chain of the examples with another number of blocks."""
    for name in ("block", "chain"):
        text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
        (folder / f"{name}.toml").write_text(text.replace("20", str(n)), encoding="utf-8")
    return hs.load(folder / "chain.toml")


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_an_event_needs_the_tapes_of_one_contact(tmp_path: Path, integrator: str) -> None:
    """A contact has three modes: an event adds at most the two others, however many contacts there are."""
    model = chain(tmp_path, 12)
    system_of(model).code.shared.clear()
    runs_of(model).clear()
    sol = hs.simulate(model, (0, 0.7), integrator=integrator)
    events = sum(event.t > 0 for event in sol.events)
    assert events > 2
    assert len(tape_cache_of(system_of(model)).tapes.modes) <= 1 + 2 * events


def test_a_first_run_costs_and_counts_what_a_later_one_does(tmp_path: Path) -> None:
    """It repeats segments whose events need tapes, and counts each of them once."""
    model = chain(tmp_path, 5)
    for integrator in ("dop853", "tsit5"):
        system_of(model).code.shared.clear()
        runs_of(model).clear()
        first, later = (hs.simulate(model, (0, 2), integrator=integrator) for _ in range(2))
        assert len(first.events) > 4
        for name in ("steps", "rejected", "rhs_evaluations"):
            assert first.stats[name] == later.stats[name]


def test_a_first_run_reaches_its_limit_where_a_later_one_does(tmp_path: Path) -> None:
    """Limits are examined between calls of the compiled loop, which goes on where it lacked a tape."""
    model = chain(tmp_path, 5)
    system_of(model).code.shared.clear()
    runs_of(model).clear()
    first, later = (hs.simulate(model, (0, 2), integrator="taylor", limits={"events": 1}) for _ in range(2))
    assert (first.status, first.t_end, len(first.events)) == (later.status, later.t_end, len(later.events))


def test_symbolic_work_is_in_proportion_to_the_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice as many parts: all pairs of states would be four times as many derivatives and substitutions."""
    counts: list[dict[str, int]] = []
    diff, subs = sympy.diff, sympy.Basic.subs

    def counted(name: str, function: Any) -> Any:
        def call(*arguments: Any, **options: Any) -> Any:
            counts[-1][name] += 1
            return function(*arguments, **options)

        return call

    monkeypatch.setattr(sympy, "diff", counted("diff", diff))
    monkeypatch.setattr(sympy.Basic, "subs", counted("subs", subs))
    for n in (8, 16):
        counts.append({"diff": 0, "subs": 0})
        emit(chain(tmp_path, n))
    for name in ("diff", "subs"):
        assert counts[1][name] < 2.3 * counts[0][name]


def test_fifty_blocks_move_as_the_chain_of_matrices(tmp_path: Path) -> None:
    """Another path: one set of matrices for all blocks, integrated as arrays."""
    n = 50
    mechanical = hs.chain_on_belt(n).with_(
        q0=[0.5 * math.sin(7 * i) for i in range(1, n + 1)], v0=np.zeros(n)
    )
    expected = hs.simulate(mechanical, (0, 2), rtol=1e-12, atol=1e-13)
    found = hs.simulate(chain(tmp_path, n), (0, 2), integrator="taylor")
    times, reference = (sorted(e.t for e in sol.events if e.t > 0) for sol in (found, expected))
    assert len(times) == len(reference) > 50
    assert times == pytest.approx(reference, abs=1e-10)
    assert sorted(found(2.0)) == pytest.approx(sorted(np.ravel(expected(2.0))), abs=1e-10)


def test_rows_that_are_added_are_seldom_copied() -> None:
    array, memories = GrowingArray((2,)), set()
    early = None
    for k in range(1000):
        array.put(k, [[k, -k]])
        memories.add(array.up_to(1).ctypes.data)
        early = array.up_to(k + 1) if k == 10 else early
    assert len(memories) < 12
    assert early is not None
    assert early.tolist() == [[k, -k] for k in range(11)]
    assert array.up_to(1000)[:, 0].tolist() == list(range(1000))


def test_a_list_that_was_not_completed_is_written_again() -> None:
    """An interruption may leave a list behind that no tape knows: the next one takes its place."""
    lists = GrowingLists(())
    lists.put(0, [1, 2])
    lists.put(1, [3, 4, 5])
    lists.put(1, [6])
    lists.put(2, [])
    lists.put(3, [7, 8])
    starts, rows = lists.up_to(4)
    assert starts.tolist() == [0, 2, 3, 3, 5]
    assert rows.tolist() == [1, 2, 6, 7, 8]
