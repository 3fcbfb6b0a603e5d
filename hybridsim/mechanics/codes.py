"""This module numbers modes, causes and results of a mechanical run, and the arguments of its kernels."""

from __future__ import annotations

STICK = 0  # the mode of a contact at rest; +1 and -1 are slip forward and backward
OPEN_END = 2.0**1000  # the time of an event that does not exist
VELOCITY, UPPER, LOWER, EXPIRY = range(
    4
)  # causes of the end of a mode; EXPIRY: the series reaches no further
DONE, FULL, INCONSISTENT, NONUNIQUE, CASCADE, LOST, LIMITED = range(7)  # reasons for the return of the loop

# Integer arguments of a kernel that is called by address; FIRST: start of a run of neighbours, or -1.
COUNT, DOFS, CONS, ORDER, NODE, FIRED, FIRST = range(7)
AT, LONGEST, RTOL, LENGTH = range(4)  # real arguments; LENGTH returns the length of a step
# Indices of these kernels; BERNSTEIN and later: conversion to Bernstein form, for decreasing numbers of terms.
EXPAND, STEP_LENGTH, JOINT_CHOICE, BERNSTEIN = range(4)
