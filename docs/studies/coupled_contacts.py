"""Compare the decisions of coupled contacts in random systems with all combinations in 40 digits.

    python docs/studies/coupled_contacts.py [systems]    (60 of each law by default)

Writes docs/studies/coupled-contacts.md. The balance of energy of each run is checked too.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from mechanics.energy import balance
from mechanics.enumeration import Enumeration
from mechanics.random_systems import LAWS, random_system, reordered

import hybridsim as hs

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "coupled-contacts.md"
MODES = {"stick": 0, "slip+": 1, "slip-": -1}
SPAN, ORDERS, RTOL = 30.0, 3, 1e-11


@dataclass(frozen=True)
class Found:
    """Instants decided, those not admissible, those with several outcomes, and errors.

    apart is the largest difference among orders of declaration. miss is the residual of the balance of energy, and
    quadrature the change with its own order. Both are relative to the work that friction dissipates.
    """

    instants: int
    wrong: int
    several: int
    apart: float
    miss: float
    quadrature: float


def examine(seed: int, law: str) -> Found:
    """One system over the whole span."""
    system = random_system(seed, law)
    sol = hs.simulate(system, (0, SPAN), rtol=RTOL)
    assert sol.success, (law, seed, sol.message)
    difference = 0.0
    for order in range(ORDERS):
        other, dofs = reordered(system, 1000 * seed + order)
        moved = hs.simulate(other, (0, SPAN), rtol=RTOL, keep="nothing")
        difference = max(difference, abs(moved.x_end - sol.x_end[np.r_[dofs, system.n + dofs]]).max())
    trials, wrong, several = Enumeration(system), 0, 0
    instants = sorted({e.t for e in sol.events})
    for t in instants:
        x = sol(t)
        at_rest, admissible, _ = trials.admissible(t, x[: system.n], x[system.n :])
        names = [system.contacts[c].name for c in at_rest]
        found = tuple(MODES[next(m.mode for m in reversed(sol.modes[c]) if m.t0 <= t)] for c in names)
        if found not in admissible:
            wrong += 1
            print(law, seed, t, names, found, admissible)
        several += len(admissible) > 1
    energies, coarser = balance(sol), balance(sol, 16)
    quadrature = abs(energies.friction - coarser.friction) / energies.dissipated
    return Found(len(instants), wrong, several, difference, energies.miss, quadrature)


def main() -> None:
    """Run all and write the page."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    rows, energy, decided, inadmissible = [], [], 0, 0
    for law in LAWS:
        found = [examine(seed, law) for seed in range(count)]
        instants, wrong, several = (
            sum(getattr(f, key) for f in found) for key in ("instants", "wrong", "several")
        )
        decided, inadmissible = decided + instants, inadmissible + wrong
        apart, miss = (sorted(getattr(f, key) for f in found) for key in ("apart", "miss"))
        rows.append(
            f"| {law} | {count} | {instants} | {wrong} | {several} | {apart[count // 2]:.1e} | {apart[-1]:.1e} |"
        )
        energy.append(
            f"| {law} | {miss[count // 2]:.1e} | {miss[-1]:.1e} | {max(f.quadrature for f in found):.1e} |"
        )
        print(rows[-1], energy[-1], flush=True)
    table, energies = "\n".join(rows), "\n".join(energy)
    PAGE.write_text(
        f"""# Coupled contacts

Are coupled contacts decided correctly? In {decided} decisions of random systems, {inadmissible} were not admissible.

`docs/studies/coupled_contacts.py` draws random mechanical systems of 2 to 12 coordinates and 2 to 5 contacts. The
mass and stiffness matrices are dense. The direction of a contact contains one, two or all coordinates. The bases
are at rest or move. The applied force is harmonic. Each run lasts {SPAN:g} units of time at rtol {RTOL:g}.

At each event the script tries all combinations of stick, slip forward and slip backward for the contacts at rest.
For each combination it computes the accelerations, the forces and two time derivatives of the forces. It solves the
whole system of equations in 40 digits, without a Delassus operator and without pivoting, which hybridsim uses. The
decision of the run must be among the admissible combinations. Each system also runs with its coordinates and
contacts in {ORDERS} other orders of declaration.

| law | systems | instants decided | not admissible | several admissible | orders apart: median | largest |
| --- | --- | --- | --- | --- | --- | --- |
{table}

If static and kinetic friction are equal, the motion is unique. Nevertheless the check sometimes counts several
combinations. It uses only two derivatives, or none for redundant sets of contacts, and treats values below 1e-9 as
zero. With static friction above kinetic friction, several outcomes may be
possible. The run begins with stick in all contacts that may stick, and then releases the contacts whose force
exceeds the limit. Different orders of declaration can lead to different results because of rounding. These
differences grow because neighbouring motions move apart.

## Work and energy

Over each run the change of the energy v.Mv/2 + q.Kq/2 must equal the work of the forcing minus the work of dampers
and friction. Each work is an integral over the dense output, by Gauss-Legendre quadrature. It has 20 nodes between
any two successive times at which a series begins or an event happens. The table gives the difference between the
two sides, relative to the work of friction. The work of friction is the integral of the sum of f (w.v - base).

| law | residual: median | largest | 16 nodes instead of 20 change the work of friction by at most |
| --- | --- | --- | --- |
{energies}

The runs are at rtol {RTOL:g}. If the friction force depends on the speed, the computed work has the error of the
run. For the laws `coulomb` and `static-kinetic`, the computed work has only rounding errors.
""",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
