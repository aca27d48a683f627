"""User-defined maps: size, Jacobian and kernel follow from their pose; errors are stored and reported."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.base import HapticMap, KernelMap
from controllers.haptic_map.map_stages import kernels_of
from controllers.haptic_map.own_map import python_map
from sim.reference.reference import map_poses
from tests.controllers.clips_for_maps import assert_same_compiled

X = np.array([0.04, -0.01, 0.02, 0.8, 0.0, 0.6, 0.0])
RATE = 3.0  # [rad/m]


class Turned(HapticMap):
    """Root along p, turned about z by RATE·p_x; its one joint turned as the stylus is."""

    def pose(self, x):
        half = 0.5 * RATE * x[0]
        return np.concatenate([x[:3], [np.cos(half), 0.0, 0.0, np.sin(half)], x[3:]])


def kernel_of(haptic_map: HapticMap, x: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    stages, params, memory, _ = haptic_map.compiled()
    pose, jacobian = np.empty(haptic_map.nq), np.empty((rows, 6))
    (kernel,) = kernels_of(stages)
    kernel(params, x, memory, pose, jacobian)
    return pose, jacobian


def poses_in_a_run(haptic_map: HapticMap, *points: np.ndarray) -> list[np.ndarray]:
    """Poses that the kernel gives at successive points of one run."""
    stages, params, memory, _ = haptic_map.compiled()
    poses = [np.empty(11) for _ in points]
    for x, pose in zip(points, poses, strict=True):
        kernels_of(stages)[0](params, x, memory, pose, np.empty((0, 6)))
    return poses


def test_sizes_and_jacobian_follow_from_the_pose() -> None:
    own = Turned()
    assert (own.nq, own.nv) == (11, 9)
    expected = np.zeros((9, 6))
    expected[:3, :3] = np.eye(3)
    expected[5, 0] = RATE
    # ω_H turns the joint about H's axes; its own frame is turned by R, so ω = Rᵀ ω_H.
    w, y = X[3], X[5]
    expected[6:, 3:] = np.array([[w * w - y * y, 0, 2 * w * y], [0, 1, 0], [-2 * w * y, 0, w * w - y * y]]).T
    np.testing.assert_allclose(own.jacobian(X), expected, atol=1e-8)


def test_kernel_calls_pose_and_jacobian_of_the_map() -> None:
    own = Turned()
    pose, jacobian = kernel_of(own, X, own.nv)
    np.testing.assert_array_equal(pose, own.pose(X))
    np.testing.assert_array_equal(jacobian, own.jacobian(X))
    assert kernel_of(own, X, 0)[0].tolist() == pose.tolist()  # without the derivative


def test_map_that_changes_its_argument_or_reuses_its_pose_has_the_same_derivative() -> None:
    class Careless(Turned):
        kept = np.empty(11)

        def pose(self, x):
            self.kept[:] = super().pose(x)
            x[:] = 0.0
            return self.kept

    for given, expected in zip(kernel_of(Careless(), X.copy(), 9), kernel_of(Turned(), X, 9), strict=True):
        np.testing.assert_array_equal(given, expected)


def with_jacobian(jacobian: Callable[[np.ndarray], object]) -> HapticMap:
    """The map `Turned` with a given Jacobian."""

    class Given(Turned):
        def jacobian(self, x, memory=None):
            return jacobian(x)

    return Given()


def test_own_jacobian_is_used() -> None:
    rounded = with_jacobian(lambda x: np.round(Turned().jacobian(x), 6))
    rounded.check_jacobian(X[None, :3])
    _, used = kernel_of(rounded, X, 9)
    rounded.check()
    np.testing.assert_array_equal(used, rounded.jacobian(X))


MALFORMED_JACOBIANS = [
    (lambda x: np.zeros((3, 3)), r"a jacobian of shape \(3, 3\); expected \(9, 6\), or none"),
    (lambda x: np.zeros(6), r"a jacobian of shape \(6,\); expected \(9, 6\)"),
    (lambda x: 0.0, r"a jacobian of shape \(\); expected \(9, 6\)"),
    (lambda x: np.full((9, 6), np.nan), "a jacobian with a number that is not finite"),
]


@pytest.mark.parametrize(("jacobian", "message"), MALFORMED_JACOBIANS)
def test_malformed_jacobian_raises_before_the_run_and_in_a_tick(jacobian, message: str) -> None:
    wrong = with_jacobian(jacobian)
    with pytest.raises(ParameterError, match=message):
        wrong.check_jacobian(X[None, :3])
    kernel_of(wrong, X, 9)
    with pytest.raises(ParameterError, match=message):
        wrong.check()


@pytest.mark.parametrize(
    ("jacobian", "message"),
    [
        (
            lambda x: -Turned().jacobian(x),
            r"is -3 in row 5, column 0 at p = \[0\.04, -0\.01, 0\.02\], and its pose .* 3 ",
        ),
        (lambda x: np.roll(Turned().jacobian(x), 3, axis=1), "linear before angular velocity in the columns"),
        (lambda x: 1.01 * Turned().jacobian(x), r"is 3\.03 in row 5, column 0"),
    ],
)
def test_jacobian_inconsistent_with_the_pose_raises_parameter_error(jacobian, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        with_jacobian(jacobian).check_jacobian(X[None, :3])


def test_jacobian_is_not_compared_at_a_kink_of_the_pose() -> None:
    class Kinked(Turned):
        def pose(self, x):
            return super().pose(np.concatenate([np.abs(x[:3] - X[:3]) + X[:3], x[3:]]))

        def jacobian(self, x, memory=None):
            return Turned().jacobian(x)

    beside = np.array([2e-5, 2e-5, 2e-5])
    Kinked().check_jacobian(X[None, :3] + beside)
    with pytest.raises(ParameterError, match="its pose changes by"):
        Kinked().check_jacobian(X[None, :3] - 100 * beside)


def test_exception_in_pose_is_stored_and_the_last_pose_kept() -> None:
    class Fails(Turned):
        def pose(self, x):
            if x[0] > 0.05:
                raise ZeroDivisionError("beyond")
            return super().pose(x) if x[0] > 0.03 else super().pose(x)[: 11 if x[0] > -0.03 else 10]

    own = Fails()
    before, after = poses_in_a_run(own, X, X + np.array([0.02, 0, 0, 0, 0, 0, 0]))
    np.testing.assert_array_equal(after, before)
    with pytest.raises(ZeroDivisionError, match="beyond"):
        own.check()
    wrong = Fails()
    kernel_of(wrong, np.array([-0.04, 0, 0, 1.0, 0, 0, 0]), 0)
    with pytest.raises(ParameterError, match=r"gave a pose of shape \(10,\) at p = .*; expected 11 finite numbers"):
        wrong.check()


class Scaled(Turned):
    """Moved along x by a gain that may be changed; a large gain raises away from the origin."""

    gain = 1.0

    def pose(self, x):
        if self.gain > 1e6 and x[0] > 0.0:
            raise ZeroDivisionError
        return super().pose(x) + np.eye(11)[0] * self.gain


class Slotted(Scaled):
    __slots__ = ("note",)


@pytest.mark.parametrize("kind", [Scaled, Slotted])
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda own: pickle.loads(pickle.dumps(own))])
def test_copy_of_a_used_map_calls_itself(copied: Callable[[HapticMap], HapticMap], kind) -> None:
    own = kind()
    if kind is Slotted:
        own.note = "kept"
    kernel_of(own, X, 0)
    other = copied(own)
    other.gain = 2.0
    np.testing.assert_array_equal(kernel_of(other, X, 0)[0], other.pose(X))
    np.testing.assert_array_equal(kernel_of(own, X, 0)[0], own.pose(X))
    assert getattr(other, "note", "kept") == "kept"


def test_concurrent_calls_of_one_map_return_their_own_poses() -> None:
    class Shared(Turned):
        def jacobian(self, x, memory=None):
            pose_of(params, -X)  # as another run of a sweep does in its own thread
            return super().jacobian(x)

    def pose_of(params: np.ndarray, x: np.ndarray, rows: int = 0) -> np.ndarray:
        pose = np.empty(11)
        python_map(params, x, np.zeros(1), pose, np.empty((rows, 6)))
        return pose

    own = Shared()
    params = own.compiled().params
    np.testing.assert_array_equal(pose_of(params, X, 9), own.pose(X))


def test_repaired_map_runs_again_after_an_error() -> None:
    own = Scaled()
    own.gain = 1e9
    kernel_of(own, X, 0)
    with pytest.raises(ZeroDivisionError):
        own.check()
    own.gain = 2.0
    np.testing.assert_array_equal(kernel_of(own, X, 0)[0], own.pose(X))
    own.check()


def upright(**numbers: object) -> np.ndarray:
    """An upright pose of the figure with some numbers replaced, by index (`at5`)."""
    pose = np.zeros(75)
    pose[3::4] = 1.0
    for key, number in numbers.items():
        pose[int(key[2:])] = number
    return pose


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (
            1.5 * upright(),
            r"quaternion of norm 1\.5 for the root, pose\[3:7\], at p = \[0\.04, -0\.01, 0\.02\]; expected 1",
        ),
        (upright(at7=0.0), r"a quaternion of norm 0 for joint 1, pose\[7:11\], at p"),
        (upright(at74=0.05), r"a quaternion of norm 1\.001 for joint 17, pose\[71:75\]"),
        (upright(at9=np.nan), r"gave a pose of shape \(75,\) with nan in it at p = .*; expected 75 finite numbers"),
        (upright() + 1j, r"the pose of map Given at p = .* is array.*; expected numbers"),
        (["1"] * 75, r"the pose of map Given at p = .* expected numbers"),
        (None, r"the pose of map Given at p = .* is None; expected numbers"),
    ],
)
def test_invalid_pose_raises_with_map_and_position(pose: object, message: str) -> None:
    class Given(HapticMap):
        def pose(self, x):
            return pose if x[0] == X[0] else upright()

    own = Given()
    kernel_of(own, X, 0)
    with pytest.raises(ParameterError, match=message) as error:
        own.check()
    assert "map Given" in str(error.value)


def test_map_that_returns_none_raises_when_its_size_is_read() -> None:
    class Nothing(HapticMap):
        def pose(self, x):
            pass

    with pytest.raises(ParameterError, match="the pose of map Nothing is None; expected numbers"):
        _ = Nothing().nq


def test_single_precision_quaternions_are_accepted() -> None:
    class Rounded(HapticMap):
        def pose(self, x):
            return (upright(at3=np.cos(x[0]), at4=np.sin(x[0]))).astype(np.float32)

    own = Rounded()
    pose, *_ = kernel_of(own, X, 0)
    own.check()
    np.testing.assert_array_equal(pose, own.pose(X))


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit])
def test_interrupt_within_a_map_is_stored_and_the_last_pose_written(kind: type[BaseException]) -> None:
    class Interrupted(Turned):
        def pose(self, x):
            if x[0] > 0.05:
                raise kind
            return super().pose(x)

    own = Interrupted()
    before, after = poses_in_a_run(own, X, X + np.array([0.02, 0, 0, 0, 0, 0, 0]))
    np.testing.assert_array_equal(after, before)
    with pytest.raises(kind):
        own.check()


def test_plain_python_kernel_raises_when_its_class_is_defined() -> None:
    with pytest.raises(ParameterError, match="expected a function compiled by numba's njit"):
        type("Plain", (KernelMap,), {"map_kernel": staticmethod(lambda params, x, memory, pose, jacobian: None)})


def test_compiled_own_map_needs_no_registration() -> None:
    rate = RATE  # a kernel of one process, which reads a number of this function

    @njit
    def slide(params, x, memory, pose, jacobian):
        jacobian[:] = 0.0
        for i in range(3):
            pose[i] = params[0] * rate * x[i]
            if jacobian.shape[0]:
                jacobian[i, i] = params[0] * rate

    class Slide(KernelMap):
        map_kernel = staticmethod(slide)
        nq, nv = 3, 3

    own = Slide(np.array([2.0]))
    assert_same_compiled(own, X)
    np.testing.assert_array_equal(map_poses(own, X[None]), 2.0 * RATE * X[None, :3])


@njit
def still(params, x, memory, pose, jacobian):
    pose[:] = params[0]
    jacobian[:] = params[1]


class Still(KernelMap):
    map_kernel = staticmethod(still)


def test_compiled_map_without_sizes_has_those_of_the_figure_and_takes_a_list() -> None:
    own = Still([0.5, 2])
    assert (own.nq, own.nv) == (75, 57)
    np.testing.assert_array_equal(own.pose(X), np.full(75, 0.5))
    np.testing.assert_array_equal(own.jacobian(X), np.full((57, 6), 2.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Still([[1.0, 2.0]]), r"params of Still have the shape \(1, 2\); expected one row"),
        (lambda: Still("soft"), "params of Still is 'soft'; expected numbers"),
        (lambda: type("Bare", (KernelMap,), {})([1.0]), "Bare has no kernel; expected map_kernel"),
    ],
)
def test_invalid_kernel_map_raises_parameter_error(make, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        make()
