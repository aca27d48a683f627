r"""Muscles, arm and fingers of a person in one physics step; see `sim.users.person.body` for the arm.

Fatigue follows a three-compartment model of muscle (Frey-Law, Looft & Heitsman 2012, J. Biomech. 45: 1803-1808): the
capacity C, as a share of her strength, falls by F times the exerted force f, and recovers at the rate R:

.. math:: \dot C = R (1 - C) - F f, \qquad f \le C
"""

import math

from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from sim.users.person import person_state as at
from sim.users.person.person_state import PersonState

PASSIVE_STIFFNESS, PASSIVE_DAMPING = 0.08, 0.3  # shares of both that a relaxed arm keeps: passive tissue
RECOVERY_RATE = 0.04  # R [1/min] of fatigued muscle, for grip (Frey-Law et al. 2012, m)
REST_FACTOR, MAX_REST_LOAD = 15.0, 0.05  # factor on R at rest (Looft et al. 2018, m), below this share of strength


@njit
def move(person: PersonState, dt: float, p: Array, v: Array, force: Array) -> None:
    """Advance the hand by a physics step dt [s] (semi-implicit Euler), and set its force on the stylus [N].

    `p` and `v` are position and velocity of the stylus in H, shape (3,); see `sim.users.person.body`.
    """
    n, m, V = person.numbers, person.memory, person.vectors
    engaged, stiffer = m[at.ENGAGED_SHARE], m[at.STIFFNESS_FACTOR]
    spring = stiffer * (PASSIVE_STIFFNESS + (1.0 - PASSIVE_STIFFNESS) * engaged) * (1.0 - n[at.REFLEX_GAIN])
    damper = math.sqrt(stiffer) * (PASSIVE_DAMPING + (1.0 - PASSIVE_DAMPING) * engaged) * (1.0 - n[at.REFLEX_GAIN])
    muscle, size, force_size = work_array(3), 0.0, 0.0
    for k in range(3):
        component = V[at.WANTED_FORCE, k] + engaged * V[at.REFLEX, k]
        for j in range(3):
            component += spring * person.stiffness[k, j] * (V[at.DRIVEN_P, j] - V[at.HAND_P, j])
            component += damper * person.damping[k, j] * (V[at.DRIVEN_V, j] - V[at.HAND_V, j])
            component += person.inertia[k, j] * (n[at.SKILL] * V[at.DRIVEN_A, j] + V[at.TREMOR, j])
        muscle[k] = component
        size += component * component
    size = math.sqrt(size)
    for k in range(3):
        muscle[k] += size * V[at.UNSTEADY, k]
    max_force = n[at.STRENGTH] * m[at.CAPACITY]
    scale = min(1.0, max_force / max(size, 1e-12))
    for k in range(3):
        muscle[k] *= scale
        force[k] = stiffer * (
            n[at.GRIP_STIFFNESS] * (V[at.HAND_P, k] - p[k]) + n[at.GRIP_DAMPING] * (V[at.HAND_V, k] - v[k])
        )
        force_size += force[k] * force[k]
    force_size = math.sqrt(force_size)
    if force_size > n[at.STRENGTH]:  # the stylus slips between the fingers
        for k in range(3):
            force[k] *= n[at.STRENGTH] / force_size
    for k in range(3):
        acceleration = 0.0
        for j in range(3):
            acceleration += person.mobility[k, j] * (muscle[j] - force[j])
        V[at.HAND_V, k] += dt * acceleration
    for k in range(3):
        V[at.HAND_P, k] += dt * V[at.HAND_V, k]
    if n[at.FATIGUE] > 0.0:
        load = min(size, max_force) / n[at.STRENGTH]
        recovery = RECOVERY_RATE * (REST_FACTOR if load < MAX_REST_LOAD else 1.0)
        m[at.CAPACITY] += dt / 60.0 * (recovery * (1.0 - m[at.CAPACITY]) - n[at.FATIGUE] * load)
