"""Order conditions of one-step methods from rooted trees (Hairer, Norsett and Wanner 1993, section II.2)."""

from __future__ import annotations

from functools import cache
from math import prod

import numpy as np

Tree = tuple["Tree", ...]  # a root with its branches, sorted


def order(tree: Tree) -> int:
    """Number of vertices."""
    return 1 + sum(map(order, tree))


def density(tree: Tree) -> int:
    """gamma: the order of the tree times the densities of its branches."""
    return order(tree) * prod(map(density, tree))


@cache
def trees(size: int) -> frozenset[Tree]:
    """All rooted trees with so many vertices: a new leaf on every vertex of every smaller tree."""
    if size == 1:
        return frozenset([()])
    return frozenset(grown for tree in trees(size - 1) for grown in with_leaf(tree))


def with_leaf(tree: Tree) -> list[Tree]:
    """A tree with one more leaf, in all ways."""
    grown = [tuple(sorted((*tree, ())))]
    for i, branch in enumerate(tree):
        grown += [tuple(sorted((*tree[:i], new, *tree[i + 1 :]))) for new in with_leaf(branch)]
    return grown


def stages(tree: Tree, a: np.ndarray) -> np.ndarray:
    """Elementary weights of the stages: products over the branches of a times theirs."""
    out = np.ones(len(a))
    for branch in tree:
        out = out * (a @ stages(branch, a))
    return out


def defects(a: np.ndarray, b: np.ndarray, size: int) -> np.ndarray:
    """b . stages(tree) - 1/density(tree) of all trees with so many vertices: zero where the order is reached."""
    return np.array([b @ stages(tree, a) - 1 / density(tree) for tree in sorted(trees(size))])
