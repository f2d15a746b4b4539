"""Families of records that people make, each with its truth and what it can tell.

`system`, `drive`, `simulate`, `noise`, `bound`: a simulator apart from the package, and the
Cramér-Rao bound. `catalogue`: the families. `scoring`, `study`, `table`: the measure.
"""
