"""Haptic vector fields: a hand on a force-feedback arm feels an animation as a river, follows it, bends it.

The public interface: it re-exports the parts of a simulation and what can be done with it, and implements nothing.

    import hvf

    dance, cheer = hvf.clips("squat_dance", "cheer")
    curve = hvf.circle(radius=0.0477, lap=4.0)
    river = hvf.Follow(curve, k_r=300, b_d=8)
    sim = hvf.Simulation(field=river, haptic_map=hvf.Cylindrical([dance, cheer], around=curve))
    run = sim.run(10.0)
    print(run)
"""

from controllers.certificates.loop.hand import HandRange
from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError, ParameterError
from controllers.fields.algebra.law import Law
from controllers.fields.algebra.weights import Weight
from controllers.fields.bundle import RiverBundle
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.fields.own.own_law import law
from controllers.fields.river import River
from controllers.fields.stretchy_tubes import StretchyTubes
from controllers.haptic_map.base import HapticMap, KernelMap
from controllers.haptic_map.lifting.room import Room
from controllers.safety.energy_tank import EnergyTank
from controllers.state import HandState, Wrench
from experiments.certify.certify_simulation import certify
from experiments.config.run_config import Clock, Figure, Phantom, Replay
from experiments.public import circle, clips, lift, load, prepare, version
from experiments.runs.map_objects import Composite, Cylindrical, Lifted, RobotArm
from experiments.runs.run_options import run
from experiments.runs.run_result import Run
from experiments.runs.simulation import Simulation, Tick, User
from experiments.runs.sweep import Swept, sweep
from experiments.setups.parts.pace import paced
from experiments.trials.study import Study
from experiments.tuning.tune import Search, tune
from geometry.errors import HvfError
from models.errors import ModelError
from models.humanoid.skeleton import rest_pose
from models.mocap.motion.clip import Clip
from sim.devices.own_device import TipDevice, TipPose
from sim.errors import SimError
from sim.users import intents
from sim.users.hand.actions import Grab, Push, Turn
from sim.users.person.person import Person
from sim.users.person.population import persona, population

__version__ = version()
__all__ = [
    "Bunny",
    "Clip",
    "Clock",
    "Composite",
    "ControllerError",
    "Cylindrical",
    "EnergyTank",
    "Figure",
    "Follow",
    "Grab",
    "HandRange",
    "HandState",
    "HapticMap",
    "HigherOrder",
    "HvfError",
    "KernelMap",
    "Law",
    "Lifted",
    "ModelError",
    "ParameterError",
    "Person",
    "Phantom",
    "Push",
    "Replay",
    "River",
    "RiverBundle",
    "RobotArm",
    "Room",
    "Run",
    "Search",
    "SimError",
    "Simulation",
    "StretchyTubes",
    "Study",
    "Swept",
    "Tick",
    "TipDevice",
    "TipPose",
    "Trajectory",
    "Turn",
    "User",
    "Weight",
    "Wrench",
    "certify",
    "circle",
    "clips",
    "intents",
    "law",
    "lift",
    "load",
    "paced",
    "persona",
    "population",
    "prepare",
    "rest_pose",
    "run",
    "sweep",
    "tune",
]
