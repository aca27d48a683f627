"""JSON for other programs to read."""

import json
import math
from collections.abc import Mapping
from typing import cast


def json_text(value: object) -> str:
    """Indented JSON; null for a number that is not finite, since JSON has none."""
    return json.dumps(_finite(value), indent=2, allow_nan=False)


def _finite(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in cast(Mapping[str, object], value).items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in cast(list[object], value)]
    return value
