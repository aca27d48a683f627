"""Results of a run: measures, summary, figures, page."""
