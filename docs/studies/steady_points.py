"""Random points of models with friction, impacts and switching, for docs/studies/steady_states.py."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import hybridsim as hs

Rng = np.random.Generator


@dataclass(frozen=True)
class Friction:
    """A mass on a spring with a harmonic force, as numbers for a program that shares nothing with hybridsim.

    m x'' + c x' + k x + f = F sin(w t). limit: largest friction in stick; slip: friction at a speed above zero.
    """

    m: float
    c: float
    k: float
    F: float
    w: float
    limit: float
    slip: Callable[[float], float]


@dataclass(frozen=True)
class Point:
    """A model with its random numbers.

    Parameters
    ----------
    kind : the kind of model, a row of the table.
    model : argument of `hs.steady_state`.
    plain : the model that the brute force runs; the same, or the ordinary model of a mechanical system.
    period : period of the forcing as the generator knows it, or None without forcing.
    time : about a period of the motion.
    swept : a parameter for `hs.sweep`, or nothing.
    frequency : whether this parameter is the angular frequency of the forcing.
    friction : the same numbers for SciPy, if the model is a single mass with harmonic forcing.
    """

    kind: str
    model: hs.Model | hs.MechanicalSystem
    plain: hs.Model
    period: float | None
    time: float
    swept: str = ""
    frequency: bool = False
    friction: Friction | None = None


# -- numbers -----------------------------------------------------------------------------------------------------


def drawn(rng: Rng, low: float, high: float) -> float:
    """A number with four digits, uniform in its logarithm; low may be zero, and the number is then uniform."""
    value = rng.uniform(low, high) if low <= 0.0 else math.exp(rng.uniform(math.log(low), math.log(high)))
    return float(f"{value:.4g}")


def forced(kind: str, model: hs.Model, omega: str = "omega", **further: object) -> Point:
    """A point of a model whose parameter `omega` is the angular frequency of the forcing."""
    period = 2.0 * math.pi / model.parameter_values()[omega]
    return Point(kind, model, model, period, period, omega, True, **further)  # type: ignore[arg-type]


def free(kind: str, model: hs.Model, time: float, swept: str = "", **further: object) -> Point:
    """A point of a model without forcing."""
    return Point(kind, model, model, None, time, swept, **further)  # type: ignore[arg-type]


def clocked(kind: str, model: hs.Model, period: float, swept: str = "", **further: object) -> Point:
    """A point of a model whose forcing has a known period."""
    return Point(kind, model, model, period, period, swept, **further)  # type: ignore[arg-type]


def written(name: str, parameters: dict[str, float], states: str, rest: str = "") -> hs.Model:
    """A model from the text of its states and other declarations."""
    numbers = "\n".join(f"{key} = {value!r}" for key, value in parameters.items())
    return hs.Model.from_toml(
        f'schema = 1\nname = "{name}"\n[parameters]\n{numbers}\n[states]\n{states}\n{rest}\n'
    )


def one_mass(rng: Rng) -> dict[str, float]:
    """Numbers of a mass on a spring with a harmonic force, for a friction of about 1."""
    return {
        "F": drawn(rng, 0.7, 6.0),
        "omega": drawn(rng, 0.25, 2.5),
        "z": drawn(rng, 0.01, 0.3),
        "x0": drawn(rng, -2.0, 2.0),
    }


MASS = 'x = { start = "x0", der = "v" }\nv = { start = 0, der = "%s - 2*z*v - x - f" }'
HARMONIC = "F*sin(omega*t)"


def contact(law: str, velocity: str = "v", normal: str = "1", name: str = "f") -> str:
    """The text of a contact."""
    return f'[contacts.{name}]\nvelocity = "{velocity}"\nnormal = "{normal}"\nlaw = {{ {law} }}\n'


def falling(rng: Rng, low: float, high: float) -> str:
    """The text of a Stribeck law whose friction at rest is between two bounds."""
    mu_s, mu_k, v_s = drawn(rng, low, high), drawn(rng, 0.2, 0.6), drawn(rng, 0.1, 1.0)
    return f'name = "stribeck", mu_s = {mu_s}, mu_k = {mu_k}, v_s = {v_s}'


# -- kinds of models ---------------------------------------------------------------------------------------------


def coulomb(rng: Rng) -> Point:
    """The packaged oscillator with Coulomb friction."""
    model = hs.load("dfcs").with_(
        F0=drawn(rng, 15.0, 80.0), c=drawn(rng, 2.0, 40.0), omega=f"{drawn(rng, 0.08, 2.0)}*sqrt(k/m)"
    )
    p = model.parameter_values()
    friction = p["mu"] * p["N"]
    as_numbers = Friction(p["m"], p["c"], p["k"], p["F0"], p["omega"], friction, lambda v: friction)
    return forced("dfcs, Coulomb", model, friction=as_numbers)


def stribeck(rng: Rng) -> Point:
    """The packaged oscillator with a Stribeck law."""
    mu_s = drawn(rng, 0.4, 1.0)
    model = hs.load("dfcs-stribeck").with_(
        F0=drawn(rng, 15.0, 80.0), c=drawn(rng, 2.0, 40.0), omega=f"{drawn(rng, 0.08, 2.0)}*sqrt(k/m)",
        mu_s=mu_s, mu_k=float(f"{mu_s * drawn(rng, 0.3, 0.95):.4g}"), v_s=drawn(rng, 0.01, 0.3),
    )  # fmt: skip
    p = model.parameter_values()

    def slip(v: float) -> float:
        return p["N"] * (p["mu_k"] + (p["mu_s"] - p["mu_k"]) * math.exp(-((v / p["v_s"]) ** 2)))

    as_numbers = Friction(p["m"], p["c"], p["k"], p["F0"], p["omega"], p["mu_s"] * p["N"], slip)
    return forced("dfcs-stribeck", model, friction=as_numbers)


def other_laws(rng: Rng) -> Point:
    """A mass with another law in which it sticks."""
    p, mu_s = one_mass(rng), drawn(rng, 0.5, 1.5)
    mu_k = float(f"{mu_s * drawn(rng, 0.3, 0.95):.4g}")
    which = int(rng.integers(4))
    law = (
        f'name = "static-kinetic", mu_s = {mu_s}, mu_k = {mu_k}',
        f'name = "viscous", mu = {mu_s}, c = {drawn(rng, 0.01, 0.5)}',
        f'name = "asymmetric", mu_forward = {mu_s}, mu_backward = {mu_k}',
        f'name = "stribeck-exponential", mu_s = {mu_s}, mu_k = {mu_k}, v_s = {drawn(rng, 0.05, 1.0)}',
    )[which]
    as_numbers = None
    if which == 0:
        as_numbers = Friction(1.0, 2.0 * p["z"], 1.0, p["F"], p["omega"], mu_s, lambda v: mu_k)
    model = written("one-mass", p, MASS % HARMONIC, contact(law))
    return forced("mass, other laws with stick", model, friction=as_numbers)


def regularized(rng: Rng) -> Point:
    """A mass with a law without stick."""
    p, mu = one_mass(rng), drawn(rng, 0.5, 1.5)
    name = str(rng.choice(["tanh", "arctan"]))
    law = f'name = "{name}", mu = {mu}, v0 = {drawn(rng, 0.01, 0.3)}'
    return forced("mass, tanh and arctan", written(name, p, MASS % HARMONIC, contact(law)))


def with_memory(rng: Rng) -> Point:
    """A mass with a law that has a state."""
    p, mu = one_mass(rng), drawn(rng, 0.5, 1.5)
    sigma = drawn(rng, 3.0, 100.0)
    law = (
        f'name = "dahl", mu = {mu}, sigma = {sigma}',
        f'name = "lugre", mu_s = {mu}, mu_k = {float(f"{0.7 * mu:.4g}")}, v_s = {drawn(rng, 0.05, 0.5)}, '
        f"sigma_0 = {sigma}, sigma_1 = {drawn(rng, 0.3, 3.0)}, sigma_2 = {drawn(rng, 0.01, 0.2)}",
        f'name = "jenkins", mu = {mu}, k = {drawn(rng, 0.5, 10.0)}',
        f'name = "iwan", n = 4, mu = {mu}, k = {drawn(rng, 0.5, 10.0)}',
    )[int(rng.integers(4))]
    model = written("memory", p, MASS % HARMONIC, contact(law))
    return forced("mass, Dahl, LuGre, Jenkins and Iwan", model)


def self_excited(rng: Rng) -> Point:
    """Packaged models that vibrate without forcing, and a mass on a belt."""
    kind = "self-excited, without forcing"
    which = int(rng.integers(5))
    if which == 0:
        model = hs.load("belt").with_(delta=drawn(rng, 0.5, 10.0), v_belt=drawn(rng, 0.03, 0.6))
        return free(kind, model, 12.0, "v_belt")
    if which == 1:
        model = hs.load("static-kinetic").with_(
            v_pull=drawn(rng, 0.002, 0.1), mu_s=drawn(rng, 0.31, 0.9), k=drawn(rng, 20.0, 500.0)
        )
        return free(kind, model, 2.0, "v_pull")
    if which == 2:
        model = hs.load("drill-string").with_(Omega=drawn(rng, 2.0, 20.0), T_s=drawn(rng, 4100.0, 9000.0))
        return free(kind, model, 8.0, "Omega")
    if which == 3:
        model = hs.load("pid-servo").with_(mu_s=drawn(rng, 0.13, 0.4), ki=drawn(rng, 100.0, 900.0))
        return free(kind, model, 2.0, "ki")
    p = {"vb": drawn(rng, 0.05, 1.5), "z": drawn(rng, 0.005, 0.3), "x0": drawn(rng, -2.0, 2.0)}
    law = falling(rng, 0.8, 2.0)
    return free(kind, written("mass-on-belt", p, MASS % "0", contact(law, "v - vb")), 6.3, "vb")


def forced_on_a_belt(rng: Rng) -> Point:
    """A mass on a belt that is forced too."""
    p = one_mass(rng) | {"vb": drawn(rng, 0.05, 1.5)}
    p["F"] = drawn(rng, 0.1, 2.0)
    law = falling(rng, 0.6, 1.5)
    return forced(
        "mass on a belt with forcing", written("belt-forced", p, MASS % HARMONIC, contact(law, "v - vb"))
    )


def impacts(rng: Rng) -> Point:
    """Impacts as guards with resets."""
    which = int(rng.integers(3))
    if which == 0:
        model = hs.load("impact-oscillator").with_(
            omega=drawn(rng, 0.5, 3.0),
            reach=drawn(rng, 0.8, 1.6),
            e=drawn(rng, 0.3, 0.95),
            zeta=drawn(rng, 0.02, 0.2),
        )
    elif which == 1:
        model = hs.load("gear-rattle").with_(d=drawn(rng, 1e-3, 1e-2), e=drawn(rng, 0.2, 0.9))
    else:
        p = one_mass(rng) | {"e": drawn(rng, 0.2, 0.9), "gap": drawn(rng, 0.1, 2.0)}
        reset = 'then = { to = "free", reset = { x = "%sgap", v = "-e*v" } }'
        both = "[modes.free]\n" + "".join(
            f'guards.{name} = {{ expr = "gap {sign} x", {reset % side} }}\n'
            for name, sign, side in (("upper", "-", ""), ("lower", "+", "-"))
        )
        p["x0"] = 0.0
        model = written("two-stops", p, (MASS % HARMONIC).replace(" - f", ""), both)
    return forced("impacts as resets", model)


def lift_off(rng: Rng) -> Point:
    """A friction contact whose load varies with the motion, and that may open."""
    model = hs.load("feeny-moon").with_(
        k=drawn(rng, 0.2, 2.0), a=drawn(rng, 0.5, 3.0), Omega=drawn(rng, 0.5, 2.0), zeta=drawn(rng, 0.01, 0.1)
    )
    return forced("contact that opens", model, "Omega")


def relays(rng: Rng) -> Point:
    """Relays with hysteresis, relays on a surface, and a thermostat."""
    kind = "relays"
    which = int(rng.integers(4))
    if which == 0:
        model = hs.load("relay-control").with_(d=drawn(rng, 0.2, 4.0), omega=drawn(rng, 1.0, 20.0))
        return forced(kind, model)
    if which == 1:
        low = drawn(rng, 10.0, 20.0)
        model = hs.load("thermostat").with_(T_low=low, T_high=round(low + drawn(rng, 0.3, 6.0), 4))
        return free(kind, model, 2.0, "tau")
    p = one_mass(rng) | {"h": drawn(rng, 0.02, 0.5), "U": drawn(rng, 0.2, 2.0)}
    states = 'x = { start = "x0", der = "v" }\nv = { start = 0, der = "%s - 2*z*v - x - U*u" }'
    relay = '[elements]\nu = { kind = "relay", input = "v", on = "h", off = "-h", high = 1, low = -1 }'
    if which == 2:
        return forced(kind, written("relay-forced", p, states % HARMONIC, relay))
    relay = relay.replace('input = "v"', 'input = "-x"')
    return free(kind, written("relay-free", p, (states % "0").replace("- U*u", "+ U*u"), relay), 6.0, "U")


def waves(rng: Rng) -> Point:
    """A mass with a periodic input as its force or its normal load."""
    p, mu = one_mass(rng), drawn(rng, 0.4, 1.2)
    p["T"] = float(f"{2.0 * math.pi / p.pop('omega'):.4g}")
    shape = str(rng.choice(["square", "triangle", "sawtooth", "sine"]))
    wave = f'[inputs.p]\nkind = "wave"\nshape = "{shape}"\nperiod = "T"\n'
    law = f'name = "static-kinetic", mu_s = {mu}, mu_k = {float(f"{mu * drawn(rng, 0.5, 1.0):.4g}")}'
    if rng.uniform() < 0.6:
        rest = wave + 'amplitude = "F"\n' + contact(law)
        model = written("wave", p, MASS % "p", rest)
    else:
        rest = wave + f"amplitude = {drawn(rng, 0.1, 0.9)}\noffset = 1\n" + contact(law, normal="p")
        model = written("load-of-wave", p, MASS % "F*sin(2*pi*t/T)", rest)
    return clocked("waves as inputs", model, p["T"], "F")


def clocks(rng: Rng) -> Point:
    """Sampled controllers, and a converter with pulse-width modulation."""
    kind = "clocks"
    which = int(rng.integers(3))
    if which == 0:
        model = hs.load("buck-converter").with_(E=drawn(rng, 15.0, 35.0))
        return clocked(kind, model, 400e-6, "E")
    p = {
        "kp": drawn(rng, 0.2, 4.0),
        "kd": drawn(rng, 0.1, 2.0),
        "T": drawn(rng, 0.1, 0.8),
        "x0": drawn(rng, -2.0, 2.0),
    }
    clock = '[discrete]\nu = { start = 0 }\n[clocks.c]\nperiod = "T"\nset.u = "-kp*(x - 0.3) - kd*v"\n'
    if which == 1:
        states = 'x = { start = "x0", der = "v" }\nv = { start = 0, der = "u - f" }'
        law = f'name = "static-kinetic", mu_s = {drawn(rng, 0.1, 0.5)}, mu_k = 0.1'
        return clocked(kind, written("sampled", p, states, clock + contact(law)), p["T"], "kp")
    count = int(rng.integers(4, 12))
    p |= {"F": drawn(rng, 0.3, 3.0), "count": float(count), "mu": drawn(rng, 0.1, 0.8)}
    states = 'x = { start = "x0", der = "v" }\nv = { start = 0, der = "u + F*sin(2*pi*t/(count*T)) - x - 0.1*v - f" }'
    model = written("sampled-forced", p, states, clock + contact('name = "coulomb", mu = "mu"'))
    return clocked(kind, model, count * p["T"], "F")


def monitors(rng: Rng) -> Point:
    """Monitors, of which some reset a state."""
    p = one_mass(rng) | {
        "level": drawn(rng, -0.5, 0.9),
        "kick": drawn(rng, 0.1, 0.8),
        "mu": drawn(rng, 0.2, 1.0),
    }
    if rng.uniform() < 0.5:
        rest = contact('name = "coulomb", mu = "mu"')
        rest += '[monitors.passes]\nexpr = "x - level"\ndirection = "both"\n'
        return forced("monitors", written("watched", p, MASS % HARMONIC, rest))
    rest = (
        '[monitors.kicks]\nexpr = "x - level"\ndirection = "up"\naction = "reset"\nreset.v = "v*(1 - kick)"\n'
    )
    if rng.uniform() < 0.5:
        return forced("monitors", written("braked", p, (MASS % HARMONIC).replace(" - f", ""), rest))
    p["vb"] = drawn(rng, 0.1, 1.0)
    rest = rest.replace('"v*(1 - kick)"', '"v + kick"')
    model = written("kicked", p, MASS % "0", rest + contact('name = "viscous", mu = "mu/5", c = 0.1'))
    return free("monitors", model, 6.3, "kick")


def two_contacts(rng: Rng) -> Point:
    """Two masses with two friction contacts, on the ground, on a belt or between the masses."""
    p = one_mass(rng) | {
        "m2": drawn(rng, 0.3, 3.0), "k2": drawn(rng, 0.2, 3.0), "N1": drawn(rng, 0.2, 1.5), "N2": drawn(rng, 0.05, 1.0)
    }  # fmt: skip
    between = bool(rng.uniform() < 0.5)
    first, second = ("- f - g", "+ g") if between else ("- f", "- g")
    states = f"""x = {{ start = "x0", der = "v" }}
v = {{ start = 0, der = "F*sin(omega*t) - 2*z*v - x - k2*(x - y) {first}" }}
y = {{ start = 0, der = "w" }}
w = {{ start = 0, der = "(k2*(x - y) - 0.3*y - 2*z*w {second})/m2" }}"""
    mu = drawn(rng, 0.5, 1.0)
    laws = (
        f'name = "coulomb", mu = {mu}',
        f'name = "stribeck", mu_s = {mu}, mu_k = {0.6 * mu:.4g}, v_s = 0.2',
    )
    one, other = (laws[int(rng.integers(2))] for _ in range(2))
    belt = drawn(rng, 0.1, 0.8) if rng.uniform() < 0.3 else 0.0
    rest = contact(one, f"v - {belt}", "N1") + contact(other, "v - w" if between else "w", "N2", "g")
    return forced("two masses, two contacts", written("two-contacts", p, states, rest))


def coupled_modes(rng: Rng) -> Point:
    """The packaged model of brake squeal."""
    model = hs.load("mode-coupling").with_(
        mu=drawn(rng, 0.5, 1.2), c=drawn(rng, 0.03, 0.3), v_belt=drawn(rng, 0.1, 1.0)
    )
    return free("mode-coupling", model, 4.5, "v_belt")


def smooth(rng: Rng) -> Point:
    """Smooth and piecewise smooth oscillators: Duffing, van der Pol, play, a bilinear spring."""
    p = one_mass(rng) | {"b": drawn(rng, 0.1, 2.0)}
    free_mass = (MASS % HARMONIC).replace(" - f", "")
    which = int(rng.integers(4))
    if which == 0:
        model = written(
            "duffing",
            p,
            free_mass.replace(" - x", " + x - b*x**3" if rng.uniform() < 0.5 else " - x - b*x**3"),
        )
    elif which == 1:
        p["F"] = drawn(rng, 0.1, 2.0)
        model = written("van-der-pol", p, free_mass.replace("- 2*z*v", "+ b*(1 - x**2)*v"))
    elif which == 2:
        model = hs.load("elastic-gap").with_(
            F=drawn(rng, 0.5, 5.0),
            omega=drawn(rng, 2.0, 15.0),
            c=drawn(rng, 0.1, 2.0),
            d=drawn(rng, 0.01, 0.1),
        )
    else:
        p["k2"] = drawn(rng, 2.0, 30.0)
        rest = '[components.wall.modes.off]\ninitial = true\nset = { push = "0" }\n'
        rest += 'guards.hits = { expr = "b - x", then = "on" }\n[components.wall.modes.on]\n'
        rest += 'set = { push = "k2*(x - b)" }\nguards.leaves = { expr = "x - b", then = "off" }\n'
        p["x0"] = 0.0
        model = written("bilinear", p, free_mass.replace(" - x", " - x - push"), rest)
    return forced("without friction", model)


def structures(rng: Rng) -> Point:
    """A mechanical system of two to four masses with two to four contacts."""
    n = int(rng.integers(2, 5))
    omega = drawn(rng, 0.3, 2.5)
    k = [drawn(rng, 0.3, 2.0) for _ in range(n + 1)]
    masses = [drawn(rng, 0.4, 2.5) for _ in range(n)]
    K = np.diag([k[i] + k[i + 1] for i in range(n)])
    for i in range(n - 1):
        K[i, i + 1] = K[i + 1, i] = -k[i + 1]
    z = drawn(rng, 0.01, 0.1)
    found = []
    for i in range(n):
        mu = drawn(rng, 0.2, 1.0)
        law, values = ("coulomb", {"mu": mu}) if rng.uniform() < 0.6 else (
            "stribeck", {"mu_s": mu, "mu_k": float(f"{0.6 * mu:.4g}"), "v_s": 0.2}
        )  # fmt: skip
        along = {i: 1.0, i - 1: -1.0} if i and rng.uniform() < 0.5 else {i: 1.0}
        base: float | hs.Harmonic = 0.0
        if len(along) == 1 and rng.uniform() < 0.3:
            base = (
                drawn(rng, 0.05, 0.6)
                if rng.uniform() < 0.5
                else hs.Harmonic(omega, cos=drawn(rng, 0.05, 0.6))
            )
        found.append(hs.MechanicalContact(f"f{i + 1}", along, drawn(rng, 0.1, 1.5), law, values, base=base))
    system = hs.MechanicalSystem(
        masses, (z * K).tolist(), K.tolist(), {0: hs.Harmonic(omega, sin=drawn(rng, 0.5, 4.0))}, found
    )
    period = 2.0 * math.pi / omega
    return Point("mechanical systems", system, system.to_model(), period, period, "omega", True)


KINDS: tuple[Callable[[Rng], Point], ...] = (
    coulomb, stribeck, other_laws, regularized, with_memory, self_excited, forced_on_a_belt, impacts, lift_off,
    relays, waves, clocks, monitors, two_contacts, coupled_modes, smooth, structures,
)  # fmt: skip


def point(number: int, seed: int) -> Point:
    """The point of a number; the kinds take turns."""
    return KINDS[number % len(KINDS)](np.random.default_rng((seed, number)))
