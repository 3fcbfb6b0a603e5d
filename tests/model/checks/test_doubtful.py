"""Warnings about valid models: each oddity is named with its line, and no sound model is suspected."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.model.checks.caution import Caution
from hybridsim.model.checks.doubtful import warnings_of
from hybridsim.testing.measuring import SCENES as FOLDER

SCENES = sorted(FOLDER.glob("*.toml"))
PLAIN = '[states]\nx = { start = 0, der = "v" }\nv = { start = 1, der = "-x" }\n'


def cautions(text: str) -> tuple[Caution, ...]:
    return warnings_of(hs.Model.from_toml(f'schema = 1\nname = "m"\n{text}', path="m.toml"))


def guarded(guard: str, more: str = "") -> str:
    modes = f'[modes.a]\ninitial = true\nguards.g = {{ expr = "{guard}", then = "b" }}\n[modes.b]\n'
    return PLAIN + more + modes


@pytest.mark.parametrize("name", [info.name for info in hs.list_models()])
def test_no_packaged_model_is_suspected(name: str) -> None:
    assert warnings_of(hs.load(name)) == ()


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_no_scene_is_suspected(path: Path) -> None:
    """Except that of two monitors of a gap, which fire only when the ball rests."""
    found = warnings_of(hs.load(path))
    assert [caution.message for caution in found if "only touches zero" not in caution.message] == []
    assert len(found) == (2 if path.stem == "bounces-watched" else 0)


@pytest.mark.parametrize(
    ("guard", "reason"),
    [
        ("(x - 1)**2", "a square"),
        ("(x - 1)*(x - 1)", "a square"),
        ("x**4", "an even power"),
        ("abs(x - 1)", "an absolute value"),
        ("3*abs(x)", "an absolute value"),
        ("x**2/k", "a square"),
        ("x**2 + v**2", "a sum"),
        ("x**2*abs(v)", "a product"),
        ("sqrt(x + 2)", "a root"),
        ("exp(x)", "an exponential"),
        ("max(x, 0)", "a maximum"),
        ("energy", "a sum"),
    ],
)
def test_a_guard_that_is_never_negative(guard: str, reason: str) -> None:
    more = '[parameters]\nk = 3\n[definitions]\nenergy = "v**2/2 + k*x**2/2"\n'
    (caution,) = cautions(guarded(guard, more))
    assert f"guard g of mode a, component mode: '{guard}' is {reason}" in caution.message
    assert "never fires" in caution.message
    assert caution.place is not None and (caution.place.file, caution.place.line) == ("m.toml", 12)
    assert "changes its sign" in caution.remedy
    assert str(caution).startswith("m.toml:12: guard g")


def test_a_guard_that_is_never_positive_fires_at_once() -> None:
    (caution,) = cautions(guarded("-(x - 1)**2"))
    assert "minus a square, never positive, so it fires as soon as it is not zero" in caution.message


@pytest.mark.parametrize(
    "guard",
    [
        "1 - x",
        "(x - 1)**3",
        "x*v",
        "1 - x**2",
        "x**2 + v**2 - 1",
        "-3*x**2 + 1",
        "k*x",
        "x/k",
        "min(x, 1)",
        "abs(x) - 1",
    ],
)
def test_a_guard_that_may_change_its_sign(guard: str) -> None:
    assert cautions(guarded(guard, "[parameters]\nk = 3\n")) == ()


@pytest.mark.parametrize("sign", [1, -1])
def test_the_value_of_a_parameter_counts(sign: int) -> None:
    found = cautions(guarded("k*x**2", f"[parameters]\nk = {3 * sign}\n"))
    assert len(found) == (sign > 0)


@pytest.mark.parametrize(
    ("guard", "constant"),
    [
        ("k - 1", True),
        ("y - 1", True),
        ("y + gap", True),
        ("u - 1", True),
        ("x - y", False),
        ("t - 1", False),
        ("signal - 1", False),
        ("ticked - 1", False),
        ("other - 1", False),
    ],
)
def test_a_guard_that_is_constant_in_its_mode(guard: str, constant: bool) -> None:
    """Constant are: parameters, states at rest, own variables, discrete states that nobody else changes."""
    text = f"""
        [parameters]
        k = 3
        [definitions]
        gap = "k/2"
        [states]
        x = {{ start = 0, der = "1" }}
        y = {{ start = 0, der = "x" }}
        [discrete]
        u = 0
        ticked = 0
        [inputs.signal]
        kind = "wave"
        shape = "sine"
        period = 1
        [clocks.tick]
        period = 1
        set = {{ ticked = "ticked + 1" }}
        [components.c.modes.rest]
        initial = true
        der = {{ y = "0*k" }}
        guards.g = {{ expr = "{guard}", then = {{ to = "go", reset = {{ u = "1" }} }} }}
        [components.c.modes.go]
        [components.d.modes.low]
        initial = true
        set = {{ other = "0" }}
        guards.h = {{ expr = "1 - x", then = "high" }}
        [components.d.modes.high]
        set = {{ other = "2" }}
    """
    found = cautions(text)
    assert [("constant in this mode" in caution.message) for caution in found] == [True] * constant


def test_monitors_are_judged_too() -> None:
    text = '[monitors.a]\nexpr = "v**2"\n[monitors.b]\nexpr = "k - 1"\n[monitors.c]\nexpr = "x - 1"\n'
    found = cautions("[parameters]\nk = 3\n" + PLAIN + text)
    assert [caution.message.split(":")[0] for caution in found] == ["monitor a", "monitor b"]


def test_contacts_are_not_suspected() -> None:
    contact = '[contacts.f]\nvelocity = "v"\nnormal = "1 + x**2"\nlaw = { name = "coulomb", mu = 1 }\n'
    assert cautions(PLAIN.replace('"-x"', '"-x - f"') + contact) == ()


def rubbing(
    law: hs.FrictionLaw | str, normal: str = "2", size: float | None = None, **given: object
) -> list[str]:
    """What is said of a block with a contact."""
    opens, arguments = bool(given.pop("opens", False)), given
    block = hs.Model(
        "block",
        states=[hs.State("x", 3, "v"), hs.State("v", 0, "-x - f", nominal=size)],
        contacts=[hs.Contact("f", "v", normal, law, arguments, opens=opens)],
    ).validate()
    return [caution.message for caution in warnings_of(block)]


FALLING = hs.FrictionLaw("falling", slip="N*(0.5 - v/4)", stick="0.5*N")


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (rubbing("coulomb", "1 - x", mu=0.5), "the normal load '1 - x' is -2 at the start"),
        (rubbing("coulomb", "2*cos(t) - x", mu=0.5), "the normal load '2*cos(t) - x' is -1 at the start"),
        (rubbing("coulomb", mu="1 - x"), "the stick limit is -4 at the start"),
        (rubbing(FALLING, size=4), "the slip force is -1 at the nominal speed v = 4"),
        (
            rubbing(hs.FrictionLaw("a", force="-c*v", parameters={"c": 3})),
            "the force of the law 'a' acts in the direction of the velocity, so it drives the motion",
        ),
        (
            rubbing(hs.FrictionLaw("b", force="mu*N*tanh(v/0.01)", parameters=["mu"]), mu=-0.5),
            "the force of the law 'b' acts in the direction of the velocity, so it drives the motion",
        ),
    ],
)
def test_a_load_or_a_friction_force_of_the_wrong_sign(found: list[str], message: str) -> None:
    assert found == [f"contact f: {message}"]


@pytest.mark.parametrize(
    "found",
    [
        rubbing("coulomb", "x - 3", mu=0.5),  # which is nothing at the start
        rubbing("coulomb", "1 - x", mu=0.5, opens=True),
        rubbing("coulomb", mu="1 + x"),
        rubbing(FALLING),  # no speed is known to be usual
        rubbing(FALLING, size=1),
        rubbing(hs.FrictionLaw("a", force="c*v", parameters={"c": 3})),
        rubbing(hs.FrictionLaw("b", force="v**3 - v")),  # drives at small speeds alone, as a bowed string
        rubbing("dahl", mu=0.5, sigma=100),
    ],
)
def test_friction_that_opposes_the_motion_is_not_suspected(found: list[str]) -> None:
    assert found == []


def test_a_guard_without_units_among_others_with() -> None:
    text = """
        [parameters]
        far = { value = 2, unit = "m" }
        late = 3
        [states]
        x = { start = 0, unit = "m", der = "1" }
        [modes.a]
        initial = true
        guards.far = { expr = "far - x", then = "b" }
        guards.late = { expr = "late - t", then = "b" }
        [modes.b]
    """
    (caution,) = cautions(text)
    assert "guard late of mode a" in caution.message and "without units (late)" in caution.message
    assert cautions(text.replace("late = 3", 'late = { value = 3, unit = "s" }')) == ()
    assert cautions(text.replace(', unit = "m"', "")) == ()


@pytest.mark.parametrize(
    ("term", "pulse"),
    [
        ("exp(-((t - 3)/0.01)**2)", True),
        ("1/(1 + ((t - 3)/w)**2)", True),
        ("(1 + (t - 3)**2)**-2", True),
        ("tanh((t - 3)/w)", True),
        ("(1 if t > 3 and t < 3.1 else 0)", False),
        ("(1 if abs(t - 3) < 0.1 or not t < 7 else 0) + sign(t - 3)", False),
        ("sign(t - 3)", False),
        ("sign(t - 3) + (1 if 4 < t else 0)", False),
        ("sign(t - 3)*exp(-((t - 3)/0.01)**2)", True),
        ("bump", True),
        ("exp(-t/w)", False),
        ("sin(9*t)", False),
        ("exp(cos(9*t))", False),
        ("sin(t**2)", False),
        ("t**2/w", False),
        ("1/(1 + t)", False),
        ("exp(-x**2)", False),
    ],
)
def test_a_pulse_in_plain_time(term: str, pulse: bool) -> None:
    text = PLAIN.replace('"-x"', f'"-x + {term}"')
    found = cautions('[parameters]\nw = 0.1\n[definitions]\nbump = "2*exp(-t**2/w)"\n' + text)
    assert [("pulse or step in t" in caution.message) for caution in found] == [True] * pulse
    assert all("max_step" in caution.remedy and "input" in caution.remedy for caution in found)


def test_one_pulse_used_twice_is_reported_once() -> None:
    text = PLAIN.replace('"-x"', '"bump - x"').replace('"v"', '"v + bump"')
    assert len(cautions('[definitions]\nbump = "exp(-t**2)"\n' + text)) == 1
