"""Analysis of a study's trials: tables, statistics, plots, and one page."""
