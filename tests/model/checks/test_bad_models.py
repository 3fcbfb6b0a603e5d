"""Every way a model can be wrong gives a ModelError with place, value and remedy; all faults come at once."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from model.samples import block, everything

import hybridsim as hs

BLOCK = """\
name = "block"
[parameters]
m = 1.0
k = "4*m"
mu = 0.3
N = 2.0
[states]
x = { start = 1, der = "v" }
v = { start = 0, der = "(-k*x - f)/m" }
[contacts.f]
velocity = "v"
normal = "N"
law = { name = "coulomb", mu = "mu" }
"""

RELAY = """\
[states]
T = { start = 20, der = "u - T/10" }
[components.relay.modes.on]
initial = true
set = { u = "3" }
guards.hot = { expr = "22 - T", then = [
  { when = "T > 0", to = "off" },
  { to = "on", reset = { T = "0" } } ] }
[components.relay.modes.off]
set = { u = "0" }
guards.cold = { expr = "T - 18", then = "on" }
"""

LAW = """\
[laws.own]
parameters = { a = 0.5, b = "a/2" }
slip = "N*(a - b + b*exp(-v))"
stick = "N*a"
"""

OWN = BLOCK.replace('{ name = "coulomb", mu = "mu" }', '{ name = "own" }') + LAW


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, f"{old} stands {text.count(old)} times"
    return text.replace(old, new)


# name -> (the file, what the message holds, the line it names)
FORM = {
    "unknown key at the top": (BLOCK + "[state]\n", "key 'state'\n    [state]\n     ^\ndid you mean 'states'", 14),
    "unknown key of a parameter": (changed(BLOCK, "m = 1.0", "m = { vlaue = 1 }"), "did you mean 'value'", 3),
    "unknown key of a contact": (changed(BLOCK, "normal", "norml"), "did you mean 'normal'", 12),
    "unknown key of a mode": (changed(RELAY, 'set = { u = "0" }', "sett = { u = 0 }"), "did you mean 'set'", 10),
    "unknown key of a guard": (changed(RELAY, 'then = "on"', 'than = "on"'), "did you mean 'then'", 11),
    "unknown key of a choice": (changed(RELAY, "when", "wenn"), "did you mean 'when'", 7),
    "unknown key of a component": (RELAY + "[components.relay]\nstart = 1\n", "unknown key 'start'", 13),
    "unknown key of a law": (changed(OWN, 'stick = "N*a"', 'stik = "N*a"'), "did you mean 'stick'", 17),
    "unknown key of a monitor": (BLOCK + "[monitors.p]\nexpression = 'v'\n", "unknown key 'expression'", 15),
    "unknown key of a clock": (BLOCK + "[clocks.c]\nperiod = 1\nreset = {}\n", "unknown key 'reset'", 16),
    "unknown key of a schedule": (BLOCK + "[schedules.c]\ntime = 1\n", "did you mean 'times'", 15),
    "unknown key of an output": (BLOCK + "[outputs]\nf = { exp = 'f' }\n", "did you mean 'expr'", 15),
    "a number for a text": (changed(BLOCK, '"block"', "3"), "'name' cannot be a number (3)", 1),
    "a text for a number": (changed(BLOCK, "start = 1,", "start = 1, nominal = 'big',"), "a string ('big')", 8),
    "a text for a flag": (changed(RELAY, "initial = true", "initial = 'yes'"), "use true or false", 4),
    "a list for a table": (changed(BLOCK, "[states]", "states = []\n[other]"), "states", None),
    "a number for a state": (changed(BLOCK, '{ start = 1, der = "v" }', "1"), "state x cannot be a number (1)", 8),
    "a list for an expression": (changed(BLOCK, "m = 1.0", "m = [1]"), "[1]", 3),
    "a date for an expression": (changed(BLOCK, "m = 1.0", "m = 2026-01-01"), "date", 3),
    "a state without der": (changed(BLOCK, ', der = "v"', ""), "'der' is missing", 8),
    "a state without start": (changed(BLOCK, "start = 1, ", ""), "'start' is missing", 8),
    "a contact without law": (changed(BLOCK, 'law = { name = "coulomb", mu = "mu" }', ""), "'law' is missing", 10),
    "a law without stick": (changed(OWN, 'stick = "N*a"', ""), "'stick' is missing", 14),
    "a guard without expr": (changed(RELAY, 'expr = "22 - T", ', ""), "'expr' is missing", 6),
    "a choice without mode": (changed(RELAY, '"T > 0", to = "off"', '"T > 0"'), "'to' is missing", 7),
    "a component without modes": (RELAY + "[components.empty]\n", "it has no modes", 12),
    "two initial modes": (changed(RELAY, "off]", "off]\ninitial = true"), "two initial modes, 'on' and 'off'", 10),
    "an unknown law": (changed(BLOCK, "coulomb", "culomb"), "unknown law 'culomb'", 13),
    "a table without a law": (changed(BLOCK, "coulomb", "table"), "such as a table, in [laws.table]", 13),
    "a parameter list of numbers": (changed(OWN, '{ a = 0.5, b = "a/2" }', "[1]"), "'parameters' contains 1", 15),
    "law keys in a contact": (changed(BLOCK, 'mu = "mu" }', 'mu = "mu", title = "x" }'), "[laws.coulomb]", 13),
    "an unknown schema": ("schema = 2\n" + BLOCK, "write schema = 1", 1),
}  # fmt: skip

CONTENT = {
    "unknown name": (changed(BLOCK, "-k*x", "-kk*x"), "unknown name 'kk'\n    (-kk*x - f)/m\n      ^", 9),
    "unknown name in a parameter": (changed(BLOCK, "4*m", "4*M"), "did you mean 'm'", 4),
    "a state in a parameter": (changed(BLOCK, "4*m", "4*x"), "the state 'x' cannot be used in this expression", 4),
    "time in a start": (changed(BLOCK, "start = 1,", "start = 't',"),
        "the time 't' cannot be used in this expression", 8),
    "a condition for a number": (changed(BLOCK, 'der = "v"', 'der = "v > 0"'),
        "'v > 0' is a condition, but a number is needed", 8),
    "a number for a condition": (changed(RELAY, '"T > 0"', '"T"'), "write a condition", 7),
    "an unknown mode": (changed(RELAY, 'to = "off"', 'to = "of"'), "unknown mode 'of'", 7),
    "no initial mode": (changed(RELAY, "initial = true\n", ""), "has no initial mode", 3),
    "an unknown initial mode": (changed(RELAY, "initial = true\n", "") + "[components.relay]\ninitial = 'un'\n",
        "unknown initial mode 'un'", 3),
    "a variable not set": (changed(RELAY, 'set = { u = "0" }', ""), "mode off does not set 'u', but mode on", 9),
    "a reset of a parameter": (BLOCK + "[monitors.a]\nexpr = 'x'\nreset = { m = 1 }\n",
        "resets 'm', which is not a state\n    [monitors.a]\n              ^\n'm' is a parameter", 14),
    "a reset of an unknown state": (changed(RELAY, "reset = { T", "reset = { t0"), "resets 't0', which is not", 8),
    "a rate of an unknown state": (RELAY + 'der = { S = "1" }\n', "rate of an unknown state 'S'", 9),
    "a guard that leads nowhere": (changed(RELAY, ', then = "on"', ""), "guard cold has no choices", 11),
    "a choice never reached": (changed(RELAY, 'when = "T > 0", ', ""), "the choice 'on' is never reached", 8),
    "two owners of a rate": (RELAY + 'der = { T = "1" }\n[components.two.modes.m]\nder = { T = "2" }\n',
        "components relay and two both set the rate of 'T'", 13),
    "a circle among parameters": (changed(BLOCK, "m = 1.0", 'm = "k/4"'), "m -> k -> m", None),
    "a circle among definitions": (BLOCK + '[definitions]\na = "b"\nb = "a"\n', "a -> b -> a", None),
    "a circle through a variable": (changed(RELAY, '"3"', '"d"') + '[definitions]\nd = "2*u"\n', "d -> u -> d", 5),
    "definitions that explode": (
        BLOCK + '[definitions]\nd0 = "x*x"\n' + "".join(f'd{i} = "d{i - 1}*d{i - 1}"\n' for i in range(1, 99)),
        "at most 20000 are allowed", 28),
    "a power bomb in pieces": (changed(BLOCK, "-k*x", "-k*x**(d*d)") + '[definitions]\nd = "3**4"\n', "6561", 9),
    "reserved name": (changed(BLOCK, "mu = 0.3", "pi = 3\nmu = 0.3"), "'pi': the name is reserved", 5),
    "a function's name": (changed(BLOCK, "mu = 0.3", "exp = 3\nmu = 0.3"), "reserved", 5),
    "a word of Python": (changed(BLOCK, "mu = 0.3", "lambda = 3\nmu = 0.3"), "reserved", 5),
    "a name that is none": (changed(BLOCK, "mu = 0.3", '"a b" = 3\nmu = 0.3'), "parameter 'a b': not a valid name", 5),
    "a name that is empty": (changed(BLOCK, "mu = 0.3", '"" = 3\nmu = 0.3'), "not a valid name", 5),
    "a Greek name": (changed(BLOCK, "mu = 0.3", '"\u03bc" = 3\nmu = 0.3'), "ASCII", 5),
    "two things of one name": (changed(BLOCK, "mu = 0.3", "x = 3\nmu = 0.3"), "used twice", 9),
    "a contact named as a state": (changed(BLOCK, "[contacts.f]", "[contacts.x]"), "used twice", 10),
    "a model's name with a path": (changed(BLOCK, '"block"', '"../block"'), "'../block': not a valid name", None),
    "an output named as something else": (BLOCK + '[outputs]\nx = "2*x"\n', "rename the output", 15),
    "an output in an unknown mode": (BLOCK + '[outputs]\ng = { expr = "x", modes = { "f.stuck" = 1 } }\n',
        "unknown COMPONENT.MODE 'f.stuck'", 15),
    "an output of an output": (BLOCK + '[outputs]\np = "f*v"\nq = "2*p"\n',
        "output q: 'p' is an output, which expressions cannot use\n    2*p\ndeclare 'p' under [definitions]", 16),
    "a rate of an output": (changed(BLOCK, '"v" }', '"p" }') + '[outputs]\np = "v"\n',
        "state x, der: 'p' is an output, which expressions cannot use", 8),
    "an output of one by modes": (BLOCK + '[outputs]\np = { expr = "f*v", modes = { "f.stick" = 0 } }\nq = "2*p"\n',
        "write 'f*v' instead, since the output depends on the mode", 16),
    "an output in a parameter": (changed(BLOCK, "4*m", "4*p") + '[outputs]\np = "v"\n',
        "the output 'p' cannot be used in this expression", 4),
    "an output of nothing": (BLOCK + '[outputs]\nu = "u"\n', "output u: unknown name 'u'", 15),
    "no states": ("title = 'x'\n", "model scene has no states", None),
    "an infinite parameter": (changed(BLOCK, "m = 1.0", "m = inf"), "inf is not finite", 3),
    "a parameter that overflows": (changed(BLOCK, "4*m", "1e300*(m + 1e300)"), "the result is inf", 4),
    "a start without value": (changed(BLOCK, "start = 1,", "start = 'log(-m)',"), "evaluated with m = 1", 8),
    "nominal zero": (changed(BLOCK, "start = 1,", "start = 1, nominal = 0,"), "'nominal' cannot be 0", 8),
    "negative normal load": (changed(BLOCK, "N = 2.0", "N = -2.0"), "the normal load cannot be -2 (N)", 10),
    "negative load by expression": (changed(BLOCK, '"N"', '"N - 3*d"') + "[definitions]\nd = 'm'\n",
        "the normal load cannot be -1 (N - 3*d)", 10),
    "negative friction": (changed(BLOCK, "mu = 0.3", "mu = -0.3"), "the stick limit cannot be -0.6", 10),
    "static below kinetic": (changed(OWN, "a - b", "a + b"), "the stick limit 1 is below", 10),
    "a velocity without state": (changed(BLOCK, 'velocity = "v"', 'velocity = "t"'), "contains no state", 10),
    "a velocity with a force": (changed(BLOCK, 'velocity = "v"', 'velocity = "v + w"') + '[definitions]\nw = "f"\n',
        "the velocity depends on 'f'", 10),
    "its own force in the load": (changed(BLOCK, 'normal = "N"', 'normal = "N + f"'),
        "'f' cannot be used in this expression", 12),
    "a name of the model in a law": (changed(OWN, '"N*a"', '"N*a*mu"'), "unknown name 'mu'", 17),
    "the speed in stick": (changed(OWN, '"N*a"', '"N*a + v"'), "'v' cannot be used here", 17),
    "an unused parameter of a law": (changed(OWN, "a = 0.5,", "a = 0.5, c = 1,"), "'c' is used neither", 15),
    "a parameter of a law named N": (changed(OWN, "a = 0.5,", "a = 0.5, N = 1,"), "the name of the normal load", 14),
    "an unknown argument": (changed(OWN, '"own" }', '"own", A = 1 }'), "has no parameter 'A'", 13),
    "an argument that is missing": (changed(BLOCK, ', mu = "mu"', ""), "needs a value for 'mu'", 10),
    "a circle among defaults": (changed(OWN, "a = 0.5", 'a = "b"'), "dependency among defaults of the law 'own'", 15),
    "an unknown direction": (BLOCK + "[monitors.p]\nexpr = 'v'\ndirection = 'dwon'\n", "did you mean 'down'", 14),
    "an unknown action": (BLOCK + "[monitors.p]\nexpr = 'v'\naction = 'stop'\n", "known actions", 14),
    "a reset of nothing": (BLOCK + "[monitors.p]\nexpr = 'v'\naction = 'reset'\n", "nothing to reset", 14),
    "a period of zero": (BLOCK + "[clocks.c]\nperiod = 0\n", "'period' cannot be 0", 14),
    "a negative period": (BLOCK + '[clocks.c]\nperiod = "m - 2"\n', "'period' cannot be -1 (m - 2)", 14),
    "no times": (BLOCK + "[schedules.c]\nterminate = true\n", "has neither 'times' nor 'start'", 14),
    "times and a clock": (BLOCK + "[schedules.c]\ntimes = 1\nperiod = 2\n", "has 'times' together with", 14),
    "a count without period": (BLOCK + "[schedules.c]\nstart = 1\ncount = 3\n", "count = 3 but no 'period'", 14),
    "a count of zero": (BLOCK + "[schedules.c]\nperiod = 1\ncount = 0\n", "'count' cannot be 0", 14),
    "two events of one name": (BLOCK + "[monitors]\na = 'v'\n[clocks.a]\nperiod = 1\n",
        "event 'a' is declared twice", 16),
}  # fmt: skip


@pytest.mark.parametrize("case", {**FORM, **CONTENT})
def test_place_value_and_remedy(case: str) -> None:
    text, fragment, line = {**FORM, **CONTENT}[case]
    with pytest.raises(hs.ModelError) as caught:
        hs.Model.from_toml(text, "scene.toml")
    said = str(caught.value)
    assert fragment in said
    assert caught.value.exit_code == 3
    for error in caught.value.errors:
        assert error.remedy, error
        assert error.place is not None and error.place.file == "scene.toml", error
    if line is not None:
        assert f"scene.toml:{line}: " in said


def test_what_the_cases_are_made_from_is_good() -> None:
    for text in (BLOCK, RELAY, OWN):
        hs.Model.from_toml(text)


def test_all_faults_at_once() -> None:
    form = changed(changed(BLOCK, "mu = 0.3", "mu = { vlaue = 1 }"), "-k*x", "-k*x^2")
    with pytest.raises(hs.ModelError) as caught:
        hs.Model.from_toml(form, "m.toml")
    assert [error.place.line for error in caught.value.errors if error.place] == [5, 9]
    content = (
        changed(changed(BLOCK, "-k*x", "-kk*x"), 'normal = "N"', 'normal = "NN"')
        + "[clocks.c]\nperiod = 1\nset = { q = 1 }\n"
    )
    with pytest.raises(hs.ModelError) as caught:
        hs.Model.from_toml(content, "m.toml")
    assert [error.place.line for error in caught.value.errors if error.place] == [9, 12, 14]
    assert str(caught.value).startswith("model block: 3 errors\nm.toml:")


def test_python_models_are_checked_alike() -> None:
    with pytest.raises(hs.ModelError, match="unknown name 'g'"):
        block(states=[hs.State("x", 1, "v"), hs.State("v", 0, "g - f")]).validate()
    with pytest.raises(hs.ModelError, match=r"contact f: the law 'coulomb' needs a value for 'mu'"):
        block(contacts=[hs.Contact("f", "v", "N", "coulomb")]).validate()
    surface = hs.Surface("v", "r", "a", "b", "c", 0, 0)
    sides = [hs.Mode("a", set={"r": 1}), hs.Mode("b", set={"r": -1})]
    with pytest.raises(hs.ModelError, match="surface: unknown mode 'c'"):
        block(components=[hs.Component("s", sides, surface=surface)]).validate()
    held = hs.Mode("c", [hs.Guard("g", "r", "a")], set={"r": 0})
    with pytest.raises(hs.ModelError) as caught:
        block(components=[hs.Component("s", [*sides, held], surface=surface)]).validate()
    assert "sets 'r', but the solver computes it in this mode" in str(caught.value)
    assert "has choices, but the surface selects the next mode" in str(caught.value)
    unguarded = [*sides, hs.Mode("c", [hs.Guard("g", "1 - r")])]
    with pytest.raises(hs.ModelError) as caught:
        block(components=[hs.Component("s", unguarded, surface=surface)]).validate()
    assert "mode a has no guard, so the surface could never be reached" in str(caught.value)
    assert "mode c needs one guard for each side but has only 1" in str(caught.value)
    with pytest.raises(hs.ModelError, match="both choices and a fatal message"):
        block(components=[hs.Component("s", [hs.Mode("a", [hs.Guard("g", "x", "a", "end")])])]).validate()


def test_rounding_in_a_law_with_equal_coefficients_is_no_fault() -> None:
    law = {"mu_s": 0.1 + 0.2, "mu_k": 0.3, "v_s": 0.1}
    for mu_s, mu_k in ((0.1 + 0.2, 0.3), (0.3, 0.1 + 0.2), (0.7, 0.7)):
        contact = hs.Contact("f", "v", "N", "stribeck", {**law, "mu_s": mu_s, "mu_k": mu_k})
        block(contacts=[contact], parameters={"m": 1, "k": 1, "N": 17.3}).validate()


TEXTS = [
    BLOCK,
    RELAY,
    OWN,
    everything().to_toml(),
    *(hs.load(info.name).to_toml() for info in hs.list_models()),
]
SCRAPS = [*"='[]{},.\n\\#xvt0", '"', "-1", "nan", "true", "1e999", "9**9**9"]


@given(st.sampled_from(TEXTS), st.data())
def test_a_damaged_file_is_a_model_or_a_model_error(text: str, data: st.DataObject) -> None:
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        length = data.draw(st.sampled_from([0, 0, 1, 2, 10, 60]))
        text = text[:start] + data.draw(st.sampled_from([*SCRAPS, ""])) + text[start + length :]
    try:
        hs.Model.from_toml(text, "m.toml")
    except hs.ModelError as error:
        assert all(single.remedy and single.place for single in error.errors)


values = st.recursive(
    st.one_of(
        st.integers(-3, 3), st.booleans(), st.sampled_from(["x", "v", "on", "1", "", "N*mu", "coulomb", "up"])
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.sampled_from(
                ["x", "v", "f", "start", "der", "to", "then", "expr", "set", "name", "law", "modes", "kind"]
            ),
            inner,
            max_size=3,
        ),
    ),
    max_leaves=6,
)


def _inline(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return json.dumps(value)


@given(st.data())
def test_a_wrong_value_anywhere_is_a_model_or_a_model_error(data: st.DataObject) -> None:
    tables = (
        "parameters", "states", "discrete", "definitions", "inputs", "laws", "contacts", "modes", "components",
        "monitors", "schedules", "clocks", "outputs", "initial", "name", "schema", "look",
    )  # fmt: skip
    chosen = data.draw(st.dictionaries(st.sampled_from(tables), values, min_size=1, max_size=3))
    text = "".join(f"{key} = {_inline(value)}\n" for key, value in chosen.items())
    try:
        hs.Model.from_toml(text, "m.toml")
    except hs.ModelError as error:
        assert all(single.remedy and single.place for single in error.errors)
