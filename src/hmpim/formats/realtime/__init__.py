"""Section III in real time: a stimulus as C99 that a target computes sample by sample.

- `waveforms`: each waveform's formula in C;
- `program`: the file around them, with lead, stop and what a caller needs to know.
"""

from hmpim.formats.realtime.program import program_of, save_stimulus_program

__all__ = ["program_of", "save_stimulus_program"]
