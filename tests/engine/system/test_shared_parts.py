"""What runs on several threads share is made twice at worst, and the one that is in use stays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import hybridsim as hs
from hybridsim.engine.system import modules
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.guard_parts import GuardParts
from hybridsim.engine.system.programs.mode_tables import TapeCache
from hybridsim.engine.system.system import System


def interrupted_once(function: Callable[..., Any], by: Callable[[], Any]) -> Callable[..., Any]:
    """The function, whose first call another thread overtakes: `by` runs whole inside of it."""
    calls: list[int] = []

    def called(*arguments: Any) -> Any:
        calls.append(1)
        if len(calls) == 1:
            by()
        return function(*arguments)

    return called


def test_code_that_a_thread_runs_is_not_let_go_by_another(monkeypatch: pytest.MonkeyPatch) -> None:
    code = modules.Compiled(System(hs.load("dfcs")).code.module, 0.0)
    overtaking: list[int] = []
    compile_function = interrupted_once(
        lambda module, name: (object(), name), lambda: overtaking.append(code.address("flow"))
    )
    monkeypatch.setattr("hybridsim.engine.native.model_functions.compile_model_function", compile_function)
    late = code.address("flow")
    assert overtaking == [late] == [code._compiled["flow"][0]]


def test_what_is_shared_is_the_same_for_all() -> None:
    system, overtaking = System(hs.load("dfcs")), []
    made_of = per_structure(
        interrupted_once(lambda system: object(), lambda: overtaking.append(made_of(system)))
    )
    assert made_of(system) is overtaking[0] is made_of(System(hs.load("dfcs")))


def test_parts_are_those_of_the_tapes_asked_for_while_others_ask() -> None:
    """Parts of another vector of modes have another number of rows: a kernel would read beyond their end."""
    system = System(hs.load("belt"))
    small, large = TapeCache(system), TapeCache(system)
    large.with_complete_set()

    class Overtaken(GuardParts):
        """Right after it has noted the parts of one shelf, another thread asks for those of the other."""

        def __setattr__(self, name: str, value: Any) -> None:
            super().__setattr__(name, value)
            if name == "_known" and value is not None and value[0] is large.tapes:
                self.of(small.tapes)

    found, expected = Overtaken(system).of(large.tapes), GuardParts(system).of(large.tapes)
    assert len(found.start) == len(expected.start) > len(GuardParts(system).of(small.tapes).start)
