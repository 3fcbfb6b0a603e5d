"""Models with many vectors of modes: what was run before changes no bit, and a shelf may grow as long as it likes."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.linear.matrix_template import templates_of
from hybridsim.engine.linear.tables import LinearTables, cached_tables, linear_tables
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.programs.mode_tables import TapeCache, tape_cache_of
from hybridsim.engine.system.programs.modes_index import find_modes, index_of
from hybridsim.engine.system.system import System
from hybridsim.engine.system.system_cache import runs_of, system_of

COMPILED = ("exact", "taylor", "dop853", "tsit5")


class ModeVectors(NamedTuple):
    """What `find_modes` looks at."""

    modes: np.ndarray
    hash_slots: np.ndarray


def cornered_chain() -> hs.Model:
    """Three masses on springs, each rubbing on the ground; a spring that is stiffer one way, two that saturate."""
    loads = (
        "1.7*sin(1.3*t) - 0.3*abs(x0)",
        "2.1*sin(0.8*t) + 0.2*max(v1, 0.1)",
        "1.1*sin(2.2*t) + 0.2*min(x2, 0.1)",
    )
    states = []
    for i, load in enumerate(loads):
        joints = "".join(f" - {3 + i + j}.0*(x{i} - x{j})" for j in (i - 1, i + 1) if 0 <= j < 3)
        states += [
            hs.State(f"x{i}", 0.3 - 0.4 * i, f"v{i}", nominal=1.0),
            hs.State(
                f"v{i}", 0.5 * i - 0.2, f"{load} - {4 + i}.0*x{i} - 0.1*v{i}{joints} - f{i}", nominal=1.0
            ),
        ]
    contacts = [
        hs.Contact(f"f{i}", velocity=f"v{i}", normal=0.4 + 0.2 * i, law="coulomb", arguments={"mu": 0.7})
        for i in range(3)
    ]
    return hs.Model("cornered", states, contacts=contacts)


def seven_contacts() -> hs.Model:
    """Seven bodies that are pushed at rates of their own: 391 vectors of modes are met within a minute."""
    return hs.Model(
        "seven",
        [
            hs.State(f"v{i}", 0.0, f"a*sin({i + 1}*t + {i}) - f{i} - 0.01*v{i}**3", nominal=1.0)
            for i in range(7)
        ],
        parameters={"a": 2.0},
        contacts=[
            hs.Contact(f"f{i}", velocity=f"v{i}", normal=1, law="coulomb", arguments={"mu": 0.5})
            for i in range(7)
        ],
    )


def bits(sol: hs.Solution) -> list[Any]:
    return [(e.t, e.component, e.target, *e.x_plus.tolist()) for e in sol.events] + sol(sol.t_end).tolist()


def first_and_later(model: hs.Model, integrator: str, end: float) -> tuple[list[Any], list[Any]]:
    """Return the results of a run that begins without instruction tapes, and of a run that has all it needs."""
    system = system_of(model)
    system.code.shared.clear()
    runs_of(model).clear()
    runs = [hs.simulate(model, (0, end), integrator=integrator) for _ in range(2)]
    return bits(runs[0]), bits(runs[1])


@pytest.mark.parametrize("integrator", COMPILED)
def test_a_first_run_is_as_later_ones(integrator: str) -> None:
    """On its way it stops where modes are new, and goes on: this must change no digit."""
    model = cornered_chain()
    first, later = first_and_later(model, integrator, 40.0)
    assert len(tape_cache_of(system_of(model)).tapes.modes) > 27
    assert len(first) > 60
    assert first == later


def joined_contacts() -> hs.Model:
    """Four contacts that act on each other's bodies: at some events two of them change their modes."""
    return hs.Model(
        "joined",
        [
            hs.State(
                f"v{i}",
                0.0,
                f"1.2*sin({1 + 0.37 * i}*t + {i}) - f{i} + 0.4*f{(i + 1) % 4} + 0.4*f{(i - 1) % 4} - 0.1*v{i}",
                nominal=1.0,
            )
            for i in range(4)
        ],
        contacts=[
            hs.Contact(
                f"f{i}",
                velocity=f"v{i}",
                normal=1,
                law="stribeck",
                arguments={"mu_s": 0.9, "mu_k": 0.3, "v_s": 0.2},
            )
            for i in range(4)
        ],
    )


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5"])
def test_contacts_that_change_together_do_so_in_a_first_run_as_in_a_later_one(integrator: str) -> None:
    """A first run lacks the instruction tapes of the modes in which two contacts have changed."""
    first, later = first_and_later(joined_contacts(), integrator, 30.0)
    times = [event[0] for event in first if isinstance(event, tuple)]
    assert len(times) - len(set(times)) >= 10
    assert first == later


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5"])
def test_more_vectors_of_modes_than_are_searched(integrator: str) -> None:
    model = seven_contacts()
    runs = [hs.simulate(model.with_(a=a), (0, 60), integrator=integrator) for a in (2.0, 2.1, 2.0)]
    assert len(tape_cache_of(system_of(model)).tapes.modes) > 64
    assert [sol.status for sol in runs] == ["finished"] * 3
    assert bits(runs[0]) == bits(runs[2])
    # each body by itself: nothing joins them
    for i in (0, 6):
        alone = hs.Model(
            "one",
            [hs.State("v", 0.0, f"2.1*sin({i + 1}*t + {i}) - f - 0.01*v**3", nominal=1.0)],
            contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 0.5})],
        )
        expected = hs.simulate(alone, (0, 60), integrator="taylor", rtol=1e-12).event_times("f")
        found = runs[1].event_times(f"f{i}")
        assert len(found) == len(expected)
        assert np.abs(found - expected).max() < (1e-6 if integrator == "tsit5" else 1e-7)


def test_a_vector_is_found_where_it_is() -> None:
    draw = np.random.default_rng(5)
    for count, components, modes in ((1, 1, 3), (32, 5, 3), (33, 5, 3), (200, 5, 3), (3000, 9, 4)):
        vectors = np.array([np.unravel_index(i, (modes,) * components) for i in range(modes**components)])
        vectors = vectors[draw.permutation(len(vectors))]
        tape_cache, others = vectors[:count], vectors[count : count + 300]
        tapes = ModeVectors(tape_cache, index_of(tape_cache))
        assert [find_modes(tapes, z) for z in tape_cache] == list(range(len(tape_cache)))
        assert {find_modes(tapes, z) for z in others} <= {-1}


def test_tables_that_grew_are_those_made_at_once() -> None:
    system = System(cornered_chain())
    p = system.vector(Instant(0.0), np.zeros(0))
    tape_cache = TapeCache(system)
    made, steps = None, []
    for z in (
        np.zeros(len(system.automata), dtype=np.int64),
        *np.eye(len(system.automata), dtype=np.int64),
    ):
        tape_cache.with_modes(z)
        made = linear_tables(system, tape_cache.tapes.modes, p, 100.0, made)
        assert made is not None
        steps.append(made)
    assert len({id(step.rows) for step in steps}) < len(steps)  # some found room behind the former ones
    templates_of(system).clear()
    whole = linear_tables(system, tape_cache.tapes.modes, p, 100.0)
    assert whole is not None
    for name in LinearTables._fields:
        np.testing.assert_array_equal(getattr(made.tables, name), getattr(whole.tables, name), err_msg=name)


def one_way_chain(contacts: int) -> hs.Model:
    """Each mass is pulled by the one before it."""
    return hs.Model(
        "one-way",
        [
            state
            for i in range(contacts)
            for state in (
                hs.State(f"x{i}", 0, f"v{i}"),
                hs.State(
                    f"v{i}",
                    0,
                    f"F*sin((0.7 + 0.26*{i})*t + {i}) - 2*x{i} + {f'x{i - 1}' if i else 0} - 0.02*v{i} - f{i}",
                ),
            )
        ],
        parameters={"F": 3.0, "mu": 0.3},
        contacts=[
            hs.Contact(f"f{i}", velocity=f"v{i}", normal=1 + 0.5 * i, law="coulomb", arguments={"mu": "mu"})
            for i in range(contacts)
        ],
    )


ELSEWHERE = """
import sys
import hybridsim as hs
from engine.system.test_many_modes import bits, one_way_chain

for other in (4.0, 8.0)[: int(sys.argv[1])]:  # with these its vectors of modes are met in another order
    hs.simulate(one_way_chain(4), (0, 200), params={"F": other}, integrator="exact", keep="nothing")
print(repr(bits(hs.load_solution(sys.argv[2]).resume())))
"""


@pytest.mark.parametrize("before", [0, 2])
def test_another_process_goes_on_to_the_same_bits(before: int, tmp_path: Path) -> None:
    """What an unfinished run remembers of its modes is not bound to their order on the shelf."""
    model = one_way_chain(4)
    part = hs.simulate(model, (0, 2000), integrator="exact", limits={"events": 1})
    assert part.status == "limit"
    part.save(tmp_path / "part.hsol")
    done = subprocess.run(
        [sys.executable, "-c", ELSEWHERE, str(before), str(tmp_path / "part.hsol")],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    whole = hs.simulate(model, (0, 2000), integrator="exact")
    assert len(whole.events) > 1100
    assert bits(part.resume()) == bits(whole)
    assert ast.literal_eval(done.stdout) == bits(whole)


@pytest.mark.parametrize("integrator", COMPILED)
def test_threads_that_meet_the_same_modes_change_no_bit(integrator: str) -> None:
    """One may put modes on the shelf while the others are on their way to them."""
    model = replace(one_way_chain(5), name=f"one-way-{integrator}")
    system = system_of(model)
    system.code.shared.clear()
    values = {"F": np.linspace(2.5, 6, 4)}
    many, one = (
        hs.sweep(model, values, "final", workers=workers, t_span=(0, 20), integrator=integrator)
        for workers in (4, 1)
    )
    for name in system.names:
        assert many[f"final.{name}"].tolist() == one[f"final.{name}"].tolist()
    assert len(tape_cache_of(system).tapes.modes) > 50


def test_tables_of_many_values_do_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of hundreds of modes take some 30 MB each: the oldest are let go of."""
    model = cornered_chain()
    kept = cached_tables(system_of(model))
    for key in list(kept):
        kept.discard(key)
    for end in (1.0, 20.0, 400.0):  # a table for each order of magnitude
        hs.simulate(model, (0, end), integrator="exact", keep="nothing")
    assert len(kept) >= 3
    most = max(made.rows.size for made in kept.values())
    monkeypatch.setattr("hybridsim.engine.linear.tables._MAX_BYTES", most)
    hs.simulate(model, (0, 0.01), integrator="exact", keep="nothing")
    assert len(kept) == 1 or sum(made.rows.size for made in kept.values()) <= most
    assert len(kept) < 3
