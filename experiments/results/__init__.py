"""What a run leaves: measures, summary, figures, page."""
