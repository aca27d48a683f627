"""The process at the terminal: its start, progress and estimates while it works, results in words or as JSON."""
