"""Laws of force as values: what every law can do, sums and weights of laws, and how a composition is evaluated."""
