"""A Functional Mock-up Unit under test, run by FMPy: FMI 2 and 3, co-simulation and exchange."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RigError, UnitError
from hmpim.record import Intersample
from hmpim.rigs.block import Block, Layout, Quantity
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.stimuli import feed_of
from hmpim.stimulus import Limits
from hmpim.units import check_unit, conversion_factor, read_unit

__all__ = ["FmuRig", "Interface"]

FloatArray = NDArray[np.float64]

Interface = Literal["auto", "cosimulation", "exchange"]
"""How an FMU is run; 'auto' takes co-simulation where the FMU has it."""

_REAL = ("Real", "Float64")

_LAST: dict[str, Any] = {}
"""Callbacks of the last FMU. FMPy's proxy hands what any FMU of the process says to the last logger
it was given, so that one which is gone would take the process down.
"""


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FmuRig(Simulated):
    """An FMU as the unit under test; it is set up anew for each run.

    In co-simulation each sample is set, the output is read, and the FMU does a step of the
    stimulus's interval: what it makes of its input between the samples is its own affair. In model
    exchange its equations are integrated here; the input is joined linearly between the samples,
    which the record says.

    Parameters
    ----------
    path : str
        The FMU.
    input, output : str
        Names of a real input and a real output; empty where the FMU has only one.
    interface : {'auto', 'cosimulation', 'exchange'}
        How it is run.
    start : mapping of str to float or str
        Start values of its variables and parameters.
    tolerance : float
        Relative, of the integration in model exchange.
    measures : {'position', 'velocity', 'acceleration'}
        Which quantity of the motion is fed.
    output_unit : str or None
        None takes the FMU's, or the input's where it states none.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the record says of the input in co-simulation; None leaves it open.
    name, input_name, output_name : str
        Name of the rig, and of its record's channels.
    limits : Limits or None
        What it is made for; None for anything.

    Raises
    ------
    ArgumentError
        If an option is not known.

    Examples
    --------
    >>> FmuRig(path="axis.fmu", interface="exchange").interface
    'exchange'
    """

    path: str
    input: str = ""
    output: str = ""
    interface: Interface = "auto"
    start: Mapping[str, float | str] = field(default_factory=dict)
    tolerance: float = 1e-8
    measures: Quantity = "position"
    output_unit: str | None = None
    intersample: Intersample | None = None
    name: str = "fmu"
    input_name: str = "u"
    output_name: str = "y"
    limits: Limits | None = None
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise ArgumentError(f"tolerance = {self.tolerance!r} must be between 0 and 1")
        check_unit(self.output_unit or "")

    @property
    def axes(self) -> tuple[str, ...]:
        """Empty: any one stimulus is fed."""
        return ()

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Open the FMU, choose its variables, and set it up.

        Raises
        ------
        RigError
            If it cannot be read or run, or its input's unit is not the stimulus's.
        """
        self.stop()
        fed = feed_of(stimulus, measures=self.measures, rig=self.name, name=self.input_name)
        described = read_described(self.path)
        taken = _chosen(described, "input", self.input, path=self.path)
        read = _chosen(described, "output", self.output, path=self.path)
        _check_input_unit(taken, fed.unit, path=self.path)
        exchange = _is_exchange(described, self.interface, path=self.path)
        work = tempfile.TemporaryDirectory(prefix="hmpim-fmu-")
        play: Callable[[slice], FloatArray]
        unit_under_test = None
        try:
            unit_under_test = _Opened(
                self.path, described, work.name, taken=taken, read=read, start=self.start
            )
            if exchange:
                whole = unit_under_test.exchanged(fed.values, fs=fed.fs, tolerance=self.tolerance)
                play = whole.__getitem__
            else:
                play = unit_under_test.cosimulated(fed.values, fs=fed.fs)
        except BaseException:
            if unit_under_test is not None:
                unit_under_test.close()
            work.cleanup()
            raise
        self._playing.state = (play, unit_under_test, work)
        stated = self.output_unit
        if stated is None:
            stated = fed.unit if not read.unit else (read_unit(read.unit) or fed.unit)
        return fed.layout(
            output=self.output_name,
            unit=stated,
            intersample="foh" if exchange else self.intersample,
            source=f"FMU {Path(self.path).name}, {read.name} from {taken.name}, "
            + ("model exchange" if exchange else "co-simulation"),
        )

    def play(self, block: Block, /) -> dict[str, FloatArray]:
        """Return what the FMU makes of the block's samples.

        Raises
        ------
        RigError
            If the FMU fails, or its output is not finite.
        """
        play, _, _ = self._playing.current(self.name)
        values = play(slice(block.start, block.stop))
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise RigError(
                f"{self.path!r} returned {values[bad[0]]} at sample {block.start + bad[0]}"
            )
        return {self.output_name: values}

    def stop(self) -> None:
        """Take the FMU down."""
        state, self._playing.state = self._playing.state, None
        if state is not None:
            state[1].close()
            state[2].cleanup()


class _Opened:
    """An FMU unpacked into a folder, with the input that it takes and the output that is read."""

    def __init__(
        self,
        path: str,
        described: Any,
        folder: str,
        *,
        taken: Any,
        read: Any,
        start: Mapping[str, float | str],
    ) -> None:
        import fmpy

        self._path, self._described = path, described
        self._taken, self._read, self._start = taken, read, dict(start)
        self._fmu: Any = None
        known = {v.name for v in described.modelVariables}
        strange = sorted(set(self._start) - known)
        if strange:
            raise RigError(f"{path!r} has no variable {strange[0]!r} to start from")
        self._folder = fmpy.extract(path, unzipdir=folder)

    def exchanged(self, fed: FloatArray, *, fs: float, tolerance: float) -> FloatArray:
        """Output at k/fs, the input joined linearly, the equations integrated."""
        from hmpim.rigs.software.exchange import exchanged

        said: list[str] = []
        fmu = self._set_up("ModelExchange", float(fed[0]), said)
        try:
            return exchanged(
                fmu,
                self._described,
                fed,
                fs=fs,
                taken=self._taken.valueReference,
                read=self._read.valueReference,
                tolerance=tolerance,
            )
        except Exception as error:  # the FMU raises whatever it likes
            raise RigError(f"{self._path!r} failed: {_words(error, said)}") from error

    def cosimulated(self, fed: FloatArray, *, fs: float) -> Callable[[slice], FloatArray]:
        """Set up for steps of 1/fs; what is returned plays a part of the samples."""
        said: list[str] = []
        fmu = self._set_up("CoSimulation", float(fed[0]), said)
        put, get = _access(fmu)
        taken, read, step = [self._taken.valueReference], [self._read.valueReference], 1.0 / fs

        def play(part: slice) -> FloatArray:
            values = np.empty(part.stop - part.start)
            for k, sample in enumerate(fed[part].tolist()):
                number = part.start + k
                try:
                    put(taken, [sample])
                    values[k] = get(read)[0]
                    fmu.doStep(number * step, step)
                except Exception as error:  # as above
                    raise RigError(
                        f"{self._path!r} failed at sample {number}, step {1e3 * step:g} ms: "
                        f"{_words(error, said)}{self._own_step(fs)}"
                    ) from error
            return values

        return play

    def _set_up(self, kind: str, first: float, said: list[str]) -> Any:
        """Make an instance, set what it starts from, and end its initialisation."""
        from fmpy.simulation import (
            apply_start_values,
            instantiate_fmu,
            settable_in_initialization_mode,
            settable_in_instantiated,
        )

        described = self._described
        try:
            fmu = self._fmu = instantiate_fmu(self._folder, described, kind, logger=_listener(said))
            _LAST["callbacks"] = getattr(fmu, "callbacks", None)
            left = apply_start_values(
                fmu, described, dict(self._start), settable=settable_in_instantiated
            )
            if described.fmiVersion == "2.0":
                fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            left = apply_start_values(
                fmu, described, left, settable=settable_in_initialization_mode
            )
            _access(fmu)[0]([self._taken.valueReference], [first])
            fmu.exitInitializationMode()
        except Exception as error:  # as above
            raise RigError(f"{self._path!r} cannot be set up: {_words(error, said)}") from error
        if left:
            raise RigError(f"{self._path!r}: {sorted(left)[0]!r} cannot be set")
        return fmu

    def close(self) -> None:
        """Free the instance, whatever state it is in."""
        fmu, self._fmu = self._fmu, None
        if fmu is None:
            return
        for last in (fmu.terminate, fmu.freeInstance):
            try:
                last()
            except Exception:  # it may have failed before; nothing is left to be saved
                continue

    def _own_step(self, fs: float) -> str:
        wished = getattr(self._described.defaultExperiment, "stepSize", None)
        if not wished or abs(float(wished) * fs - 1.0) < 1e-9:
            return ""
        return f"; its own step is {1e3 * float(wished):g} ms: design the stimulus at that rate"


def _access(fmu: Any) -> tuple[Any, Any]:
    """How real variables are set and read, in either version."""
    if hasattr(fmu, "setReal"):
        return fmu.setReal, fmu.getReal
    return fmu.setFloat64, fmu.getFloat64


def read_described(path: str) -> Any:
    """Read the description of an FMU.

    Raises
    ------
    RigError
        If FMPy is not installed, there is no such file, or it is no FMU of version 2 or 3.

    Examples
    --------
    >>> read_described("nowhere.fmu")
    Traceback (most recent call last):
    hmpim.errors.RigError: there is no FMU 'nowhere.fmu'
    """
    if not Path(path).is_file():
        raise RigError(f"there is no FMU {path!r}")
    try:
        import fmpy
    except ImportError:
        raise RigError("an FMU needs FMPy; install the extra: pip install 'hmpim[fmu]'") from None
    try:
        described = fmpy.read_model_description(path)
    except Exception as error:  # FMPy raises bare Exception
        raise RigError(f"{path!r} is not an FMU that FMPy reads: {_words(error, [])}") from error
    if described.fmiVersion not in ("2.0", "3.0"):
        raise RigError(f"{path!r} is of FMI {described.fmiVersion}; 2.0 and 3.0 can be run")
    return described


def _chosen(described: Any, causality: str, wished: str, *, path: str) -> Any:
    there = {
        v.name: v
        for v in described.modelVariables
        if v.causality == causality and v.type in _REAL and not v.dimensions
    }
    if wished in there:
        return there[wished]
    if not wished and len(there) == 1:
        return next(iter(there.values()))
    which = f"no real {causality} {wished!r}" if wished else f"{len(there)} real {causality}s"
    names = f"; name one with the option {causality}: {', '.join(there)}" if there else ""
    raise RigError(f"{path!r} has {which}{names}")


def _is_exchange(described: Any, wished: Interface, *, path: str) -> bool:
    there = {
        "cosimulation": described.coSimulation is not None,
        "exchange": described.modelExchange is not None,
    }
    if wished != "auto" and not there[wished]:
        other = ", ".join(name for name, has in there.items() if has) or "none of ours"
        raise RigError(f"{path!r} is not made for {wished}; it is for {other}")
    if not any(there.values()):
        raise RigError(f"{path!r} is made neither for co-simulation nor for model exchange")
    return wished == "exchange" or not there["cosimulation"]


def _check_input_unit(variable: Any, unit: str, *, path: str) -> None:
    """Refuse a stimulus in another unit than the FMU states; one that pint cannot read passes."""
    stated = read_unit(variable.unit) if variable.unit else None
    if not stated or not unit:
        return
    try:
        same = abs(conversion_factor(unit, to=stated) - 1.0) < 1e-9
    except UnitError:
        same = False
    if not same:
        raise RigError(
            f"{path!r} takes {variable.name} in {variable.unit}, and the stimulus is in {unit}; "
            f"design the stimulus in {stated}"
        )


def _listener(said: list[str]) -> Callable[..., None]:
    """Keep what an FMU logs, in either version's way of calling."""

    def heard(*arguments: Any) -> None:
        last = arguments[-1]
        said.append(last.decode(errors="replace") if isinstance(last, bytes) else str(last))

    return heard


def _words(error: BaseException, said: list[str]) -> str:
    whole = " ".join([f"{type(error).__name__}: {error}", *said[-2:]])
    return " ".join(whole.split())[:400]
