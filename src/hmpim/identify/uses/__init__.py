"""What a result is used for.

predict     a model of it, and what that makes of another input
validate    the model held against a record that it has not seen
compare     two results of one unit: what has changed, beyond error bars
gain_phase  gain and phase at any frequency
"""
