"""Makes models/records/ground-motion.csv: a synthetic record of ground acceleration, the same on every machine.

A stationary process with the Clough-Penzien spectrum, as a sum of cosines with random phases, is shaped by an envelope
of time, corrected so that the ground ends at rest where it began, and scaled to a peak.

    S(w) = (wg^4 + (2 zg wg w)^2) / ((wg^2 - w^2)^2 + (2 zg wg w)^2) * w^4 / ((wf^2 - w^2)^2 + (2 zf wf w)^2)
    a(t) = (t/tp)^b exp(b (1 - t/tp)) * sum of sqrt(2 S(w) dw) cos(w t + phase)

Sources: the spectrum of white noise filtered by the ground, H. Tajimi, Proc. 2nd World Conf. Earthquake Engineering
(1960) 781, and R. W. Clough, J. Penzien, Dynamics of Structures, McGraw-Hill 1975; the sum of cosines, M. Shinozuka,
G. Deodatis, Appl. Mech. Rev. 44 (1991) 191, doi:10.1115/1.3119501; the envelope, G. R. Saragoni, G. C. Hart, Earthquake
Eng. Struct. Dyn. 2 (1973) 249, doi:10.1002/eqe.4290020305.

    python docs/make/make_ground_motion.py            writes the file
"""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np

FILE = Path(__file__).parents[2] / "models" / "records" / "ground-motion.csv"

SEED = 1
SPACING, DURATION = 0.02, 20.0  # s; the spacing of many digitised records
PEAK = 0.35 * 9.81  # m/s^2, a strong earthquake
GROUND, GROUND_DAMPING = 15.6, 0.6  # wg in rad/s, zg: firm ground
FILTER, FILTER_DAMPING = 1.56, 0.6  # wf, zf: a tenth of wg keeps displacements finite
HIGHEST, COUNT = 100.0, 1000  # rad/s, number of cosines: the sum repeats after 63 s, thrice the record
PEAK_TIME, SHAPE = 4.0, 2.0  # tp in s, b of the envelope
TAPER = 1.0  # s at the end over which the record goes to zero: its last value holds for ever after
DECIMALS = 5  # of the file: far above rounding, so that every machine writes the same


def record() -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and accelerations (m/s^2)."""
    count = round(DURATION / SPACING)
    t = np.arange(count + 1) * SPACING
    envelope = (t / PEAK_TIME) ** SHAPE * np.exp(SHAPE * (1.0 - t / PEAK_TIME))
    envelope *= np.clip((DURATION - t) / TAPER, 0.0, 1.0)
    a = at_rest_in_the_end(t, envelope * stationary(t), envelope)
    return t, a * PEAK / np.abs(a).max()


def stationary(t: np.ndarray) -> np.ndarray:
    """The stationary process; its phases come from a generator whose sequence Python guarantees."""
    uniform = random.Random(SEED).random
    step = HIGHEST / COUNT
    total = np.zeros_like(t)
    for k in range(COUNT):
        w = (k + 0.5) * step
        total += math.sqrt(2.0 * spectrum(w) * step) * np.cos(w * t + 2.0 * math.pi * uniform())
    return total


def spectrum(w: float) -> float:
    """The Clough-Penzien spectrum over that of the white noise."""
    ground, low = (2 * GROUND_DAMPING * GROUND * w) ** 2, (2 * FILTER_DAMPING * FILTER * w) ** 2
    kanai_tajimi = (GROUND**4 + ground) / ((GROUND**2 - w**2) ** 2 + ground)
    return kanai_tajimi * w**4 / ((FILTER**2 - w**2) ** 2 + low)


def at_rest_in_the_end(t: np.ndarray, a: np.ndarray, envelope: np.ndarray) -> np.ndarray:
    """The acceleration less envelope*(c0 + c1 t), with which velocity and displacement end at zero."""
    shapes = np.array([envelope, envelope * t])
    system = np.array([final_motion(t, shape) for shape in shapes]).T
    return a - np.linalg.solve(system, final_motion(t, a)) @ shapes


def final_motion(t: np.ndarray, a: np.ndarray) -> tuple[float, float]:
    """Velocity and displacement at the end, from rest, of an acceleration that is linear between its points."""
    h = np.diff(t)
    dv = h * (a[:-1] + a[1:]) / 2
    v = np.concatenate([[0.0], np.cumsum(dv)])
    dx = h * v[:-1] + h**2 * (2 * a[:-1] + a[1:]) / 6
    return float(v[-1]), float(dx.sum())


def text() -> str:
    """The file."""
    lines = [
        f"# Synthetic ground acceleration, made by docs/make/make_ground_motion.py with seed {SEED}.",
        "t (s),a (m/s^2)",
    ]
    lines += [f"{t:.2f},{a:.{DECIMALS}f}" for t, a in zip(*record(), strict=True)]
    return "\n".join(lines).replace(",-0.00000", ",0.00000") + "\n"


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(text(), encoding="utf-8")
