"""What `hvf bench` measures: speed, as ratios within one run."""
