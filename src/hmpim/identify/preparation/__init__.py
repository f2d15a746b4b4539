"""Checks and preparation before anything is fitted.

refusals   arguments and records that are refused
question   one output, and what is known of it beforehand; whether the record is software's
reference  a plant in a loop, identified through the loop's reference
clocks     inputs that change between the samples of the outputs
swapped    whether input and output were swapped
"""
