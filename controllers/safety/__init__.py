"""What stands between a law of force and the motors: limiter, energy tank."""
