"""This module numbers the operations of instruction tapes, including operations that only optimised tapes have."""

from __future__ import annotations

# INTEGRAL gives y with y' * a = b' (log, atan, asin: the derivative is a quotient).
COPY, ADD, SUB, MUL, DIV, NEG, SQRT, EXP, SINCOS, INTEGRAL = range(10)
SINHCOSH, TANGENT, ABS, SIGN, MIN, MAX, LESS, LESS_EQUAL, AND, OR, NOT, SELECT, EQUAL = range(10, 23)
# c of a LESS whose two choices are the same function
AGREEING = 1
# how INTEGRAL computes its leading coefficient from the argument c
LOG, ASIN, ACOS, ATAN, ANGLE = range(30, 35)
# Additional operations of the optimised tape, on a series a and a constant b.
ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB, SCALE, DIVIDE_BY, SINCOS_LINEAR = range(40, 46)
