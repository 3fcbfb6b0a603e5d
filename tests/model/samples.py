"""Models that between them use everything a model can have, built in Python."""

from __future__ import annotations

import hybridsim as hs


def everything() -> hs.Model:
    """One model with every kind of part."""
    relay = hs.Component(
        "relay",
        [
            hs.Mode(
                "on",
                [
                    hs.Guard(
                        "high",
                        "top - T",
                        [hs.Choice("off", "x > 0", {"n": "n + 1"}), hs.Choice("idle", reset={"T": "top"})],
                    )
                ],
                set={"heat": "q*scale"},
            ),
            hs.Mode("off", [hs.Guard("low", "T - bottom", "on")], set={"heat": 0}),
            hs.Mode("idle", der={"T": "-T/100"}, set={"heat": "0"}),
        ],
        initial="off",
    )
    held = hs.Component(
        "hold",
        [
            hs.Mode("up", [hs.Guard("sign", "w")], set={"r": "1"}),
            hs.Mode("down", [hs.Guard("sign", "-w")], set={"r": "-1"}),
            hs.Mode("rest", [hs.Guard("a", "2 - r"), hs.Guard("b", "2 + r")]),
        ],
        surface=hs.Surface("w", "r", "up", "down", "rest", 1, "-1"),
    )
    sticky = hs.FrictionLaw(
        "sticky",
        "N*(mu + extra*exp(-v/v_s))",
        "N*(mu + extra)",
        {"mu": None, "extra": 0.1, "v_s": "extra/10"},
    )
    plain = hs.FrictionLaw("sticky", "mu*N", "mu*N", ["mu"], title="another of the same name")
    return hs.Model(
        "everything",
        states=[
            hs.State("x", "x_start", "v", unit="m", nominal=1e-3),
            hs.State("v", 0, "(u1 + u2 + u3 + u4 - f1 - f2 - k*x)/m"),
            hs.State("w", 0.5, "-r - w + n"),
            hs.State("T", 15, "(heat - T)/10 - leak - side/50", unit="degC"),
        ],
        parameters=[
            hs.Parameter("m", 2, "kg", "mass"),
            hs.Parameter("k", "8*m", "N/m"),
            hs.Parameter("x_start", "1e-3"),
            hs.Parameter("top", 21.5),
            hs.Parameter("bottom", "top - 2"),
            hs.Parameter("q", 30),
            hs.Parameter("P", 0.25, "s"),
        ],
        discrete=[hs.Discrete("n", 0), hs.Discrete("scale", "q/30", "K")],
        components=[relay, held],
        surfaces=[hs.SwitchingSurface("side", "T - 19", above={"leak": "T/100"}, below={"leak": "scale/9"})],
        contacts=[
            hs.Contact("f1", "v", "m*9.81", sticky, {"mu": 0.3, "v_s": "P/100"}),
            hs.Contact("f2", "v - 0.1*cos(3*t)", "max(0, 1 + load)", plain, {"mu": "0.1 + P"}),
        ],
        inputs=[
            hs.Input("u1", "table", times=[0, 1, 1, 2.5], values=[0, 0.1, -0.1, 1e-17]),
            hs.Input("u2", "wave", shape="square", amplitude="q/10", period="P", duty=0.3),
            hs.Input("u3", "wave", shape="triangle", period=2, phase=0.5, offset="-m"),
            hs.Input("u4", "chirp", amplitude=0.5, f0=1, f1="1/P", duration=10),
        ],
        monitors=[
            hs.Monitor("peak", "v", "down"),
            hs.Monitor("wall", "x - 1", "up", "reset", {"v": "-0.5*v", "n": 0}),
            hs.Monitor("end", "x - 5", action="terminate"),
        ],
        schedules=[
            hs.Schedule("kick", times=[1, "3*P"], reset={"v": "v + 0.1"}),
            hs.Schedule("clock", start="P", period="P", count=12, reset={"scale": "scale/2"}),
            hs.Schedule("stop", times=20, terminate=True),
        ],
        outputs=[
            hs.Output("f1", "f1", "N"),
            hs.Output("power", "f1*v", "W", {"f1.stick": 0, "relay.on": "f1*v + heat"}),
        ],
        definitions={"load": "0.5*depth", "depth": "x + heat/100"},
        title='Text with "quotes", \\ backslash, Greek \u03c9,\ttab\nand a second line',
        source="tests",
        description="\x7f",
        look="here",
    )


def block(**changes: object) -> hs.Model:
    """A block on a spring with one contact; keywords replace parts of it."""
    parts: dict[str, object] = {
        "states": [hs.State("x", 1, "v"), hs.State("v", 0, "(-k*x - f)/m")],
        "parameters": {"m": 1.0, "k": "4*m", "mu": 0.3, "N": 2.0},
        "contacts": [hs.Contact("f", "v", "N", "coulomb", {"mu": "mu"})],
    }
    return hs.Model("block", **{**parts, **changes})
