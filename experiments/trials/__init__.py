"""User studies with simulated people: design, trials on one core to a cluster, database, analysis."""
