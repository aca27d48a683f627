"""Intents of simulated persons at the stylus; each is turned into a table of wishes (see `sim.users.person.wishes`)."""

from sim.users.intents.actions import Bend, Lead, Press
from sim.users.intents.along_curve import ChangeOver, CutCorner, Exaggerate, GetLost, Relax, Resist, Trace
from sim.users.intents.own import Own, Wish

__all__ = [
    "Bend", "ChangeOver", "CutCorner", "Exaggerate", "GetLost", "Lead", "Own", "Press", "Relax", "Resist", "Trace",
    "Wish",
]  # fmt: skip
