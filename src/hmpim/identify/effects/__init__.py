"""What a sensor does to its output besides dynamics (Fig. 1).

imperfections   detect all of them, and refine the fit for them
findings        findings and parameters for the result
saturation, smeared   clipping levels, exact or covered by noise
hold, held      data hold: period and phase; the model at its updates
censored        maximum likelihood with clipped and held samples
quantization    rounding step
lost_samples    spikes, repeated frames and standstills
drift, gain, hum      a bias or gain that changes, and mains hum, fitted with the model
disturbance     what drift and hum share: rows of the fit
"""
