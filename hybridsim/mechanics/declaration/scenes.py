"""This module builds known systems of several blocks with friction, with adjustable parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.arguments import finite_number, numbers, whole_number
from hybridsim.errors import UsageError
from hybridsim.expr import parse
from hybridsim.mechanics.declaration.impact import MechanicalImpact
from hybridsim.mechanics.declaration.system import Harmonic, MechanicalContact, MechanicalSystem
from hybridsim.model.library import load_law

MOST_BLOCKS = 1_000_000  # of a chain


def chain_on_belt(
    n: int,
    *,
    coupling: float = 1.0,
    leaf: float = 1.0,
    delta: float = 3.0,
    belt: float = 0.2,
    spread: float = 0.5,
    seed: int = 0,
    gap: float | None = None,
    restitution: float = 0.5,
) -> MechanicalSystem:
    """Build a chain of n blocks on a moving belt with leaf springs: the model of Burridge and Knopoff.

    ::

        x_i'' + leaf x_i + coupling (2 x_i - x_{i-1} - x_{i+1}) = - f_i,   |f_i| = 1/(1 + delta |x_i' - belt|)

    Parameters
    ----------
    n : int
        Number of blocks, of mass 1; the ends are free.
    coupling, leaf : float, optional
        Stiffness between neighbours, and of each block to the frame.
    delta, belt : float, optional
        Decrease of friction with speed, and the belt's speed.
    spread, seed : float, int, optional
        The blocks start at rest, at random places within +-spread.
    gap, restitution : float, optional
        If given, neighbours collide when their distance is smaller by this gap than with slack springs.

    Returns
    -------
    MechanicalSystem
        The chain, without units.

    Raises
    ------
    UsageError
        For a gap in which the start may overlap: spread must be below gap/2.

    Notes
    -----
    Events travel along the chain. With one block it is the model ``belt``.

    References
    ----------
    R. Burridge, L. Knopoff, Bull. Seismol. Soc. Am. 57 (1967) 341; velocity weakening as J. M. Carlson, J. S. Langer,
    Phys. Rev. A 40 (1989) 6470, doi:10.1103/PhysRevA.40.6470.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.chain_on_belt(100).n
    100
    """
    from scipy import sparse

    n, seed = whole_number(n, "n", 1, MOST_BLOCKS), whole_number(seed, "seed", 0, 2**63)
    coupling, leaf = finite_number(coupling, "coupling"), finite_number(leaf, "leaf")
    belt = finite_number(belt, "belt")
    spread, gap = finite_number(spread, "spread"), None if gap is None else finite_number(gap, "gap")
    if not spread >= 0.0:
        raise UsageError(f"`spread` cannot be {spread!r}", remedy="use a number >= 0")
    diagonal = np.full(n, leaf + 2.0 * coupling)
    diagonal[0] -= coupling
    diagonal[-1] -= coupling
    beside = np.full(n - 1, -coupling)
    law: Any = {"mu": 1.0, "delta": delta}
    contacts = [
        MechanicalContact(f"f{i + 1}", {i: 1.0}, 1.0, load_law("hyperbolic"), law, belt) for i in range(n)
    ]
    if gap is not None and not 2.0 * spread < gap:
        raise UsageError(
            f"`gap` is {gap!r}, and `spread` is {spread!r}: neighbouring blocks could overlap at the start",
            remedy="use a spread below gap/2",
        )
    stops = range(n - 1) if gap is not None else ()
    return MechanicalSystem(
        np.ones(n),
        None,
        sparse.diags_array([diagonal, beside, beside], offsets=[0, 1, -1]),
        None,
        contacts,
        impacts=[
            MechanicalImpact(f"p{i + 1}", {i: -1.0, i + 1: 1.0}, gap or 0.0, restitution) for i in stops
        ],
        q0=np.random.default_rng(seed).uniform(-spread, spread, n),
        name=f"chain-{n}",
        title="Chain of blocks on a belt",
        source="R. Burridge, L. Knopoff, Bull. Seismol. Soc. Am. 57 (1967) 341",
    )


def two_blocks_on_belt(
    *, coupling: float = 1.2, second: float = 1.3, delta: float = 3.0, belt: float = 0.3
) -> MechanicalSystem:
    """Build two blocks on a moving belt, joined by a spring; the second block has the larger friction.

    Parameters
    ----------
    coupling : float, optional
        Stiffness between the blocks; each has a spring of stiffness 1 to the frame, and mass 1.
    second : float, optional
        Load of the second block, that of the first is 1.
    delta, belt : float, optional
        Decrease of friction with speed, and the belt's speed.

    Returns
    -------
    MechanicalSystem
        Two coordinates and two contacts, without units.

    Notes
    -----
    Both blocks stick together, the first is pulled off, and its motion then determines when the second follows.

    References
    ----------
    After U. Galvanetto, S. R. Bishop, L. Briseghella, Int. J. Bifurcation and Chaos 5 (1995) 637.

    Examples
    --------
    >>> import hybridsim as hs
    >>> len(hs.two_blocks_on_belt().contacts)
    2
    """
    coupling, second = finite_number(coupling, "coupling"), finite_number(second, "second")
    belt = finite_number(belt, "belt")
    law: Any = {"mu": 1.0, "delta": delta}
    loads = (1.0, second)
    contacts = [
        MechanicalContact(f"f{i + 1}", {i: 1.0}, loads[i], load_law("hyperbolic"), law, belt)
        for i in range(2)
    ]
    stiffness = [[1.0 + coupling, -coupling], [-coupling, 1.0 + coupling]]
    return MechanicalSystem(
        np.ones(2), None, stiffness, None, contacts, name="two-blocks",
        title="Two blocks on a belt, joined by a spring",
        source="after U. Galvanetto, S. R. Bishop, L. Briseghella, Int. J. Bifurcation and Chaos 5 (1995) 637",
    )  # fmt: skip


def three_coupled_blocks(
    *, mu: tuple[float, float, float] = (0.15, 0.3, 0.2), amplitude: float = 12.0, omega: float = 1.5
) -> MechanicalSystem:
    """Build a stack of three blocks. The lowest block is on the ground, and the middle block is shaken.

    Parameters
    ----------
    mu : tuple of float, optional
        Coefficients of friction from the lowest contact up; the blocks have mass 1 and g = 10, so that the
        loads are 30, 20 and 10.
    amplitude, omega : float, optional
        Amplitude and angular frequency of the force on the middle block.

    Returns
    -------
    MechanicalSystem
        Three coordinates and three contacts that share them, without units.

    Notes
    -----
    The slip of the three contacts is decided jointly, because each force acts on two blocks. Two blocks whose
    contact sticks have one velocity.

    References
    ----------
    In the manner of the problems of D. E. Stewart, Numer. Math. 58 (1990) 299, doi:10.1007/BF01385627.

    Examples
    --------
    >>> import hybridsim as hs
    >>> [contact.normal for contact in hs.three_coupled_blocks().contacts]
    [30.0, 20.0, 10.0]
    """
    coefficients = numbers(
        mu, "mu", "use three numbers, the coefficients of friction from the lowest contact up"
    )
    if len(coefficients) != 3:
        raise UsageError(
            f"`mu` cannot be {mu!r}",
            remedy="use three numbers, the coefficients of friction from the lowest contact up",
        )
    directions = [[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]]
    contacts = [
        MechanicalContact(
            f"f{i + 1}", directions[i], load, load_law("coulomb"), {"mu": parse(float(coefficients[i]))}
        )
        for i, load in enumerate((30.0, 20.0, 10.0))
    ]
    forces = [0, Harmonic(omega, sin=finite_number(amplitude, "amplitude")), 0]
    return MechanicalSystem(
        np.ones(3), None, None, forces, contacts, name="three-blocks",
        title="Three blocks on top of each other", source="after D. E. Stewart, Numer. Math. 58 (1990) 299",
    )  # fmt: skip
