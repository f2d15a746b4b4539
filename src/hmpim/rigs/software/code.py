"""A function or a class of a Python file, as a rig is made of it."""

import importlib.util
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hmpim.errors import RigError

__all__ = ["Fresh", "load_code"]


class Fresh:
    """Objects of a class with a memory: each run gets a new one.

    Parameters
    ----------
    make : callable
        Makes the object, which is called with each sample.

    Examples
    --------
    >>> class Counter:
    ...     seen = 0
    ...     def __call__(self, u):
    ...         self.seen += 1
    ...         return self.seen
    >>> fresh = Fresh(Counter)
    >>> fresh(0.0), fresh(0.0)
    (1, 2)
    >>> fresh.reset()
    >>> fresh(0.0)
    1
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self.reset()

    def reset(self) -> None:
        """Begin with a new object."""
        self._one = self._make()

    def __call__(self, value: Any) -> Any:
        """Call the object."""
        return self._one(value)


def load_code(file: str, name: str) -> Callable[[Any], Any]:
    r"""Run a Python file and return one of its functions, or a `Fresh` for one of its classes.

    Modules beside the file can be imported by it.

    Parameters
    ----------
    file : str
        Path of the file.
    name : str
        Of a function of one argument, or of a class whose objects are called with one.

    Raises
    ------
    RigError
        If there is no such file, it does not run, or it has no such function or class.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "mine.py")
    ...     _ = path.write_text("def double(u):\n    return 2 * u\n")
    ...     load_code(str(path), "double")(3)
    6
    """
    path = Path(file)
    if not path.is_file():
        raise RigError(f"there is no file {file!r} to take {name!r} from")
    spec = importlib.util.spec_from_file_location(f"hmpim_under_test_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise RigError(f"{file!r} is not a Python file; its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    beside = str(path.resolve().parent)
    sys.path.insert(0, beside)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:  # whatever the software under test raises, SystemExit too
        if isinstance(error, KeyboardInterrupt):
            raise
        raise RigError(f"{file!r} does not run: {type(error).__name__}: {error}") from error
    finally:
        if beside in sys.path:
            sys.path.remove(beside)
    found = getattr(module, name, None)
    if not callable(found):
        own = (n for n, v in vars(module).items() if callable(v) and _is_own(v, module.__name__))
        there = ", ".join(sorted(own)) or "no function at all"
        raise RigError(f"{file!r} has no function {name!r}; it has {there}")
    if not inspect.isclass(found):
        return found  # type: ignore[no-any-return]
    try:
        fresh = Fresh(found)
    except Exception as error:  # whatever the software under test raises
        raise RigError(
            f"{file!r}: {name}() failed: {type(error).__name__}: {error}; a class under test "
            "is made without arguments"
        ) from error
    if not callable(fresh._one):
        raise RigError(f"{file!r}: objects of {name} cannot be called; give the class __call__")
    return fresh


def _is_own(value: Any, module: str) -> bool:
    return getattr(value, "__module__", None) == module
