"""One short, safe excitation; every parameter of a simulation model; an honest error bar on each."""
