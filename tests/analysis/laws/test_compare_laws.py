"""One model under several laws: measures in closed form, what is refused, and what the answer shows."""

from __future__ import annotations

from math import exp, inf, log
from pathlib import Path

import pytest

import hybridsim as hs

M, G, V = 2.0, 9.81, 2.0
THICK = hs.FrictionLaw("thick", parameters=["mu"], force="mu*N*v")


def block(normal: str = "m*g") -> hs.Model:
    """A block of mass m that slides on a floor with the velocity V at first."""
    states = [hs.State("x", 0, "v", nominal=1), hs.State("v", V, "-f/m", nominal=1)]
    contact = hs.Contact("f", "v", normal, "coulomb", {"mu": 0.3})
    return hs.Model("block", states, {"m": M, "g": G}, contacts=[contact], title="Block")


def test_a_block_that_slides_to_rest() -> None:
    """Coulomb: the block stops after V**2/(2*mu*g) and loses all its energy. Viscous: x = V/c*(1 - exp(-c*t))."""
    laws = ["coulomb", ("coulomb", {"mu": 0.15}), THICK]
    found = hs.compare_laws(block(), laws, (0, 4))
    assert found.labels == ("coulomb", "coulomb (mu=0.15)", "thick")
    assert found.t_span == (0, 4)
    first, second, third = found.rows
    for row, mu in ((first, 0.3), (second, 0.15)):
        assert row.amplitude_of_quantity == pytest.approx(V**2 / (2 * mu * G) / 2, rel=1e-9)
        assert row.energy_loss == pytest.approx(M * V**2 / 2, rel=1e-9)
        assert row.stops == 1
    c = 0.3 * G
    assert third.amplitude_of_quantity == pytest.approx(V / c * (1 - exp(-4 * c)) / 2, rel=1e-6)
    assert third.energy_loss == pytest.approx(M * V**2 / 2 * (1 - exp(-8 * c)), rel=1e-6)
    assert third.stops is None


def test_a_run_without_a_period_that_begins_and_ends_in_stick_has_two_stops() -> None:
    """Of the forces 0, 1 and 0, one second each, only the second exceeds the limit 1/2; the speed 1/2 then decays."""
    push = hs.Input("u", "table", times=[0, 1, 1, 2, 2, 4], values=[0, 0, 1, 1, 0, 0])
    states = [hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "u - f", nominal=1)]
    contact = hs.Contact("f", "v", 1, "coulomb", {"mu": 0.5})
    (row,) = hs.compare_laws(
        hs.Model("pushed", states, inputs=[push], contacts=[contact]), ["coulomb"], (0, 4)
    ).rows
    assert row.stops == 2
    assert row.amplitude_of_quantity == pytest.approx(0.25, rel=1e-9)


def test_a_loop_of_coulombs_law_is_a_rectangle() -> None:
    """The last period of a forced motion: the loss is 4*mu*N times the amplitude."""
    model = hs.load("dfcs")
    values = model.parameter_values()
    found = hs.compare_laws(model, ["coulomb", ("coulomb", {"mu": "mu/2"})], contact="f", quantity="x")
    period = 2 * 3.141592653589793 / values["omega"]
    assert found.t_span[1] - found.t_span[0] == pytest.approx(period, rel=1e-9)
    assert [row.energy_loss for row in found.rows] == pytest.approx(
        [
            4 * mu * values["N"] * row.amplitude_of_quantity
            for mu, row in zip((0.5, 0.25), found.rows, strict=True)
        ],
        rel=1e-6,
    )


def test_values_of_the_call_and_options_of_runs() -> None:
    found = hs.compare_laws(
        block(),
        ["coulomb"],
        (0, 4),
        params={"g": 5},
        x0={"v": 1},
        quantity="v",
        integrator="dop853",
        rtol=1e-9,
    )
    (row,) = found.rows
    assert row.solution.integrator == "dop853"
    assert row.energy_loss == pytest.approx(M / 2, rel=1e-7)
    assert row.amplitude_of_quantity == pytest.approx(0.5, rel=1e-7)


def test_a_run_that_fails_is_a_row_and_the_others_are_measured() -> None:
    """The load vanishes at x = 1, which a block with less friction reaches."""
    found = hs.compare_laws(
        block("20*(1 - x)"), [("coulomb", {"mu": 0.05}), ("coulomb", {"mu": 0.9})], (0, 3)
    )
    weak, strong = found.records()
    assert weak["status"] != "finished" and "normal load" in weak["message"]
    assert (weak["amplitude"], weak["stops"], weak["energy_loss"]) == (None, None, None)
    assert strong["status"] == "finished" and strong["energy_loss"] == pytest.approx(M * V**2 / 2, rel=1e-8)
    assert "normal load" in repr(found)
    _, bars = found.plot()
    assert bars.texts[0].get_text().strip() == "no result"


def test_a_run_that_stops_at_its_start_has_no_loop() -> None:
    found = hs.compare_laws(block("x - 1"), ["coulomb"], (0, 1))
    loops, bars = found.plot()
    assert len(loops.lines) == 0 and bars.texts[0].get_text().strip() == "no result"


def test_what_the_answer_shows() -> None:
    found = hs.compare_laws(block(), ["coulomb", THICK], (0, 4))
    lines = repr(found).splitlines()
    assert lines[0] == "Block: laws of contact f, t = 0 to 4"
    assert lines[1].split("  ")[1:] != [] and "amplitude of x" in lines[1] and "energy loss" in lines[1]
    assert lines[2].split()[:4] == ["coulomb", f"{V**2 / (4 * 0.3 * G):.6g}", "1", "4"]
    assert lines[3].split()[2] == "-"
    assert found._repr_html_().startswith("<pre>Block")


def test_the_picture_has_a_loop_and_a_bar_for_each_law() -> None:
    found = hs.compare_laws(block(), ["coulomb", THICK], (0, 4))
    loops, bars = found.plot()
    assert len(loops.lines) == len(bars.patches) == 2
    first, _ = loops.lines
    assert max(first.get_ydata()) == pytest.approx(0.3 * M * G)
    assert [bar.get_width() for bar in bars.patches] == [row.amplitude_of_quantity for row in found.rows]
    assert [label.get_text() for label in bars.get_yticklabels()] == ["coulomb", "thick"]
    assert [bar.get_facecolor()[:3] for bar in bars.patches] != [bars.patches[0].get_facecolor()[:3]] * 2


def test_readings_of_a_block_that_slides_to_rest() -> None:
    """Coulomb: it stops at V/(mu*g) after V**2/(2*mu*g). Viscous: it never stops, and v(4) = V*exp(-4*c)."""
    names = ["final.v", "maximum.x", "stick_fraction.f", "first_passage.x>0.5"]
    found = hs.compare_laws(block(), ["coulomb", THICK], (0, 4), measure=names)
    coulomb, viscous = (row.measured for row in found.rows)
    assert found.readings == tuple(names)
    a = 0.3 * G
    passage = (V - (V**2 - 2 * a * 0.5) ** 0.5) / a
    assert [*coulomb.values()] == pytest.approx(
        [0, V**2 / (2 * a), 1 - V / a / 4, passage], rel=1e-9, abs=1e-12
    )
    assert viscous["final.v"] == pytest.approx(V * exp(-4 * a), rel=1e-5)
    assert viscous["first_passage.x>0.5"] == pytest.approx(-log(1 - 0.5 * a / V) / a, rel=1e-6)
    assert viscous["stick_fraction.f"] is None  # a law without stick
    assert found.records()[0]["maximum.x"] == coulomb["maximum.x"]
    head, first, second = repr(found).splitlines()[1:]
    assert all(name in head for name in names) and "stops" not in head
    assert first.split()[2] == f"{V**2 / (2 * a):.6g}" and second.split()[3] == "-"
    _, bars = found.plot()
    assert [bar.get_width() for bar in bars.patches] == [row.measured["final.v"] for row in found.rows]
    assert "final" in bars.get_xlabel()


def test_readings_of_the_last_period_and_of_states_that_a_law_brings() -> None:
    """A mass without friction force follows its base: the first harmonic of a sine with amplitude 2 is -2j."""
    states = [hs.State("x", 0, "v", nominal=1), hs.State("v", 6, "-18*sin(3*t) - f", nominal=1)]
    model = hs.Model("sine", states, contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": 0.1})])
    names = ["amplitude.x", "rms.v", "harmonic.x.1", "amplitude.f_z"]
    free = hs.FrictionLaw("free", force="0*v")
    found = hs.compare_laws(model, [free, ("dahl", {"sigma": 10})], (0, 7), measure=names)
    first, second = (row.measured for row in found.rows)
    assert [first["amplitude.x"], first["rms.v"]] == pytest.approx([2, 6 / 2**0.5], rel=1e-7)
    assert abs(first["harmonic.x.1"]) == pytest.approx(2, rel=1e-7)
    assert first["amplitude.f_z"] is None and second["amplitude.f_z"] > 0
    single = hs.compare_laws(model, [free], (0, 7), measure="harmonic.x.1")
    assert single.plot()[1].patches[0].get_width() == pytest.approx(2, rel=1e-7)


def test_a_failed_run_and_a_passage_that_never_comes_have_no_bar() -> None:
    laws = [("coulomb", {"mu": 0.05}), ("coulomb", {"mu": 0.9})]
    found = hs.compare_laws(block("20*(1 - x)"), laws, (0, 3), measure="first_passage.x>0.9")
    assert found.rows[0].measured == {"first_passage.x>0.9": None}
    assert found.rows[1].measured == {"first_passage.x>0.9": inf}
    _, bars = found.plot()
    assert [text.get_text().strip() for text in bars.texts] == ["no result", "no result"]


@pytest.mark.parametrize(
    ("laws", "options", "message"),
    [
        ("coulomb", {}, "`laws` cannot be 'coulomb'"),
        ([], {}, r"`laws` cannot be \[\]"),
        ([("coulomb", 3)], {}, "an entry of `laws` cannot be"),
        (["coulomb", "coulomb"], {}, "`laws` contains 'coulomb' twice"),
        (["columb"], {}, "there is no law 'columb'"),
        ([("coulomb", {"nu": 1})], {}, "has no parameter 'nu'"),
        (["coulomb"], {"contact": "g"}, "model block has no contact 'g'"),
        (["coulomb"], {"quantity": "y"}, "model block has no quantity 'y'"),
        (["coulomb"], {"rtl": 1}, "'rtl' is not an option"),
        (["coulomb"], {"t_span": (0, 1), "keep": "events"}, "`keep` cannot be 'events'"),
        (["coulomb"], {"t_span": (0, 1), "keep": "last-period"}, "`keep` cannot be 'last-period'"),
        (["coulomb"], {"t_span": (0, 1), "save": "all"}, "has no option `save`"),
        (["coulomb"], {"measure": 3}, "`measure` cannot be 3"),
        (["coulomb"], {"measure": []}, r"`measure` cannot be \[\]"),
        (["coulomb"], {"t_span": (0, 1), "measure": "maximum.y"}, "no measure 'maximum.y' of a run"),
        (["coulomb"], {"t_span": (0, 1), "measure": "2*x"}, "no measure '2\\*x'"),
        (["coulomb"], {"t_eval": [0, 1]}, "has no option `t_eval`"),
        (["coulomb"], {"t_span": (1, 0)}, r"`t_span` cannot be \(1, 0\)"),
    ],
)
def test_what_is_refused(laws: object, options: dict[str, object], message: str) -> None:
    with pytest.raises(hs.HybridsimError, match=message):
        hs.compare_laws(block(), laws, **options)  # type: ignore[arg-type]  # wrong on purpose


def test_readings_of_whole_runs_are_refused_for_the_last_period() -> None:
    for name in ("final.x", "first_passage.x>0", "stops.f"):
        with pytest.raises(hs.UsageError, match="belongs to a whole run") as caught:
            hs.compare_laws("dfcs", ["coulomb"], measure=name)
        assert "amplitude.x" in (caught.value.remedy or "")


def test_a_model_with_several_contacts_needs_the_name_of_one() -> None:
    with pytest.raises(hs.UsageError, match="2 contacts") as caught:
        hs.compare_laws(hs.Model("pair", use=[hs.Use("a", block()), hs.Use("b", block())]), ["coulomb"])
    assert caught.value.remedy == "pass `contact`, one of a.f, b.f"


def test_a_motion_that_has_not_settled_is_said() -> None:
    """A state that grows linearly changes by twice half of its range in each period; a block at rest has settled."""
    drift = hs.State("y", 0, "rate", nominal=1)
    states = [hs.State("v", 0, "sin(t) - f", nominal=1), drift]
    contact = hs.Contact("f", "v", "10", "coulomb", {"mu": 0.3})
    for rate, residual in ((0.1, 2.0), (0.0, 0.0)):
        found = hs.compare_laws(
            hs.Model("drift", states, {"rate": rate}, contacts=[contact]), ["coulomb"], (0, 20)
        )
        assert found.rows[0].residual == pytest.approx(residual)
        assert ("has not settled, a state changes by 2e+02 %" in str(found)) == (rate > 0.0)


def test_a_definition_is_not_a_measured_quantity() -> None:
    model = block()
    text = model.to_toml() + '\n[definitions]\npower = "f*v"\n'
    defined = hs.Model.from_toml(text)
    remedy = "power is a definition; declare an output with the value power"
    with pytest.raises(hs.UsageError, match=remedy):
        hs.compare_laws(defined, ["coulomb"], (0, 1), quantity="power")
    with pytest.raises(hs.UsageError, match=remedy):
        hs.compare_laws(defined, ["coulomb"], (0, 1), measure="final.power")
    with pytest.raises(hs.UsageError, match=remedy):
        hs.sweep(defined, {"m": [1.0, 2.0]}, "amplitude.power")


def test_the_whole_run_of_a_forced_model() -> None:
    """From rest at x = 1 under -x - f + 0*sin(2*t), mu*N = 0.1: the turns are at -0.8, 0.6, -0.4, 0.2 and 0.

    The run ends in the last of these stops. In the last period of 3 nothing moves.
    """
    states = [hs.State("x", 1, "v", nominal=1), hs.State("v", 0, "-x - f + tiny*sin(2*t)", nominal=1)]
    contact = hs.Contact("f", "v", "1", "coulomb", {"mu": 0.1})
    model = hs.Model("swing", states, {"tiny": 0.0}, contacts=[contact], duration=20)
    forced = hs.Model("swing", states, {"tiny": 1e-9}, contacts=[contact], duration=20)
    (last,) = hs.compare_laws(forced, ["coulomb"]).rows
    assert last.is_period and last.amplitude_of_quantity == pytest.approx(0.0, abs=1e-8)
    found = hs.compare_laws(forced, ["coulomb"], keep="all", measure=None)
    (whole,) = found.rows
    assert found.t_span == (0, 20) and not whole.is_period and whole.residual is None
    assert whole.amplitude_of_quantity == pytest.approx((1 + 0.8) / 2, abs=1e-8)
    assert whole.energy_loss == pytest.approx(0.1 * (1.8 + 1.4 + 1.0 + 0.6 + 0.2), abs=1e-8)
    (free,) = hs.compare_laws(model, ["coulomb"], keep="all").rows
    assert whole.stops == free.stops == 1
    loops, _ = found.plot()
    assert (loops.lines[0].get_xdata().min(), loops.lines[0].get_xdata().max()) == pytest.approx((-0.8, 1.0))
    (row,) = hs.compare_laws(forced, ["coulomb"], (0, 20), keep="all", measure="final.x").rows
    assert row.measured["final.x"] == pytest.approx(0.0, abs=1e-8)


def test_all_periods_of_a_long_run_are_drawn() -> None:
    """Of 40 periods the first one has the largest motion."""
    states = [hs.State("x", 5, "v", nominal=1), hs.State("v", 0, "-x - 0.5*v - f + sin(t)", nominal=1)]
    contact = hs.Contact("f", "v", "1", "coulomb", {"mu": 0.1})
    model = hs.Model("long", states, contacts=[contact])
    loops, _ = hs.compare_laws(model, ["coulomb"], (0, 250), keep="all").plot()
    assert loops.lines[0].get_xdata().max() == pytest.approx(5.0)


def test_laws_of_one_name_have_labels_of_their_own(tmp_path: Path) -> None:
    text = '[laws.pad]\nparameters.mu = 0.3\nslip = "mu*N"\nstick = "{stick}*mu*N"\n'
    for name, stick in (("dry", 1), ("wet", 1.1)):
        (tmp_path / f"{name}.toml").write_text(text.format(stick=stick), encoding="utf-8")
    dry, wet = str(tmp_path / "dry.toml"), tmp_path / "wet.toml"
    found = hs.compare_laws(block(), [dry, wet, (wet, {"mu": 0.2}), "coulomb"], (0, 4))
    assert found.labels == (f"pad ({dry})", f"pad ({wet})", f"pad ({wet}, mu=0.2)", "coulomb")
    own = [hs.FrictionLaw("own", slip=f"{mu}*N", stick=f"{mu}*N") for mu in (0.1, 0.2)]
    found = hs.compare_laws(block(), [*own, ("coulomb", {"mu": 0.1}), ("coulomb", {"mu": 0.2})], (0, 4))
    assert found.labels == ("own #1", "own #2", "coulomb (mu=0.1)", "coulomb (mu=0.2)")
    _, bars = found.plot()
    assert tuple(label.get_text() for label in bars.get_yticklabels()) == found.labels


def test_the_axis_of_the_loops_is_chosen_and_has_its_unit() -> None:
    model = block().to_toml()
    for old, new in (
        ("nominal = 1.0", 'nominal = 1.0\nunit = "m"'),
        ("start = 2.0", 'start = 2.0\nunit = "m/s"'),
    ):
        assert old in model
        model = model.replace(old, new, 1)
    found = hs.compare_laws(hs.Model.from_toml(model), ["coulomb", THICK], (0, 4))
    loops, bars = found.plot()
    assert loops.get_xlabel() == "x [mm]" and bars.get_xlabel() == "amplitude of x [mm]"
    for name in ("v", "v_rel(f)"):
        loops, bars = found.plot(name)
        assert "[m/s]" in loops.get_xlabel() and bars.get_xlabel() == "amplitude of x [mm]"
        assert [max(line.get_xdata()) for line in loops.lines] == pytest.approx([V, V])
    with pytest.raises(hs.UsageError, match="has no quantity 'w'"):
        found.plot("w")
