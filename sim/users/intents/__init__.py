"""Intents of simulated persons at the stylus; each is turned into a table of wishes (see `sim.users.person.wishes`)."""

from sim.users.intents.bend import Bend
from sim.users.intents.change_over import ChangeOver
from sim.users.intents.cut_corner import CutCorner
from sim.users.intents.exaggerate import Exaggerate
from sim.users.intents.get_lost import GetLost
from sim.users.intents.lead import Lead
from sim.users.intents.own import Own, Wish
from sim.users.intents.press import Press
from sim.users.intents.relax import Relax
from sim.users.intents.resist import Resist
from sim.users.intents.trace import Trace

__all__ = [
    "Bend", "ChangeOver", "CutCorner", "Exaggerate", "GetLost", "Lead", "Own", "Press", "Relax", "Resist", "Trace",
    "Wish",
]  # fmt: skip
