"""What to do about a finding, and which finding is the cause of which."""

import re
from collections.abc import Sequence

from hmpim.record import Finding

__all__ = ["MOST_FINDINGS", "leading_findings", "said_and_done"]

MOST_FINDINGS = 3

# From causes to what they cause: a fault of the channels comes before one of the clock, that
# before one of the stimulus, that before one of the model, and what only describes comes last.
_ADVICE = {
    "dead_channel": "Check the wiring and the choice of the channel, and record again.",
    "swapped": "Name input and output the other way round: `--input`, `--output`.",
    "unrelated": "Check that both channels belong to one test.",
    "check_failed": "Report this, with the record: a check failed on it.",
    "not_identifiable": "Check the channels first; then excite more strongly or for longer.",
    "time_unit": "State the unit of the time stamps: `--time 'NAME [ms]'`.",
    "mixed_stamps": "Record with one clock for each channel.",
    "backward_stamps": "Sort the samples, or find out why the clock ran backwards.",
    "doubled_stamps": "Check the recorder: samples share a time stamp.",
    "timing": "State the rate, or record with time stamps taken at the samples.",
    "clocks": "Record both channels with one clock.",
    "clock_offset": "State the offset with `--offset`, or record with one clock.",
    "jitter": "Stamp the samples where they are taken.",
    "even_samples": "Stamp the samples where they are taken.",
    "rate": "State the rate with `--fs`.",
    "tick": "Record finer time stamps.",
    "dropouts": "Find out why samples were lost; the rest was used.",
    "missing_samples": "Find out why samples were lost; the rest was used.",
    "gaps": "Record without a pause, or cut the pause out with `--from` and `--to`.",
    "datagrams": "Shorten the path of the datagrams, or lower the rate.",
    "repeated_frames": "Raise the frame rate, or read the camera less often.",
    "repeated_samples": "Read the sensor no faster than it renews its value.",
    "frozen": "Find out why the channel did not change, and record again.",
    "stuck": "Find out why the channel did not change, and record again.",
    "damaged_parts": "Look at the parts named, and record again if they matter.",
    "spikes": "Look for loose contacts and interference; the spikes were left out.",
    "saturation": "Lower the level of the stimulus, or widen the range.",
    "quantization": "Raise the level of the stimulus, or use a finer range.",
    "hum": "Look for mains hum or vibration; it was removed.",
    "drift": "Let the unit warm up; the drift was removed.",
    "gain_change": "Let the unit warm up, and repeat the test with the sweep reversed.",
    "cut_short": "Record until the output has come to rest.",
    "ended_early": "Record until the stimulus is over.",
    "short_record": "Record for longer.",
    "several_sweeps": "Choose one sweep with `--sweep`, or give all of them as repeats.",
    "weak_excitation": "Raise the level or the duration of the stimulus.",
    "few_lines": "Excite more frequencies: a sweep rather than some tones.",
    "input_noise": "Measure the command itself, or raise the level of the stimulus.",
    "unfound_response": "Excite the input that is named more, or alone.",
    "coupled_inputs": "Drive the axes one after another, or with stimuli that differ.",
    "elsewhere": "Widen the band of the stimulus to where the response changes.",
    "beyond_band": "Widen the band of the stimulus.",
    "extrapolated": "Widen the band of the stimulus to the frequency named.",
    "intersample": "State what the input does between samples: `--intersample`.",
    "held_between": "Record input and output with one clock.",
    "held_output": "Identify the record itself.",
    "drift_or_noise": "Let the unit warm up; for statistics, compress with `knots=`.",
    "cut_response": "Compress with more `lags`.",
    "perhaps_software": "Identify the record itself.",
    "hold": "Nothing to do if the unit is known to hold its output.",
    "asymmetry": "Include it in the simulation, or test at a smaller level.",
    "backlash": "Look at gears and couplings; include it in the simulation.",
    "curvature": "Include it in the simulation, or calibrate the scale.",
    "dead_zone": "Include it in the simulation, or use larger commands.",
    "friction": "Test at a larger level as well, and compare.",
    "hardening": "Test at several levels, and state the one that each figure is for.",
    "rate_limit": "Keep the stimulus below the speed named.",
    "nonlinear": "Test at a smaller level too. Where figures differ, state their level.",
    "other_dynamics": "Sweep higher, or use the measured response.",
    "structure": "Record for longer or excite more, if the number of poles matters.",
    "unmodelled": "Use the measured response where it differs from the model.",
    "lack_of_fit": "Use the measured response where it differs from the model.",
    "bandwidth_disagrees": "Take the bandwidth of the measured response.",
    "grazed_bandwidth": "Read the Bode plot instead, or lower the noise.",
    "unsampled_input": "Sample faster, or filter the command before it is sampled.",
    "halves_disagree": "Repeat the test: the unit may have changed while it ran.",
    "feedback": "Identify the unit through what drives its loop: `--reference`.",
    "not_converged": "Repeat the test with a stronger stimulus.",
    "negative_delay": "Read delay and dynamics together: feedforward can make the output lead.",
    "folded": "Sample faster: the unit responds beyond half the sampling rate.",
    "scatter": "Repeat the test under the same conditions.",
    "noise_colour": "Nothing to do: the error bars allow for it.",
    "coloured_noise": "Nothing to do: the error bars allow for it.",
    "filled_input": "Record without gaps where the input moves.",
    "changing_noise": "Nothing to do: the error bars allow for it.",
    "initial_transient": "Start the record while the unit is at rest.",
    "weak_coupling": "Nothing to do if a coupling this small is expected.",
    "assumed_roles": "Check which channel is input and which is output, and state it.",
    "unit_declared": "Check the units of the channels.",
}  # fmt: skip
_ORDER = {code: place for place, code in enumerate(_ADVICE)}


_SENTENCES = re.compile(r"(?<=[.!?]) (?=[A-Z'])")
_VERBS = {sentence.split()[0] for sentence in _ADVICE.values()} | {
    *("Add", "Choose", "Compare", "Excite", "Give", "Lower", "Measure", "Move", "Reduce", "Set"),
    *("Sweep", "Treat", "Weigh", "Tighten", "Identify", "Shorten", "Slow"),
}
"""What an instruction begins with."""


def said_and_done(finding: Finding) -> tuple[str, str]:
    """Part what was found from what to do about it, which is said once.

    What a finding itself asks for is taken, as it knows the case; else what is advised for its
    kind, and so where it names an argument of Python: a page names the command line's option.

    Examples
    --------
    >>> def of(code, message):
    ...     return Finding(code=code, message=message, severity="doubt", parameters=())
    >>> said_and_done(of("structure", "Two models differ. Sweep higher, or lower the noise."))
    ('Two models differ.', 'Sweep higher, or lower the noise.')
    >>> said_and_done(of("intersample", "It may be held. State it with intersample=."))
    ('It may be held.', 'State what the input does between samples: `--intersample`.')
    >>> said_and_done(of("saturation", "7 % of the samples are clipped"))
    ('7 % of the samples are clipped.', 'Lower the level of the stimulus, or widen the range.')
    """
    message = finding.message.rstrip()
    message += "" if message.endswith((".", "!", "?")) else "."
    told = _SENTENCES.split(message)
    asked: list[str] = []
    while len(told) > 1 and (told[-1].split()[0] in _VERBS or told[-1].startswith("If you ")):
        asked.insert(0, told.pop())
    wanted = " ".join(asked)
    usual = _ADVICE.get(finding.code, "")
    return " ".join(told), (usual or wanted) if "=" in wanted else (wanted or usual)


def leading_findings(findings: Sequence[Finding]) -> list[Finding]:
    """Return the three findings that matter most: doubts first, causes before their effects.

    Parameters
    ----------
    findings : sequence of Finding
        All of them; of one code the first is taken.

    Examples
    --------
    >>> def of(code, severity):
    ...     return Finding(code=code, message="…", severity=severity, parameters=())
    >>> found = [of("lack_of_fit", "doubt"), of("jitter", "info"), of("saturation", "doubt")]
    >>> [finding.code for finding in leading_findings(found)]
    ['saturation', 'lack_of_fit', 'jitter']
    """
    once: dict[str, Finding] = {}
    for finding in sorted(findings, key=lambda f: f.severity != "doubt"):
        once.setdefault(finding.code, finding)
    ranked = sorted(
        once.values(),
        key=lambda f: (f.severity != "doubt", _ORDER.get(f.code, len(_ORDER))),
    )
    return ranked[:MOST_FINDINGS]
