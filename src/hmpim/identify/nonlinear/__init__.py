"""Nonlinearity: what follows the input but no linear model.

nonlinearity          the inspection of one fit, and its summary
harmonics             harmonics that follow a sweep, odd and even
sweep_phase           the phase of a sweep, from its samples
harmonic_regression   the regression behind them
lines                 lines of a periodic input left out
mechanisms            friction, backlash, rate limit, hard and soft springs
evidence              which of them the record speaks for
bends                 how far a nonlinearity moves a linear fit
"""
