"""The commands of ``hvf``: ``hvf NAME`` is the class of ``NAME.py``, whose fields are its options.

These modules import little: what a command does is imported when it is called.
"""

NAMES = (
    "demo", "run", "live", "clips", "convert", "prepare", "track", "certify", "lift", "repair", "trials", "tune",
    "report", "picture", "render", "figures", "reproduce", "users", "bench", "hardware",
)  # fmt: skip
"""In the order of the help."""
