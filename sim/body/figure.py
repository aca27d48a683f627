r"""The physical figure: it tracks a reference by joint torques and ground contact, with a bounded residual wrench.

Whole-body inverse dynamics at each control tick (`sim.body.whole_body`). For the reference pose, velocity and
acceleration (q_r, v_r, a_r) the wanted acceleration of all 57 degrees of freedom is

.. math:: a^* = a_r + 2\omega\,(v_r - v) + \omega^2\,(q_r \ominus q) ,

amended in the legs so that feet in stance rest (`sim.body.stance`) and feet in flight land where the reference's do
(`sim.body.foot_placement`). The root has no motors, so its six rows of M a + c = S^T τ + J^T f + w are a demand on the
contact forces,

.. math:: (M a^* + c)_r = J_r^T f + w ,

met by f within the friction cones of the points in contact (`sim.body.contact_forces`). The residual wrench w is the
rest. It is bounded in proportion to the support, and zero while the reference flies or nothing touches the floor: then
the root falls freely. The torques follow from the other 51 rows. Where a motor would exceed its limit, its joint's
acceleration is reduced to what the limit allows and the plan is repeated; torque that saturated joints of a standing
leg lack is added to the residual. No spring holds the root. A figure that falls is set back (`sim.body.falls`).
"""

from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np

from controllers.kernel_call import call_as_given
from controllers.lent import by_pointer
from geometry.arrays import Array
from models.humanoid.skeleton import (
    BODIES,
    CONTACT_RADIUS,
    DEFAULT_STATURE,
    FOOT_CONTACTS,
    HAND_CONTACTS,
    JOINTS,
    N_POSE,
    N_TANGENT,
    SEGMENTS,
)
from sim.body.contact_forces import N_EDGES
from sim.body.drive import drive_unit
from sim.body.falls import fall_state
from sim.body.figure_state import REPORT_SIZE, FigureGains, FigureState
from sim.body.mass_matrix import mass_matrix
from sim.compilation.compiled import entry_point
from sim.errors import SimError

CONTACTS = FOOT_CONTACTS + HAND_CONTACTS
# Share of the coefficient of friction with which contact forces are planned. With 0.7 or 1.0 the residual of walk, run
# and jump changes by at most 0.3 % of weight (jump: 3.1 and 2.7 %, instead of 2.8 with 0.9).
_PLANNED_FRICTION_RATIO = 0.9
_N_MOTORS = N_TANGENT - 6
_MAY_BE_ZERO = ("force_bound", "moment_bound", "placement_reach")


@entry_point
def _update(drive: int, s: FigureState, q_r: Array, v_r: Array, a_r: Array) -> None:
    call_as_given(drive, (by_pointer(s), q_r, v_r, a_r))


@dataclass(frozen=True)
class Figure:
    """The physical figure of a world (see the module's equations) and the arrays that `figure_torque` works on.

    Parameters
    ----------
    model, data
        The compiled world and its state; kept alive here, since the kernel holds their addresses.
    twin
        Model of the figure alone, of the same stature and mass (`models.humanoid.skeleton.figure_model`), on which the
        reference pose is evaluated.
    prefix : str
        Prefix of the figure's names in the world.
    gains : FigureGains
        Feedback and bounds.
    period : float
        Period of the control [s].

    Raises
    ------
    SimError
        If the world has no figure with that prefix, or a gain is not finite and positive (`_MAY_BE_ZERO`: ≥ 0).
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    twin: mujoco.MjModel
    prefix: str = ""
    gains: FigureGains = FigureGains()  # noqa: RUF009 - immutable
    period: float = 2e-3
    twin_data: mujoco.MjData = field(init=False, repr=False)
    state: FigureState = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name, value in self.gains._asdict().items():
            if not (np.isfinite(value) and value >= 0.0) or (value == 0.0 and name not in _MAY_BE_ZERO):
                condition = ", may be 0" if name in _MAY_BE_ZERO else " > 0"
                raise SimError(f"FigureGains.{name} is {value}; expected a finite number{condition}")
        object.__setattr__(self, "twin_data", mujoco.MjData(self.twin))
        object.__setattr__(self, "state", self._state())

    def update(self, q_r: Array, v_r: Array, a_r: Array) -> None:
        """Set torques and residual for a reference, once, from Python; the servo calls `figure_torque` directly.

        Parameters
        ----------
        q_r, v_r, a_r : Array
            Reference pose (75), velocity (57) and acceleration (57), in the conventions of qpos and qvel.
        """
        _update(self._kernel, self.state, q_r, v_r, a_r)

    @cached_property
    def _kernel(self) -> int:
        return drive_unit(self.state).address()  # the same unit as in the servo's loop

    def _state(self) -> FigureState:
        m, d, twin = self.model, self.data, self.twin
        try:
            root = m.joint(self.prefix + "root")
            body = int(m.body(self.prefix + BODIES[0]).id)
            motor = int(m.actuator(f"{self.prefix}{JOINTS[0]}_x").id)
            spheres = [int(m.geom(self.prefix + name).id) for name in CONTACTS]
        except KeyError as error:
            raise SimError(f"the world has no figure with the prefix {self.prefix!r}: {error}") from None
        n, qpos, dof = len(CONTACTS), int(root.qposadr[0]), int(root.dofadr[0])
        bodies, dofs = slice(body, body + len(BODIES)), slice(dof, dof + N_TANGENT)
        motors = slice(motor, motor + _N_MOTORS)
        radius = float(m.geom_size[spheres[0], 0])
        stature = DEFAULT_STATURE * radius / CONTACT_RADIUS
        legs = [[BODIES.index(f"{side}_{name}") for name in ("thigh", "shank", "foot")] for side in ("left", "right")]
        return FigureState(
            model=m._address, data=d._address, twin_model=twin._address, twin_data=self.twin_data._address,
            gains=FigureGains(*(float(value) for value in self.gains)),
            qpos=d.qpos[qpos : qpos + N_POSE], qvel=d.qvel[dofs], bias=d.qfrc_bias[dofs],
            passive=d.qfrc_passive[dofs], ctrl=d.ctrl[motors], applied=d.qfrc_applied[dof : dof + 6],
            xpos=d.xpos[bodies], xmat=d.xmat[bodies], contact_pos=d.geom_xpos, contact=np.array(spheres),
            contact_body=np.array([int(m.geom_bodyid[sphere]) - body for sphere in spheres]),
            twin_qpos=self.twin_data.qpos, twin_contact_pos=self.twin_data.geom_xpos,
            twin_contact=np.array([int(twin.geom(name).id) for name in CONTACTS]),
            mass=mass_matrix(m, d, dofs), parent=np.array([segment.parent for segment in SEGMENTS]),
            legs=np.array(legs), torque_limit=m.actuator_ctrlrange[motors, 1].copy(),
            weight=float(m.body_subtreemass[body]) * float(np.linalg.norm(m.opt.gravity)),
            stature=stature, radius=radius,
            friction=_PLANNED_FRICTION_RATIO * float(m.geom_friction[spheres[0], 0]),
            acceleration=np.zeros(N_TANGENT), wanted_root=np.zeros(6), rotation=np.zeros((2, 3)), loaded=np.zeros(2),
            share=np.zeros(n), near=np.zeros(n), points=np.zeros((n, 3)), edges=np.zeros((N_EDGES * n, 6)),
            edge_share=np.zeros(N_EDGES * n), edge_force=np.zeros(N_EDGES * n), scaled=np.zeros(6),
            residual=np.zeros(6), force=np.zeros((n, 3)), given=np.zeros(N_TANGENT), demand=np.zeros(6),
            wrench=np.zeros(6), offset=np.zeros(9), response=np.zeros((2, 9, 6)), lost=np.zeros(_N_MOTORS),
            yielding=np.zeros(_N_MOTORS, dtype=np.int64), block=np.zeros((_N_MOTORS, _N_MOTORS)),
            correction=np.zeros(_N_MOTORS), report=np.zeros(REPORT_SIZE),
            fall=fall_state(m, d, twin, self.twin_data, self.prefix, self.period, stature),
        )  # fmt: skip
