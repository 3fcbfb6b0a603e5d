"""What `check` says of compiling: measured where it is known, and of the right size where it is estimated."""

from __future__ import annotations

import secrets
import time

import pytest

import hybridsim as hs
from hybridsim.engine.native.kernels import ENABLED
from hybridsim.engine.native.llvm import functions_in
from hybridsim.engine.run.report import describe
from hybridsim.engine.system.modules import compiled
from hybridsim.presentation.automaton import lines_of

pytestmark = pytest.mark.skipif(not ENABLED, reason="nothing is compiled")


def beads(count: int) -> hs.Model:
    """Beads on springs that are stiffer the longer they are, under names that no model had before."""
    name = f"x{secrets.token_hex(6)}_"
    states = []
    for k in range(count):
        left, right = (f"{name}{(k + shift) % count}" for shift in (-1, 1))
        force = f"sin({left} - {name}{k})**3 + exp({right})*cos({name}{k}*{left}) - f{k}/(2 + {name}{k}**2)"
        states += [hs.State(f"{name}{k}", 0.1, f"v{k}"), hs.State(f"v{k}", 1, force)]
    contacts = [hs.Contact(f"f{k}", f"v{k}", "1", "coulomb", {"mu": 0.1}) for k in range(count)]
    return hs.Model(name, states=states, contacts=contacts)


def seconds_to_compile(model: hs.Model) -> float:
    """Compile all functions of a model, and return the processor time of this thread."""
    code = compiled(model)
    names = functions_in(code.module.__loader__.get_source(code.module.__name__))
    start = time.thread_time()
    for name in names:
        code.address(name)
    return time.thread_time() - start


def test_the_estimate_is_of_the_size_of_the_measured_time() -> None:
    model = beads(4)
    before = describe(model)
    assert before.lowering_seconds > 0.0
    text = "\n".join(lines_of(model, before, (), ()))
    assert f"({before.operations} operations, generated in {before.lowering_seconds:.1g} s)" in text
    assert f"compiled at the first run, in about {before.compile_seconds:.1g} s or less" in text
    measured = min(
        seconds_to_compile(model), seconds_to_compile(beads(4))
    )  # other programs may slow down one
    assert before.compile_seconds / 5.0 < measured < 5.0 * before.compile_seconds
    after = describe(model)
    assert after.compile_seconds == 0.0
    assert "operations" in text and "compiled code of this model: cached" in "\n".join(
        lines_of(model, after, (), ())
    )
