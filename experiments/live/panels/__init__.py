"""Panels of the live page."""

from collections.abc import Callable
from typing import Any

Acts = Callable[[Callable[[Any], None]], Callable[[Any], None]]
"""The wrapper of event handlers that every panel receives (`experiments.live.page.Page.acts`)."""
