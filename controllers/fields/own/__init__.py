"""Laws of one's own: a function, interpreted or compiled, made into a law of force."""
