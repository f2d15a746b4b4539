"""Every number that decides in `hmpim.identify`, and what it decides.

`constants`: the numbers with a name, read from the source. `watch`: one run that tells at which
records a number decides anything. `effects`: the records of the families study with a number 30 %
less and more. `table`: docs/thresholds.md.
"""
