"""Nonlinearity: what follows the input but no linear model can produce.

nonlinearity          the inspection of one fit, and its summary
harmonics             even and odd harmonics that follow a sweep
sweep_phase           the phase of a sweep, from its samples
harmonic_regression   the regression on these harmonics
period                the period of an input that repeats
mechanisms            friction, backlash, rate limit, hard and soft springs
evidence              which of them the record supports
bends                 how far a nonlinearity moves a linear fit
modelled              a nonlinearity as part of the model
rows                  its row in the fit, from the model
speed                 a command that is followed at a limited speed
"""
