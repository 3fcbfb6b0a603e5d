"""Time stepping of masses with friction, relays, stops and automata, which shares no code with hybridsim.

No event is located. A step goes half a step with the old velocities, finds the forces of friction, relays and stops
that fit their laws at its end (projected Gauss-Seidel), and goes the other half with the new ones; automata are looked
at once a step. Smooth stretches are of second order, what jumps makes the whole of first order.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

FRICTION, RELAY, STOP = 0, 1, 2
BILINEAR, HYSTERESIS, KICK, SATURATION, THERMOSTAT = 0, 1, 2, 3, 4
SWEEPS = 400  # of Gauss-Seidel; coupled contacts take some ten
SETTLED = 1e-13  # change of an impulse, relative to the largest


class Plan(NamedTuple):
    """A structure with its numbers; m masses, E elements that are set-valued, A automata.

    mass (m,), damping and stiffness (m, m). waves (m, 6): constant, amplitude, speed, phase of the sine, amplitude and
    period of the square wave. kinds (E,); rows (E, m), shifts (E, m): an element's function is
    rows . v + shifts . q + offsets. paths (E, m): where the force of friction or of a stop acts. laws (E, 9): kinetic
    coefficient forward and backward, static forward and backward, speed of Stribeck's law (0: none), viscous
    coefficient, load, amplitude and speed of its sine. load_rows (E, m): the load's part that follows q. fields
    (E, 2, 3, m): of a relay, above and below: a force, and what is proportional to q and to v. stops (E, 3):
    restitution, amplitude and speed of the wall. machines (A, 8): kind, mass acted on, mass seen, five numbers.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    waves: np.ndarray
    kinds: np.ndarray
    rows: np.ndarray
    shifts: np.ndarray
    offsets: np.ndarray
    paths: np.ndarray
    laws: np.ndarray
    load_rows: np.ndarray
    fields: np.ndarray
    stops: np.ndarray
    machines: np.ndarray


@numba.njit(cache=True)
def machine_force(machine, place, on, q, v, heat):
    """The force of an automaton; `on` and `heat` are moved on before it."""
    kind, seen = int(machine[0]), int(machine[2])
    a, b, c, d = machine[3], machine[4], machine[5], machine[6]
    if kind == BILINEAR:
        return -a * (q[seen] - b) if q[seen] > b else 0.0
    if kind == HYSTERESIS:
        return a if on[place] else 0.0
    if kind == SATURATION:
        return -min(max(a * q[seen] + b * v[seen], -c), c)
    if kind == THERMOSTAT:
        return d * heat[place]
    return 0.0


@numba.njit(cache=True)
def switched(machine, on, q, v):
    """The state of an automaton after a look at the positions, and the velocities after a kick."""
    kind, seen = int(machine[0]), int(machine[2])
    a, b, c, d = machine[3], machine[4], machine[5], machine[6]
    if kind == HYSTERESIS:
        return q[seen] < b if not on else not q[seen] > c
    if kind == KICK:
        if not on and q[seen] > a:
            v[seen] = b * v[seen] + c
            return True
        if on and q[seen] < a - d:
            return False
    return on


@numba.njit(cache=True)
def one_of_all(
    kinds, active, before, rows, moves, target, low, high, hold_low, hold_high, free, impulse, now
):
    """Impulses that fit all laws, by trying all combinations of sides and holding; whether there are any.

    Of several the one that changes least, and holds most, is taken.
    """
    E, best = kinds.shape[0], -1
    sides, found = np.zeros(E, dtype=np.int64), np.zeros(E)
    for number in range(3**E):
        rest, likeness, fits = number, 0, True
        for j in range(E):
            sides[j], rest = rest % 3 - 1, rest // 3
            pushes = (rows[j] * moves[j]).sum()
            if not active[j]:
                fits = fits and sides[j] == 0
            elif kinds[j] == STOP:
                fits = fits and sides[j] >= 0
            elif not pushes < 0.0:
                fits = fits and sides[j] == (1 if before[j] >= 0.0 else -1)
            likeness += 2 * (E + 1) * (sides[j] == before[j]) + 2 * (sides[j] == 0)
        if not fits or likeness <= best:
            continue
        matrix, known = np.eye(E), np.zeros(E)
        for j in range(E):
            if not active[j] or (kinds[j] == STOP and sides[j] == 1):
                continue
            if sides[j] != 0:
                known[j] = high[j] if sides[j] > 0 else low[j]
                continue
            known[j] = target[j] - (rows[j] * free).sum()
            for i in range(E):
                matrix[j, i] = (rows[j] * moves[i]).sum() if active[i] else 0.0
        if abs(np.linalg.det(matrix)) < 1e-30:
            continue
        impulses = np.linalg.solve(matrix, known)
        new = free.copy()
        for j in range(E):
            if active[j]:
                new += moves[j] * impulses[j]
        for j in range(E):
            s = (rows[j] * new).sum() - target[j]
            if not active[j] or (kinds[j] != STOP and not (rows[j] * moves[j]).sum() < 0.0):
                continue
            if sides[j] != 0:
                fits = fits and s * sides[j] >= 0.0
            elif kinds[j] == STOP:
                fits = fits and impulses[j] >= 0.0
            else:
                fits = fits and hold_low[j] <= impulses[j] <= hold_high[j]
        if fits:
            best = likeness
            found[:], now[:] = impulses, sides
    if best >= 0:
        impulse[:] = found
    return best >= 0


@numba.njit(cache=True)
def march(plan, q0, v0, end, samples, steps):
    """Positions and heat at equal times, (samples + 1, m + 1), and the number of steps whose forces did not settle.

    Inside a step the positions are on the two straight lines that it takes, the heat on one.
    """
    m, E, A = plan.mass.shape[0], plan.kinds.shape[0], plan.machines.shape[0]
    h = end / steps
    left = np.diag(plan.mass) + 0.5 * h * plan.damping
    inverse = np.linalg.inv(left)
    right = np.diag(plan.mass) - 0.5 * h * plan.damping
    q, v = q0.copy(), v0.copy()
    out = np.zeros((samples + 1, m + 1))
    out[0, :m] = q
    on, heat = np.zeros(A, dtype=np.bool_), np.zeros(A)
    before = np.zeros(E)
    impulse, low, high, hold_low, hold_high = np.zeros(E), np.zeros(E), np.zeros(E), np.zeros(E), np.zeros(E)
    target, path, rows, active = np.zeros(E), np.zeros((E, m)), np.zeros((E, m)), np.zeros(E, dtype=np.bool_)
    unsettled, place, now = 0, 1, np.zeros(E, dtype=np.int64)
    cold = heat.copy()
    for j in range(E):
        if plan.kinds[j] != STOP:
            s = plan.offsets[j]
            for i in range(m):
                s += plan.rows[j, i] * v[i] + plan.shifts[j, i] * q[i]
            before[j] = np.sign(s)
    for step in range(steps):
        t = (step + 0.5) * h
        middle = q + 0.5 * h * v
        cold[:] = heat
        for k in range(A):
            on[k] = switched(plan.machines[k], on[k], middle, v)
        force = -(plan.stiffness @ middle)
        for i in range(m):
            w = plan.waves[i]
            force[i] += w[0] + w[1] * np.sin(w[2] * t + w[3])
            if w[4] != 0.0:
                force[i] += w[4] if (t % w[5]) < 0.5 * w[5] else -w[4]
        for k in range(A):
            machine = plan.machines[k]
            if machine[0] == THERMOSTAT:
                source = (machine[3] if on[k] else 0.0) + machine[7] * middle[int(machine[2])]
                warmer = heat[k] + h * (source - heat[k]) / (1.0 + 0.5 * h)
                edge = machine[5] if on[k] else machine[4]
                # the rest of the step with the other source
                if (warmer > edge) if on[k] else (warmer < edge):
                    on[k] = not on[k]
                    rest = h * (1.0 - (edge - heat[k]) / (warmer - heat[k])) if heat[k] != warmer else h
                    source += machine[3] if on[k] else -machine[3]
                    start = edge if 0.0 <= rest <= h else heat[k]
                    rest = min(max(rest, 0.0), h)
                    warmer = start + rest * (source - start) / (1.0 + 0.5 * rest)
                heat[k] = 0.5 * (heat[k] + warmer)
                force[int(machine[1])] += machine_force(machine, k, on, middle, v, heat)
                heat[k] = warmer
            else:
                force[int(machine[1])] += machine_force(machine, k, on, middle, v, heat)
        for j in range(E):
            rows[j] = plan.rows[j]
            active[j] = True
            if plan.kinds[j] == STOP:
                impulse[j] = 0.0
            if plan.kinds[j] == FRICTION:
                law = plan.laws[j]
                load = law[6] + law[7] * np.sin(law[8] * t)
                speed = plan.offsets[j]
                for i in range(m):
                    load += plan.load_rows[j, i] * middle[i]
                    speed += plan.rows[j, i] * v[i]
                load = max(load, 0.0)
                speed = abs(speed) if before[j] != 0.0 else 0.0
                bump = np.exp(-((speed / law[4]) ** 2)) if law[4] > 0.0 else 0.0
                high[j] = h * (load * (law[0] + (law[2] - law[0]) * bump) + law[5] * speed)
                low[j] = -h * (load * (law[1] + (law[3] - law[1]) * bump) + law[5] * speed)
                hold_high[j], hold_low[j] = h * load * law[2], -h * load * law[3]
                target[j] = -plan.offsets[j]
                path[j] = -plan.paths[j]
            elif plan.kinds[j] == RELAY:
                rows[j] = plan.rows[j] + 0.5 * h * plan.shifts[j]
                shift = plan.offsets[j]
                for i in range(m):
                    shift += plan.shifts[j, i] * middle[i]
                    above = plan.fields[j, 0, 0, i] + plan.fields[j, 0, 1, i] * middle[i]
                    above += plan.fields[j, 0, 2, i] * v[i]
                    below = plan.fields[j, 1, 0, i] + plan.fields[j, 1, 1, i] * middle[i]
                    below += plan.fields[j, 1, 2, i] * v[i]
                    force[i] += 0.5 * (above + below)
                    path[j, i] = 0.5 * (above - below)
                target[j] = -shift
                high[j], low[j], hold_high[j], hold_low[j] = h, -h, h, -h
            else:
                stop = plan.stops[j]
                gap = plan.offsets[j] - stop[1] * np.sin(stop[2] * t)
                wall = stop[1] * stop[2] * np.cos(stop[2] * t)
                speed = -wall
                for i in range(m):
                    gap += plan.rows[j, i] * middle[i]
                    speed += plan.rows[j, i] * v[i]
                active[j] = gap <= 0.0
                target[j] = wall - stop[0] * min(speed, 0.0)
                path[j] = plan.paths[j]
        free = inverse @ (right @ v + h * force)
        moves = np.zeros((E, m))
        for j in range(E):
            moves[j] = inverse @ path[j]
        new = free.copy()
        for j in range(E):  # from the forces of the step before, lest what sticks be found to slip on the way
            new += moves[j] * impulse[j]
        settled = E == 0
        for _ in range(SWEEPS):
            change, largest = 0.0, 0.0
            for j in range(E):
                if not active[j]:
                    continue
                gain, s = 0.0, -target[j]
                for i in range(m):
                    gain += rows[j, i] * moves[j, i]
                    s += rows[j, i] * (new[i] - moves[j, i] * impulse[j])
                old = impulse[j]
                if plan.kinds[j] == STOP:
                    impulse[j] = max(0.0, -s / gain)
                else:
                    pushes = 0.0
                    for i in range(m):
                        pushes += plan.rows[j, i] * moves[j, i]
                    if not pushes < 0.0:  # a relay that does not draw to its surface: the side as it is now
                        impulse[j] = high[j] if before[j] >= 0.0 else low[j]
                    elif before[j] > 0.0 and s + gain * high[j] > 0.0:
                        impulse[j], now[j] = high[j], 1
                    elif before[j] < 0.0 and s + gain * low[j] < 0.0:
                        impulse[j], now[j] = low[j], -1
                    elif hold_low[j] <= -s / gain <= hold_high[j]:
                        impulse[j], now[j] = -s / gain, 0
                    else:
                        impulse[j], now[j] = (high[j], 1) if s > 0.0 else (low[j], -1)
                change = max(change, abs(impulse[j] - old))
                largest = max(largest, abs(impulse[j]))
                for i in range(m):
                    new[i] += moves[j, i] * (impulse[j] - old)
            if change <= SETTLED * largest:
                settled = True
                break
        if not settled:
            unsettled += not one_of_all(
                plan.kinds,
                active,
                before,
                rows,
                moves,
                target,
                low,
                high,
                hold_low,
                hold_high,
                free,
                impulse,
                now,
            )
            new = free.copy()
            for j in range(E):
                if active[j]:
                    new += moves[j] * impulse[j]
        for j in range(E):
            before[j] = now[j]
            if plan.kinds[j] == RELAY and not (plan.rows[j] * moves[j]).sum() < 0.0:
                before[j] = np.sign((rows[j] * new).sum() - target[j])
        after = middle + 0.5 * h * new
        while place <= samples and place * steps <= (step + 1) * samples:
            share = place * steps / samples - step  # of the step
            if share <= 0.5:
                out[place, :m] = q + 2.0 * share * (middle - q)
            else:
                out[place, :m] = middle + (2.0 * share - 1.0) * (after - middle)
            for k in range(A):
                if plan.machines[k, 0] == THERMOSTAT:
                    out[place, m] = cold[k] + share * (heat[k] - cold[k])
            place += 1
        q, v = after, new
    return out, unsettled
