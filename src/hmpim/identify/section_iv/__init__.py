"""The paper's steps (8) to (25), as printed and nothing else.

paper                     all of them in their order
correlation               the delay at the peak of the cross-correlation, (8)
static                    bias, scale factor of the first cycle and noise, (9)-(14)
windows, spectrum         windowed and padded spectra, (15)-(18)
response                  magnitude and phase, without the delay's phase, (19)-(25)
"""
