"""What a colour means, the same in the replay, the report and the figures; and what counts as a push there."""

FIELD = "#22a046"  # the field and what it leads
USER = "#eb7814"  # the hand's own force, and where it pushes
CURVE = "#3c465a"
TUBE = "#4682c8"
RIVERS = (TUBE, "#b5417a", "#8a6d1d", "#7a5fc0", "#1f8f98", "#a8453a", "#6b7280")  # one after the other, then again

PUSH = 0.2  # a hand that presses harder than this is pushing [N]


def rgb(color: str) -> tuple[int, int, int]:
    """``#rrggbb`` as three numbers from 0 to 255."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue
