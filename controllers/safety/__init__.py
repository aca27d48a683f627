"""Safety between a law of force and the motors: limiter, energy tank, faults, and the gate of a real device."""
