"""Intents of simulated persons at the stylus; each is turned into a table of wishes (see `sim.users.person.wishes`)."""

from sim.users.intents.along_curve import ChangeOver, CutCorner, Exaggerate, GetLost, Relax, Resist, Trace
from sim.users.intents.bend import Bend
from sim.users.intents.lead import Lead
from sim.users.intents.own import Own, Wish
from sim.users.intents.press import Press

__all__ = [
    "Bend", "ChangeOver", "CutCorner", "Exaggerate", "GetLost", "Lead", "Own", "Press", "Relax", "Resist", "Trace",
    "Wish",
]  # fmt: skip
