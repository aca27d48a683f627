"""Set-ups of haptic maps: what each kind of map gives a run, one file a kind."""
