"""Hardware runs: checks of the machine, link measurement, permit, run, calibration and identification of devices."""
