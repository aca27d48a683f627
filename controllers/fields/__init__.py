"""Force fields: what the hand feels along its curves."""
