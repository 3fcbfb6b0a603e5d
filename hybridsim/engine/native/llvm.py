"""Translation of generated functions, which use a small part of Python, to LLVM and then to machine code.

A general compiler of Python first infers types. Here all numbers are doubles except the modes, and a function
of some dozen lines is compiled in milliseconds.
"""

from __future__ import annotations

import ast
import ctypes
import ctypes.util
import hashlib
import re
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from llvmlite import binding, ir

from hybridsim.engine.native.cache import load_whole, store_whole
from hybridsim.engine.native.inner_parts import find_part
from hybridsim.expr.python_tree import python_tree

_DOUBLE, _LONG, _STATUS, _BIT = ir.DoubleType(), ir.IntType(64), ir.IntType(32), ir.IntType(1)
_SIGNATURE = ir.FunctionType(
    _STATUS, [_DOUBLE, _DOUBLE.as_pointer(), _DOUBLE.as_pointer(), _LONG.as_pointer(), _DOUBLE.as_pointer()]
)
_OF_C = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow")
_INTRINSIC = {"sqrt": "llvm.sqrt", "abs": "llvm.fabs", "copysign": "llvm.copysign"}
_NAMED = {"pi": 3.141592653589793, "inf": float("inf"), "nan": float("nan")}
_COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}


class Translator(ast.NodeVisitor):
    """Translate one function of a generated module into an LLVM module."""

    def __init__(self, module: ir.Module, definition: ast.FunctionDef) -> None:
        self.module = module
        function = ir.Function(module, _SIGNATURE, definition.name)
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
        """Translate one assignment, or an if statement with its branches."""
        if isinstance(node, ast.Assign):
            self._assign(node.targets[0], self.number(node.value))
        elif isinstance(node, ast.If):
            self._branch(node)
        elif isinstance(node, ast.Return):
            self.builder.ret(ir.Constant(_STATUS, 0))
        else:
            raise NotImplementedError(ast.dump(node))

    def _assign(self, target: ast.expr, value: Any) -> None:
        place = self._element(target) if isinstance(target, ast.Subscript) else self._place(target)
        self.builder.store(value, place)

    def _place(self, target: Any) -> Any:
        """Return the stack slot of a variable; the optimiser moves it to a register."""
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
        """Translate and, or; all operands are evaluated, since they have no side effects."""
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
                function.attributes.add("nounwind")
        return self.builder.call(function, values)

    def generic_visit(self, node: ast.AST) -> Any:
        """Reject a node that generated modules never contain."""
        raise NotImplementedError(ast.dump(node))


@cache
def _prepare() -> None:
    """Initialise LLVM for this machine and register the functions of the C library."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    library = ctypes.CDLL(ctypes.util.find_library("m")) if sys.platform != "win32" else ctypes.cdll.msvcrt
    for name in _OF_C:
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        binding.add_symbol(f"c_{name}", address)


def _machine() -> Any:
    """Return a new LLVM target machine for this computer; each compilation uses its own."""
    _prepare()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )


def compile_text(text: str, name: str, stored: Path | None) -> tuple[int, Any]:
    """Compile a function of a generated module from the module's text; return its address and the object to keep alive.

    stored: path of its cached machine code, if any; written at the first compilation.
    """
    addresses, engine = load_or_compile(stored, (name,), lambda: _translated(text, name))
    return addresses[0], engine


def load_or_compile(
    stored: Path | None, names: Sequence[str], written: Callable[[], str]
) -> tuple[list[int], Any]:
    """Return the addresses of functions of an LLVM module and the object that keeps them alive.

    stored: path of the cached machine code, if any. If the file does not exist, the text that `written` returns
    is compiled and stored.
    """
    code = load_whole(stored)
    if code is None:
        code = _compiled(written())
        store_whole(stored, code)
    _prepare()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return [engine.get_function_address(name) for name in names], engine


def _translated(text: str, name: str) -> str:
    """Translate a function of a generated module into an LLVM module."""
    module = ir.Module(name)
    Translator(module, python_tree(definition_in(text, name)).body[0])
    return str(module)


def functions_in(text: str) -> list[str]:
    """Return the names of the functions of a generated module that are compiled."""
    return re.findall(r"^def (\w+)\(t, x, p, z, out", text, re.MULTILINE)


def definition_in(text: str, name: str) -> str:
    """Return the lines of one function of a generated module, without parsing the whole module."""
    found = re.search(rf"^def {name}\(.*?(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL)
    assert found is not None, f"the module has no function {name}"
    return found.group()


def _compiled(text: str) -> bytes:
    """Compile an LLVM module to an object file for this machine."""
    machine = _machine()
    parsed = binding.parse_assembly(text)
    parsed.triple = machine.triple
    parsed.verify()
    create = find_part("llvmlite.binding", "create_pass_builder", "the functions of models run slower")
    if create is not None:
        builder = create(machine, binding.create_pipeline_tuning_options(speed_level=2))
        builder.getModulePassManager().run(parsed, builder)
    return bytes(machine.emit_object(parsed))


@cache
def machine_name() -> str:
    """Return a short name of the machine type for which code is compiled."""
    features = binding.get_host_cpu_features().flatten()
    described = f"{binding.get_default_triple()} {binding.get_host_cpu_name()} {features}"
    return hashlib.sha256(described.encode()).hexdigest()[:12]
