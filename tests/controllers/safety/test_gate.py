"""The gate: for any command its force is finite, within the limits, and zero unless armed and free of oscillation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.errors import ParameterError
from controllers.safety.arming import ARM, CLEAR, DISARM, NO_REQUEST, TRANSITIONS, Event, State, next_state
from controllers.safety.faults import FAULT_CODE, Fault, Plausibility, latch, rearm
from controllers.safety.gate import GATE_FORCE, GATE_GAIN, GATE_STATE, Gate, pass_gate
from controllers.state import HAND_SIZE

T = 1e-3
SMALL = (0.3, 0.0, 0.0)


class Gated:
    """A gate called from Python, tick by tick."""

    def __init__(self, **limits) -> None:
        self.gate = Gate(T, **({"permitted": True, "dead_man": False} | limits))
        self.params, self.detector_params = self.gate.params(), self.gate.detector.params()
        self.memory, self.detector_memory = self.gate.fresh_memory(), self.gate.detector.fresh_memory()
        self.faults = Plausibility(T, (100.0,) * 3, (1e-4,) * 3, 5 * T).fresh()
        self.hand = np.zeros(HAND_SIZE)
        self.hand[4] = 1.0

    def tick(self, force, request: int = NO_REQUEST, p=(0, 0, 0), v=(0, 0, 0), switch: float = 0.0) -> np.ndarray:
        self.hand[1:4], self.hand[8:11], self.hand[14] = p, v, switch
        out = np.array(force, dtype=float)
        pass_gate(
            self.params, self.detector_params, self.memory, self.detector_memory, self.faults, self.hand, request, out
        )
        self.hand[0] += T
        return out

    def clear(self) -> None:
        rearm(self.faults)
        self.tick(SMALL, CLEAR)

    def armed(self) -> "Gated":
        self.tick(SMALL, ARM)
        for _ in range(1200):
            self.tick(SMALL)
        assert self.state is State.ACTIVE
        return self

    @property
    def state(self) -> State:
        return State(int(self.memory[GATE_STATE]))

    @property
    def fault(self) -> Fault:
        return Fault(int(self.faults[FAULT_CODE]))


numbers = st.one_of(
    st.floats(-10, 10), st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0.0, 0.3, 1e308, -1e308])
)
vectors = st.tuples(numbers, numbers, numbers)
motions = st.tuples(*[st.floats(-0.3, 0.3) | st.sampled_from([0.0, np.nan, np.inf])] * 3)
commands = st.lists(
    st.tuples(vectors, st.sampled_from([NO_REQUEST, NO_REQUEST, ARM, DISARM, CLEAR]), motions, motions,
              st.sampled_from([0.0, 1.0]), st.integers(1, 80)),
    min_size=1, max_size=40,
)  # fmt: skip


@settings(max_examples=150)
@given(commands, st.booleans(), st.booleans())
@pytest.mark.slow
def test_no_command_sequence_sends_a_force_above_the_limits(sequence, permitted: bool, dead_man: bool) -> None:
    gated = Gated(permitted=permitted, dead_man=dead_man, ramp=0.05, quiet=0.01)
    gate, last, clean = gated.gate, np.zeros(3), 0
    for force, request, p, v, switch, ticks in sequence:
        for _ in range(ticks):
            if request == CLEAR:
                rearm(gated.faults)
            faulted = gated.fault is not Fault.NONE
            out = gated.tick(force, request, p, v, switch)
            assert np.isfinite(out).all()
            assert np.linalg.norm(out) <= gate.force * (1 + 1e-12)
            if gated.state in (State.RAMPING, State.ACTIVE):
                assert np.linalg.norm(out - last) <= gate.slew * T * (1 + 1e-9)
                assert permitted
                assert switch > 0.0 or not dead_man
            else:
                assert not out.any()
            if faulted:
                assert not out.any()
                assert gated.state is State.FAULT
            clean += not faulted
            last = out
    assert np.isfinite(gated.memory).all()


def test_table_leads_from_fault_to_force_only_by_clearing_and_arming() -> None:
    assert {(a, e): b for (a, e), b in TRANSITIONS.items() if a is State.FAULT} == {
        (State.FAULT, Event.CLEAR): State.DISARMED, (State.FAULT, Event.FAULTED): State.FAULT
    }  # fmt: skip
    before_ramping = {a for (a, _), b in TRANSITIONS.items() if b is State.RAMPING}
    assert before_ramping == {State.ARMING}
    assert {a for (a, _), b in TRANSITIONS.items() if b is State.ACTIVE} == {State.RAMPING}
    assert all(TRANSITIONS[state, Event.FAULTED] is State.FAULT for state in State)


def test_compiled_table_equals_the_table() -> None:
    for state in State:
        for event in Event:
            assert next_state(int(state), int(event)) == TRANSITIONS.get((state, event), state)


def test_arming_waits_for_a_small_force_and_ramps_it_in() -> None:
    gated = Gated()
    gated.tick((3.0, 0.0, 0.0), ARM)
    for _ in range(500):
        assert not gated.tick((3.0, 0.0, 0.0)).any()
    assert gated.state is State.ARMING
    sizes = [np.linalg.norm(gated.tick(SMALL)) for _ in range(1200)]
    assert max(sizes[:40]) == 0.0
    assert gated.state is State.ACTIVE
    assert sizes[-1] == pytest.approx(0.3)
    assert np.diff(sizes).max() <= 0.3 * T / gated.gate.ramp * 1.001


def test_unpermitted_gate_does_not_arm() -> None:
    gated = Gated(permitted=False)
    gated.tick(SMALL, ARM)
    for _ in range(2000):
        assert not gated.tick(SMALL).any()
    assert gated.state is State.DISARMED


def test_released_dead_man_switch_stops_the_force_and_ramps_it_in_again() -> None:
    gated = Gated(dead_man=True)
    gated.tick(SMALL, ARM, switch=1.0)
    for _ in range(1200):
        gated.tick(SMALL, switch=1.0)
    assert gated.state is State.ACTIVE
    assert not gated.tick(SMALL, switch=0.0).any()
    assert gated.state is State.ARMING
    assert gated.fault is Fault.NONE
    for _ in range(60):
        out = gated.tick(SMALL, switch=1.0)
    assert 0.0 < np.linalg.norm(out) < 0.05


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", range(3))
def test_non_finite_force_is_a_fault_in_its_tick(bad: float, axis: int) -> None:
    gated = Gated().armed()
    force = np.array(SMALL)
    force[axis] = bad
    assert not gated.tick(force).any()
    assert (gated.fault, gated.state) == (Fault.FORCE_NOT_FINITE, State.FAULT)


@pytest.mark.parametrize(
    ("motion", "fault"),
    [
        ({"p": (0.13, 0, 0)}, Fault.LEFT_WORKSPACE),
        ({"p": (0, -0.23, 0)}, Fault.LEFT_WORKSPACE),
        ({"p": (0, 0, 0.17)}, Fault.LEFT_WORKSPACE),
        ({"p": (np.nan, 0, 0)}, Fault.LEFT_WORKSPACE),
        ({"v": (1.6, 0, 0)}, Fault.TOO_FAST),
        ({"v": (0, -1.2, 1.2)}, Fault.TOO_FAST),
        ({"v": (0, np.inf, 0)}, Fault.TOO_FAST),
    ],
)
def test_hand_beyond_a_limit_margin_is_a_fault_only_under_force(motion, fault: Fault) -> None:
    gated = Gated()
    gated.tick(SMALL, **motion)
    assert gated.fault is Fault.NONE
    gated.armed()
    assert not gated.tick(SMALL, **motion).any()
    assert gated.fault is fault
    assert not gated.tick(SMALL).any()
    gated.clear()
    assert gated.state is State.DISARMED


def test_force_fades_within_the_margins() -> None:
    gated = Gated().armed()
    gate = gated.gate
    full = np.linalg.norm(gated.tick(SMALL))
    half = np.linalg.norm(gated.tick(SMALL, p=(gate.high[0] + 0.5 * gate.margin, 0, 0)))
    fast = np.linalg.norm(gated.tick(SMALL, v=(0, 0, gate.speed + 0.5 * gate.speed_margin)))
    assert (half / full, fast / full) == (pytest.approx(0.5), pytest.approx(0.5))
    assert gated.fault is Fault.NONE


def test_fault_latched_elsewhere_stops_the_force_and_stays() -> None:
    gated = Gated().armed()
    latch(gated.faults, int(Fault.CONTROL_LOST), gated.hand[0], 0.6)
    assert not gated.tick(SMALL).any()
    for request in (NO_REQUEST, ARM, DISARM, CLEAR):
        assert not gated.tick(SMALL, request).any()
    assert (gated.fault, gated.state) == (Fault.CONTROL_LOST, State.FAULT)


def test_jumping_command_is_slewed_and_limited() -> None:
    gated = Gated().armed()
    steps = [gated.tick((0.0, 50.0, 0.0)) for _ in range(10)]
    sizes = np.linalg.norm(steps, axis=1)
    assert np.abs(np.diff(sizes)).max() <= gated.gate.slew * T
    assert sizes[-1] == pytest.approx(gated.gate.force)
    np.testing.assert_array_equal(gated.memory[GATE_FORCE:], steps[-1])


def test_oscillation_that_persists_at_low_gain_is_a_fault() -> None:
    """A field whose oscillation grows as the gain falls."""
    gated, sizes = Gated().armed(), []
    for k in range(3000):
        size = 2.0 / max(0.05, gated.memory[GATE_GAIN])
        sizes.append(np.linalg.norm(gated.tick((size * np.sin(2 * np.pi * 60.0 * k * T), 0.0, 0.0))))
        if gated.fault is not Fault.NONE:
            break
    assert gated.fault is Fault.OSCILLATION
    assert 0.9 < len(sizes) * T < 1.3


def test_oscillating_field_is_attenuated_to_a_weak_force() -> None:
    gated, sizes = Gated().armed(), []
    for k in range(5000):
        sizes.append(np.linalg.norm(gated.tick((2.0 * np.sin(2 * np.pi * 60.0 * k * T), 0.0, 0.0))))
    assert max(sizes[:100]) > 1.0
    assert max(sizes[500:]) < 0.5
    assert gated.fault is Fault.NONE


@pytest.mark.parametrize(("frequency", "size"), [(1.0, 3.5), (5.0, 3.5), (10.0, 1.5), (100.0, 0.25)])
def test_voluntary_motion_and_tremor_are_no_oscillation(frequency: float, size: float) -> None:
    gated = Gated().armed()
    for k in range(3000):
        gated.tick((size * np.sin(2 * np.pi * frequency * k * T), 0.0, 0.0))
    assert gated.memory[GATE_GAIN] == 1.0


def test_contact_with_a_wall_is_no_oscillation() -> None:
    gated = Gated().armed()
    for k in range(3000):
        gated.tick((3.0 if (k // 250) % 2 else 0.0, 0.0, 0.0))
    assert gated.memory[GATE_GAIN] == 1.0


def test_gain_recovers_after_an_oscillation_that_lower_gain_stops() -> None:
    """An oscillation that grows above a gain of 0.5 and decays below it."""
    gated, size, gains = Gated().armed(), 0.4, []
    for k in range(6000):
        force = gated.tick((size * np.sin(2 * np.pi * 40.0 * k * T), 0.0, 0.0))
        gain = gated.memory[GATE_GAIN]
        limit = 0.5 if k < 2000 else 1.5
        size = min(2.0, max(0.05, size * np.exp((gain - limit) * T / 0.05)))
        gains.append(gain)
        assert np.isfinite(force).all()
    assert gated.fault is Fault.NONE
    assert min(gains) < 0.5
    assert gains[-1] == 1.0


@pytest.mark.parametrize("limits", [{"force": 0.0}, {"slew": np.nan}, {"margin": -1.0}, {"low": (0.2, 0.0, 0.0)}])
def test_invalid_limits_raise_parameter_error(limits) -> None:
    with pytest.raises(ParameterError, match=r"of the gate is .*; expected more than 0, and finite|no room"):
        Gate(T, **limits)
