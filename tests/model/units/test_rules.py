"""Each rule of the check of units: what is a fault, with its message and line, and what is not."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.model.units.faults import unit_faults, unit_rows

HEAD = """[parameters]
m = { value = 1, unit = "kg" }
k = { value = 50, unit = "N/m" }
c = { value = 1, unit = "N s/m" }
F = { value = 1, unit = "N" }
L = { value = 1, unit = "m" }
gap = { value = 1, unit = "mm" }
omega = { value = 1, unit = "rad/s" }
f0 = { value = 1, unit = "Hz" }
n = { value = 60, unit = "rpm" }
alpha = { value = 1, unit = "deg" }
ratio = { value = 1, unit = "1" }
p = 2
free = 3
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 0, unit = "m/s", der = "-k*x/m" }
phi = { start = 0, unit = "rad", der = "omega" }
"""
FIRST = HEAD.count("\n") + 2  # the line after the table that a test adds


def faults(text: str) -> list[str]:
    """The warnings on a model with this text after the head, each in one line with its remedy."""
    return [caution.sentence for caution in unit_faults(hs.Model.from_toml(HEAD + text, path="m.toml"))]


def of_expression(expr: str, unit: str = "") -> list[str]:
    return faults(f'[outputs]\ny = {{ expr = "{expr}", unit = "{unit}" }}\n')


@pytest.mark.parametrize(
    ("expr", "unit"),
    [
        ("k*x + c*v - F", "N"),
        ("0", "N"),
        ("x - 0.5", "m"),  # a number is a value in the unit of the other side
        ("0.5 - x", "m"),
        ("max(x - 0.1, 0)", "m"),
        ("k*x**2/2 + m*v**2/2", "J"),
        ("sqrt(k/m)*t", "1"),
        ("sin(omega*t + 0.3)", "1"),
        ("sin(2*pi*f0*t)", "1"),
        ("2*pi*f0", "rad/s"),
        ("omega/(2*pi)", "Hz"),
        ("2*pi*n/60", "rad/s"),  # an explicit conversion: 60 may have a unit
        ("1000*x", "mm"),
        ("alpha*pi/180", "rad"),
        ("sin(10*t)", "1"),
        ("9.81*m", "N"),
        ("0.3*v**1.7", "N"),
        ("-4*x - 0.4*v", "m/s^2"),
        ("F*(v/2)**p", "N"),
        ("F*(x/L)**p", "N"),
        ("F*abs(v)**p", "N"),  # a symbolic exponent: unknown
        ("free*x + F", "N"),
        ("free + F", "N"),
        ("atan2(x, L)", "rad"),
        ("exp(-x/L)*F", "N"),
        ("mod(x, L) + round(x/L)*L", "m"),
        ("F*sign(v)", "N"),
        ("x if v > 0 else L", "m"),
        ("(x/L)**(1/3)*F", "N"),
        ("sqrt(x**2 + L**2)", "m"),
        ("phi + omega*t", "rad"),
        ("omega*L", "m/s"),
        ("x", "widgets"),
        ("x", "J/kg K"),
    ],
)
def test_no_fault(expr: str, unit: str) -> None:
    assert of_expression(expr, unit) == []


@pytest.mark.parametrize(
    ("expr", "unit", "message"),
    [
        ("x + gap", "m", "'gap' is in mm, but 'x' is in m"),
        ("x + v", "", "'v' is in m/s, but 'x' is in m"),
        ("k*x - c*v - L", "", "'L' is in m, but 'k*x' is in N"),
        ("F - L*v + k*x", "", "'L*v' is in m^2/s, but 'F' is in N"),
        ("k*x**2/2 + m*v/2", "", "'m*v/2' is in N s, but 'k*x**2/2' is in N m"),
        ("min(x, gap)", "", "'gap' is in mm, but 'x' is in m"),
        ("atan2(x, v)", "", "'v' is in m/s, but 'x' is in m"),
        ("x if v > 0 else gap", "", "'gap' is in mm, but 'x' is in m"),
        ("1 if n > omega else 0", "", "'omega' is in rad/s, but 'n' is in rpm"),
        ("1 if omega > f0 and x > 0 else 0", "", "'f0' is in Hz, but 'omega' is in rad/s"),
        ("sin(x)", "", "'x' is in m, but the argument of sin is a pure number"),
        ("exp(-t)", "", "'-t' is in s, but the argument of exp is a pure number"),
        ("floor(x)", "", "'x' is in m, but the argument of floor is a pure number"),
        ("mod(x, ratio)", "", "'ratio' is a pure number, but 'x' is in m"),
        ("sin(alpha)", "", "'alpha' is in deg, but the argument of sin is a pure number"),
        ("sin(f0*t)", "", "'f0*t' is in turn, but the argument of sin is a pure number"),
        ("log(x/gap)", "", "'x/gap' is in 1000, but the argument of log is a pure number"),
        ("L**(x/L)*ratio**x", "", "'x' is in m, but an exponent is a pure number"),
        ("k*x", "kN", "'k*x' is in N, but output y is in kN"),
        ("k*x", "N/m", "'k*x' is in N, but output y is in N/m"),
        ("f0", "rad/s", "'f0' is in Hz, but output y is in rad/s"),
        ("sqrt(k*m)", "N", "'sqrt(k*m)' is in N s/m, but output y is in N"),
        ("abs(x)**1.5", "m", "'abs(x)**1.5' is in m^(3/2), but output y is in m"),
        ("F*ratio/L", "N", "'F*ratio/L' is in N/m, but output y is in N"),
    ],
)
def test_a_fault_names_line_expression_term_and_both_units(expr: str, unit: str, message: str) -> None:
    (found,) = of_expression(expr, unit)
    assert found.startswith(f"m.toml:{FIRST}: output y: {message}: ")


PLACES = {
    "parameter": ('[parameters.w]\nvalue = "sqrt(k)/m"\nunit = "1/s"\n', "parameter w: 'sqrt(k)/m' is in ", 0),
    "start": ('[states.y]\nstart = "F"\nunit = "m"\nder = 0\n', "state y, start: 'F' is in N, but y is in m", 0),
    "rate": (
        '[states.y]\nstart = 0\nunit = "m"\nder = "F/m"\n',
        "state y, der: 'F/m' is in m/s^2, but the rate of y is in m/s", 2,
    ),
    "rate in a mode": (
        '[components.a.modes.b]\nder = { x = "F" }\n',
        "component a, mode b, der of x: 'F' is in N, but the rate of x is in m/s", 0,
    ),
    "discrete": (
        '[discrete]\ny = { start = "F", unit = "m" }\n',
        "discrete state y, start: 'F' is in N, but y is in m", 0,
    ),
    "definition": ('[definitions]\ny = "x + v"\n', "definition y: 'v' is in m/s, but 'x' is in m", 0),
    "amplitude": (
        '[inputs.u]\nkind = "wave"\nshape = "sine"\nperiod = 1\namplitude = "F"\nunit = "m"\n',
        "input u, amplitude: 'F' is in N, but u is in m", 3,
    ),
    "period": (
        '[inputs.u]\nkind = "wave"\nshape = "sine"\nperiod = "omega"\n',
        "input u, period: 'omega' is in rad/s, but t is in s", 2,
    ),
    "chirp": (
        '[inputs.u]\nkind = "chirp"\nf0 = "omega"\nf1 = 2\nduration = 1\n',
        "input u, f0: 'omega' is in rad/s, but a frequency is in Hz", 1,
    ),
    "velocity": (
        '[contacts.f]\nvelocity = "v - x"\nnormal = "F"\nlaw = { name = "coulomb", mu = "ratio" }\n',
        "contact f, velocity: 'x' is in m, but 'v' is in m/s", 0,
    ),
    "load": (
        '[contacts.f]\nvelocity = "v"\nnormal = "F - x"\nlaw = { name = "coulomb", mu = "ratio" }\n',
        "contact f, normal: 'x' is in m, but 'F' is in N", 1,
    ),
    "law": (
        '[contacts.f]\nvelocity = "v"\nnormal = "F"\nlaw = { name = "viscous", mu = "ratio", c = "k" }\n',
        "contact f, law viscous, slip: 'k*v' is in N/s, but 'ratio*F' is in N", 2,
    ),
    "law with states": (
        '[contacts.f]\nvelocity = "v"\nnormal = "F"\nlaw = { name = "lugre", mu_s = "ratio", mu_k = "ratio", '
        'v_s = "L", sigma_0 = "k", sigma_1 = "c", sigma_2 = "c" }\n',
        "'-(v/L)**2' is in 1/s^2, but the argument of exp is a pure number", 2,
    ),
    "force of a law": (
        '[contacts.f]\nvelocity = "v"\nnormal = "F"\nlaw = { name = "dahl", mu = "ratio", sigma = "c" }\n',
        "contact f, law dahl, rate of z: 'c/(ratio*F)*abs(v)*f_z' is in m, but 'v' is in m/s", 2,
    ),
    "surface": ('[surfaces]\nu = "x + v"\n', "surface u: 'v' is in m/s, but 'x' is in m", 0),
    "above": (
        '[surfaces.u]\nexpr = "x"\nabove = { a = "F" }\nbelow = { a = "x" }\n',
        "surface u, a below: 'x' is in m, but a is in N", 2,
    ),
    "dimension of a velocity": (
        '[contacts.f]\nvelocity = "x"\nnormal = "F"\nlaw = { name = "coulomb", mu = "ratio" }\n',
        "contact f, velocity: 'x' is in m, but a relative velocity is in m/s", 0,
    ),
    "dimension of a gap": (
        '[impacts.q]\ngap = "v"\nrestitution = 0.5\n', "impact q, gap: 'v' is in m/s, but a gap is in m", 0,
    ),
    "load that is no force": (
        '[states.y]\nstart = 0\nunit = "m/s"\nder = "(F - f)/m"\n'
        '[contacts.f]\nvelocity = "v"\nnormal = "k"\nlaw = { name = "coulomb", mu = "ratio" }\n'
        '[outputs]\nf = { expr = "f", unit = "N" }\n',
        "contact f, law coulomb, slip: 'ratio*k' is in N/m, but f is in N", 5,
    ),
    "gap": ('[impacts.q]\ngap = "x - gap"\nrestitution = 0.5\n', "impact q, gap: 'gap' is in mm, but 'x' is in m", 0),
    "restitution": (
        '[impacts.q]\ngap = "x"\nrestitution = "L"\n',
        "impact q, restitution: 'L' is in m, but a ratio of speeds is a pure number", 1,
    ),
    "guard": (
        '[components.a.modes.b]\nguards.stop = { expr = "x - v", then = "b" }\n',
        "component a, mode b, guard stop: 'v' is in m/s, but 'x' is in m", 0,
    ),
    "condition": (
        '[components.a.modes.b]\nguards.stop = { expr = "x", then = [{ when = "v > L", to = "b" }, { to = "b" }] }\n',
        "component a, mode b, guard stop, when: 'L' is in m, but 'v' is in m/s", 0,
    ),
    "reset": (
        '[components.a.modes.b]\nguards.stop = { expr = "x", then = { to = "b", reset = { v = "x" } } }\n',
        "component a, mode b, guard stop, reset of v: 'x' is in m, but v is in m/s", 0,
    ),
    "set": (
        '[components.a]\ninitial = "b"\nmodes.b = { set = { y = "x" } }\nmodes.d = { set = { y = "v" } }\n',
        "component a, mode d, set y: 'v' is in m/s, but y is in m", 2,
    ),
    "monitor": ('[monitors]\ny = "x - v"\n', "monitor y: 'v' is in m/s, but 'x' is in m", 0),
    "reset of a monitor": (
        '[monitors]\ny = { expr = "x - 1", reset = { v = "+= x" } }\n',
        "monitor y, reset of v: 'x' is in m, but v is in m/s", 0,
    ),
    "clock": ('[clocks.tick]\nperiod = "L"\n', "schedule tick, period: 'L' is in m, but t is in s", 0),
    "reset of a clock": (
        '[clocks.tick]\nperiod = 1\nset = { v = "x" }\n', "schedule tick, reset of v: 'x' is in m, but v is in m/s", 1,
    ),
    "times": ('[schedules]\nbump = { times = [1, "L"] }\n', "schedule bump, times: 'L' is in m, but t is in s", 0),
    "output in a mode": (
        '[components.a.modes.b]\n[outputs.y]\nexpr = "x"\nunit = "m"\nmodes = { "a.b" = "v" }\n',
        "output y in a.b: 'v' is in m/s, but output y is in m", 4 - 1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_every_kind_of_expression_is_checked(place: str) -> None:
    text, message, line = PLACES[place]
    (found,) = faults(text)
    assert message in found and found.startswith(f"m.toml:{FIRST + line}: ")


@pytest.mark.parametrize(
    ("expr", "unit", "factor", "of_factor"),
    [
        ("gap", "m", 1e-3, "m/mm"),
        ("n", "rad/s", 2 * math.pi / 60, "(rad/s)/rpm"),
        ("f0", "rad/s", 2 * math.pi, "(rad/s)/Hz"),
        ("omega", "Hz", 1 / (2 * math.pi), "Hz/(rad/s)"),
        ("alpha", "rad", math.pi / 180, "rad/deg"),
        ("k*x", "kN", 1e-3, "kN/N"),
    ],
)
def test_the_remedy_of_a_scale_is_a_factor_that_mends_it(
    expr: str, unit: str, factor: float, of_factor: str
) -> None:
    (found,) = of_expression(expr, unit)
    assert found.endswith(f'a parameter that converts, {{ value = {factor:.9g}, unit = "{of_factor}" }}')
    added = f'[parameters.q]\nvalue = {factor!r}\nunit = "{of_factor}"\n'
    assert faults(f'{added}[outputs]\ny = {{ expr = "q*{expr}", unit = "{unit}" }}\n') == []


def test_a_caret_points_at_the_term() -> None:
    (caution,) = unit_faults(hs.Model.from_toml(f'{HEAD}[outputs]\ny = "k*x + c*v - L"\n'))
    lines = str(caution).splitlines()
    assert lines[2].index("^") == lines[1].index("L")


def test_the_unit_of_a_connected_input_is_checked_in_the_whole_model(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text(
        '[inputs]\nu = { kind = "connected", unit = "m" }\n[states]\ny = { start = 0, unit = "m s", der = "u" }\n'
    )
    (tmp_path / "inner.toml").write_text(
        '[inputs]\nw = { kind = "connected", unit = "m" }\n[use]\np = { model = "part.toml", connect = { u = "w" } }\n'
    )
    path = tmp_path / "whole.toml"
    path.write_text(HEAD + '[use]\na = { model = "part.toml", connect = { u = "v" } }\n')
    (caution,) = unit_faults(hs.load(path))
    assert "definition a.u: 'v' is in m/s, but a.u is in m" in caution.message
    assert caution.place is not None and caution.place.line == FIRST
    path.write_text(HEAD + '[use]\na = { model = "inner.toml", connect = { w = "x" } }\n')
    assert not [*unit_faults(hs.load(path).with_(m=2))]
    path.write_text(HEAD + '[use]\na = { model = "inner.toml", connect = { w = "gap" } }\n')
    assert ["a.w is in m" in one.message for one in unit_faults(hs.load(path))] == [True]


def test_names_without_units_inherit_what_most_expressions_tell() -> None:
    model = hs.Model.from_toml(
        HEAD
        + '[discrete]\nheld = "F"\n[definitions]\nS = "k*x + c*v"\n'
        + '[inputs.a]\nkind = "table"\ntimes = [0, 1]\nvalues = [0, 1]\n'
        + '[states.y]\nstart = 0\nunit = "m/s"\nder = "a - f/m"\n'
        + '[contacts.f]\nvelocity = "v"\nnormal = "free"\nlaw = { name = "dahl", mu = 0.3, sigma = "k" }\n'
    )
    rows = {what: (unit, known) for what, unit, known in unit_rows(model)}
    assert rows["held"] == rows["S"] == rows["f"] == ("N", "inferred")
    assert rows["a"] == ("m/s^2", "inferred")
    assert rows["f_z"] == ("m", "inferred")
    assert rows["free"] == ("", "unknown")
    assert rows["t"] == ("s", "inferred")
    assert rows["contact f, normal"] == ("", "unknown: free has no known unit")


def test_a_unit_in_python_is_checked_without_a_line() -> None:
    fall = [hs.State("h", 10, der="w", unit="m"), hs.State("w", 0, der="h", unit="m/s")]
    (caution,) = unit_faults(hs.Model("fall", states=fall))
    assert caution.sentence.startswith("state w, der: 'h' is in m, but the rate of w is in m/s^2: ")


def test_states_in_python_have_a_warning_each() -> None:
    pair = [hs.State(name, 0, der="h", unit="m/s") for name in ("a", "b")]
    found = [*unit_faults(hs.Model("pair", states=[hs.State("h", 0, der=1, unit="m"), *pair]))]
    assert [one.message.partition(",")[0] for one in found] == ["state a", "state b"]


def test_a_fault_of_a_repeated_part_is_one_warning(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text('[states]\ny = { start = 0, unit = "m/s", der = "y" }\n')
    path = tmp_path / "whole.toml"
    path.write_text('[use]\nblock = { model = "part.toml", repeat = 12 }\n')
    (caution,) = unit_faults(hs.load(path))
    assert (
        "state block1.y, der: 'block1.y' is in m/s, but the rate of block1.y is in m/s^2" in caution.message
    )


def test_a_power_beyond_doubles_and_deep_sums_are_no_problem() -> None:
    text = '[parameters.q]\nvalue = 1\nunit = "1e300 m"\n'
    assert faults(f'{text}[outputs]\ny = "q**9/q**9 + q**-9 + q**9"\n')[0].startswith("m.toml:")
    nested = "held"
    for _ in range(25):
        nested = f"k*(x + ({nested})/k)"
    assert faults(f'[discrete]\nheld = 0\n[definitions]\ny = "{nested}"\n') == []
