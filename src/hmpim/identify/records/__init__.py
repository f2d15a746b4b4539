"""Several records of one unit.

alike     whether they are of one test
repeats   one test repeated: averages, and whether they scatter as stated
repeated  its result
levels    one stimulus at several amplitudes
"""
