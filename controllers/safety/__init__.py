"""Safety between a force law and the motors: limiter, energy tank, faults, and the gate of a real device."""
