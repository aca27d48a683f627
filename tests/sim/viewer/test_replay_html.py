"""The replay shows the recorded motion in one self-contained page."""

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
import zstandard

from models.humanoid.skeleton import rest_pose
from models.world.scene import P_WH, SceneConfig, world_model
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.viewer import replay_html as module
from sim.viewer.palette import CURVE, FIELD, RIVERS, USER, rgb, river_colors
from sim.viewer.replay_html import GHOST_AT, MAGNIFICATION, PHANTOM_AT, drawn_tube, replay_html
from sim.viewer.shapes import body_shapes, tube

ANGLE = np.linspace(0, 2 * np.pi, 81)
CIRCLE = 0.05 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE])


@pytest.fixture(scope="module")
def model():
    return world_model(SceneConfig())


def record(path, model, seconds=1.0, speed=0.0, still=False, radius=0.02, rivers=None):
    """Record a hand on a circle that presses harder with time, and a figure that leans and may travel along x."""
    ticks, frames = np.arange(0, seconds, 1e-3), np.arange(0, seconds, 1e-2)
    root = int(model.joint("figure/root").qposadr[0])
    theta1 = int(model.joint("phantom/theta1").qposadr[0])
    p = np.tile(CIRCLE[0], (len(ticks), 1)) if still else 0.05 * np.stack([np.cos(ticks), np.sin(ticks), 0 * ticks], 1)
    force = np.outer(0.1 + ticks, [0.0, 0.6, 0.8])
    reference = np.tile(rest_pose(), (len(frames), 1))
    reference[:, 0] = speed * frames
    reference[:, 7:11] = np.column_stack([np.cos(frames / 4), 0 * frames, np.sin(frames / 4), 0 * frames])
    qpos = np.tile(model.qpos0, (len(frames), 1))
    qpos[:, root : root + 75] = reference
    qpos[:, root + 1] += 0.03
    qpos[:, theta1] = 0.3 * frames
    groups = {
        "ticks": Group(1000, {"t": (), "p": (3,), "force": (3,), "user": (3,)}),
        "frames": Group(100, {"t": (), "qpos": (model.nq,), "reference": (75,)}),
    }
    static = {"curve": CIRCLE, "tube_radius": radius, "p_WH": P_WH, **(rivers or {})}
    with Recorder(path, {}, 1, groups, static) as recorder:
        recorder.append("ticks", {"t": ticks, "p": p, "force": force, "user": 0.0 * force})
        recorder.append("frames", {"t": frames, "qpos": qpos, "reference": reference})
        recorder.close({})
    return Recording(path)


def decoded(page: str) -> dict:
    """The recording that viser embedded in the page."""
    found = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    assert found is not None
    raw = zstandard.ZstdDecompressor().decompress(base64.b64decode(found[1])[8:])
    size = int.from_bytes(raw[:8], "little")
    content = msgspec.msgpack.decode(raw[8 : 8 + size])
    start, buffers = 8 + size, []
    for length in content["binaryBufferLengths"]:
        start += -start % 8
        buffers.append(raw[start : start + length])
        start += length
    content["buffers"] = buffers
    return content


class State:
    """The scene at a time, after all messages until then."""

    def __init__(self, content: dict, time: float):
        self.position: dict[str, np.ndarray] = {}
        self.points: dict[str, np.ndarray] = {}
        self.visible: dict[str, bool] = {}
        for when, message in content["messages"]:
            if when > time:
                break
            kind, name = message["type"], message.get("name")
            if kind == "SetPositionMessage":
                self.position[name] = np.array(message["position"])
            elif kind == "SetSceneNodeVisibilityMessage":
                self.visible[name] = message["visible"]
            elif kind == "SceneNodeUpdateMessage" and "points" in message["updates"]:
                index = next(v for v in message["updates"]["points"].values() if isinstance(v, int))
                self.points[name] = np.frombuffer(content["buffers"][index], np.float32).reshape(2, 3)


class References(HTMLParser):
    """All references that a page would fetch."""

    def __init__(self, page: str):
        super().__init__()
        self.found: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]


def test_bodies_are_drawn_at_their_recorded_positions(tmp_path, model, capsys):
    with record(tmp_path / "run.h5", model) as recording:
        page = replay_html(recording, model)
        state = State(decoded(page), 0.5)
        qpos, reference = recording.groups["frames"]["qpos"][50], recording.groups["frames"]["reference"][50]
    assert capsys.readouterr().out == ""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    for name in ("figure/pelvis", "figure/left_hand", "figure/head"):
        body = model.body(name).id
        np.testing.assert_allclose(state.position[f"/figure/{body}"], data.xpos[body], atol=1e-6)
    stylus = model.body("phantom/stylus").id
    shown = PHANTOM_AT + MAGNIFICATION * (data.xpos[stylus] - P_WH)
    np.testing.assert_allclose(state.position[f"/phantom/{stylus}"], shown, atol=1e-6)
    root = int(model.joint("figure/root").qposadr[0])
    data.qpos[root : root + 75] = reference
    mujoco.mj_kinematics(model, data)
    for name in ("figure/pelvis", "figure/left_hand", "figure/head"):
        body = model.body(name).id
        np.testing.assert_allclose(state.position[f"/ghost/{body}"], GHOST_AT + data.xpos[body], atol=1e-6)


def test_force_arrow_starts_at_the_stylus_with_length_proportional_to_the_force(tmp_path, model):
    with record(tmp_path / "run.h5", model) as recording:
        content = decoded(replay_html(recording, model))
        ticks = recording.groups["ticks"]
        lengths = []
        for time in (0.2, 0.8):
            start, end = State(content, time + 1e-6).points["/forces/force"]
            row = round(time * 1000)
            np.testing.assert_allclose(start, PHANTOM_AT + MAGNIFICATION * ticks["p"][row], atol=1e-4)
            np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), [0, 0.6, 0.8], atol=1e-4)
            lengths.append(np.linalg.norm(end - start))
    assert lengths[1] / lengths[0] == pytest.approx(0.9 / 0.3, rel=1e-3)
    assert State(content, 0.9).visible["/forces/user"] is False


@pytest.mark.slow
def test_replay_lasts_as_long_as_the_run_or_its_shown_part(tmp_path, model, monkeypatch):
    with record(tmp_path / "run.h5", model) as recording:
        content = decoded(replay_html(recording, model))
        assert content["durationSeconds"] == pytest.approx(1.0, abs=1 / 30)
        times = [when for when, _ in content["messages"]]
        assert times == sorted(times)
        monkeypatch.setattr(module, "MAX_SECONDS", 0.5)
        assert decoded(replay_html(recording, model))["durationSeconds"] == pytest.approx(0.5)


@pytest.mark.slow
def test_travelling_figure_stays_in_view_while_the_floor_moves(tmp_path, model):
    with record(tmp_path / "run.h5", model, seconds=3.0, speed=1.5) as recording:
        content = decoded(replay_html(recording, model))
        pelvis = model.body("figure/pelvis").id
        for time in (0.5, 1.5, 2.5):
            state = State(content, time + 1e-6)
            figure, ghost = state.position[f"/figure/{pelvis}"], state.position[f"/ghost/{pelvis}"]
            assert abs(figure[0]) < 0.5
            np.testing.assert_allclose(figure - ghost, np.array([0, 0.03, 0]) - GHOST_AT, atol=1e-6)
            cells = state.position["/floor"][0] + 1.5 * time - figure[0]
            assert cells == pytest.approx(round(cells), abs=1e-6)


def test_motionless_hand_leaves_no_trail_and_no_nan(tmp_path, model):
    with record(tmp_path / "run.h5", model, still=True) as recording:
        content = decoded(replay_html(recording, model))
    names = {message.get("name", "") for _, message in content["messages"]}
    assert not any(name.startswith("/trail/") for name in names)
    for buffer in content["buffers"]:
        assert len(buffer) % 4 or np.all(np.isfinite(np.frombuffer(buffer, np.float32)))


def meshes(page: str) -> dict[str, tuple[np.ndarray, tuple[int, ...]]]:
    """Vertices and colour of every mesh."""
    content = decoded(page)
    found = {}
    for _, message in content["messages"]:
        if message["type"] == "MeshMessage":
            props = message["props"]
            index = next(v for v in props["vertices"].values() if isinstance(v, int))
            vertices = np.frombuffer(content["buffers"][index], np.float32).reshape(-1, 3)
            found[message["name"]] = vertices, tuple(props["color"])
    return found


def test_every_river_is_drawn_with_its_tube_in_its_own_colour(tmp_path, model):
    curves = np.stack([CIRCLE + np.array([0.0, 0.0, height]) for height in (0.0, 0.01, 0.03)])
    rivers = {"river_names": "low\nmiddle\nhigh", "river_curves": curves}
    with record(tmp_path / "run.h5", model, seconds=0.1, rivers=rivers) as recording:
        drawn = meshes(replay_html(recording, model))
    assert {name for name in drawn if name.startswith("/curve/")} == {
        f"/curve/{k}/{part}" for k in range(3) for part in ("line", "tube")
    }
    for k, curve in enumerate(curves):
        for part, radius in (("line", 0.004), ("tube", MAGNIFICATION * 0.02)):
            vertices, color = drawn[f"/curve/{k}/{part}"]
            assert color == rgb(RIVERS[k])
            at = PHANTOM_AT + MAGNIFICATION * curve
            away = np.linalg.norm(vertices[:, None] - at[None], axis=2).min(axis=1)
            np.testing.assert_allclose(away, radius, atol=1e-5)


def test_single_curve_without_radius_is_drawn_without_a_tube(tmp_path, model):
    with record(tmp_path / "run.h5", model, seconds=0.1, radius=0.0) as recording:
        drawn = meshes(replay_html(recording, model))
    assert {name for name in drawn if name.startswith("/curve/")} == {"/curve/0/line"}


def test_river_colours_differ_from_each_other_and_from_hand_and_field():
    assert river_colors(3) == RIVERS[:3]
    for n in (len(RIVERS), 8, 30):
        colors = [*river_colors(n), FIELD, USER, CURVE]
        seen = np.array([rgb(color) for color in colors], dtype=float)
        distances = np.linalg.norm(seen[:, None] - seen[None], axis=2) + 1e3 * np.eye(len(colors))
        assert distances.min() > 25.0
        # Distinct from white, the background of the page and of figures.
        assert (np.linalg.norm(seen - 255.0, axis=1) > 100.0).all()


@pytest.mark.parametrize(("radius", "drawn"), [(0.01, 0.01), (0.25, 0.03)])
def test_wide_tube_is_drawn_narrower(tmp_path, model, radius, drawn):
    with record(tmp_path / "run.h5", model, seconds=0.1, radius=radius) as recording:
        assert drawn_tube(recording) == pytest.approx(drawn)


def test_page_refers_to_nothing_outside_itself(tmp_path, model):
    with record(tmp_path / "run.h5", model, seconds=0.1) as recording:
        page = replay_html(recording, model)
    assert all(not reference or reference.startswith("data:") for reference in References(page).found)


@pytest.mark.slow
def test_fifteen_seconds_stay_below_thirty_megabytes(tmp_path, model):
    with record(tmp_path / "run.h5", model, seconds=15.0) as recording:
        assert len(replay_html(recording, model)) < 30e6


@pytest.mark.slow
def test_browser_plays_the_page_from_disk_without_network(tmp_path, model):
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    chromium = Path("/usr/bin/chromium")
    if not chromium.exists():
        pytest.skip("no chromium")
    with record(tmp_path / "run.h5", model) as recording:
        (tmp_path / "replay.html").write_text(replay_html(recording, model), encoding="utf-8")
    requested_urls: list[str] = []
    page_errors: list[str] = []
    options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=options)
        page = browser.new_page(viewport={"width": 640, "height": 400})
        page.on("request", lambda request: requested_urls.append(request.url))
        page.on("pageerror", lambda error: page_errors.append(str(error)))
        page.set_default_timeout(240_000)  # a processor that draws in software may be busy with other tests
        page.goto((tmp_path / "replay.html").as_uri())
        clock = page.locator("input").first
        clock.wait_for()
        page.wait_for_function(f"document.querySelector('input').value != '{clock.input_value()}'")
        picture = page.screenshot()
        browser.close()
    assert page_errors == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requested_urls)
    assert len(picture) > 20_000  # a blank page compresses to a few kilobytes


def test_drawn_geometry_is_the_figure_without_its_contact_spheres(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shapes = body_shapes(model, "figure/")
    points = np.concatenate([data.xpos[s.body] + s.vertices @ data.xmat[s.body].reshape(3, 3).T for s in shapes])
    assert np.max(points[:, 2]) == pytest.approx(1.75, abs=0.03)
    assert np.min(points[:, 2]) == pytest.approx(0.0, abs=0.01)
    assert {model.body(s.body).name.split("/")[0] for s in shapes} == {"figure"}
    assert all(s.rgba[3] == 1.0 for s in shapes)


def test_tube_lies_at_its_radius_and_faces_outwards():
    helix = np.column_stack([np.cos(ANGLE), np.sin(ANGLE), 0.3 * ANGLE])
    vertices, faces = tube(helix, 0.1, sides=12)
    axis = np.repeat(helix, 12, axis=0)
    np.testing.assert_allclose(np.linalg.norm(vertices - axis, axis=1), 0.1, atol=1e-12)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outwards = (a + b + c) / 3 - (axis[faces[:, 0]] + axis[faces[:, 1]] + axis[faces[:, 2]]) / 3
    assert np.all(np.sum(np.cross(b - a, c - a) * outwards, axis=1) > 0)


@pytest.mark.parametrize(
    "points",
    [
        np.concatenate([np.zeros((3, 3)), np.column_stack([np.arange(4.0), np.zeros((4, 2))])]),
        np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0]]),
        np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [0, 0, 1]]),
        np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0, 1], [2, 0, 2], [2, 1, 2], [2, 2, 2], [3, 2, 2]]),
        np.ones((4, 3)),
    ],
    ids=["rests at first", "rests", "turns back", "corners", "never moves"],
)
@pytest.mark.filterwarnings("error")
def test_tube_about_a_resting_or_sharply_turning_path_is_intact(points):
    vertices, _ = tube(points, 0.1, sides=6)
    rings = vertices.reshape(len(points), 6, 3) - points[:, None]
    np.testing.assert_allclose(np.linalg.norm(rings, axis=2), 0.1, atol=1e-12)
    # No ring is degenerate.
    assert all(np.linalg.svd(ring, compute_uv=False)[1] > 0.1 for ring in rings)


def test_closed_tube_has_no_gap():
    vertices, _ = tube(CIRCLE, 0.01, sides=8)
    np.testing.assert_allclose(vertices[:8], vertices[-8:], atol=1e-12)
