"""Skeletons whose names say nothing: the same motion as by names, or a reason for refusal; never another body."""

import re
import shutil

import numpy as np
import pytest

from models.mocap.library import load
from models.mocap.readers.formats import READABLE_SUFFIXES, read_motion
from models.mocap.readers.motion_file import MotionFileError
from models.mocap.retargeting.hints import Hints
from models.mocap.retargeting.roles_by_shape import roles_by_shape
from models.mocap.retargeting.skeleton_roles import roles_of
from tests.models.mocap.retargeting.creatures import (
    arms_with_hands,
    grow,
    grow_both,
    lone_root,
    quadruped,
    radial,
    twice,
    with_fingers,
    with_skirt,
    without,
)
from tests.models.mocap.retargeting.posed_clips import posed
from tests.models.mocap.retargeting.rigs import Rig, at_rate, largest_angle, random_rig, write_rig

JOINT = re.compile(r"(?<=ROOT |OINT )\S.*")
PARTS = "Hips Spine Spine4 Neck Head @Shoulder @Arm @ForeArm @Hand @UpLeg @Leg @Foot @ToeBase"
# Words for the sides, and for the parts above.
LANGUAGES = {
    "German": ("linkes rechtes", "Becken Lende Brustkorb Nacken Kopf @~Schlüsselbein @~Oberarmbein @~Unterarmbein "
               "@~Händchen @~Oberschenkelbein @~Schienbein @~Füßchen @~Zehenglied"),
    "French": ("gauche droite", "bassin lombaires poitrine cou tête clavicule_@ bras_@ avant_bras_@ main_@ cuisse_@ "
               "mollet_@ pied_@ orteils_@"),
    "Spanish": ("izq der", "cadera espalda pecho cuello cabeza clavícula_@ brazo_@ antebrazo_@ mano_@ muslo_@ "
                "pantorrilla_@ pie_@ dedos_@"),
    "Russian": ("лев прав", "таз поясница грудь шея голова ключица_@ плечо_@ предплечье_@ кисть_@ бедро_@ голень_@ "
                "стопа_@ носок_@"),
    "Chinese": ("左 右", "骨盆 腰椎 胸椎 颈 头部 @锁骨 @上臂 @前臂 @手掌 @大腿 @小腿 @脚掌 @脚趾"),
    "Korean": ("왼쪽 오른쪽", "골반 허리 가슴 목 머리 @쇄골 @위팔 @아래팔 @손 @허벅지 @종아리 @발 @발가락"),
}  # fmt: skip


def rename(path, new_name):
    """Rename all joints of a BVH file; the new names by old name."""
    text = path.read_text(encoding="utf-8")
    names = {name: new_name(k, name) for k, name in enumerate(JOINT.findall(text))}
    path.write_text(JOINT.sub(lambda found: names[found[0]], text), encoding="utf-8")
    return names


def read_with_and_without_names(path, rng=None):
    """What a file gives by names, what it gives with numbers for names, and the numbers by name."""
    named, numbers = load(path), (rng or np.random.default_rng(0)).permutation(1000)
    names = rename(path, lambda k, _: f"Bone.{numbers[k]:03d}")
    return named, load(path), names


def human(name="walk", **more):
    """The motion of an embedded clip on a rig, with the names of MotionBuilder."""

    def read(folder):
        write_rig(Rig(**more), at_rate(name, 30.0), folder / "human.bvh")
        return read_motion(folder / "human.bvh")

    return read


def test_numbers_for_names_give_the_same_motion_and_a_remark(tmp_path):
    rig = Rig(zero="random", twists="{}Twist", beside=True, fingers=True, props=True, hips=0.4, shuffled=True, seed=3)
    write_rig(rig, at_rate("walk", 30.0), tmp_path / "r.bvh")
    named, numbered, names = read_with_and_without_names(tmp_path / "r.bvh")
    np.testing.assert_allclose(numbered.clip.poses, named.clip.poses, atol=1e-9)
    assert numbered.report.taken == {body: names[joint] for body, joint in named.report.taken.items()}
    (remark,) = [remark for remark in numbered.report.remarks if remark not in named.report.remarks]
    assert f"{names['LeftUpLeg']} as left_thigh" in remark
    assert remark.endswith("--roles FILE overrules")


@pytest.mark.parametrize("language", LANGUAGES)
def test_names_in_any_language_give_the_same_roles(language, tmp_path):
    sides, parts = LANGUAGES[language]
    words = {}
    for side, own in zip(("Left", "Right"), sides.split(), strict=True):
        for part, word in zip(PARTS.split(), parts.split(), strict=True):
            words[part.replace("@", side)] = word.replace("@", own).replace("~", " ")
    write_rig(Rig(seed=1), at_rate("ginga", 30.0), tmp_path / "r.bvh")
    named = load(tmp_path / "r.bvh").report
    rename(tmp_path / "r.bvh", lambda _, name: words[name])
    assert load(tmp_path / "r.bvh").report.taken == {body: words[joint] for body, joint in named.taken.items()}


def test_names_of_which_one_is_unknown_give_the_same_roles(tmp_path):
    write_rig(Rig(), at_rate("walk", 30.0), tmp_path / "r.bvh")
    named = load(tmp_path / "r.bvh")
    rename(tmp_path / "r.bvh", lambda _, name: name.replace("ForeArm", "Cubitus"))
    np.testing.assert_allclose(load(tmp_path / "r.bvh").clip.poses, named.clip.poses, atol=1e-9)


def test_sides_in_names_that_the_body_contradicts_are_refused(tmp_path):
    write_rig(Rig(), at_rate("walk", 30.0), tmp_path / "r.bvh")
    other = {"Left": "R_", "Right": "L_"}
    rename(tmp_path / "r.bvh", lambda k, name: re.sub("(Left|Right).*", lambda side: f"{other[side[1]]}{k}", name))
    with pytest.raises(MotionFileError, match=r"by toes, knees and arms, R_\d+ is its left thigh\), or --roles FILE"):
        load(tmp_path / "r.bvh")


@pytest.mark.parametrize(
    ("read", "reason"),
    [
        (lambda _: quadruped((40, 35, 20), (40, 35, 20), 70), "no two legs and two arms"),
        (lambda _: quadruped((40, 35, 20), (25, 22, 12), 70), "the trunk is 1.0 times as long as thigh and shank"),
        (lambda _: quadruped((40, 45, 25), (22, 20, 8), 60), "its trunk is hardly ever upright"),
        (lambda _: quadruped((50, 50, 40), (45, 45, 35), 130), "no two legs and two arms"),
        (lambda _: radial(8), "several limbs might be its legs or arms"),
        (lambda _: radial(100), "no two legs and two arms"),
        (lambda _: with_fingers(lone_root(), "root"), "no two legs and two arms"),
        (lambda _: arms_with_hands(), "no two legs and two arms"),
        (lambda _: grow(lone_root(), "root", [(0, -10, 0)] * 200), "no two legs and two arms"),
        (lambda folder: without(human()(folder), "LeftShoulder"), "no two legs and two arms"),
        (lambda folder: without(human()(folder), "LeftUpLeg"), "no two legs and two arms"),
        (lambda folder: with_skirt(human()(folder), "Hips", 2, (42, 43)), "several limbs might be its legs or arms"),
        (lambda folder: with_skirt(human()(folder), "Hips", 8, (42, 43)), "several limbs might be its legs or arms"),
        (lambda folder: grow_both(human()(folder), "Head", [(8, 0, 10), (0, 0, -28), (0, 0, -25)]),
         "several limbs might be its legs or arms"),
        (lambda folder: grow_both(human()(folder), "Spine4", [(8, -8, 10), (28, -20, 0), (35, 0, -25)]),
         "several limbs might be its legs or arms"),
        (lambda folder: twice(human()(folder), 150.0), "several limbs might be its legs or arms"),
    ],
    ids=["dog", "dog with short forelegs", "rabbit", "horse", "spider", "sea urchin", "hand", "two arms", "rope",
         "one arm", "one leg", "two strands as long as legs", "skirt as long as legs", "hair as long as arms", "wings",
         "two people"],
)  # fmt: skip
def test_other_creatures_are_refused(read, reason, tmp_path):
    assert reason in roles_by_shape(read(tmp_path))


@pytest.mark.parametrize(
    "change",
    [
        lambda body: grow(body, "Hips", [(-20, 0, 0)] * 5, 0.3),
        lambda body: grow(body, "RightHand", [(5, 0, 10), (0, 0, 90)], 0.0),
        lambda body: grow(body, "RightHand", [(5, 0, 10), (0, 0, 60), (0, 0, 60)], 0.5),
        lambda body: with_skirt(body, "Hips", 8, (12, 10)),
        lambda body: grow(body, "Spine4", [(-10, 0, 10), *[(0, 0, -20)] * 6], 0.2),
        lambda body: grow_both(body, "Head", [(8, 0, 10), (0, 0, 12), (0, 0, 12)]),
    ],
    ids=["tail", "sword", "whip", "short skirt", "cape", "ears"],
)
def test_what_a_human_carries_is_not_taken_for_a_limb(change, tmp_path):
    body = human()(tmp_path)
    by_names, by_shape = roles_of(body.joints, body.parents), roles_by_shape(changed := change(body))
    assert not isinstance(by_shape, str), by_shape
    assert {part: changed.joints[k] for part, k in by_shape.segments.items()} == {
        part: body.joints[k] for part, k in by_names.segments.items()
    }


def test_head_with_a_ponytail_is_reported_as_missing_and_not_guessed(tmp_path):
    roles = roles_by_shape(grow(human()(tmp_path), "Head", [(-8, 0, 10), *[(0, 0, -10)] * 5]))
    assert "head" not in roles.segments
    assert "chest" in roles.segments


def test_body_without_a_head_is_refused(tmp_path):
    assert roles_by_shape(human(without=("neck", "head"))(tmp_path)) == "nothing above its shoulders might be a head"


@pytest.mark.parametrize("name", ["walk", "ginga", "backflip"])
def test_arms_longer_than_legs_are_not_taken_for_these(name, tmp_path):
    body = human(name, proportions={"arm": 1.3, "leg": 0.5})(tmp_path)
    assert isinstance(roles_by_shape(body), str)
    assert isinstance(roles_by_shape(grow(body, "Hips", [(-10, 0, -10)] * 3)), str)  # nor with a tail for a head


@pytest.mark.parametrize("up", ["+X", "-Y", "-Z"])
def test_vertical_that_programs_do_not_write_has_to_be_stated(up, tmp_path):
    body = human(up=up)(tmp_path)
    assert roles_by_shape(body) == "up would be an axis that programs do not write: --up states it"
    assert roles_by_shape(body, up) == roles_of(body.joints, body.parents)


def test_knees_that_bend_back_do_not_decide_which_side_is_left(tmp_path):
    turns = (("thigh", 30.0), ("shank", -70.0), ("foot", 40.0))
    back = [(f"{side}_{part}", "y", angle) for side in ("left", "right") for part, angle in turns]
    back = posed(back, at_rate("walk", 30.0))
    write_rig(Rig(), back, tmp_path / "r.bvh")
    assert roles_by_shape(read_motion(tmp_path / "r.bvh")) == "toes, knees and arms do not show which side is left"


def test_wrist_that_never_bends_is_found_by_the_proportions_of_the_arm(tmp_path):
    """Forearm, hand and End Site are then one straight line."""
    still = posed([("left_hand", "x", 0.0), ("right_hand", "x", 0.0)], at_rate("walk", 30.0))
    write_rig(Rig(tips=0.3, twists="{}Twist"), still, tmp_path / "r.bvh")
    named, numbered, _ = read_with_and_without_names(tmp_path / "r.bvh")
    np.testing.assert_allclose(numbered.clip.poses, named.clip.poses, atol=1e-9)


def test_heel_below_an_ankle_with_a_tip_is_not_taken_for_toes(tmp_path):
    """The tip, which has no joint, shows where the foot points."""
    body = human(without=("toe",))(tmp_path)
    for side in ("Left", "Right"):
        body = grow(body, f"{side}Foot", [(-3, 0, -4)], 0.0, name=f"{side}Heel")
        body.tips[body.joints.index(f"{side}Foot")] = (12, 0, -5)
        body.tips[-1] = 0.0
    assert "left_foot" not in roles_by_shape(body).ends


CAPTURES = ("cmu_amc/02_01.amc", "snu/walk.bvh", "deepmimic/humanoid3d_cartwheel.txt")


def roles_of_capture_by_names_and_shape(path):
    motion = read_motion(path)
    nameless = motion.of_joints(range(len(motion.joints)))
    object.__setattr__(nameless, "joints", tuple(f"joint_{k}" for k in range(len(motion.joints))))
    return motion, roles_of(motion.joints, motion.parents, still=motion.still_joints), roles_by_shape(nameless)


@pytest.mark.parametrize("name", CAPTURES)
def test_capture_has_the_same_roles_by_shape_as_by_names(name, mocap):
    _, by_names, by_shape = roles_of_capture_by_names_and_shape(mocap / name)
    assert by_shape == by_names


# Knees that never bend, and a single pose.
UNCLEAR = ("wave_hello.bvh", "xia_rest_1frame.bvh")


@pytest.mark.slow
def test_every_capture_has_the_same_roles_by_shape_as_by_names_or_is_refused(mocap):
    for folder in ("animated_drawings", "cmu_amc", "cmu_bvh", "deepmimic", "snu", "xia"):
        for path in sorted((mocap / folder).glob("*")):
            if path.suffix in READABLE_SUFFIXES and path.name != "humanoid3d_character.txt":
                motion, by_names, by_shape = roles_of_capture_by_names_and_shape(path)
                assert isinstance(by_shape, str) == (path.name in UNCLEAR), (path, by_shape)
                if not isinstance(by_shape, str):
                    different = {
                        part for part, joint in by_names.segments.items() if by_shape.segments.get(part) != joint
                    }
                    assert not different or (different == {"head"} and by_names.segments["head"] in motion.still_joints)
                    assert by_shape.ends == by_names.ends


def compare_random_rigs(n, seed, folder):
    """Random rigs by names and by shape: deviations above 2° [deg], and reasons of those refused by shape alone.

    A rig with the same roles by both is not retargeted: all else of a skeleton's names is in remarks.
    """
    rng, wrong, refused = np.random.default_rng(seed), [], []
    clips = [at_rate(name, 30.0) for name in ("walk", "run", "ginga", "cheer", "jump", "squat_dance", "angry")]
    for k in range(n):
        rig, clip = random_rig(rng), clips[int(rng.integers(len(clips)))]
        write_rig(rig, clip, folder / "named.bvh")
        shutil.copy(folder / "named.bvh", folder / "numbered.bvh")
        numbers = rng.permutation(1000)
        rename(folder / "numbered.bvh", lambda j, _, numbers=numbers: f"Bone.{numbers[j]:03d}")
        hints = Hints(up=None if rig.up in ("+Y", "+Z") else rig.up)
        motion, nameless = read_motion(folder / "named.bvh"), read_motion(folder / "numbered.bvh")
        by_names = roles_of(motion.joints, motion.parents, still=motion.still_joints)
        if roles_by_shape(nameless, hints.up) == by_names:
            continue
        try:
            named = load(folder / "named.bvh", hints)
        except MotionFileError:
            continue
        try:
            numbered = load(folder / "numbered.bvh", hints)
        except MotionFileError as error:
            refused.append((k, str(error)))
            continue
        if (angle := largest_angle(numbered.clip, named.clip)) > 2.0:
            wrong.append((k, rig, angle))
    return wrong, refused


def test_eight_random_rigs_with_numbers_for_names_give_the_same_motion(tmp_path):
    wrong, refused = compare_random_rigs(8, 1, tmp_path)
    assert not wrong
    assert len(refused) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_many_random_rigs_with_numbers_for_names_give_the_same_motion(seed, tmp_path):
    """Refused are most of those with arms as long as legs or without hands, heads or toes: a fifth."""
    wrong, refused = compare_random_rigs(50, 200 + seed, tmp_path)
    assert not wrong
    assert len(refused) <= 20, refused
