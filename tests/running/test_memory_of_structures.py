"""What is kept of models that were run: bounded, however many structures a program goes through."""

from __future__ import annotations

import gc
import weakref

import pytest

import hybridsim as hs
from hybridsim.engine.system import modules, system_cache
from hybridsim.engine.system.system_cache import system_of


def model(k: int) -> hs.Model:
    """A structure of its own: the number is in the rate."""
    return hs.Model(f"m{k}", states=[hs.State("x", 1, der=f"-{k + 1}.5*x")])


def test_the_code_of_those_that_were_asked_for_last_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is in use stays; what was asked for long ago goes, with its machine code."""
    monkeypatch.setattr(modules, "_STRUCTURES", 3)
    monkeypatch.setattr(system_cache, "_MAX_SYSTEMS", 2)
    first, used = model(0), model(1)
    gone = weakref.ref(system_of(first).code.module)
    code = system_of(used).code
    names = {used.once("module", lambda: "")}
    for k in range(2, 10):
        modules.compiled(model(k))
        modules.compiled(used)
        system_of(model(k))
    gc.collect()
    assert len(modules._loaded) <= modules._STRUCTURES
    assert names <= set(modules._loaded) and modules.compiled(used) is code
    assert gone() is None
    assert hs.simulate(first, (0, 1)).success
