"""Each answer draws itself: `plot()` of runs, steady states, sweeps, comparisons, branches and derivatives."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError

MU, N, M, START = 0.3, 20.0, 2.0, 1.5


def block() -> hs.Model:
    """A block that slides from the speed START, slowed by mu N/m, until it stops."""
    return hs.Model(
        "block",
        parameters={"mu": MU},
        states=[hs.State("x", 0, "v"), hs.State("v", START, f"-f/{M}")],
        contacts=[hs.Contact("f", velocity="v", normal=N, law="coulomb", arguments={"mu": "mu"})],
        outputs=[hs.Output("power", "f*v")],
    )


def curve(axes) -> np.ndarray:
    """The longest line of axes, (k, 2)."""
    return max((line.get_xydata() for line in axes.get_lines()), key=len)


def dots(axes) -> np.ndarray:
    """The round marks of axes, (k, 2)."""
    return np.concatenate([line.get_xydata() for line in axes.get_lines() if line.get_marker() == "o"])


def test_a_run_draws_its_quantities_and_modes() -> None:
    picture = hs.simulate(block(), (0, 0.4)).plot("v", "power", t_span=(0.1, 0.3))
    speed, power = (curve(axes) for axes in picture.quantities)
    assert speed[[0, -1], 0].tolist() == [0.1, 0.3]
    assert speed[:, 1] == pytest.approx(START - MU * N / M * speed[:, 0])
    assert power[:, 1] == pytest.approx(MU * N * (START - MU * N / M * power[:, 0]))
    assert picture.modes is not None
    assert picture._repr_png_().startswith(b"\x89PNG")


def test_a_run_without_names_draws_the_states_and_outputs() -> None:
    picture = hs.simulate(block(), (0, 1)).plot()
    assert [axes.get_ylabel() for axes in picture.quantities] == ["x", "v", "power", "friction force\nf"]


def test_a_run_does_not_draw_what_it_has_not() -> None:
    sol = hs.simulate(block(), (0, 1))
    with pytest.raises(UsageError, match="no quantity 'w'"):
        sol.plot("w")
    with pytest.raises(UsageError, match=r"plot\(\) has no argument 'tspan'"):
        sol.plot(tspan=(0, 1))


@pytest.mark.parametrize("options", [{}, {"integrator": "moreau", "step": 1e-3}])
def test_arrays_of_contacts_draw_their_states_and_modes(options: dict) -> None:
    """A free block of mass 2 on a floor, thrown at the speed START: q = START t - mu N/(2 m) t^2 until it stops."""
    floor = hs.MechanicalContact("f", [1.0], normal=N, law="coulomb", arguments={"mu": MU})
    system = hs.MechanicalSystem(M=[M], C=None, K=None, contacts=[floor], v0=[START])
    picture = hs.simulate(system, (0, 1), **options).plot("q1", "v_rel(f)")
    stop = START * M / (MU * N)
    t, q = curve(picture.quantities[0]).T
    slides = np.minimum(t, stop)
    tolerance = 1e-9 if not options else 2e-3  # moreau steps by 1e-3
    assert q == pytest.approx(START * slides - 0.5 * MU * N / M * slides**2, abs=tolerance)
    assert {text.get_text() for text in picture.modes.get_legend().get_texts()} == {"slip+", "stick"}
    assert not [line for line in picture.quantities[0].get_lines() if line.get_marker() == "v"]


def test_of_many_contacts_the_first_are_shown_and_the_title_says_so() -> None:
    picture = hs.simulate(hs.chain_on_belt(20), (0, 1)).plot("q1")
    assert [text.get_text() for text in picture.modes.get_yticklabels()] == [f"f{k}" for k in range(1, 17)]
    assert "modes of 4 other components" in picture.quantities[0].get_title(loc="left")


def test_a_steady_state_draws_its_period() -> None:
    """A linear oscillator: the amplitude is F/|k - m w^2| with k = 4, m = 1, w = 1 and no damping to speak of."""
    model = hs.Model(
        "linear",
        parameters={"omega": 1.0},
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "3*cos(omega*t) - 4*x - 0.3*v")],
    )
    t, x = curve(hs.steady_state(model).plot("x").quantities[0]).T
    assert t[-1] - t[0] == pytest.approx(2 * math.pi)
    assert abs(x).max() == pytest.approx(3 / math.hypot(4 - 1, 0.3), rel=1e-4)


def test_a_linearization_draws_its_eigenvalues() -> None:
    model = hs.Model("spiral", states=[hs.State("x", 0, "0.5*x - 2*y"), hs.State("y", 0, "2*x + 0.5*y")])
    axes = hs.linearize(model).plot()
    (points,) = [line.get_xydata() for line in axes.get_lines() if line.get_marker() == "x"]
    assert sorted(map(tuple, points.round(12))) == [(0.5, -2.0), (0.5, 2.0)]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["grows"]
    assert axes.get_title(loc="left").startswith("not stable")


def test_sensitivities_draw_how_event_times_move() -> None:
    """The block stops at t = v0 m/(mu N), so that dt/dmu = -t/mu and dt/dv0 = t/v0."""
    found = hs.sensitivities(hs.simulate(block(), (0, 1)), ["mu"])
    stop = START * M / (MU * N)
    (panel,) = found.plot()
    assert dots(panel) == pytest.approx(np.array([[stop, -stop / MU]]), rel=1e-8)
    assert panel.get_ylabel() == "dt/dmu"
    _, speeds = found.plot("mu", "v")
    assert speeds.get_ylabel() == "dt/dv(0)"
    assert dots(speeds) == pytest.approx(np.array([[stop, stop / START]]), rel=1e-8)
    with pytest.raises(UsageError, match="no 'nu'"):
        found.plot("nu")


def test_sensitivities_without_events_say_so() -> None:
    found = hs.sensitivities(hs.simulate(block(), (0, 0.1)), ["mu"])
    with pytest.raises(UsageError, match="no events"):
        found.plot()


def test_the_title_of_a_fit_is_no_mathematics() -> None:
    line = hs.Model("line", [hs.State("x", 0, "k")], {"k": 1.0}, title="From $5 to $10")
    t = np.linspace(0, 1, 5)
    found = hs.fit(line, {"t": t, "x": 2 * t + 0.01 * np.cos(9 * t)}, {"k": (0.5, 3)})
    assert found.plot().get_suptitle().startswith(r"From \$5 to \$10")


def test_a_branch_and_a_comparison_draw_themselves() -> None:
    branch = hs.continuation("dfcs", "F0", (29.0, 31.0))
    axes = branch.plot("v")
    assert axes.get_ylabel().startswith("amplitude of v")
    assert sorted(curve(axes)[:, 0]) == sorted(branch.parameter.tolist())
    found = hs.compare("dfcs", t_span=(0, 0.03), integrators=["exact"], rtols=[1e-9], repeat=1)
    assert len(found.plot()) == len(found.quantities)


def test_plot_is_a_name_of_the_package_and_loads_when_it_is_used() -> None:
    code = (
        "import sys, hybridsim as hs\n"
        "assert 'matplotlib' not in sys.modules and 'plot' in dir(hs)\n"
        "assert hs.plot.save.__module__ == 'hybridsim.plot.shared.style' and 'matplotlib' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
