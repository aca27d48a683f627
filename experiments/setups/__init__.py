"""Set-ups (composition root): make the parts of a run from its configuration."""
