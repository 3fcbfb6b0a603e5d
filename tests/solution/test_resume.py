"""Runs that stop early go on to the same bits; solutions come back from a file as they went."""

from __future__ import annotations

import json
import pickle
import signal
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.integrators.registry import integrator_class

# a contact, a clock with discrete states, impacts that come to rest, an input with jumps, a thermostat
SCENES = {"dfcs": 0.01, "sampled-servo": 0.05, "bouncing-ball": 3.0, "square-wave": 1.0, "thermostat": 3.0}
COMPILED = ("exact", "taylor", "dop853", "tsit5")
OTHERS = ("rodas5p", "rk4-dichotomy", "rk4-sign", "moreau", "scipy-dop853", "cvode-bdf")


def difference(one: hs.Solution, other: hs.Solution) -> str:
    """What differs between two solutions, events and states to the last bit; empty where nothing does."""
    if (one.status, len(one.events)) != (other.status, len(other.events)):
        return f"{one.status} with {len(one.events)} events, {other.status} with {len(other.events)}"
    for a, b in zip(one.events, other.events, strict=True):
        if repr(a) != repr(b) or a.t != b.t or not np.array_equal(a.x_plus, b.x_plus):
            return f"{a} at {a.t!r}, {b} at {b.t!r}"
    if one.t.shape != other.t.shape or not (one.t == other.t).all() or not (one.y == other.y).all():
        return "the states"
    return ""


@pytest.mark.parametrize("name", COMPILED + OTHERS)
@pytest.mark.parametrize("scene", SCENES)
def test_a_run_in_parts_is_the_run(scene: str, name: str, tmp_path: Path) -> None:
    model, span = hs.load(scene), (0.0, SCENES[scene])
    try:
        whole = hs.simulate(model, span, integrator=name)
    except hs.UsageError:
        pytest.skip("the method lacks what the scene needs")  # said by the refusal, tested elsewhere
    draws = np.random.default_rng(len(scene + name))
    for _ in range(2):
        most = max(int(whole.stats["steps"]), 2)
        part = hs.simulate(model, span, integrator=name, limits={"steps": draws.integers(1, most)})
        if part.status == "limit":
            part = part.resume(limits={"steps": draws.integers(1, most)})
        if part.status == "limit":
            part.save(tmp_path / "part.hsol")
            part = hs.load_solution(tmp_path / "part.hsol").resume()
        assert not difference(whole, part)


@pytest.mark.parametrize("name", ["dop853", "tsit5", "rodas5p", "taylor"])
def test_a_run_that_is_stopped_at_any_step_of_the_general_loop_goes_on(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each segment begins with the step that the one before it ended with."""
    monkeypatch.setattr(integrator_class(name), "has_compiled_loop", False)
    model = hs.Model(
        "rub",
        states=[hs.State("x", 0.5, "v"), hs.State("v", 0, "-2 + 8*sin(5*t) - f + p")],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 1})],
        impacts=[hs.Impact("p", gap="x", restitution=0.5)],
    )
    whole = hs.simulate(model, (0.0, 3.0), integrator=name)
    for steps in np.linspace(1, int(whole.stats["steps"]) // 3, 12).astype(int):
        part = hs.simulate(model, (0.0, 3.0), integrator=name, limits={"steps": int(steps)})
        assert part.status == "limit" and not difference(whole, part.resume(limits=None)), steps


@pytest.mark.parametrize("name", ["rk4-dichotomy", "rk4-sign", "moreau"])
def test_a_run_of_fixed_steps_goes_on_with_a_limit_below_one_call(name: str) -> None:
    """Each part begins where the one before it ended, so that no step is taken twice and the parts come to an end."""
    whole = hs.simulate("dfcs", (0.0, 0.4), integrator=name)
    part, ends = hs.simulate("dfcs", (0.0, 0.4), integrator=name, limits={"steps": 5000}), [0.0]
    while part.status == "limit":
        assert part.t_end > ends[-1]
        ends.append(part.t_end)
        part = part.resume(limits={"steps": 5000})
    assert len(ends) > 2 and part.stats["steps"] == whole.stats["steps"] and not difference(whole, part)


@pytest.mark.parametrize("name", COMPILED)
def test_a_run_goes_further(name: str) -> None:
    short = hs.simulate("dfcs", (0.0, 0.0123), integrator=name)
    assert not difference(hs.simulate("dfcs", (0.0, 0.03), integrator=name), short.resume(0.03))


@pytest.mark.parametrize("name", ["exact", "scipy-dop853", "rk4-dichotomy"])
def test_an_interrupted_run_goes_on(name: str) -> None:
    calls = 0

    def interrupt(fraction: float) -> None:
        nonlocal calls
        calls += 1
        if calls == 2:
            raise KeyboardInterrupt

    scene = {"exact": "sampled-servo", "scipy-dop853": "belt", "rk4-dichotomy": "square-wave"}[name]
    span = (0.0, {"sampled-servo": 20.0, "belt": 10.0, "square-wave": 5.0}[scene])
    with pytest.raises(KeyboardInterrupt) as caught:  # it ends the script that the run is in
        hs.simulate(scene, span, integrator=name, progress=interrupt)
    part = caught.value.solution
    assert part.status == "interrupted" and "sol.resume()" in part.message
    assert not difference(hs.simulate(scene, span, integrator=name), part.resume())


@pytest.fixture
def interruptible() -> Iterator[None]:
    """SIGINT raises KeyboardInterrupt, also where a shell has started the tests in the background with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_ends_a_loop_of_runs(interruptible: None) -> None:
    """An interruption from outside, as it comes to a notebook, ends the loop, and what was computed is kept."""
    runs = 0

    def stop(fraction: float) -> None:
        if runs == 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as caught:
        for _ in range(5):
            runs += 1
            hs.simulate("belt", (0.0, 10.0), integrator="scipy-dop853", progress=stop)
    assert runs == 2
    part = pickle.loads(pickle.dumps(caught.value)).solution
    assert part.status == "interrupted" and 0.0 <= part.t_end < 10.0
    assert "stopped at t" in str(caught.value) or "interrupted" in str(caught.value)
    with pytest.raises(KeyboardInterrupt) as again:
        part.resume(progress=stop)
    assert again.value.solution.status == "interrupted"
    assert not difference(hs.simulate("belt", (0.0, 10.0), integrator="scipy-dop853"), part.resume())


@pytest.mark.parametrize(
    ("limits", "word"),
    [({"events": 5}, "events"), ({"steps": 5}, "steps"), ({"seconds": 1e-9}, " s have passed, but")],
)
def test_limits_are_named(limits: dict[str, float], word: str) -> None:
    part = hs.simulate("belt", (0.0, 100.0), integrator="scipy-dop853", limits=limits)
    assert part.status == "limit" and not part.success and word in part.message
    assert part.t_end < 100.0 and len(part.t)


@pytest.mark.parametrize("name", ["dop853", "exact", "scipy-dop853", "rk4-dichotomy", "moreau"])
def test_a_run_that_is_stopped_says_where_its_solution_ends(name: str) -> None:
    part = hs.simulate("dfcs", (0.0, 1e4), integrator=name, limits={"seconds": 1e-6})
    assert part.status == "limit" and f"stopped at t = {part.t_end!r};" in part.message
    part(part.t_end)
    steps = hs.simulate("belt", (0.0, 100.0), integrator="scipy-dop853", limits={"steps": 5})
    assert not any(event.t == steps.t_end for event in steps.events)  # between two events
    assert f"stopped at t = {steps.t_end!r};" in steps.message


def test_memory_is_limited() -> None:
    """In a process of its own: one that has done much fills the memory that it has been given back first."""
    lines = """import hybridsim as hs
part = hs.simulate("belt", (0.0, 1e5), integrator="scipy-dop853", limits={"megabytes": 3, "steps": 10**6})
assert part.status == "limit" and "MB" in part.message, part.message
"""
    subprocess.run([sys.executable, "-c", lines], check=True)


@pytest.mark.parametrize("save", ["events", "last-period", "nothing", 0.01])
def test_what_was_kept_goes_on(save: str | float) -> None:
    whole = hs.simulate("dfcs", (0.0, 0.2), integrator="dop853", keep=save)
    part = hs.simulate("dfcs", (0.0, 0.1), integrator="dop853", keep=save).resume(0.2)
    assert (whole.y[:, -1] == part.y[:, -1]).all() and whole.t_end == part.t_end
    if save != "nothing":
        assert [e.t for e in whole.events] == [e.t for e in part.events]


@pytest.mark.parametrize("name", COMPILED + OTHERS)
def test_a_file_holds_all_of_a_solution(name: str, tmp_path: Path) -> None:
    grid = np.linspace(0.0, 0.03, 50) if name in COMPILED else None
    sol = hs.simulate("dfcs", (0.0, 0.03), params={"F0": 25.0}, integrator=name, t_eval=grid)
    sol.save(tmp_path / "run.hsol")
    again = hs.load_solution(tmp_path / "run.hsol")
    assert not difference(sol, again)
    assert again.model == sol.model and again.modes == sol.modes and again.stats == sol.stats
    assert (again.message, again.warnings) == (sol.message, sol.warnings)
    times = np.linspace(0.0, 0.03, 777)
    for state, one, other in zip(sol.names, sol(times), again(times), strict=True):
        assert np.abs(one - other).max() <= 1e-14 * np.abs(one).max(), state
    if name in COMPILED:
        assert (sol(times) == again(times)).all()
    assert np.allclose(sol.output("f", times), again.output("f", times), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["exact", "dop853", "scipy-dop853"])
def test_a_flight_from_zero_to_zero_is_kept_to_rounding(name: str, tmp_path: Path) -> None:
    """The height is zero at both ends, which is no measure of how exactly it has to be kept."""
    again = [hs.Choice("a", reset={"w": "-0.9*w", "h": "0"})]
    ball = hs.Model(
        "ball",
        states=[hs.State("h", 1, "w"), hs.State("w", 0, "-9.81")],
        components=[hs.Component("c", [hs.Mode("a", hs.Guard("floor", "h", again))])],
    )
    sol = hs.simulate(ball, (0, 5), integrator=name)
    sol.save(tmp_path / "run.hsol")
    times = np.linspace(0, 5, 501)
    assert np.abs(sol(times) - hs.load_solution(tmp_path / "run.hsol")(times)).max() < 2e-14
    assert (tmp_path / "run.hsol").stat().st_size < 60_000


def test_solutions_come_from_other_processes() -> None:
    """Pools send them by pickle: to the last bit, and they go on as well as here."""
    here = hs.simulate("dfcs", (0.0, 0.03), integrator="exact")
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        sent = pool.submit(hs.simulate, "dfcs", (0.0, 0.03), integrator="exact").result()
    assert not difference(here, sent)
    times = np.linspace(0.0, 0.03, 777)
    assert (here(times) == sent(times)).all()
    assert not difference(here.resume(0.05), sent.resume(0.05))


def test_a_solution_of_functions_says_why_it_stays_in_its_process() -> None:
    sol = hs.simulate(hs.Model("decay", states={"x": 1.0}, flow=decay), (0.0, 1.0), integrator="dop853")
    with pytest.raises(hs.UsageError, match="decay"):
        pickle.dumps(sol)


def decay(t: float, x: np.ndarray, p: np.ndarray) -> list[float]:
    return [-x[0]]


def test_files_that_are_none(tmp_path: Path) -> None:
    path = tmp_path / "run.hsol"
    with pytest.raises(hs.UsageError, match="cannot be read"):
        hs.load_solution(path)
    path.write_text("no solution")
    with pytest.raises(hs.UsageError, match="is not a saved solution: the file is not an archive of arrays"):
        hs.load_solution(path)
    with path.open("wb") as file:
        np.savez(file, x=np.zeros(3))
    with pytest.raises(hs.UsageError, match="is not a saved solution: the header is missing"):
        hs.load_solution(path)
    with path.open("wb") as file:
        np.savez(file, header=np.array([{}], dtype=object))
    with pytest.raises(
        hs.UsageError, match="is not a saved solution: the array 'header' cannot be read"
    ) as caught:
        hs.load_solution(path)
    assert "pickle" not in str(caught.value)


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.hsol"
    hs.simulate("dfcs", (0.0, 0.01)).save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    header = json.loads(bytes(arrays["header"]))

    def write(**changes: object) -> None:
        arrays["header"] = np.frombuffer(json.dumps(header | changes).encode(), dtype=np.uint8)
        with path.open("wb") as file:
            np.savez(file, **arrays)

    write(version=99)
    with pytest.raises(hs.UsageError, match="version 99"):
        hs.load_solution(path)
    write(kinds=["no such kind"])
    with pytest.raises(hs.UsageError, match="damaged"):
        hs.load_solution(path)
    write()
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) // 2])
    with pytest.raises(hs.UsageError, match="is not a saved solution"):
        hs.load_solution(path)


def test_nothing_is_pickled(tmp_path: Path) -> None:
    path = tmp_path / "run.hsol"
    hs.simulate("belt", (0.0, 10.0), integrator="scipy-radau").save(path)
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            assert b"'descr': '|O'" not in archive.read(name)[:128]


def test_where_there_is_no_way_on() -> None:
    sol = hs.simulate("dfcs", (0.0, 0.01))
    with pytest.raises(hs.UsageError, match="already reached its end"):
        sol.resume()
    with pytest.raises(hs.UsageError, match="already at"):
        sol.resume(0.005)
    with pytest.raises(hs.UsageError, match="Unknown limit"):
        sol.resume(0.02, limits={"event": 3})
    with pytest.raises(hs.UsageError, match="limit 'steps' cannot be 0"):
        hs.simulate("dfcs", (0.0, 0.01), limits={"steps": 0})


@pytest.mark.parametrize("integrator", ["exact", "dop853", "scipy-dop853"])
@pytest.mark.parametrize("save", ["nothing", 0.01])
def test_what_is_kept_does_not_change_where_a_resumed_run_rests(
    integrator: str, save: str | float, tmp_path: Path
) -> None:
    """The end of bounces on a far floor is found from the bounces before, in the file or not."""
    back = hs.Choice("flight", reset={"h": 1e6, "w": "-0.9*w"})
    stop = hs.Choice("rest", reset={"h": 1e6, "w": 0})
    modes = [
        hs.Mode("flight", hs.Guard("floor", "h - 1e6", back), set={"g": 10}),
        hs.Mode("rest", set={"g": 0}),
    ]
    ball = hs.Component("ball", modes, initial="flight", limit=stop)
    states = [hs.State("h", 1e6 + 0.2, "w"), hs.State("w", 0, "-g"), hs.State("clock", 0, "g/10")]
    model = hs.Model("far", states=states, components=[ball])
    whole = hs.simulate(model, (0, 5), integrator=integrator, keep=save)
    part = hs.simulate(model, (0, 5), integrator=integrator, keep=save, limits={"events": 72})
    assert part.status == "limit"
    part.save(tmp_path / "part.hsol")
    for rest in (part.resume(), hs.load_solution(tmp_path / "part.hsol").resume()):
        assert (rest.y[:, -1] == whole.y[:, -1]).all()


def test_a_file_that_was_changed_is_refused(tmp_path: Path) -> None:
    """Whether in its numbers or in its header: what does not fit together would be followed by compiled code."""
    hs.simulate("dfcs", (0, 0.01)).save(tmp_path / "run.hsol")
    with np.load(tmp_path / "run.hsol") as stored:
        arrays = dict(stored)
    number = next(name for name in arrays if name.endswith(("/ends", "/rows")))
    header = arrays["header"].copy()
    header[header.tolist().index(ord("1"))] = ord("2")
    for name, value in {number: arrays[number] + 1000, "header": header}.items():
        with open(tmp_path / "other.hsol", "wb") as file:
            np.savez(file, **{**arrays, name: value})
        with pytest.raises(hs.UsageError, match=r"does not match its checksum|version 3"):
            hs.load_solution(tmp_path / "other.hsol")


def test_the_remedy_after_a_termination_names_the_discrete_states() -> None:
    """They are not in sol.y, so a new run from it would begin with their declared values."""
    model = hs.Model(
        "ended",
        states=[hs.State("x", 0, "n + 1")],
        discrete=[hs.Discrete("n", 0)],
        schedules=[hs.Schedule("k", times=[0.5], reset={"n": "n + 2"})],
        monitors=[hs.Monitor("end", "x - 1", "up", "terminate")],
    )
    sol = hs.simulate(model, (0, 2))
    with pytest.raises(hs.UsageError) as fault:
        sol.resume(2.0)
    assert "the discrete states {'n': 2.0}, all in x0" in str(fault.value.remedy)
