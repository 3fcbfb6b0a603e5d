"""Models that are right, with empirical laws and numbers in many forms, have no warning about units."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.model.units.faults import UNKNOWN, unit_faults, unit_rows

ROOT = Path(__file__).parents[3]
FILES = sorted([*(ROOT / "models").glob("*.toml"), *(ROOT / "docs" / "examples" / "parts").glob("*.toml")])

# Parameters, states and other tables of models that occur in practice; units are declared where a user would.
MODELS = {
    "pendulum with small numbers": """
[parameters]
l = { value = 0.5, unit = "m" }
[states]
phi = { start = 1, unit = "rad", der = "w" }
w = { start = 0, unit = "rad/s", der = "-9.81/l*sin(phi) - 0.1*w" }
""",
    "fall with quadratic drag, all numbers": """
[states]
h = { start = 10, unit = "m", der = "w" }
w = { start = 0, unit = "m/s", der = "-9.81 - 0.05*w*abs(w)" }
[monitors]
half = "h - 5"
""",
    "drag with a declared constant": """
[parameters]
g = { value = 9.81, unit = "m/s^2" }
rho = { value = 1.2, unit = "kg/m^3" }
A = { value = 0.01, unit = "m^2" }
cd = { value = 0.47, unit = "1" }
m = { value = 0.1, unit = "kg" }
[states]
h = { start = 10, unit = "m", der = "w" }
w = { start = 0, unit = "m/s", der = "-g - rho*cd*A*w*abs(w)/(2*m)" }
""",
    "spring with a cubic term": """
[parameters]
m = { value = 1, unit = "kg" }
k1 = { value = 100, unit = "N/m" }
k3 = { value = 1e4, unit = "N/m^3" }
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 1, unit = "m/s", der = "-(k1*x + k3*x**3)/m" }
[outputs]
energy = { expr = "m*v**2/2 + k1*x**2/2 + k3*x**4/4", unit = "J" }
""",
    "Hertzian contact, exponent 3/2": """
[parameters]
m = { value = 1, unit = "kg" }
kh = { value = 1e7, unit = "N/m^(3/2)" }
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 1, unit = "m/s", der = "-kh*max(x, 0)**1.5/m" }
""",
    "power law with a measured exponent": """
[parameters]
m = { value = 1, unit = "kg" }
c = { value = 3.2, unit = "N/(m/s)^0.7" }
[states]
v = { start = 1, unit = "m/s", der = "-c*v**0.7/m" }
""",
    "power law with a symbolic exponent": """
[parameters]
m = { value = 1, unit = "kg" }
c = { value = 3.2, unit = "N" }
n = 0.7
v0 = { value = 1, unit = "m/s" }
[states]
v = { start = 1, unit = "m/s", der = "-c*(v/v0)**n/m" }
w = { start = 1, unit = "m/s", der = "-3*w**n" }
""",
    "Stribeck friction in numbers": """
[parameters]
m = { value = 1, unit = "kg" }
N = { value = 10, unit = "N" }
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 1, unit = "m/s", der = "(5*sin(10*t) - 100*x - f)/m" }
[laws.measured]
slip = "N*(0.3 + 0.2*exp(-v/0.01)) + 0.4*v"
stick = "0.5*N"
[contacts.f]
velocity = "v"
normal = "N"
law = "measured"
""",
    "temperature with an Arrhenius rate": """
[parameters]
R = { value = 8.314, unit = "J/(mol K)" }
Ea = { value = 5e4, unit = "J/mol" }
k0 = { value = 1e6, unit = "1/s" }
[states]
c = { start = 1, unit = "mol/L", der = "-k0*exp(-Ea/(R*T))*c" }
T = { start = 300, unit = "K", der = "0.1*(350 - T)" }
""",
    "pressure and flow through an orifice": """
[parameters]
Cd = { value = 0.6, unit = "1" }
A = { value = 1e-4, unit = "m^2" }
rho = { value = 850, unit = "kg/m^3" }
V = { value = 1e-3, unit = "m^3" }
B = { value = 1.4e9, unit = "Pa" }
p_s = { value = 1e7, unit = "Pa" }
[states]
p = { start = 0, unit = "Pa", der = "B/V*Cd*A*sqrt(2*abs(p_s - p)/rho)*sign(p_s - p)" }
""",
    "millimetres, newtons and milliseconds": """
[parameters]
k = { value = 0.1, unit = "N/mm" }
m = { value = 1, unit = "N ms^2/mm" }
F = { value = 5, unit = "N" }
omega = { value = 0.01, unit = "rad/ms" }
[states]
x = { start = 0, unit = "mm", der = "v" }
v = { start = 0, unit = "mm/ms", der = "(F*sin(omega*t) - k*x)/m" }
""",
    "converted by declared factors": """
[parameters]
n = { value = 1500, unit = "rpm" }
to_rad = { value = 0.10471975511965977, unit = "rad/s/rpm" }
mm = { value = 1e-3, unit = "m/mm" }
e = { value = 2, unit = "mm" }
[states]
phi = { start = 0, unit = "rad", der = "n*to_rad" }
[outputs]
y = { expr = "mm*e*sin(phi)", unit = "m" }
""",
    "converted by numbers": """
[parameters]
n = { value = 1500, unit = "rpm" }
f = { value = 50, unit = "Hz" }
alpha = { value = 30, unit = "deg" }
[states]
phi = { start = "alpha*pi/180", unit = "rad", der = "2*pi*n/60" }
[outputs]
y = { expr = "sin(2*pi*f*t)", unit = "1" }
percent = { expr = "100*sin(phi)", unit = "%" }
""",
    "motor with current and torque": """
[parameters]
R = { value = 1, unit = "ohm" }
L = { value = 1, unit = "mH" }
K = { value = 0.1, unit = "N m/A" }
J = { value = 1e-4, unit = "kg m^2" }
U = { value = 24, unit = "V" }
H = { value = 1e-3, unit = "H" }
[states]
i = { start = 0, unit = "A", der = "(U - R*i - K*w)/H" }
w = { start = 0, unit = "rad/s", der = "K*i/J" }
[outputs]
power = { expr = "U*i", unit = "W" }
""",
    "controller with gains in numbers": """
[parameters]
m = { value = 2, unit = "kg" }
target = { value = 1, unit = "m" }
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 0, unit = "m/s", der = "(40*(target - x) - 4*v + 2*I)/m" }
I = { start = 0, unit = "m s", der = "target - x" }
[surfaces]
u = "x + 2*v"
""",
    "thermostat in hours": """
[parameters]
tau = { value = 2, unit = "h" }
T_out = { value = 5, unit = "degC" }
q = { value = 25, unit = "K" }
[states]
T = { start = 15, unit = "degC", der = "(T_out + q - T)/tau" }
[schedules]
night = { start = 8, period = 24, reset = { T = "T - 1" } }
""",
    "a count and a sampled value": """
[parameters]
T_s = { value = 0.01, unit = "s" }
k = { value = 10, unit = "N/m" }
m = { value = 1, unit = "kg" }
[states]
x = { start = 1, unit = "m", der = "v" }
v = { start = 0, unit = "m/s", der = "-u/m" }
[discrete]
u = 0
ticks = 0
[clocks.c]
period = "T_s"
set = { u = "k*x", ticks = "ticks + 1" }
""",
    "rate and state friction": """
[parameters]
m = { value = 1, unit = "kg" }
k = { value = 1, unit = "N/m" }
N = { value = 1, unit = "N" }
V = { value = 1e-6, unit = "m/s" }
L = { value = 1e-5, unit = "m" }
mu0 = { value = 0.6, unit = "1" }
[states]
x = { start = 0, unit = "m", der = "V - v" }
v = { start = 1e-6, unit = "m/s", der = "(k*x - f)/m" }
[contacts.f]
velocity = "v"
normal = "N"
law = { name = "rate-and-state", mu_0 = "mu0", a = 0.01, b = 0.015, L = "L", v_0 = "V" }
""",
    "growth per hour in a unit that is not known": """
[parameters]
r = { value = 0.3, unit = "1/h" }
K = { value = 1e9, unit = "cells" }
[states]
n = { start = 1e3, unit = "cells", der = "r*n*(1 - n/K)" }
""",
    "amplitude in micrometres, tested law": """
[parameters]
N = { value = 10, unit = "N" }
m = { value = 1, unit = "kg" }
sigma = { value = 1e6, unit = "N/m" }
mu = { value = 0.3, unit = "1" }
[inputs.F]
kind = "wave"
shape = "sine"
period = 0.1
amplitude = 2
unit = "N"
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 0, unit = "m/s", der = "(F - f)/m" }
[contacts.f]
velocity = "v"
normal = "N"
law = { name = "dahl", mu = "mu", sigma = "sigma" }
[outputs]
um = { expr = "1e6*x", unit = "um" }
""",
    "table of a law": """
[parameters]
N = { value = 10, unit = "N" }
m = { value = 1, unit = "kg" }
[states]
v = { start = 1, unit = "m/s", der = "-f/m" }
[laws.points]
slip = "mu*N"
stick = "mu*N"
tables.mu = { at = [0, 0.1, 1], values = [0.5, 0.4, 0.35] }
[contacts.f]
velocity = "v"
normal = "N"
law = "points"
""",
}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_alarm_on_packaged_models(path: Path) -> None:
    assert [str(caution) for caution in unit_faults(hs.load(path))] == []


@pytest.mark.parametrize("name", MODELS)
def test_no_alarm_on_a_right_model(name: str) -> None:
    model = hs.Model.from_toml(MODELS[name])
    assert [str(caution) for caution in unit_faults(model)] == []
    assert any(known != UNKNOWN for _, _, known in unit_rows(model))


def test_a_model_without_units_is_not_checked() -> None:
    model = hs.Model.from_toml(
        '[states]\nx = { start = 1, der = "v" }\nv = { start = 0, der = "-x - 0.1*v + sin(t)" }\n'
    )
    assert not [*unit_rows(model)] and not [*unit_faults(model)]
