"""Switching surfaces as declarations: the forms in which they can be written, and the faults that are named."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.model.checks.doubtful import warnings_of

STATES = '[states]\nx = { start = 1, der = "v" }\nv = { start = 0, der = "-u" }\n'


def read(text: str) -> hs.Model:
    return hs.Model.from_toml(f'schema = 1\nname = "m"\n{text}', "m.toml")


def python(**changes: object) -> hs.Model:
    parts = {
        "states": [hs.State("x", 1, "v"), hs.State("v", 0, "-u")],
        "surfaces": [hs.SwitchingSurface("u", "x + v")],
    }
    return hs.Model("m", **{**parts, **changes})


def test_short_and_long_forms_and_python_are_one() -> None:
    short = read(STATES + '[surfaces]\nu = "x + v"\n')
    assert short == read(STATES + '[surfaces.u]\nexpr = "x + v"\n') == python()
    assert hs.Model.from_toml(short.to_toml()) == short
    assert "surfaces" not in read(STATES.replace("-u", "-x")).to_toml()


def test_what_differs_on_the_sides_comes_back_equal() -> None:
    sides = {"above": {"a": "1 + x", "b": 0}, "below": {"a": "-v", "b": "sqrt(1 + x**2)"}}
    model = python(
        states=[hs.State("x", 1, "v + b"), hs.State("v", 0, "-a")],
        surfaces=[hs.SwitchingSurface("u", "x + v", **sides)],
    ).validate()
    assert hs.Model.from_toml(model.to_toml()) == model
    component = model.all_components()[0]
    assert component.variables == ("u", "a", "b")
    assert [mode.name for mode in component.modes] == ["above", "below", "sliding"]
    assert component.mode("above").set["a"].text == "1 + x"


def test_a_surface_of_a_component_can_ask_for_the_only_motion() -> None:
    modes = [
        hs.Mode("up", [hs.Guard("side", "x")], set={"u": 1}),
        hs.Mode("down", [hs.Guard("side", "-x")], set={"u": -1}),
        hs.Mode("on", [hs.Guard("a", "1 - u"), hs.Guard("b", "1 + u")]),
    ]
    surface = hs.Surface("x", "u", "up", "down", "on", 0, 0, unique=True)
    model = python(surfaces=[], components=[hs.Component("c", modes, surface=surface)]).validate()
    assert hs.Model.from_toml(model.to_toml()) == model
    assert "unique = true" in model.to_toml()


@pytest.mark.parametrize(
    ("text", "message", "remedy", "line"),
    [
        ('[surfaces]\nu = "x + y"\n', "surface u, expr: unknown name 'y'", "", 7),
        (
            '[surfaces]\nu = "t - 1"\n',
            "the switching function 't - 1' contains no state",
            "inputs need no surface",
            7,
        ),
        (
            '[surfaces]\nu = "w"\nw = "u"\n',
            "depends on 'w', which depends on a mode",
            "use only states",
            7,
        ),
        ("[surfaces.u]\nabove = { a = 1 }\n", "'expr' is missing", "changes its sign at the surface", 6),
        (
            '[surfaces.u]\nexpr = "x"\nabove = { a = 1 }\n',
            "'a' is set in 'above' but not in 'below'",
            "below = { a = ... }",
            8,
        ),
        (
            '[surfaces.u]\nexpr = "x"\nbelow = { a = 1 }\n',
            "'a' is set in 'below' but not in 'above'",
            "above = { a = ... }",
            8,
        ),
        ('[surfaces.u]\nexpr = "x"\nabouve = { a = 1 }\n', "unknown key 'abouve'", "did you mean 'above'", 8),
        (
            '[surfaces]\nx = "v"\n',
            "the name 'x' is used twice, for a state and for a switching surface",
            "",
            7,
        ),
        (
            '[surfaces.u]\nexpr = "x"\nabove = { a = "a" }\nbelow = { a = "q" }\n',
            "surface u, above, a:",
            "",
            8,
        ),
    ],
)
def test_faults_are_named(text: str, message: str, remedy: str, line: int) -> None:
    with pytest.raises(hs.ModelError) as caught:
        read(STATES + text)
    assert message in str(caught.value)
    assert remedy in str(caught.value)
    places = [e.place.line for e in (caught.value.errors or [caught.value]) if e.place]
    assert line in places


def test_python_faults_are_named() -> None:
    with pytest.raises(hs.UsageError, match="'a' is set in `above` but not in `below`"):
        hs.SwitchingSurface("u", "x", above={"a": 1})
    with pytest.raises(hs.UsageError, match="`surfaces` contains"):
        python(surfaces=["x"])
    with pytest.raises(hs.ModelError, match="cannot have 'surfaces'"):
        hs.Model(
            "m", {"x": 1}, surfaces=[hs.SwitchingSurface("u", "x")], flow=lambda t, x, p: (-x[0],)
        ).validate()


def test_a_contact_cannot_slide_at_what_a_relay_sets() -> None:
    contact = hs.Contact("f", "v - u", 1, "coulomb", {"mu": 0.5})
    with pytest.raises(hs.ModelError, match="the velocity depends on 'u', which depends on a mode"):
        python(contacts=[contact]).validate()


def test_corners_on_a_side_are_taken_care_of() -> None:
    """|x| in the rate above is x there, since the surface says the side."""
    model = python(
        states=[hs.State("x", 1, "-rate")],
        surfaces=[hs.SwitchingSurface("s", "x", above={"rate": "abs(x)"}, below={"rate": "-2*abs(x)"})],
    )
    solution = hs.simulate(model, (0, 1), integrator="exact")
    assert solution(1.0)[0] == pytest.approx(2.718281828459045**-1, abs=1e-14)


def test_a_sign_in_a_rate_is_told_of_surfaces() -> None:
    relay = '[modes.a]\nset = { w = "sign(x)" }\n'
    (caution,) = warnings_of(read('[states]\nx = { start = 1, der = "-w" }\n' + relay))
    assert "'sign(x)' in mode a of mode is not treated as a switching surface" in caution.message
    assert "[surfaces.NAME]" in caution.remedy and "[contacts.NAME]" in caution.remedy
    assert not warnings_of(read(STATES + '[surfaces]\nu = "x + v"\n'))
