"""Run a campaign: every case once, each written as soon as it is done."""

import json
import math
import zlib
from collections.abc import Callable, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.campaign.case import Case
from hmpim.campaign.cases import check_wanted, expand, prepare
from hmpim.campaign.plan import Plan
from hmpim.campaign.rig import CampaignRig, Player, make_rig
from hmpim.errors import ArgumentError, FormatError, HmpimError
from hmpim.formats.atomic import write_text
from hmpim.formats.recording import save_recording
from hmpim.identify import Identification, identify
from hmpim.identify.section_iv.spectrum import decibel, spectrum
from hmpim.record import Record
from hmpim.stimulus import Stimulus

__all__ = ["CASE_SCHEMA", "RECORDS", "STAMP", "run_campaign"]

STAMP = "campaign.json"
"""Name of the file that says of which plan a folder's cases are."""

RECORDS = "records"
"""Name of the folder that keeps the raw record of each case, ``ID.h5``."""

CASE_SCHEMA = "hmpim/campaign-case/2"
CAMPAIGN_SCHEMA = "hmpim/campaign/2"
_PLAYED = 5  # times as long as a design takes: what is left is told from it
_A_PERIOD = 10.0  # samples kept of each period of the fastest motion
Progress = Callable[[int, int, str], None]


def run_campaign(
    plan: Plan,
    folder: Path,
    *,
    fresh: bool = False,
    player: Player | None = None,
    progress: Progress | None = None,
) -> tuple[dict[str, Any], ...]:
    """Run what is still missing of a campaign, and return all cases.

    Stimuli of all missing cases are designed and checked first, so that what is refused is
    refused before anything moves. Each case is written to ``folder/cases/ID.json`` the moment it
    is done; stopped at any time, the campaign goes on from there and repeats nothing. The noise
    of a simulated rig depends on the plan's seed and the case alone.

    Parameters
    ----------
    plan : Plan
        What to do.
    folder : Path
        Where it is kept; made if need be.
    fresh : bool
        True throws away what `folder` holds of an earlier campaign.
    player : Player, optional
        A rig of one's own in place of the plan's.
    progress : callable, optional
        Told steps done, steps in all (a case played counts as several designed), and what
        comes next.

    Returns
    -------
    tuple of dict
        As written, in the plan's order.

    Raises
    ------
    ArgumentError
        If `folder` holds a campaign of another plan, or a specification fits no case.
    LimitsError
        If a stimulus cannot be designed inside its limits.
    RigError
        If the rig fails; what was done by then is kept.
    """
    rig = make_rig(plan, player=player)
    cases = expand(plan)
    check_wanted(plan, cases)
    _open(plan, folder, fresh=fresh)
    known = {case.id: _read(folder, case) for case in cases}
    missing = [case for case in cases if known[case.id] is None]
    steps = (1 + _PLAYED) * len(missing)
    ready = []
    for i, case in enumerate(missing):
        if progress is not None:
            progress(i, steps, f"designing {case.id}")
        ready.append((case, prepare(plan, case, rig)))
    for i, (case, stimuli) in enumerate(ready):
        if progress is not None:
            progress(len(missing) + _PLAYED * i, steps, case.id)
        done = _measured(plan, case, stimuli, rig, raw=folder / RECORDS / f"{case.id}.h5")
        _write(folder / "cases" / f"{case.id}.json", done)
        known[case.id] = done
    if progress is not None:
        progress(steps, steps, "study")
    return tuple(found for found in known.values() if found is not None)


def _open(plan: Plan, folder: Path, *, fresh: bool) -> None:
    """Make the folder, or check that what it holds belongs to the plan."""
    if folder.exists() and not folder.is_dir():
        raise ArgumentError(f"{folder} is a file; name a folder")
    for room in ("cases", RECORDS):
        (folder / room).mkdir(parents=True, exist_ok=True)
        for half in (folder / room).glob(".hmpim-*"):  # of a run that was killed as it wrote
            half.unlink()
    stamp = folder / STAMP
    if fresh:
        for old in (*(folder / "cases").glob("*.json"), *(folder / RECORDS).glob("*.h5")):
            old.unlink()
    elif stamp.exists() and any((folder / "cases").glob("*.json")):
        try:
            stamped = json.loads(stamp.read_text(encoding="utf-8"))
            schema, digest = stamped["schema"], stamped["plan"]
        except (ValueError, KeyError, TypeError) as error:
            raise FormatError(f"{stamp} is damaged ({error}); start afresh with --fresh") from error
        if schema != CAMPAIGN_SCHEMA:
            raise FormatError(
                f"{folder} holds a campaign of schema {schema!r} and this version writes "
                f"{CAMPAIGN_SCHEMA!r}, so it cannot be resumed; start afresh with --fresh, or name "
                "another folder"
            )
        if digest != plan.digest:
            raise ArgumentError(
                f"{folder} holds a campaign of another plan ({digest[:12]}, this one is "
                f"{plan.digest[:12]}): the plan was changed since; start afresh with --fresh, or "
                "name another folder"
            )
    _write(stamp, {"schema": CAMPAIGN_SCHEMA, "name": plan.name, "plan": plan.digest})


def _write(path: Path, data: dict[str, Any]) -> None:
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def _read(folder: Path, case: Case) -> dict[str, Any] | None:
    path = folder / "cases" / f"{case.id}.json"
    if not path.exists():
        return None
    try:
        data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise FormatError(f"{path} is damaged ({error}); remove it to run it again") from error
    if data.get("schema") != CASE_SCHEMA:
        raise FormatError(
            f"{path} has schema {data.get('schema')!r} and {CASE_SCHEMA!r} is needed; start afresh "
            "with --fresh, or name another folder"
        )
    return data


def _measured(
    plan: Plan, case: Case, stimuli: Sequence[Stimulus], rig: CampaignRig, *, raw: Path
) -> dict[str, Any]:
    """Play a case, keep its record, and identify it."""
    seed = (plan.seed, zlib.crc32(case.id.encode()))
    torque = rig.check(case, stimuli)  # once more, right before anything moves
    record = rig.play(case, stimuli, np.random.default_rng(seed))
    save_recording(record, raw, stimuli=stimuli, rig=f"{plan.name}: {case.id}")
    try:
        # Where levels are compared, friction counts as it acts at each of them.
        levels = next(test.levels for test in plan.tests if test.name == case.test)
        found = identify(record, nonlinear="reported" if len(levels) > 1 else "modelled")
    except HmpimError as error:  # a dead encoder, for instance: say where
        raise type(error)(f"case {case.id}: {error}") from error
    pairs = [
        {
            "axis": axis,
            "known": rig.known(case, axis),
            "bins": _bins(record, axis, band=plan.axis(axis, test=case.test).band),
            **found[f"{axis}.position", f"{axis}.command"].to_dict(),
        }
        for axis in case.axes
    ]
    done: dict[str, Any] = _finite(
        {
            "schema": CASE_SCHEMA,
            "id": case.id,
            "case": case.to_dict(),
            "stimuli": [_described(stimulus) for stimulus in stimuli],
            "torque": torque,
            "pairs": pairs,
            "couplings": _couplings(plan, case, found, rig) if len(case.axes) > 1 else [],
        }
    )
    return done


def _bins(record: Record, axis: str, *, band: tuple[float, float]) -> dict[str, list[float]]:
    """Ratio of an axis's spectra at the bins of the record, as the paper takes it, in the band."""
    u, y = (record.channel(f"{axis}.{name}").values for name in ("command", "position"))
    above = spectrum(y - y.mean(), record.fs, window="gaussian", alpha=1.5, pad=0)
    below = spectrum(u - u.mean(), record.fs, window="gaussian", alpha=1.5, pad=0)
    seen = (above.frequency >= band[0]) & (above.frequency <= band[1])
    seen &= np.abs(below.value) > 0.0
    ratio = above.value[seen] / below.value[seen]
    columns = {"frequency": above.frequency[seen], "real": ratio.real, "imag": ratio.imag}
    return {name: [float(f"{x:.6g}") for x in values.tolist()] for name, values in columns.items()}


def _couplings(
    plan: Plan, case: Case, found: Identification, rig: CampaignRig
) -> list[dict[str, Any]]:
    """Gain from each command to each other position, off the responses that were identified.

    Beside it stands the exact one where the rig knows it, the median over the same frequencies.
    """
    high = min(plan.axis(axis, test=case.test).band[1] for axis in case.axes)
    band = (0.25 * high, 0.5 * high)
    told = []
    for source, target in permutations(case.axes, 2):
        response = found[f"{target}.position", f"{source}.command"].frequency_response
        seen = (response.frequency >= band[0]) & (response.frequency <= band[1])
        if not seen.any():
            continue
        exact = rig.coupling(case, source, target, response.frequency[seen])
        told.append(
            {
                "from": source,
                "to": target,
                "band": list(band),
                "gain": float(np.median(np.abs(response.response[seen]))),
                "std": float(np.median(response.std[seen])),
                "exact": None if exact is None else float(np.median(exact)),
            }
        )
    return told


def _described(stimulus: Stimulus) -> dict[str, Any]:
    bins = spectrum(stimulus.position, stimulus.fs, window="gaussian", alpha=1.5)
    low, high = stimulus.band or (0.1, 0.4 * stimulus.fs)
    grid = np.geomspace(low, min(1.2 * high, 0.5 * stimulus.fs), 120)
    level = np.interp(grid, bins.frequency, decibel(bins.value))
    peaks = stimulus.peaks
    return {
        "axis": stimulus.axis,
        "unit": stimulus.unit,
        "band": [low, high],
        "samples": stimulus.samples,
        "gain": stimulus.gain,
        "extinction": stimulus.extinction,
        "peaks": [peaks.position, peaks.velocity, peaks.acceleration],
        "frequency": grid.tolist(),
        "level_db": level.tolist(),
        "history": _history(stimulus, high),
    }


def _history(stimulus: Stimulus, high: float) -> dict[str, list[float]]:
    """Time (s) and position, as few samples as a picture needs: ten a period at the band's end."""
    step = max(1, int(stimulus.fs / (_A_PERIOD * high)))
    return {
        "time": [float(f"{t:.6g}") for t in stimulus.time[::step].tolist()],
        "position": [float(f"{x:.4g}") for x in stimulus.position[::step].tolist()],
    }


def _finite(value: Any) -> Any:
    """The same with null for what is no number, as JSON has none."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
