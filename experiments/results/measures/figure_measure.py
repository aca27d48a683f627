"""Tracking of the animation by the physical figure, measured from blocks of frames."""

import math
from collections.abc import Mapping

import numpy as np

from experiments.results.measures.summary_parts import FigureSummary
from geometry.arrays import Array
from models.humanoid.skeleton import N_TANGENT
from sim.body.falls import UP
from sim.body.residual import MIN_GROUND_FORCE, ResidualMeasure
from sim.recording.recording import Recording


class MeanSquare:
    """Root mean square and largest magnitude of numbers (n,), or norm of vectors (n, d), that are given in blocks."""

    def __init__(self) -> None:
        self._sum, self.count, self.largest = 0.0, 0, 0.0

    def add(self, values: Array) -> None:
        """Add numbers or vectors."""
        square = values**2 if values.ndim == 1 else np.sum(values**2, axis=1)
        self._sum, self.count = self._sum + float(np.sum(square)), self.count + len(square)
        self.largest = max(self.largest, math.sqrt(float(square.max(initial=0.0))))

    @property
    def root(self) -> float:
        """Root mean square; 0 if there are none."""
        return math.sqrt(self._sum / max(self.count, 1))


class FigureMeasure:
    """`FigureSummary` of frames that are given in blocks.

    Intended stance and flight are those of the reference; actual contact is taken from the simulated ground force.
    """

    def __init__(self, recording: Recording):
        self._weight, self._rate = float(recording.arrays["body_weight"]), recording.rates["frames"]
        height = float(recording.arrays["com_height"])
        self._joints, self._root = MeanSquare(), MeanSquare()
        self._stance, self._flight, self._airborne = (
            ResidualMeasure(self._weight, height, 1.0 / self._rate) for _ in range(3)
        )
        self._frames, self._up, self._lost, self._saturated, self._ground = (0, 0, 0, 0.0, 0.0)
        self._was_up, self._falls = True, list[float]()

    def add(self, frames: Mapping[str, Array]) -> None:
        """Add a block of frames; those in which the figure lies or is being set back count in `seconds` only."""
        up = frames["down"] == UP
        falls = ~up & np.concatenate(([self._was_up], up[:-1]))
        self._falls += frames["t"][falls].tolist()
        self._was_up, self._frames, self._up = (bool(up[-1]), self._frames + len(up), self._up + int(np.sum(up)))
        in_flight, supported = frames["flight"][up] > 0.0, frames["ground"][up][:, 2] > MIN_GROUND_FORCE
        residual = frames["residual"][up]
        self._joints.add(frames["joint_error"][up])
        self._root.add(frames["root_error"][up])
        self._stance.add(residual[~in_flight])
        self._flight.add(residual[in_flight])
        self._airborne.add(residual[~supported])
        self._lost += int(np.sum(~in_flight & ~supported))
        self._saturated += float(np.sum(frames["saturated"][up]))
        self._ground += float(np.sum(frames["ground"][up][:, 2]))

    def summary(self) -> FigureSummary:
        """Summary of all frames so far."""
        up, stance, flight = max(self._up, 1), self._stance.summary(), self._flight.summary()
        return FigureSummary(
            falls=tuple(self._falls),
            fell_at=self._falls[0] if self._falls else None,
            seconds=self._frames / self._rate,
            up_seconds=self._up / self._rate,
            joint_error_rms_deg=math.degrees(self._joints.root),
            root_error_rms_cm=100.0 * self._root.root,
            root_error_max_cm=100.0 * self._root.largest,
            residual_force_rms=stance.force_rms,
            stance=stance,
            flight=flight,
            without_ground_force=self._airborne.summary(),
            residual_in_flight_max=max(flight.force_max, flight.moment_max),
            flight_seconds=flight.seconds,
            lost_contact_seconds=self._lost / self._rate,
            saturated=self._saturated / up / (N_TANGENT - 6),
            grounded=1.0 - self._lost / self._rate / stance.seconds if stance.seconds else 1.0,
            ground_force_mean=self._ground / up / self._weight,
        )
