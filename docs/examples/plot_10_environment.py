"""
A drill as an environment for a learning agent
==============================================

A drill string stores twist between its drive and its bit. The dry friction of the bit on the rock decreases with the
speed. Under a constant torque the bit therefore sticks and slips. The class below has the methods ``reset`` and
``step`` of an environment of gymnasium. The action of an agent is a torque, which is
constant between two calls of ``step``. The class also works without gymnasium. If gymnasium is installed, the class
registers itself.
"""

import matplotlib.pyplot as plt
import numpy as np

import hybridsim as hs
from hybridsim import plot

try:
    import gymnasium
except ImportError:
    gymnasium = None

drill = hs.Model(
    "drill",
    parameters={
        "J1": 2000,
        "J2": 400,
        "k": 500,
        "c": 20,
        "d": 100,
        "weight": 1,
        "mu_s": 9000,
        "mu_k": 5000,
        "v_s": 0.8,
    },
    inputs=[hs.Input("torque", "held", value=0, unit="N m")],
    states=[
        hs.State("twist", 0, "w1 - w2", unit="rad", nominal=10),
        hs.State("w1", 5, "(torque - k*twist - c*(w1 - w2))/J1", unit="rad/s", nominal=10),
        hs.State("w2", 0, "(k*twist + c*(w1 - w2) - d*w2 - f)/J2", unit="rad/s", nominal=10),
    ],
    contacts=[
        hs.Contact(
            "f",
            velocity="w2",
            normal="weight",
            law="stribeck",
            arguments={"mu_s": "mu_s", "mu_k": "mu_k", "v_s": "v_s"},
        )
    ],
)


class DrillEnv(gymnasium.Env if gymnasium else object):
    """Hold the speed of the bit at a target by the torque of the drive."""

    period, target, largest, duration = 0.1, 8.0, 15000.0, 60.0

    def __init__(self, integrator="dop853"):
        self.simulator, self.generator = hs.Simulator(drill, integrator=integrator), np.random.default_rng()
        if gymnasium:
            one = np.ones(1, dtype=np.float32)
            self.action_space = gymnasium.spaces.Box(-one, one)
            bound = np.full(3, 1e3, dtype=np.float32)
            self.observation_space = gymnasium.spaces.Box(-bound, bound)

    def reset(self, *, seed=None, options=None):
        """Start with the drive at a random speed and the bit at rest."""
        if gymnasium:
            super().reset(seed=seed)
        if seed is not None:
            self.generator = np.random.default_rng(seed)
        self.simulator.start(0.0, x0={"w1": self.generator.uniform(4, 8)} | (options or {}))
        return self._observation(), {"events": ()}

    def step(self, action):
        """Hold a torque, a fraction of the largest one, for one period."""
        sim = self.simulator
        torque = self.largest * float(np.clip(np.ravel(action)[0], -1, 1))
        events = sim.advance(sim.t + self.period, {"torque": torque})
        reward = -abs(sim.state["w2"] / self.target - 1.0)
        return self._observation(), reward, False, sim.t >= self.duration, {"events": events}

    def _observation(self):
        return np.array(list(self.simulator.state.values()), dtype=np.float32)


if gymnasium and "hybridsim/Drill-v0" not in gymnasium.registry:
    gymnasium.register("hybridsim/Drill-v0", entry_point=DrillEnv)

# %%
# Two simple rules replace an agent. One rule is a constant torque. The other rule reduces the torque when the twist
# grows (soft torque).


def constant(observation):
    """The torque of steady drilling, whatever happens."""
    return 5800 / DrillEnv.largest


def soft(observation):
    """More torque while the drive is slow, so that it damps the waves in the string."""
    return (5800 + 1000 * (DrillEnv.target - observation[1])) / DrillEnv.largest


env, speeds, stops = DrillEnv(), {}, {}
for rule in (constant, soft):
    observation, info = env.reset(seed=3)
    speeds[rule.__name__], events, truncated = [], [], False
    while not truncated:
        observation, reward, terminated, truncated, info = env.step(rule(observation))
        speeds[rule.__name__].append(observation[2])
        events += info["events"]
    stops[rule.__name__] = sum(event.target == "stick" for event in events)
    print(
        f"{rule.__name__}: the bit stops {stops[rule.__name__]} times, {observation[2]:.2f} rad/s at the end"
    )

figure, axes = plt.subplots(layout="constrained")
for name, values in speeds.items():
    axes.plot(DrillEnv.period * np.arange(1, len(values) + 1), values, label=name)
axes.set(xlabel="t in s", ylabel="speed of the bit in rad/s")
axes.legend()
plot.save(axes, "drill.png")
