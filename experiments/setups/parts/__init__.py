"""Parts of a run that modes and maps put together, one file a part, and their types."""
