r"""Sampled-data loop: one servo period of a river as an exact discrete-time linear map, at phases of the curve.

Encoder angles θ_k; rates ω_k = s ω_{k−1} + (1 − s)(θ_k − θ_{k−1})/T; a force F(p(θ_k), J(θ_k) ω_k) by the law;
torques τ_k = J(θ_k)ᵀ F + N(θ_k), held for a period and delayed. Between the samples the linkage moves by its own
dynamics; the zero-order hold is exact (matrix exponential, with the plant at the period's first phase).

The state is ξ = (δθ_k, δθ̇_k, δθ_{k−1}, δω_{k−1}, δτ_{k−1}, …, δτ_{k−m}), m the delay in periods, rounded up.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from controllers.certificates.loop.linear_loop import LinearLoop
from controllers.certificates.loop.sampling import Sampling
from geometry.arrays import Array

PLANT, UNDELAYED_SIZE = 6, 12  # sizes of (θ, θ̇), and of the state without delayed torques


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A linearised loop with sampling, for any gains.

    Parameters
    ----------
    linear : LinearLoop
        Derivatives at n phases.
    sampling : Sampling
        Period, delay and velocity filter.
    """

    linear: LinearLoop
    sampling: Sampling

    @property
    def size(self) -> int:
        """Size of the state ξ."""
        return UNDELAYED_SIZE + 3 * (self.sampling.whole_delay + (self.sampling.rest_delay > 0.0))

    @cached_property
    def _response_cache(self) -> dict[float, tuple[Array, Array]]:
        return {}

    def plant(self, duration: float) -> tuple[Array, Array]:
        """Exact response over a duration [s]: Φ (n, 6, 6) to (δθ, δθ̇), Γ (n, 6, 3) to constant joint torques."""
        if duration not in self._response_cache:
            self._response_cache[duration] = self._response(duration)
        return self._response_cache[duration]

    def _response(self, duration: float) -> tuple[Array, Array]:
        linear = self.linear
        augmented = np.zeros((len(linear.phases), 9, 9))
        augmented[:, :3, 3:6] = np.eye(3)
        augmented[:, 3:6, :3] = -np.linalg.solve(linear.mass, linear.inverse_theta)
        augmented[:, 3:6, 3:6] = -np.linalg.solve(linear.mass, linear.inverse_rate)
        augmented[:, 3:6, 6:] = np.linalg.inv(linear.mass)
        response = np.asarray(expm(augmented * duration), dtype=np.float64)
        return response[:, :6, :6], response[:, :6, 6:]

    @cached_property
    def push(self) -> Array:
        """Response of the state to a force on the tip [N] of one period's duration, shape (n, size, 3)."""
        response = np.zeros((len(self.linear.phases), self.size, 3))
        response[:, :PLANT] = self.plant(self.sampling.period)[1] @ self.linear.jacobian.transpose(0, 2, 1)
        return response

    @cached_property
    def _omega(self) -> Array:
        """Filtered rates ω_k as a linear function of the state, shape (3, size)."""
        keep, share = self.sampling.keep, (1.0 - self.sampling.keep) / self.sampling.period
        row = np.zeros((3, self.size))
        row[:, 0:3], row[:, 6:9], row[:, 9:12] = share * np.eye(3), -share * np.eye(3), keep * np.eye(3)
        return row

    @property
    def measured_velocity(self) -> Array:
        """Filtered velocity of the tip [m/s] as a linear function of the state, shape (n, 3, size)."""
        return self.linear.jacobian @ self._omega

    def force(self, k_r: float, b_d: float) -> Array:
        """Force of the law at the tip [N] as a linear function of the state, shape (n, 3, size)."""
        linear = self.linear
        torque = (k_r * linear.unit_omega[0] + b_d * linear.unit_omega[1]) @ self._omega
        torque[:, :, :3] += k_r * linear.unit_theta[0] + b_d * linear.unit_theta[1]
        return np.linalg.solve(linear.jacobian.transpose(0, 2, 1), torque)

    @cached_property
    def _gain_parts(self) -> tuple[Array, Array, Array]:
        """State matrices at zero gains, and their derivatives by k_r and by b_d."""
        linear = self.linear
        zero = np.zeros_like(linear.weight_theta)
        return (
            self._state_matrices(linear.weight_theta, zero, True),
            self._state_matrices(linear.unit_theta[0], linear.unit_omega[0], False),
            self._state_matrices(linear.unit_theta[1], linear.unit_omega[1], False),
        )

    def _state_matrices(self, by_theta: Array, by_omega: Array, open_loop: bool) -> Array:
        """State matrices for torques with derivatives `by_theta`, `by_omega`; with `open_loop`, plus the open loop."""
        period, size = self.sampling.period, self.size
        whole, rest = self.sampling.whole_delay, self.sampling.rest_delay
        torque = by_omega @ self._omega
        torque[:, :, 0:3] += by_theta
        delayed_rows = np.eye(size)[UNDELAYED_SIZE:] if open_loop else np.zeros((size - UNDELAYED_SIZE, size))

        def delayed_torque(age: int) -> Array:
            """Torque `age` ticks ago as a linear function of the state."""
            return torque if age == 0 else np.broadcast_to(delayed_rows[3 * age - 3 : 3 * age], torque.shape)

        free, driven = self.plant(period - rest)
        matrices = np.zeros((len(self.linear.phases), size, size))
        matrices[:, :PLANT] = driven @ delayed_torque(whole)
        if rest > 0.0:
            early_free, early_driven = self.plant(rest)
            matrices[:, :PLANT] += free @ early_driven @ delayed_torque(whole + 1)
            free = free @ early_free
        for age in range(1, (size - UNDELAYED_SIZE) // 3 + 1):
            matrices[:, UNDELAYED_SIZE + 3 * age - 3 : UNDELAYED_SIZE + 3 * age] = delayed_torque(age - 1)
        if open_loop:
            matrices[:, :PLANT, :PLANT] += free
            matrices[:, 6:9, 0:3] = np.eye(3)
            matrices[:, 9:12] = self._omega
        return matrices

    @cached_property
    def fresh(self) -> Array:
        """Response of the state to the torques [N m] computed at a tick, shape (n, size, 3)."""
        unit = np.broadcast_to(np.eye(3), self.linear.weight_theta.shape)
        return self._state_matrices(unit, np.zeros(unit.shape), False)[:, :, :3]

    @cached_property
    def shifts(self) -> Array:
        """Derivatives of the whole state by the neutral displacements, shape (n, size, m)."""
        linear = self.linear
        # The delayed torques change by those of gravity compensation; the inertia along the lap is neglected.
        weight = linear.weight_theta @ linear.shift[:, :3]
        return np.concatenate([linear.shift, np.tile(weight, (1, (self.size - UNDELAYED_SIZE) // 3, 1))], axis=1)

    @cached_property
    def across(self) -> tuple[Array, Array]:
        """Basis transverse to the neutral displacements, (n, size, r), and the projection onto it, (n, r, size).

        With X the `shifts` and C the gradients of the neutral coordinates by the state, CᵀX = 1, r is ``size − m`` and
        the projection is I − X Cᵀ, in an orthonormal basis of the kernel of Cᵀ. For a river, C is ∂t*/∂ξ.
        """
        linear, size = self.linear, self.size
        n, m = len(linear.phases), linear.neutral.shape[2]
        if m == 0:
            unit = np.broadcast_to(np.eye(size), (n, size, size))
            return unit, unit
        gradient = np.zeros((n, size, m))
        gradient[:, :3] = (np.linalg.pinv(linear.neutral) @ linear.jacobian).transpose(0, 2, 1)
        basis = np.linalg.qr(gradient, mode="complete")[0][:, :, m:]
        projection = basis.transpose(0, 2, 1) @ (np.eye(size) - self.shifts @ gradient.transpose(0, 2, 1))
        return basis, projection

    def matrices(self, k_r: float, b_d: float) -> Array:
        """State matrices of one period, shape (n, size, size)."""
        own, stiffness, damping = self._gain_parts
        return own + k_r * stiffness + b_d * damping

    @cached_property
    def _frozen_parts(self) -> tuple[Array, Array, Array]:
        basis, projection = self.across
        own, stiffness, damping = (projection @ part @ basis for part in self._gain_parts)
        return own, stiffness, damping

    def frozen(self, k_r: float | Array, b_d: float | Array) -> Array:
        """Transverse state matrices with the phase frozen, shape (n, r, r); gains may be given per phase, (n,)."""
        own, stiffness, damping = self._frozen_parts
        return own + np.reshape(k_r, (-1, 1, 1)) * stiffness + np.reshape(b_d, (-1, 1, 1)) * damping

    def radius(self, k_r: float | Array, b_d: float | Array) -> Array:
        """Spectral radius of `frozen` at every phase, shape (n,)."""
        return np.abs(np.linalg.eigvals(self.frozen(k_r, b_d))).max(axis=1)

    def multipliers(self, k_r: float, b_d: float, periods: int) -> Array:
        """Floquet multipliers of a lap transverse to the curve, complex, shape (r,), the largest first.

        For a closed curve with phases `periods` periods apart; between them the maps are those of the earlier phase.
        Products of a thousand maps would underflow, so they are rescaled; multipliers below 1e-14 of the largest are
        noise.
        """
        basis, projection = self.across
        steps = np.roll(projection, -1, axis=0) @ np.linalg.matrix_power(self.matrices(k_r, b_d), periods) @ basis
        product, exponent = np.eye(steps.shape[1]), 0.0
        for step in steps:
            product = step @ product
            size = float(np.linalg.norm(product))
            product, exponent = product / size, exponent + float(np.log(size))
        values = np.linalg.eigvals(product) * np.exp(min(exponent, 700.0))
        return values[np.argsort(-np.abs(values))]
