"""The design of a study: its configuration, conditions, participants and order, down to the plan of every trial."""
