"""Studies: simulated people at the stylus, trial by trial, from one core to a cluster."""
