"""The workbench: the whole job in a browser, with the mouse.

`settings` says how it was started, `server` serves it behind the `lock`. `desks` keep what a
person typed, `workers` do what takes long, and `bench` is where a rig is armed and run. `pages`
has one page each for design, check, run, analysis, runs and campaigns, `parts` what they are made
of, and `work` what is handed to the workers. Nothing here computes: every page shows the command
that does the same.
"""

from hmpim.workbench.settings import Settings

__all__ = ["Settings"]
