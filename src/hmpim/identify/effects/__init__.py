"""The rest of Fig. 1: what a sensor does to its output besides dynamics.

imperfections   all of them found, and the fit refined for them
said            what is said of them, and the figures read off them
saturation, smeared   clipped levels, exact or behind noise
hold, held      a data hold: period and phase, and the fit at its updates
censored        the fit that counts clipped and held samples as what they are
quantization    the rounding step
lost            spikes and standstills
drift           a bias that drifts, fitted with the model
"""
