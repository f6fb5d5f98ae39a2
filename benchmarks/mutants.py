"""Changes of one constant or operator in a module's source, one mutant each.

A mutant changes the program's tree in place and undoes the change again, so that a module is parsed
once. Excluded by rule, as no law follows from them:

- annotations, and with them units, bounds and sources in `Quantity(...)`;
- where a search starts: `KINDS`, and functions that take a `Context` or `Scales`, or return
  `Starts`, `Guess` or `Kind`;
- module constants that nothing but the excluded parts reads;
- decorators, messages of errors, assertions, `__all__`, and the arguments `strict`, `repr`,
  `compare` and `maxsize`.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass

SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
BOUNDARY: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
}
DROPPED = ("abs", "sign", "copysign")
"""Functions that are replaced by their first argument."""
EXCHANGED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
SEARCH_TYPES = ("Starts", "Guess", "Kind", "Context", "Scales")
SEARCH_TABLES = ("KINDS", "__all__")
UNCHANGED_ARGUMENTS = ("strict", "repr", "compare", "maxsize")
FACTOR, FROM_ZERO = 1.01, 0.01
"""Factor of a changed constant, and what zero becomes."""


@dataclass(frozen=True)
class Mutant:
    """One change of a module.

    Parameters
    ----------
    line
        Line of the source.
    function
        Name of the function or class that is changed; empty at module level.
    sort
        "operator", "constant" or "boundary" (a comparison that differs at equality only).
    text
        The change in words.
    apply, undo
        Change the tree, and change it back.
    """

    line: int
    function: str
    sort: str
    text: str
    apply: Callable[[], None]
    undo: Callable[[], None]


def _changed_constant(value: object) -> object | None:
    """Return another value of a constant, None for a text or another object."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value * FACTOR if value else FROM_ZERO
    return None


def _called_name(call: ast.Call) -> str:
    """Return the last part of a called function's name."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def _names_in(node: ast.AST | None) -> set[str]:
    """Return the names that stand in an annotation."""
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)} if node is not None else set()


def _starts_search(function: ast.FunctionDef) -> bool:
    """Return whether a function says where a search starts."""
    arguments = [argument.annotation for argument in function.args.args]
    return bool(
        set().union(*(_names_in(one) for one in (function.returns, *arguments))) & set(SEARCH_TYPES)
    ) and not any(argument.arg in ("self", "cls") for argument in function.args.args)


class _Lister:
    """Walks a tree and lists its mutants."""

    def __init__(self, tree: ast.Module) -> None:
        self._tree = tree
        self._idle = self._constants_of_searches()

    def _constants_of_searches(self) -> set[str]:
        """Return the module constants that only excluded parts read."""
        constants = {
            target.id
            for statement in self._tree.body
            if isinstance(statement, ast.Assign)
            for target in ast.walk(statement)
            if isinstance(target, ast.Name) and isinstance(target.ctx, ast.Store)
        }
        counted, everywhere = set(), set()
        for node in ast.walk(self._tree):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                everywhere.add(node.id)
        for statement in self._tree.body:
            for node, _ in self._visit(statement, "", set()):
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                    counted.add(node.id)
        return constants & (everywhere - counted)

    def _visit(self, node: ast.AST, function: str, idle: set[str]) -> Iterator[tuple[ast.AST, str]]:
        """Yield the nodes that are not excluded, with the name of their function."""
        if isinstance(node, (ast.Raise, ast.Assert, ast.JoinedStr, ast.Import, ast.ImportFrom)):
            return
        if isinstance(node, ast.FunctionDef) and _starts_search(node):
            return
        if isinstance(node, ast.If) and _names_in(node.test) == {"TYPE_CHECKING"}:
            return
        if isinstance(node, ast.Assign):
            targets = set().union(*(_names_in(target) for target in node.targets))
            if targets & set(SEARCH_TABLES) or (targets and targets <= idle):
                return
        if isinstance(node, ast.Call) and _called_name(node) in ("Quantity", "Choice"):
            return
        if isinstance(node, ast.keyword) and node.arg in UNCHANGED_ARGUMENTS:
            return
        yield node, function
        inside = f"{function}.{node.name}".strip(".") if hasattr(node, "name") else function  # type: ignore[attr-defined]
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "decorator_list", "type_params"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from self._visit(child, inside, idle)

    def mutants(self) -> Iterator[Mutant]:
        for statement in self._tree.body:
            for node, function in list(self._visit(statement, "", self._idle)):
                yield from _mutants_of(node, function)


def _mutants_of(node: ast.AST, function: str) -> Iterator[Mutant]:
    """Yield the mutants of one node."""
    line = getattr(node, "lineno", 0)

    def replace(target: ast.AST, field: str, value: object, sort: str, text: str) -> Mutant:
        before = getattr(target, field)
        return Mutant(
            line,
            function,
            sort,
            text,
            lambda: setattr(target, field, value),
            lambda: setattr(target, field, before),
        )

    match node:
        case ast.BinOp() | ast.AugAssign() | ast.BoolOp() if not _is_text(node):
            swapped = SWAPPED.get(type(node.op))
            if swapped is not None:
                text = f"{type(node.op).__name__} becomes {swapped.__name__}"
                yield replace(node, "op", swapped(), "operator", text)
        case ast.Compare():
            for number, operator in enumerate(node.ops):
                sort = "boundary" if type(operator) in BOUNDARY else "operator"
                swapped = BOUNDARY.get(type(operator)) or SWAPPED[type(operator)]
                changed = [*node.ops]
                changed[number] = swapped()  # type: ignore[call-overload]
                text = f"{type(operator).__name__} becomes {swapped.__name__}"
                yield replace(node, "ops", changed, sort, text)
        case ast.Constant():
            value = _changed_constant(node.value)
            if value is not None:
                text = f"{node.value!r} becomes {value!r}"
                yield replace(node, "value", value, "constant", text)
        case ast.UnaryOp(op=ast.USub()):
            yield replace(node, "op", ast.UAdd(), "operator", "minus sign dropped")
        case ast.UnaryOp(op=ast.Not()):
            twice = ast.copy_location(ast.UnaryOp(ast.Not(), node.operand), node)
            yield replace(node, "operand", twice, "operator", "not dropped")
        case ast.Call() if _called_name(node) in DROPPED and node.args:
            first = ast.Lambda(_first_of_any(), ast.Name("_first", ast.Load()))
            ast.fix_missing_locations(ast.copy_location(first, node))
            text = f"{_called_name(node)} dropped"
            yield replace(node, "func", first, "operator", text)
        case ast.Call() if _called_name(node) in EXCHANGED:
            name = _called_name(node)
            field = "attr" if isinstance(node.func, ast.Attribute) else "id"
            text = f"{name} becomes {EXCHANGED[name]}"
            yield replace(node.func, field, EXCHANGED[name], "operator", text)
        case _:
            pass


def _first_of_any() -> ast.arguments:
    """Return the arguments of a function that takes anything: `_first, *_`."""
    return ast.arguments(
        posonlyargs=[],
        args=[ast.arg("_first")],
        vararg=ast.arg("_more"),
        kwonlyargs=[],
        kw_defaults=[],
        kwarg=None,
        defaults=[],
    )


def _is_text(node: ast.AST) -> bool:
    """Return whether an operation joins or formats texts."""
    return any(
        isinstance(part, ast.JoinedStr)
        or (isinstance(part, ast.Constant) and isinstance(part.value, str))
        for part in ast.iter_child_nodes(node)
    )


def list_mutants(tree: ast.Module) -> list[Mutant]:
    """List the mutants of a module.

    Parameters
    ----------
    tree
        The module's syntax tree; every mutant changes it in place.

    Returns
    -------
    list of Mutant
        In the order of the source.
    """
    return list(_Lister(tree).mutants())
