"""A map of one's own says a pose: its size, its derivative and its kernel follow from that."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from numba import njit

from controllers.errors import ParameterError
from controllers.haptic_map.base import HapticMap, KernelMap
from controllers.haptic_map.map_stages import kernels_of
from controllers.haptic_map.own_map import own_map
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


def asked_in_a_run(haptic_map: HapticMap, *points: np.ndarray) -> list[np.ndarray]:
    """Poses that the tick gets at points of one run."""
    stages, params, memory, _ = haptic_map.compiled()
    poses = [np.empty(11) for _ in points]
    for x, pose in zip(points, poses, strict=True):
        kernels_of(stages)[0](params, x, memory, pose, np.empty((0, 6)))
    return poses


def test_sizes_and_derivative_follow_from_the_pose() -> None:
    made = Turned()
    assert (made.nq, made.nv) == (11, 9)
    expected = np.zeros((9, 6))
    expected[:3, :3] = np.eye(3)
    expected[5, 0] = RATE
    # ω_H turns the joint about H's axes; its own frame is turned by R, so ω = Rᵀ ω_H.
    w, y = X[3], X[5]
    expected[6:, 3:] = np.array([[w * w - y * y, 0, 2 * w * y], [0, 1, 0], [-2 * w * y, 0, w * w - y * y]]).T
    np.testing.assert_allclose(made.jacobian(X), expected, atol=1e-8)


def test_the_kernel_asks_the_map() -> None:
    made = Turned()
    pose, jacobian = kernel_of(made, X, made.nv)
    np.testing.assert_array_equal(pose, made.pose(X))
    np.testing.assert_array_equal(jacobian, made.jacobian(X))
    assert kernel_of(made, X, 0)[0].tolist() == pose.tolist()  # without the derivative


def given(jacobian: Callable[[np.ndarray], object]) -> HapticMap:
    """The same map with a derivative of its own."""

    class Given(Turned):
        def jacobian(self, x, memory=None):
            return jacobian(x)

    return Given()


def test_a_derivative_that_is_given_is_taken() -> None:
    rounded = given(lambda x: np.round(Turned().jacobian(x), 6))
    rounded.check_jacobian(X[None, :3])
    _, taken = kernel_of(rounded, X, 9)
    rounded.check()
    np.testing.assert_array_equal(taken, rounded.jacobian(X))


SHAPES = [
    (lambda x: np.zeros((3, 3)), r"a jacobian of shape \(3, 3\); expected \(9, 6\), or none"),
    (lambda x: np.zeros(6), r"a jacobian of shape \(6,\); expected \(9, 6\)"),
    (lambda x: 0.0, r"a jacobian of shape \(\); expected \(9, 6\)"),
    (lambda x: np.full((9, 6), np.nan), "a jacobian with a number that is not finite"),
]


@pytest.mark.parametrize(("jacobian", "said"), SHAPES)
def test_a_derivative_of_another_shape_or_not_finite_is_refused_before_a_run_and_in_a_tick(jacobian, said: str) -> None:
    wrong = given(jacobian)
    with pytest.raises(ParameterError, match=said):
        wrong.check_jacobian(X[None, :3])
    kernel_of(wrong, X, 9)
    with pytest.raises(ParameterError, match=said):
        wrong.check()


@pytest.mark.parametrize(
    ("jacobian", "said"),
    [
        (
            lambda x: -Turned().jacobian(x),
            r"is -3 in row 5, column 0 at p = \[0\.04, -0\.01, 0\.02\], and its pose .* 3 ",
        ),
        (lambda x: np.roll(Turned().jacobian(x), 3, axis=1), "linear before angular velocity in the columns"),
        (lambda x: 1.01 * Turned().jacobian(x), r"is 3\.03 in row 5, column 0"),
    ],
)
def test_a_derivative_that_is_not_that_of_the_poses_is_refused(jacobian, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        given(jacobian).check_jacobian(X[None, :3])


def test_a_derivative_is_not_compared_where_the_map_has_a_kink() -> None:
    class Kinked(Turned):
        def pose(self, x):
            return super().pose(np.concatenate([np.abs(x[:3] - X[:3]) + X[:3], x[3:]]))

        def jacobian(self, x, memory=None):
            return Turned().jacobian(x)

    beside = np.array([2e-5, 2e-5, 2e-5])
    Kinked().check_jacobian(X[None, :3] + beside)
    with pytest.raises(ParameterError, match="its pose changes by"):
        Kinked().check_jacobian(X[None, :3] - 100 * beside)


def test_what_goes_wrong_in_a_map_is_kept_and_the_pose_stays() -> None:
    class Fails(Turned):
        def pose(self, x):
            if x[0] > 0.05:
                raise ZeroDivisionError("beyond")
            return super().pose(x) if x[0] > 0.03 else super().pose(x)[: 11 if x[0] > -0.03 else 10]

    made = Fails()
    before, after = asked_in_a_run(made, X, X + np.array([0.02, 0, 0, 0, 0, 0, 0]))
    np.testing.assert_array_equal(after, before)
    with pytest.raises(ZeroDivisionError, match="beyond"):
        made.check()
    wrong = Fails()
    kernel_of(wrong, np.array([-0.04, 0, 0, 1.0, 0, 0, 0]), 0)
    with pytest.raises(ParameterError, match=r"gave a pose of shape \(10,\) at p = .*; expected 11 finite numbers"):
        wrong.check()


class Scaled(Turned):
    """Moved along x by a number that may be changed; a large one is an error away from the origin."""

    gain = 1.0

    def pose(self, x):
        if self.gain > 1e6 and x[0] > 0.0:
            raise ZeroDivisionError
        return super().pose(x) + np.eye(11)[0] * self.gain


class Slotted(Scaled):
    __slots__ = ("note",)


@pytest.mark.parametrize("kind", [Scaled, Slotted])
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda made: pickle.loads(pickle.dumps(made))])
def test_a_copy_of_a_map_that_ran_is_asked_itself(copied: Callable[[HapticMap], HapticMap], kind) -> None:
    made = kind()
    if kind is Slotted:
        made.note = "kept"
    kernel_of(made, X, 0)
    other = copied(made)
    other.gain = 2.0
    np.testing.assert_array_equal(kernel_of(other, X, 0)[0], other.pose(X))
    np.testing.assert_array_equal(kernel_of(made, X, 0)[0], made.pose(X))
    assert getattr(other, "note", "kept") == "kept"


def test_a_map_that_is_asked_elsewhere_meanwhile_gives_each_its_own_pose() -> None:
    class Shared(Turned):
        def jacobian(self, x, memory=None):
            asked_of(params, -X)  # as another run of a sweep does in its thread
            return super().jacobian(x)

    def asked_of(params: np.ndarray, x: np.ndarray, rows: int = 0) -> np.ndarray:
        pose = np.empty(11)
        own_map(params, x, np.zeros(1), pose, np.empty((rows, 6)))
        return pose

    made = Shared()
    params = made.compiled().params
    np.testing.assert_array_equal(asked_of(params, X, 9), made.pose(X))


def test_a_map_that_was_repaired_after_an_error_begins_anew() -> None:
    made = Scaled()
    made.gain = 1e9
    kernel_of(made, X, 0)
    with pytest.raises(ZeroDivisionError):
        made.check()
    made.gain = 2.0
    np.testing.assert_array_equal(kernel_of(made, X, 0)[0], made.pose(X))
    made.check()


def upright(**numbers: object) -> np.ndarray:
    """A pose of the figure, with other numbers, by place (`at5`)."""
    pose = np.zeros(75)
    pose[3::4] = 1.0
    for place, number in numbers.items():
        pose[int(place[2:])] = number
    return pose


@pytest.mark.parametrize(
    ("pose", "said"),
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
def test_a_pose_that_is_none_of_the_figure_is_refused_with_its_map_and_its_place(pose: object, said: str) -> None:
    class Given(HapticMap):
        def pose(self, x):
            return pose if x[0] == X[0] else upright()

    made = Given()
    kernel_of(made, X, 0)
    with pytest.raises(ParameterError, match=said) as told:
        made.check()
    assert "map Given" in str(told.value)


def test_a_map_that_returns_nothing_is_told_before_its_poses_are_counted() -> None:
    class Nothing(HapticMap):
        def pose(self, x):
            pass

    with pytest.raises(ParameterError, match="the pose of map Nothing is None; expected numbers"):
        _ = Nothing().nq


def test_quaternions_of_single_precision_are_taken() -> None:
    class Rounded(HapticMap):
        def pose(self, x):
            return (upright(at3=np.cos(x[0]), at4=np.sin(x[0]))).astype(np.float32)

    made = Rounded()
    pose, *_ = kernel_of(made, X, 0)
    made.check()
    np.testing.assert_array_equal(pose, made.pose(X))


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit])
def test_ctrl_c_within_a_map_is_kept_like_an_error_and_the_pose_is_written(kind: type[BaseException]) -> None:
    class Interrupted(Turned):
        def pose(self, x):
            if x[0] > 0.05:
                raise kind
            return super().pose(x)

    made = Interrupted()
    before, after = asked_in_a_run(made, X, X + np.array([0.02, 0, 0, 0, 0, 0, 0]))
    np.testing.assert_array_equal(after, before)
    with pytest.raises(kind):
        made.check()


def test_a_kernel_in_plain_python_is_refused_where_its_class_is_made() -> None:
    with pytest.raises(ParameterError, match="expected a function compiled by numba's njit"):
        type("Plain", (KernelMap,), {"map_kernel": staticmethod(lambda params, x, memory, pose, jacobian: None)})


def test_a_compiled_map_of_one_s_own_needs_no_entry_in_the_library() -> None:
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

    made = Slide(np.array([2.0]))
    assert_same_compiled(made, X)
    np.testing.assert_array_equal(map_poses(made, X[None]), 2.0 * RATE * X[None, :3])


@njit
def still(params, x, memory, pose, jacobian):
    pose[:] = params[0]
    jacobian[:] = params[1]


class Still(KernelMap):
    map_kernel = staticmethod(still)


def test_a_compiled_map_that_says_no_sizes_has_those_of_the_figure_and_takes_a_list() -> None:
    made = Still([0.5, 2])
    assert (made.nq, made.nv) == (75, 57)
    np.testing.assert_array_equal(made.pose(X), np.full(75, 0.5))
    np.testing.assert_array_equal(made.jacobian(X), np.full((57, 6), 2.0))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Still([[1.0, 2.0]]), r"params of Still have the shape \(1, 2\); expected one row"),
        (lambda: Still("soft"), "params of Still is 'soft'; expected numbers"),
        (lambda: type("Bare", (KernelMap,), {})([1.0]), "Bare has no kernel; expected map_kernel"),
    ],
)
def test_a_compiled_map_without_a_kernel_or_with_other_parameters_is_refused(make, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        make()
