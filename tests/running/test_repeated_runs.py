"""A model that is run again is not bound again, and no run sees anything of another."""

from __future__ import annotations

import gc
import threading
import weakref

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.system.system_cache import runs_of, system_of
from hybridsim.integrators.registry import registered
from hybridsim.integrators.scipy.solvers import ScipyRK45

SPAN = (0, 0.06)
METHODS = ["exact", "taylor", "dop853", "scipy-rk45", "rk4-dichotomy"]


def content(sol: hs.Solution) -> list[object]:
    """Everything that a run found, to the last bit."""
    events = [(e.t, e.guard, e.source, e.target, *e.x_minus, *e.x_plus) for e in sol.events]
    return [sol.status, sol.t.tolist(), sol.y.tolist(), events, sol.modes]


@pytest.fixture
def model() -> hs.Model:
    """Fresh, so that no other test has run it."""
    return hs.load("dfcs")


@pytest.mark.parametrize("integrator", METHODS)
def test_the_second_run_is_the_first(model: hs.Model, integrator: str) -> None:
    runs = [hs.simulate(model, SPAN, integrator=integrator) for _ in range(3)]
    fresh = hs.simulate(hs.load("dfcs"), SPAN, integrator=integrator)
    assert all(content(run) == content(fresh) for run in runs)
    assert system_of(model) is system_of(model)


@pytest.mark.parametrize("integrator", [*METHODS, "moreau", "rodas5p"])
def test_what_is_done_to_an_event_at_the_start_stays_there(integrator: str) -> None:
    """A clock ticks at t0: its states are the first ones of the run."""
    servo = hs.load("sampled-servo")
    options = {"integrator": integrator} | (
        {"step": 1e-3} if integrator in ("moreau", "rk4-dichotomy") else {}
    )
    wanted = content(hs.simulate(servo, (0, 0.5), **options))
    kept, spoilt = (hs.simulate(servo, (0, 0.5), **options) for _ in range(2))
    for event in spoilt.events:
        event.x_minus[:] = event.x_plus[:] = 99.0
    assert content(hs.simulate(servo, (0, 0.5), **options)) == wanted == content(kept)


@pytest.mark.parametrize("integrator", ["dop853", "tsit5"])
def test_every_run_takes_the_first_step_that_is_given(integrator: str) -> None:
    options = {"integrator": integrator, "first_step": 1e-5}
    runs = [hs.simulate("dfcs", SPAN, **options) for _ in range(2)]  # models of their own
    model = hs.load("dfcs")
    runs += [hs.simulate(model, SPAN, **options) for _ in range(3)]
    assert len({run.stats["steps"] for run in runs}) == 1
    assert all(content(run) == content(runs[0]) for run in runs)
    assert runs[0].stats["steps"] > hs.simulate(model, SPAN, integrator=integrator).stats["steps"]


def test_an_option_of_another_kind_is_refused_every_time(model: hs.Model) -> None:
    """16.0 equals 16, and is no whole number to an option."""
    hs.simulate(model, SPAN, integrator="rk4-dichotomy", max_bisections=16)
    for _ in range(2):
        with pytest.raises(hs.UsageError, match=r"`max_bisections` cannot be 16\.0"):
            hs.simulate(model, SPAN, integrator="rk4-dichotomy", max_bisections=16.0)


@pytest.mark.parametrize("integrator", METHODS)
def test_what_is_done_to_a_result_stays_there(model: hs.Model, integrator: str) -> None:
    """Arrays that a run gave away are written over; the next run does not notice."""
    wanted = content(hs.simulate(model, SPAN, integrator=integrator))
    spoilt = hs.simulate(model, SPAN, integrator=integrator)
    for event in spoilt.events:
        event.x_minus[:] = event.x_plus[:] = np.nan
    spoilt.y[:] = np.nan
    spoilt.t[:] = np.nan
    assert content(hs.simulate(model, SPAN, integrator=integrator)) == wanted


def test_other_starts_are_other_runs(model: hs.Model) -> None:
    """x0, t0, discrete states and parameters in turn: each as if it were alone."""
    options = [
        {},
        {"x0": {"v": 0.1}},
        {"x0": {"v": -0.1}},
        {"params": {"F0": 25.0}},
        {"params": {"F0": 25.0}, "x0": {"v": 0.1}},
        {"z0": {"f": "slip+"}, "x0": {"v": 0.2}},
    ]
    alone = [content(hs.simulate(hs.load("dfcs"), SPAN, **o)) for o in options]
    assert len({repr(c) for c in alone}) == 6
    for _ in range(2):
        assert [content(hs.simulate(model, SPAN, **o)) for o in options] == alone
    later = (0.01, 0.06)
    assert content(hs.simulate(model, later)) == content(hs.simulate(hs.load("dfcs"), later))


def test_discrete_states_of_the_start_are_told_apart() -> None:
    gate = hs.Component(
        "gate", [hs.Mode("shut", guards=[hs.Guard("g", "n - x", then="open")]), hs.Mode("open")], "shut"
    )
    model = hs.Model("gated", [hs.State("x", 0, "1")], discrete=[hs.Discrete("n", 0.5)], components=[gate])
    for _ in range(2):
        for n in (0.5, 0.25, 0.75):
            sol = hs.simulate(model, (0, 1), x0={"n": n}, integrator="taylor")
            assert [e.t for e in sol.events] == pytest.approx([n], rel=1e-12)


def test_a_faulty_model_is_refused_every_time() -> None:
    broken = hs.Model("broken", states=[hs.State("x", 0, "y")])
    pushing = hs.Model(
        "pushing",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "f")],
        contacts=[hs.Contact("f", velocity="v", normal="1", law="coulomb", arguments={"mu": 0.5})],
    )
    for _ in range(3):
        with pytest.raises(hs.ModelError, match="y"):
            hs.simulate(broken, (0, 1))
        with pytest.raises(hs.ModelError, match="acts along"):
            hs.simulate(pushing, (0, 1))


def test_models_do_not_pile_up(model: hs.Model) -> None:
    """A sweep over parameters leaves a bounded number of models behind."""
    copies = [model.with_(F0=20.0 + k) for k in range(60)]
    for copy in copies:
        hs.simulate(copy, (0, 0.001), integrator="taylor")
    left = [weakref.ref(copy) for copy in copies]
    del copies, copy
    gc.collect()
    # the last sixteen, and one more that the tables of their common structure were made for
    assert sum(ref() is not None for ref in left) <= 17


def test_the_model_of_a_call_with_other_numbers_is_let_go_with_its_solution(model: hs.Model) -> None:
    """No other call can have this model, so its system is not kept for later runs."""
    simulator = hs.Simulator(model, integrator="exact")
    for k, run in enumerate((hs.simulate, simulator.run)):
        options = {"model": model, "integrator": "exact"} if run is hs.simulate else {}
        hs.simulate(
            model, SPAN, integrator="exact", params={"F0": 24.0}
        )  # the tables of the structure keep one model
        left = weakref.ref(run(t_span=SPAN, params={"F0": 25.0 + k}, **options).model)
        gc.collect()
        assert left() is None


def test_runs_side_by_side_in_threads(model: hs.Model) -> None:
    """Scratch arrays are handed on from run to run, never shared by two at once."""
    starts = [{"v": 0.01 * k} for k in range(8)]
    wanted = [content(hs.simulate(model, SPAN, x0=s, integrator="taylor")) for s in starts]
    found: list[list[object]] = [[] for _ in starts]

    def work(k: int) -> None:
        for _ in range(10):
            found[k] = content(hs.simulate(model, SPAN, x0=starts[k], integrator="taylor"))

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == wanted


def test_a_run_inside_the_progress_of_another(model: hs.Model) -> None:
    wanted = content(hs.simulate(model, SPAN, integrator="taylor"))
    inner: list[list[object]] = []

    def progress(_: float) -> None:
        inner.append(content(hs.simulate(model, SPAN, integrator="taylor")))

    assert content(hs.simulate(model, SPAN, integrator="taylor", progress=progress)) == wanted
    assert inner and all(found == wanted for found in inner)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_a_sweep_in_threads_is_the_sweep_in_turn(integrator: str) -> None:
    """Values differ from thread to thread, zeros among them; what is kept for a structure is shared by all."""
    points = [{"F0": 5.0 * k, "omega": 380.0 + 20.0 * k} for k in range(12)]
    points += [{"F0": 30.0, "c": 0.0}, {"F0": 30.0, "mu": 0.0}, {"F0": 30.0, "N": 0.0}]
    in_turn = [content(hs.simulate("dfcs", SPAN, params=p, integrator=integrator)) for p in points]
    model = hs.load("dfcs")
    found: list[list[object]] = [[] for _ in points]
    together = threading.Barrier(4)

    def work(first: int) -> None:
        together.wait()
        for _ in range(6):
            for k in range(first, len(points), 4):
                found[k] = content(hs.simulate(model.with_(**points[k]), SPAN, integrator=integrator))

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == in_turn


# -- the same arguments again ------------------------------------------------------------------------------------


def test_the_same_words_find_the_run_that_was_prepared(model: hs.Model) -> None:
    """Only for plain numbers and words; times of output are not among them, and may differ."""
    system_of(model)
    kept = runs_of(model)
    first = hs.simulate(model, SPAN, integrator="exact", keep="events")
    assert len(kept) == 1
    again = hs.simulate(model, SPAN, integrator="exact", keep="events")
    assert len(kept) == 1 and again._run is first._run and again is not first
    assert again.stats["compile_time"] == 0.0
    assert [e.t for e in again.events] == [e.t for e in first.events]
    for other in ({"keep": "all"}, {"rtol": 1e-8}, {"max_step": 1.0}):
        hs.simulate(model, SPAN, **{"integrator": "exact", "keep": "events"} | other)
    assert len(kept) == 4
    for not_plain in ({"x0": {"v": 0.1}}, {"z0": {"f": "stick"}}, {"limits": {"events": 3}}):
        hs.simulate(model, SPAN, integrator="exact", **not_plain)
    hs.simulate(model, list(SPAN), integrator="exact")
    hs.simulate(model, SPAN, integrator="taylor", atol=[1e-12, 1e-12])
    assert len(kept) == 4


def test_the_times_of_output_are_those_of_each_call(model: hs.Model) -> None:
    grids = [np.linspace(0.0, 0.06, m) for m in (3, 7, 5)]
    runs = [hs.simulate(model, SPAN, integrator="exact", t_eval=grid) for grid in grids]
    plain = hs.simulate(model, SPAN, integrator="exact")
    assert [run.t.tolist() for run in runs] == [grid.tolist() for grid in grids]
    assert [run.y.tolist() for run in runs] == [plain(grid).tolist() for grid in grids]
    assert len(plain.t) > 7
    with pytest.raises(hs.UsageError, match="outside `t_span`"):
        hs.simulate(model, SPAN, integrator="exact", t_eval=[0.0, 1.0])


def test_what_equals_a_number_and_is_none_is_refused_every_time(model: hs.Model) -> None:
    hs.simulate(model, (0.0, 1.0), integrator="exact", max_step=1.0, keep=1.0)
    for wrong in ({"max_step": True}, {"keep": True}):
        with pytest.raises(hs.UsageError, match="cannot be True"):
            hs.simulate(model, (0.0, 1.0), integrator="exact", **{"max_step": 1.0, "keep": 1.0} | wrong)
    with pytest.raises(hs.UsageError, match="a value of `t_span` cannot be True"):
        hs.simulate(model, (0.0, True), integrator="exact", max_step=1.0, keep=1.0)


def test_a_name_that_means_another_class_is_another_run(model: hs.Model) -> None:
    class Mine(ScipyRK45):
        name = "mine"

    class Yours(ScipyRK45):
        name = "mine"

    for cls in (Mine, Yours, Mine):
        with registered(cls) as name:
            assert type(hs.simulate(model, SPAN, integrator=name)._run.method) is cls
    with pytest.raises(hs.UsageError, match="there is no integrator 'mine'"):
        hs.simulate(model, SPAN, integrator="mine")


def test_functions_that_change_their_answers_are_asked_each_time() -> None:
    """What they return at the start is looked at before every run."""
    force = [1.0]

    def flow(t: float, x: np.ndarray, p: np.ndarray) -> list[float]:
        return [force[0]] if force[0] else []

    model = hs.Model("changing", states={"x": 0.0}, flow=flow)
    assert hs.simulate(model, (0, 1), integrator="scipy-rk45")(1.0)[0] == pytest.approx(1.0)
    force[0] = 0.0
    with pytest.raises(hs.ModelError, match="returned list of shape"):
        hs.simulate(model, (0, 1), integrator="scipy-rk45")


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_a_run_of_events_alone_goes_on_over_many_leaps(model: hs.Model, integrator: str) -> None:
    """Of more segments than one call of the compiled loop has room for; the end is all that is kept of them."""
    span, keywords = (0.0, 12.0), {"integrator": integrator, "keep": "events"}
    whole = hs.simulate(model, span, **keywords)
    assert len(whole.events) > 3000
    for events in (3, 1100, 2050):
        part = hs.simulate(model, span, **keywords, limits={"events": events})
        assert part.status == "limit"
        rest = part.resume()
        assert rest.status == "finished" and [repr(e) for e in rest.events] == [repr(e) for e in whole.events]
        assert rest.t.tolist() == whole.t.tolist() == [12.0] and rest.y.tolist() == whole.y.tolist()
