"""The numbers with a name of a package, read from its source."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["ROOT", "Constant", "bare", "constants", "imported", "module_name"]

ROOT = Path(__file__).parents[2] / "src" / "hmpim" / "identify"
_NAME = re.compile(r"_?[A-Z][A-Z0-9_]*")


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """One module constant that holds a number: `file` under identify/, its text, what it says."""

    file: str
    name: str
    text: str
    says: str

    @property
    def key(self) -> str:
        return f"{self.file}:{self.name}"

    @property
    def module(self) -> str:
        return module_name(ROOT / self.file)


def module_name(path: Path) -> str:
    """`hmpim.identify.fitting.fit` for its file."""
    parts = path.relative_to(ROOT.parents[1]).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _assigned(statement: ast.stmt) -> list[tuple[str, ast.expr]]:
    """Names of constants that a statement gives values, and these."""
    if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
        target, value = statement.targets[0], statement.value
    elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
        target, value = statement.target, statement.value
    else:
        return []
    pairs = [(target, value)]
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = list(zip(target.elts, value.elts, strict=True))
    return [(t.id, v) for t, v in pairs if isinstance(t, ast.Name) and _NAME.fullmatch(t.id)]


def _is_number(value: ast.expr, known: set[str]) -> bool:
    """Whether it is made of numbers, by arithmetic or by functions of numpy."""
    nodes = list(ast.walk(value))
    if any(isinstance(n, ast.Constant) and isinstance(n.value, str) for n in nodes):
        return False
    if any(isinstance(n, ast.Lambda | ast.comprehension | ast.Dict) for n in nodes):
        return False
    return any(
        (isinstance(n, ast.Constant) and isinstance(n.value, int | float))
        or (isinstance(n, ast.Name) and n.id in known)
        for n in nodes
    )


def _words(follows: ast.stmt | None) -> str:
    if isinstance(follows, ast.Expr) and isinstance(follows.value, ast.Constant):
        return " ".join(str(follows.value.value).split())
    return ""


def _of_file(path: Path) -> Iterator[Constant]:
    body = ast.parse(path.read_text()).body
    known: set[str] = set()
    for statement, follows in zip(body, [*body[1:], None], strict=True):
        if isinstance(statement, ast.ImportFrom):
            known |= {a.asname or a.name for a in statement.names if _NAME.fullmatch(a.name)}
        for name, value in _assigned(statement):
            if _is_number(value, known):
                known.add(name)
                yield Constant(
                    file=path.relative_to(ROOT).as_posix(),
                    name=name,
                    text=ast.unparse(value),
                    says=_words(follows),
                )


def constants() -> list[Constant]:
    """All of them, by file and place."""
    return [one for path in sorted(ROOT.rglob("*.py")) for one in _of_file(path)]


def _is_arithmetic(number: float) -> bool:
    """Whether it is a half, a double or rounding, and so no choice."""
    size = abs(number)
    return size in (0.0, 0.5, 1.0, 2.0) or size <= 1e-6 or size >= 1e6


def bare(source: str) -> list[tuple[int, float]]:
    """Fractions without a name that decide in comparisons, with their lines.

    Counts, which are whole numbers, are no fractions; neither are halves, doubles and rounding.

    Examples
    --------
    >>> bare("seen = x > 0.3 * y or x < 0.5 * fs or x > 1e-9 * y or n < 3")
    [(1, 0.3)]
    """
    return sorted(
        {
            (n.lineno, n.value)
            for compare in ast.walk(ast.parse(source))
            if isinstance(compare, ast.Compare)
            for n in ast.walk(compare)
            if isinstance(n, ast.Constant) and isinstance(n.value, float)
            if not _is_arithmetic(n.value)
        }
    )


def imported(path: Path) -> dict[str, tuple[str, str]]:
    """Names of constants that a module takes from others: what it calls them, whose they are."""
    out = {}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and "hmpim" in node.module:
            for alias in node.names:
                if _NAME.fullmatch(alias.name):
                    out[alias.asname or alias.name] = (node.module, alias.name)
    return out
