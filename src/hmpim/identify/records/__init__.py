"""Several records of one unit.

alike    whether they are of one test
repeats  one test repeated: averages, and whether they scatter as stated
levels   one stimulus at several amplitudes
"""
