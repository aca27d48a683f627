"""A simulated person: parameters and populations, senses, motor planning, muscles, and the wishes that she follows."""
