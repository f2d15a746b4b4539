"""Watch the constants of `hmpim.identify` decide, in one run.

Each comparison, `min`, `max` and `clip` that names a constant is rewritten as the module is
imported: it is evaluated with the constant at both ends as well, and a difference is noted. What
names a constant elsewhere is noted as reached. So one run over the records tells which of them
have to be identified again with a constant changed, and for most constants that is none.
"""

from __future__ import annotations

import ast
import importlib.abc
import importlib.machinery
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from thresholds.constants import ROOT, Constant, constants, imported, module_name

__all__ = ["Notes", "ends", "install", "set_constant"]

LESS, MORE = 0.7, 1.3
_CLAMPS = {"min", "max", "minimum", "maximum", "clip"}


class Notes:
    """Keys of the constants that one record has reached, and that decided otherwise there."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        self.reached: set[str] = set()
        self.moved: set[str] = set()


NOTES = Notes()


def ends(value: Any) -> tuple[Any, Any]:
    """30 % less and more; of a whole number, by at least one; of several, each."""
    if isinstance(value, tuple):
        pairs = [ends(v) for v in value]
        return tuple(p[0] for p in pairs), tuple(p[1] for p in pairs)
    if isinstance(value, bool | str) or value is None:
        return value, value
    if isinstance(value, int):
        least = min(round(LESS * value), value - 1) if value > 0 else value - 1
        return least, max(round(MORE * value), value + 1)
    return LESS * value, MORE * value


def _same(a: Any, b: Any) -> bool:
    try:
        return bool(np.array_equal(a, b, equal_nan=True))
    except TypeError:
        return bool(np.array_equal(a, b))


def _watched(keys: Sequence[tuple[str, str]], value: Callable[[], Any], names: dict) -> Any:
    """The value of an expression; noted is each constant that would change it."""
    here = value()
    for name, key in keys:
        NOTES.reached.add(key)
        if key in NOTES.moved:
            continue
        kept = names[name]
        for other in ends(kept):
            names[name] = other
            try:
                same = _same(here, value())
            except Exception:  # what an expression raises with another value moves it too
                same = False
            finally:
                names[name] = kept
            if not same:
                NOTES.moved.add(key)
                break
    return here


def _used(key: str, value: Any) -> Any:
    """The value of a constant; noted is that it was used where nothing tells how much it moves."""
    NOTES.moved.add(key)
    NOTES.reached.add(key)
    return value


class _Rewrite(ast.NodeTransformer):
    def __init__(self, keys: dict[str, str]) -> None:
        self.keys = keys
        self.inside = 0

    def _function(self, node: Any) -> Any:
        self.inside += 1
        node.body = [self.visit(s) for s in node.body]
        self.inside -= 1
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> Any:
        return self._function(node)

    def _expression(self, node: Any) -> Any:
        named = sorted({n.id for n in ast.walk(node) if isinstance(n, ast.Name)} & self.keys.keys())
        walrus = any(isinstance(n, ast.NamedExpr) for n in ast.walk(node))
        if not self.inside or not named or walrus:
            return self.generic_visit(node)
        pairs = ast.Tuple(
            elts=[
                ast.Tuple(elts=[ast.Constant(n), ast.Constant(self.keys[n])], ctx=ast.Load())
                for n in named
            ],
            ctx=ast.Load(),
        )
        empty = ast.arguments(posonlyargs=[], args=[], kwonlyargs=[], kw_defaults=[], defaults=[])
        return ast.Call(
            func=ast.Name("__watched__", ast.Load()),
            args=[
                pairs,
                ast.Lambda(args=empty, body=node),
                ast.Call(func=ast.Name("globals", ast.Load()), args=[], keywords=[]),
            ],
            keywords=[],
        )

    def visit_Compare(self, node: ast.Compare) -> Any:
        return self._expression(node)

    def visit_Call(self, node: ast.Call) -> Any:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else None
        name = node.func.id if isinstance(node.func, ast.Name) else name
        return self._expression(node) if name in _CLAMPS else self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> Any:
        if not self.inside or node.id not in self.keys or not isinstance(node.ctx, ast.Load):
            return node
        return ast.Call(
            func=ast.Name("__used__", ast.Load()),
            args=[ast.Constant(self.keys[node.id]), node],
            keywords=[],
        )


class _Loader(importlib.machinery.SourceFileLoader):
    keys: ClassVar[dict[str, dict[str, str]]] = {}

    def get_code(self, fullname: str) -> Any:
        tree = ast.parse(Path(self.path).read_text())
        tree = _Rewrite(self.keys.get(fullname, {})).visit(tree)
        return compile(ast.fix_missing_locations(tree), self.path, "exec")

    def exec_module(self, module: ModuleType) -> None:
        module.__dict__.update(__watched__=_watched, __used__=_used)
        super().exec_module(module)


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, fullname: str, path: Any, target: Any = None) -> Any:
        if not fullname.startswith("hmpim.identify"):
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def places(found: Sequence[Constant]) -> dict[str, dict[str, str]]:
    """Of each module, the names that are constants, its own and those it imports."""
    own = {(c.module, c.name): c.key for c in found}
    out: dict[str, dict[str, str]] = {}
    for (module, name), key in own.items():
        out.setdefault(module, {})[name] = key
    for path in ROOT.rglob("*.py"):
        for name, where in imported(path).items():
            if where in own:
                out.setdefault(module_name(path), {})[name] = own[where]
    return out


def install() -> Notes:
    """Watch whatever is imported of `hmpim.identify` from now on."""
    if any(name.startswith("hmpim.identify") for name in sys.modules):
        raise RuntimeError("hmpim.identify is imported already; install before it is")
    _Loader.keys = places(constants())
    sys.meta_path.insert(0, _Finder())
    return NOTES


def set_constant(one: Constant, value: Any, where: dict[str, dict[str, str]]) -> None:
    """Give a constant a value, in its module and in all that import it."""
    for module, names in where.items():
        for name, key in names.items():
            if key == one.key and module in sys.modules:
                setattr(sys.modules[module], name, value)
