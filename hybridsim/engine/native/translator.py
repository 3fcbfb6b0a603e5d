"""This module translates generated functions, which use a small part of Python, to LLVM.

A general compiler of Python first infers types. Here all numbers are doubles except the modes, and a function
of some dozen lines is compiled in milliseconds.
"""

from __future__ import annotations

import ast
from typing import Any

from llvmlite import ir

_DOUBLE, _LONG, _STATUS, _BIT = ir.DoubleType(), ir.IntType(64), ir.IntType(32), ir.IntType(1)
_SIGNATURE = ir.FunctionType(
    _STATUS, [_DOUBLE, _DOUBLE.as_pointer(), _DOUBLE.as_pointer(), _LONG.as_pointer(), _DOUBLE.as_pointer()]
)
OF_C = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow")
_INTRINSIC = {"sqrt": "llvm.sqrt", "abs": "llvm.fabs", "copysign": "llvm.copysign"}
_LOCAL = {"doubles": _DOUBLE, "integers": _LONG}  # functions that make local arrays
_NAMED = {"pi": 3.141592653589793, "inf": float("inf"), "nan": float("nan")}
_COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}


class Translator(ast.NodeVisitor):
    """Translates one function of a generated module into an LLVM module."""

    def __init__(self, module: ir.Module, definition: ast.FunctionDef) -> None:
        self.module = module
        function = ir.Function(module, _SIGNATURE, definition.name)
        self.function = function
        self.builder = ir.IRBuilder(function.append_basic_block("entry"))
        names = [argument.arg for argument in definition.args.args]
        self.arrays = dict(zip(names[1:], function.args[1:], strict=True))
        self.slots: dict[str, Any] = {}
        self.values = {names[0]: function.args[0]}
        self.entry = function.entry_basic_block
        for statement in definition.body:
            self.statement(statement)

    # -- statements -----------------------------------------------------------------------------------------

    def statement(self, node: ast.stmt) -> None:
        """Translate an assignment, an if statement, a while loop or a call of an earlier function."""
        if isinstance(node, ast.Assign):
            self._assign(node.targets[0], node.value)
        elif isinstance(node, ast.Expr):
            self._call(node.value)
        elif isinstance(node, ast.If):
            self._branch(node)
        elif isinstance(node, ast.While):
            self._loop(node)
        elif isinstance(node, ast.Return):
            self.builder.ret(ir.Constant(_STATUS, 0))
        else:
            raise NotImplementedError(ast.dump(node))

    def _assign(self, target: Any, node: Any) -> None:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _LOCAL:
            self._allocate(target.id, _LOCAL[node.func.id], ast.literal_eval(node.args[0]))
            return
        place = self._element(target) if isinstance(target, ast.Subscript) else self._place(target)
        is_mode = place.type == _LONG.as_pointer()
        self.builder.store(self.visit(node) if is_mode else self.number(node), place)

    def _allocate(self, name: str, kind: Any, size: int) -> None:
        """Allocate a local array in the translated function."""
        with self.builder.goto_block(self.entry):
            self.builder.position_at_start(self.entry)
            array = self.builder.alloca(ir.ArrayType(kind, size))
            self.arrays[name] = self.builder.gep(array, [ir.Constant(_LONG, 0)] * 2)

    def _call(self, node: Any) -> None:
        arrays = [self.arrays[argument.id] for argument in node.args[1:]]
        self.builder.call(self.module.globals[node.func.id], [self.number(node.args[0]), *arrays])

    def _place(self, target: Any) -> Any:
        """Return the stack slot of a variable in the translated function."""
        if target.id not in self.slots:
            with self.builder.goto_block(self.entry):
                self.builder.position_at_start(self.entry)
                self.slots[target.id] = self.builder.alloca(_DOUBLE)
        return self.slots[target.id]

    def _branch(self, node: ast.If) -> None:
        builder = self.builder
        then, otherwise, after = (builder.append_basic_block() for _ in range(3))
        builder.cbranch(self.truth(node.test), then, otherwise)
        for block, body in ((then, node.body), (otherwise, node.orelse)):
            builder.position_at_end(block)
            for statement in body:
                self.statement(statement)
            if not builder.block.is_terminated:
                builder.branch(after)
        builder.position_at_end(after)

    def _loop(self, node: ast.While) -> None:
        builder = self.builder
        test, body, after = (builder.append_basic_block() for _ in range(3))
        builder.branch(test)
        builder.position_at_end(test)
        builder.cbranch(self.truth(node.test), body, after)
        builder.position_at_end(body)
        for statement in node.body:
            self.statement(statement)
        builder.branch(test)
        builder.position_at_end(after)

    # -- expressions ----------------------------------------------------------------------------------------

    def number(self, node: ast.expr) -> Any:
        """Translate an expression to a double; a condition becomes 1 or 0."""
        value = self.visit(node)
        if value.type == _BIT:
            return self.builder.uitofp(value, _DOUBLE)
        return value if value.type == _DOUBLE else self.builder.sitofp(value, _DOUBLE)

    def truth(self, node: ast.expr) -> Any:
        """Translate an expression to a condition."""
        value = self.visit(node)
        if value.type == _BIT:
            return value
        zero = ir.Constant(value.type, 0)
        compare = self.builder.icmp_signed if value.type == _LONG else self.builder.fcmp_unordered
        return compare("!=", value, zero)

    def visit_Constant(self, node: ast.Constant) -> Any:
        """Translate a number; integers are modes and exponents."""
        if isinstance(node.value, bool):
            return ir.Constant(_BIT, int(node.value))
        return ir.Constant(_LONG if isinstance(node.value, int) else _DOUBLE, node.value)

    def visit_Name(self, node: ast.Name) -> Any:
        """Translate a variable, the time or a mathematical constant."""
        if node.id in self.values:
            return self.values[node.id]
        if node.id in _NAMED:
            return ir.Constant(_DOUBLE, _NAMED[node.id])
        return self.builder.load(self.slots[node.id])

    def _element(self, node: ast.Subscript) -> Any:
        index = self.visit(node.slice)
        if index.type == _DOUBLE:
            index = self.builder.fptosi(index, _LONG)
        return self.builder.gep(self.arrays[node.value.id], [index])  # type: ignore[attr-defined]  # a name

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        """Translate an element of a state, parameter or mode array."""
        return self.builder.load(self._element(node))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        """Translate a sign or a negation."""
        if isinstance(node.op, ast.Not):
            return self.builder.not_(self.truth(node.operand))
        value = self.visit(node.operand)
        if isinstance(node.op, ast.UAdd):
            return value
        return self.builder.fneg(value) if value.type == _DOUBLE else self.builder.neg(value)

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        """Translate arithmetic on doubles; exponents are integers."""
        if isinstance(node.op, ast.Pow):
            return self._power(self.number(node.left), node.right)
        left, right = self.number(node.left), self.number(node.right)
        operation = {
            ast.Add: self.builder.fadd,
            ast.Sub: self.builder.fsub,
            ast.Mult: self.builder.fmul,
            ast.Div: self.builder.fdiv,
        }[type(node.op)]
        return operation(left, right)

    def _power(self, base: Any, exponent: ast.expr) -> Any:
        """Compute an integer power by repeated squaring."""
        n = ast.literal_eval(exponent)
        assert isinstance(n, int) and n > 0
        result = None
        while n:
            if n & 1:
                result = base if result is None else self.builder.fmul(result, base)
            n >>= 1
            if n:
                base = self.builder.fmul(base, base)
        return result

    def visit_Compare(self, node: ast.Compare) -> Any:
        """Translate a comparison; a chained comparison is the conjunction of its parts."""
        operands = [node.left, *node.comparators]
        found = None
        for left, op, right in zip(operands, node.ops, operands[1:], strict=False):
            one = self._compare(self.visit(left), _COMPARE[type(op)], self.visit(right))
            found = one if found is None else self.builder.and_(found, one)
        return found

    def _compare(self, left: Any, op: str, right: Any) -> Any:
        if left.type == _LONG and right.type == _LONG:
            return self.builder.icmp_signed(op, left, right)
        left, right = (
            v
            if v.type == _DOUBLE
            else (self.builder.uitofp if v.type == _BIT else self.builder.sitofp)(v, _DOUBLE)
            for v in (left, right)
        )
        compare = self.builder.fcmp_unordered if op == "!=" else self.builder.fcmp_ordered
        return compare(op, left, right)

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        """Translate `and` and `or`; all operands are evaluated, since they have no side effects."""
        found, *others = [self.truth(value) for value in node.values]
        join = self.builder.and_ if isinstance(node.op, ast.And) else self.builder.or_
        for other in others:
            found = join(found, other)
        return found

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        """Translate a conditional expression; only the chosen value is evaluated."""
        builder = self.builder
        then, otherwise, after = (builder.append_basic_block() for _ in range(3))
        builder.cbranch(self.truth(node.test), then, otherwise)
        ends = []
        for block, part in ((then, node.body), (otherwise, node.orelse)):
            builder.position_at_end(block)
            value = self.number(part)
            ends.append((value, builder.block))
            builder.branch(after)
        builder.position_at_end(after)
        joined = builder.phi(_DOUBLE)
        for value, block in ends:
            joined.add_incoming(value, block)
        return joined

    def visit_Call(self, node: ast.Call) -> Any:
        """Translate a call of a mathematical function."""
        name = node.func.id  # type: ignore[attr-defined]  # a name
        values = [self.number(argument) for argument in node.args]
        if name in ("min", "max"):  # as in Python, the first of equal values or of a NaN
            a, b = values
            takes_b = self.builder.fcmp_ordered("<" if name == "min" else ">", b, a)
            return self.builder.select(takes_b, b, a)
        if name in _INTRINSIC:
            kind = ir.FunctionType(_DOUBLE, [_DOUBLE] * len(values))
            function = self.module.declare_intrinsic(_INTRINSIC[name], [_DOUBLE], kind)
        else:
            function = self.module.globals.get(f"c_{name}")
            if function is None:
                kind = ir.FunctionType(_DOUBLE, [_DOUBLE] * len(values))
                function = ir.Function(self.module, kind, f"c_{name}")
                # equal calls are made once, and unused ones never; llvmlite does not know the last attribute
                set.update(function.attributes, ("nounwind", "readnone", "willreturn"))
        return self.builder.call(function, values)

    def generic_visit(self, node: ast.AST) -> Any:
        """Reject a node that generated modules never contain."""
        raise NotImplementedError(ast.dump(node))
