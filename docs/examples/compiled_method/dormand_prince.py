"""Dormand and Prince's pair of order 5(4) with a quartic interpolant: a compiled method in a package of its own.

J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19, doi:10.1016/0771-050X(80)90013-3. The interpolant is
that of L. F. Shampine, Math. Comp. 46 (1986) 135, doi:10.1090/S0025-5718-1986-0815836-3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from hybridsim.integrators import contract

STAGES, DEGREE = 7, 4
A = np.zeros((STAGES, STAGES))  # the last stage is at the end of the step, with the weights of order 5
A[1, :1] = 1 / 5
A[2, :2] = 3 / 40, 9 / 40
A[3, :3] = 44 / 45, -56 / 15, 32 / 9
A[4, :4] = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
A[5, :5] = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
A[6, :6] = 35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
C = A.sum(axis=1)
# weights of order 5 minus those of order 4
E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
P = np.zeros((DEGREE, STAGES))  # weights of the stages in the powers of theta from the first on
P[0, 0] = 1
P[1:, 0] = -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432
P[1:, 2] = 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799
P[1:, 3] = -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072
P[1:, 4] = 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632
P[1:, 5] = -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844
P[1:, 6] = 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423
LARGEST_DEFECT = 100.0  # of the interpolant in the middle of a step, in tolerances
CORRECTIONS = 8  # most corrections of the time of an event


@contract.kernel
def trial(flow, s, h, x, p, z, tolerances, k, out):
    """Take a step of length h from (s, x) with the slope k[0]; return its error in units of the tolerance."""
    rtol, atol = tolerances
    n, square = x.shape[0], 0.0
    for i in range(1, STAGES):
        for m in range(n):
            total = 0.0
            for j in range(i):
                total += A[i, j] * k[j, m]
            out[m] = x[m] + h * total
        contract.call(flow, s + C[i] * h, out, p, z, k[i])
    for m in range(n):
        error, scale = 0.0, atol[m] + rtol * max(abs(x[m]), abs(out[m]))
        for j in range(STAGES):
            error += E[j] * k[j, m]
        if scale > 0.0:
            square += (h * error / scale) ** 2
    return math.sqrt(square / max(n, 1))


@contract.kernel
def interpolate(x, k, h, out):
    """Write the interpolant of a step from x in powers of the time since its start."""
    for m in range(x.shape[0]):
        out[m, 0], power = x[m], 1.0
        for i in range(DEGREE):
            total = 0.0
            for j in range(STAGES):
                total += P[i, j] * k[j, m]
            out[m, i + 1] = total / power
            power *= h


@contract.kernel
def has_defect(flow, s, h, p, z, tolerances, c, x, dx):
    """Return whether an interpolant c misses the equation in the middle of a step, where no stage is."""
    rtol, atol = tolerances
    d = 0.5 * h
    for m in range(c.shape[0]):
        x[m] = (((c[m, 4] * d + c[m, 3]) * d + c[m, 2]) * d + c[m, 1]) * d + c[m, 0]
    contract.call(flow, s + d, x, p, z, dx)
    for m in range(c.shape[0]):
        slope = ((4.0 * c[m, 4] * d + 3.0 * c[m, 3]) * d + 2.0 * c[m, 2]) * d + c[m, 1]
        scale = atol[m] + rtol * max(abs(c[m, 0]), abs(x[m]))
        if not abs(h * (slope - dx[m])) <= LARGEST_DEFECT * scale:
            return True
    return False


@contract.kernel
def first_length(dx, x, bound, tolerances):
    """Return a length over which states with these rates change by far less than their size."""
    rtol, atol = tolerances
    h = bound
    for m in range(x.shape[0]):
        if dx[m] != 0.0:
            h = min(h, (abs(x[m]) * rtol**0.2 + atol[m] ** 0.5 + 1e-9 * bound) / abs(dx[m]))
    return h


@contract.inlined
def segment(start, model, call, state, work, own, rows):
    """Follow one segment; see `hybridsim.integrators.contract.MethodKernels`."""
    if not contract.begin_segment(start, model, call, state, work, own):
        return contract.not_followed(contract.STOPPED)
    flow, y, p, z, method = contract.called_by(work).flow, work.y, state.p, state.z, own.method
    k, end, tolerances = method.k, method.end, (own.control[0], own.atol)
    bound, max_step = start.bound, own.control[1]
    s, number, d = 0.0, -1, 0.0
    contract.call(flow, s, y, p, z, k[0])
    h = first_length(k[0], y, bound, tolerances)
    contract.forget(method.memory)
    while number < 0 and s < bound:
        code = contract.next_step(call, own, rows, s)
        if code == contract.FOLLOWED:
            break  # the segment is divided
        if code != contract.CONTINUES:
            return contract.not_followed(code)
        h = min(h, max_step)
        is_last = h >= bound - s
        d = whole = bound - s if is_last else (s + h) - s
        if not d > 0.0:
            return contract.not_followed(contract.STOPPED)
        error = trial(flow, s, d, y, p, z, tolerances, k, end)
        own.counts[0] += STAGES
        h = contract.next_length(d, error, 5, method.memory)
        interpolate(y, k, d, own.polynomial)
        if not error <= 1.0 or has_defect(flow, s, d, p, z, tolerances, own.polynomial, method.x, method.dx):
            own.counts[1] += 1
            h = min(h, 0.5 * d)
            continue
        outcome, number, at = contract.first_zero(start, model, own, s, d)
        if outcome == contract.OPEN:
            return contract.not_followed(contract.STOPPED)
        is_zero = outcome != contract.FOUND
        if is_zero:
            contract.project(model, work, state, s + d, end)
        for _ in range(0 if is_zero else CORRECTIONS):  # repeat the step up to the zero of the guard
            d, is_last = (s + at) - s, False
            if not d > 0.0:
                return contract.not_followed(contract.STOPPED)
            error = trial(flow, s, d, y, p, z, tolerances, k, end)
            own.counts[0] += STAGES - 1
            contract.project(model, work, state, s + d, end)
            contract.guards_at_end(start, model, own, s + d, end)
            move = -own.guards[number, 0] / own.guards[number, 1]
            is_zero = abs(move) <= 2.0 * 2.0**-52 * (s + d)
            if is_zero or not error <= 1.0 or not abs(move) < 0.125 * whole:
                break
            at = d + move
        if not error <= 1.0:
            own.counts[1] += 1
            h, number = 0.5 * d, -1
            if s == 0.0:
                contract.put_sides(state, own)
            continue
        if not is_zero:
            return contract.not_followed(contract.STOPPED)
        if number >= 0:
            interpolate(y, k, d, own.polynomial)
        contract.record_step(call, work, own, rows, s, d, end)
        s = bound if is_last else s + d
        contract.call(flow, s, y, p, z, k[0])
    return contract.end_segment(start, model, call, state, work, own, s, d, number)


def loop(model, call, state, work, record, own, rows):
    """Run from event to event over segments of this method."""
    return contract.event_loop(segment, model, call, state, work, record, own, rows)


class Arrays(NamedTuple):
    """Arrays of the method for one call."""

    k: np.ndarray  # slopes (STAGES, n) at the stages
    end: np.ndarray  # states (n,) at the end of a step
    x: np.ndarray  # states (n,) in its middle
    dx: np.ndarray  # rates (n,) there
    memory: np.ndarray  # (3,) of the step control


class Kernels(contract.PolynomialKernels):
    """The compiled part of the method."""

    loop = staticmethod(loop)
    degree = DEGREE

    def method_arrays(self):
        """Return the arrays of the method for one call."""
        n = self.system.n
        return Arrays(np.empty((STAGES, n)), np.empty(n), np.empty(n), np.empty(n), np.empty(3))


class Stepper(contract.OneStepStepper):
    """The same steps one by one, for what the compiled loop leaves to the general one."""

    def __init__(self, flow, x0, bound, tolerances, first_step):
        self.address = flow.system.address("flow")
        super().__init__(flow, x0, bound, tolerances, first_step, order=5, error_order=5)

    def attempt(self, start, h):
        """Try one step."""
        flow, n = self.flow, self.flow.n
        k, end, polynomial = np.empty((STAGES, n)), np.empty(n), np.empty((n, DEGREE + 1))
        k[0] = start.dx
        error = trial(self.address, start.s, h, start.x, flow.p, flow.z, self.control, k, end)
        interpolate(start.x, k, h, polynomial)
        flow.counters.rhs_evaluations += STAGES - 1
        return contract.Trial(end, error, polynomial)

    def holds(self, start, end, made):
        """Return whether the interpolant holds in the middle of a step."""
        flow, (x, dx), h = self.flow, np.empty((2, self.flow.n)), end.s - start.s
        return not has_defect(self.address, start.s, h, flow.p, flow.z, self.control, made.dense_data, x, dx)

    def dense(self, start, end, made):
        """Return the interpolant of a step."""
        return lambda s: (s - start.s)[:, None] ** np.arange(DEGREE + 1) @ made.dense_data.T


@dataclass(frozen=True)
class DormandPrince(contract.Integrator):
    """Dormand and Prince's pair of order 5(4), compiled, with events located by the engine.

    When to choose it: loose tolerances, smooth modes that are not stiff.
    """

    name: ClassVar[str] = "dormand-prince"
    title: ClassVar[str] = "compiled Dormand-Prince 5(4) with a quartic interpolant"
    order: ClassVar[str] = "5(4)"
    reference: ClassVar[str] = "Dormand and Prince 1980, doi:10.1016/0771-050X(80)90013-3"
    when: ClassVar[str] = "loose tolerances: smooth modes, not stiff"
    lacks: ClassVar[dict[str, str]] = {"stiff": "it is explicit: the fastest rate limits its step"}
    has_compiled_loop: ClassVar[bool] = True

    def prepare(self, system):
        """Compile the loop."""
        if system.has_tape and not system.has_corners:
            contract.compile_loops(system, Kernels)

    def compiled_loop(self, system, tolerances, longest):
        """Return the compiled loop; None if guards have no series: for corners and Python functions."""
        has_loop = system.has_tape and not system.has_corners
        return contract.CompiledLoop(Kernels(system, tolerances, longest)) if has_loop else None

    def start(self, flow, x0, s_bound, tolerances, first_step, watch):
        """Begin a smooth segment step by step."""
        return Stepper(flow, x0, s_bound, tolerances, first_step)
