"""Options that do not apply to the chosen figure or rivers are refused, even at their default, and not written out."""

import json
from typing import Any

import pytest

from controllers.errors import ParameterError
from experiments.config.keywords import option_message, to_keywords
from experiments.config.modes import Rivers, SpeedGovernor
from experiments.config.options import RunOptions, config_of_options, run_config, with_options
from experiments.config.part import from_dict, to_dict, to_json
from experiments.config.run_config import FIGURE_DEFAULTS, Figure, RunConfig
from experiments.hardware.parts import served


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"kind": "none", "residual_force": 0.1},
         "--residual-force 0.1 has no meaning with --figure none; it belongs to --figure physical"),
        ({"kind": "kinematic", "residual_moment": 0.0},
         "--residual-moment 0 has no meaning with --figure kinematic; it belongs to --figure physical"),
        ({"kind": "none", "blend": 0.1},
         "--blend 0.1 has no meaning with --figure none; it belongs to --figure physical, kinematic"),
    ],
)  # fmt: skip
def test_figure_number_inapplicable_to_its_kind_is_refused(numbers: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=f"^{to_keywords(message, figure='kind')}$") as error:
        Figure(**numbers)
    assert option_message(error.value) == message
    with pytest.raises(ParameterError, match=f"^a file: {to_keywords(message)}$"):
        from_dict(RunConfig, to_dict(RunConfig()) | {"figure": numbers}, "a file")


@pytest.mark.parametrize(
    ("figure", "name"),
    [("none", name) for name in FIGURE_DEFAULTS if name != "kind"]
    + [("kinematic", name) for name in ("mass", "residual_force", "residual_moment")],
)
def test_inapplicable_figure_option_is_refused_even_at_its_default(figure: Any, name: str) -> None:
    default, option = FIGURE_DEFAULTS[name], "--" + name.replace("_", "-")
    for value in (default, default + 1):
        with pytest.raises(
            ParameterError, match=rf"^{option} {value} has no meaning with --figure {figure}; it belongs"
        ):
            run_config(figure=figure, **{name: value})
        with pytest.raises(ParameterError, match=f"^{option} .* has no meaning with --figure {figure}; it belongs"):
            config_of_options(RunOptions(figure=figure, **{name: value}))
    with pytest.raises(ParameterError, match=f'^{name}=.* has no meaning with kind="{figure}"; it belongs'):
        RunConfig(figure=Figure(kind=figure, **{name: default + 1}))


def test_file_omits_inapplicable_numbers_and_may_contain_their_defaults() -> None:
    values = to_dict(run_config(figure="none"))
    assert values["figure"] == json.loads(to_json(run_config(figure="none")))["figure"] == {"kind": "none"}
    assert repr(Figure(kind="none")) == "Figure(kind='none')"
    kinematic = to_dict(run_config(figure="kinematic"))["figure"]
    assert kinematic == {"kind": "kinematic"} | {name: FIGURE_DEFAULTS[name] for name in (
        "stature", "smoothing", "figure_ticks", "blend")}  # fmt: skip
    whole = values | {"figure": dict(FIGURE_DEFAULTS) | {"kind": "none"}}
    assert from_dict(RunConfig, whole, "a recording") == run_config(figure="none")


def test_only_a_led_figure_keeps_its_size_on_a_device() -> None:
    size = {"stature": 1.2, "mass": 30.0}
    assert served(run_config(mode="lead", blend=0.1, **size)).figure == Figure(kind="none", **size)
    assert served(run_config(blend=0.1, **size)).figure == Figure(kind="none")


@pytest.mark.parametrize("drag", [8.0, 30.0])
def test_governor_drag_of_gated_rivers_is_refused(drag: float) -> None:
    for crossing in ({}, {"crossing": "smooth"}):
        with pytest.raises(ParameterError, match=r"^--governor-drag has no meaning with --mode rivers, whose governor"):
            run_config("rivers", governor=True, governor_drag=drag, **crossing)  # pyright: ignore
    with pytest.raises(ParameterError, match=r"^governor_drag has no meaning"):
        Rivers(governor=SpeedGovernor(governor_drag=30.0))
    summed = run_config("rivers", governor=True, governor_drag=drag, crossing="sum")
    assert summed.mode == Rivers(crossing="sum", governor=SpeedGovernor(governor_drag=drag))
    assert with_options(summed, {"crossing": "discrete"}).mode == Rivers(governor=SpeedGovernor())


def test_changed_figure_kind_resets_inapplicable_numbers() -> None:
    config = run_config(residual_force=0.2, blend=0.3, stature=1.2, mass=30.0, figure_ticks=5)
    assert with_options(config, {"figure": "kinematic"}).figure == Figure(
        kind="kinematic", blend=0.3, stature=1.2, figure_ticks=5
    )
    assert with_options(config, {"figure": "none"}).figure == Figure(kind="none")
