"""What is asked of a record, before anything is fitted.

refusals   arguments and records that cannot be answered
question   one output, and all that is known of it beforehand; whether it is software's
reference  a plant in a loop: what the loop's reference moves of the input
clocks     inputs that change between the samples of the outputs
swapped    whether the columns were taken the wrong way round
"""
