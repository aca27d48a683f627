"""Legs: limbs and soles, stance and swing, feet that keep their place on the floor."""
