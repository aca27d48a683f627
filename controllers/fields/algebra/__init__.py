"""Force laws as values: their common interface, sums and weights of laws, and the evaluation of a composition."""
