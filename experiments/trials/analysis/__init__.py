"""What the trials of a study say: tables, statistics, plots, and one page."""
